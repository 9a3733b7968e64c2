//! One step of the switching model. It reads like the block diagram: sensors, control electronics, power electronics,
//! motor, transmission, acquisition. With `FULL` false the optional details compile to nothing, with `EXTRA` false those
//! that only some servos have; a detail at its healthy value changes no bit, so the forms agree exactly where both apply.

use super::electric::{coupling, electric_step, motor_torque};
use super::model::{Model, State, E_INVERTER, E_SUPPLY};
use super::Behind;
use crate::actuator::servo::advance::Instant;
use crate::actuator::servo::details::Structure;
use crate::actuator::servo::layout::DriveKind;
use crate::inverter::hysteresis::{count_transitions, relays, six_step, transition};
use crate::inverter::losses::switching_loss;
use crate::scalar::{three_phase, Scalar};
use crate::sensor::filter::low_pass;
use crate::sensor::resolver::Reading;
use crate::three;

/// What the controller sees of the shaft.
#[inline(always)]
pub(crate) fn shaft_reading<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &mut State<S>) -> Reading<S> {
    m.sensing.shaft::<FULL>(&structure.sensing, &s.shaft, &mut s.sensed)
}

#[inline(always)]
pub(crate) fn control_step<S: Scalar, const FULL: bool>(
    m: &Model<S>,
    structure: &Structure,
    command: S,
    s: &mut State<S>,
    reading: &Reading<S>,
) {
    let position = m.sensing.output::<FULL>(&structure.sensing, &s.shaft, &mut s.sensed, reading, m.shaft.gear.per_ratio);
    let command = command + s.command_noise;
    s.current_ref = m.control.step(&structure.control, &mut s.control, command, position, reading.speed);
}

#[inline(always)]
pub(crate) fn measured_current<S: Scalar, const FULL: bool, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    s: &State<S>,
) -> [S; 3] {
    // Phase by phase: what the last step stored as three numbers is slow to load as a whole.
    let mut current = three!(|j| s.star.current[j]);
    if EXTRA && structure.shorted {
        let legs = leg_current(m, structure, s);
        current = three!(|j| legs[j]);
    }
    if FULL && structure.measured_current {
        m.sensor.measure(current, s.current_noise, s.current_reading)
    } else {
        current
    }
}

/// What the legs carry: the windings' currents and those of contacts in and at the windings.
#[inline(always)]
pub(crate) fn leg_current<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>) -> [S; 3] {
    if !structure.shorted {
        return s.star.current;
    }
    m.extra.shorts.legs(&structure.shorts, s.star.current, &s.star.contact)
}

/// Phase currents as the drive sees them.
#[inline(always)]
pub(crate) fn seen_current<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>) -> [S; 3] {
    if structure.current_filter {
        s.extra.sensed
    } else {
        measured_current::<S, true, true>(m, structure, s)
    }
}

/// Quadrature and direct components of three phase quantities (sheet 1.4).
#[inline(always)]
pub(crate) fn park<S: Scalar>(x: [S; 3], sin: [S; 3], cos: [S; 3]) -> (S, S) {
    let two_thirds = S::splat(2.0 / 3.0);
    let q = two_thirds * (x[0] * sin[0] + x[1] * sin[1] + x[2] * sin[2]);
    let d = -(two_thirds * (x[0] * cos[0] + x[1] * cos[1] + x[2] * cos[2]));
    (q, d)
}

/// Voltage that the bridge has from a source: the link's capacitor, where there is one.
#[inline(always)]
pub(crate) fn link_voltage<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, source: S) -> S {
    if structure.link {
        m.extra.link.voltage(&s.extra.link, source)
    } else {
        source
    }
}

/// What the legs' transitions lose: drawn from the link, heat in the inverter.
#[inline(always)]
pub(crate) fn lose_switching<S: Scalar>(m: &Model<S>, s: &mut State<S>, supply: S, old: [S; 3], new: [S; 3]) {
    let lost = switching_loss(m.extra.switching_time, supply, s.star.current, old, new);
    s.energy[E_SUPPLY] = s.energy[E_SUPPLY] + lost;
    s.energy[E_INVERTER] = s.energy[E_INVERTER] + lost;
}

/// What the controller is shown, and what it makes of it where it has no tick of its own.
#[inline(always)]
pub(crate) fn sense<S: Scalar, const FULL: bool, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    x: &Instant<S>,
    s: &mut State<S>,
) -> Reading<S> {
    let reading = if EXTRA && structure.sensing.unread && !structure.control_every_step {
        // Nobody looks between the ticks of the controller.
        Reading { angle: s.shaft.motor_position, position: s.shaft.motor_position, speed: s.shaft.motor_speed }
    } else {
        shaft_reading::<S, FULL>(m, structure, s)
    };
    if FULL && structure.sensing.counting {
        m.sensing.count::<FULL>(&structure.sensing, &s.shaft, &mut s.sensed);
    }
    if structure.control_every_step {
        control_step::<S, FULL>(m, structure, x.command, s, &reading);
    }
    reading
}

/// Phase currents that the drive is shown in this step.
#[inline(always)]
pub(crate) fn measure<S: Scalar, const FULL: bool, const EXTRA: bool>(m: &Model<S>, structure: &Structure, s: &mut State<S>) -> [S; 3] {
    let measured = measured_current::<S, FULL, EXTRA>(m, structure, s);
    if FULL && structure.measured_current {
        s.current_reading = measured;
    }
    if EXTRA && structure.current_filter {
        s.extra.sensed = three!(|j| low_pass(m.extra.closing, s.extra.sensed[j], measured[j]));
        return s.extra.sensed;
    }
    measured
}

/// What feeds the bridge during a step.
pub(crate) struct Feed<S> {
    source: S,
    /// Voltage of the bridge.
    pub supply: S,
    /// Energy drawn before the step.
    drawn: S,
}

impl<S: Scalar> Feed<S> {
    #[inline(always)]
    pub fn begin<const EXTRA: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &State<S>) -> Self {
        let source = x.supply * m.supply_scale;
        let supply = if EXTRA { link_voltage(m, structure, s, source) } else { source };
        Self { source, supply, drawn: s.energy[E_SUPPLY] }
    }

    /// The link's capacitor gives what the step has drawn.
    #[inline(always)]
    pub fn end<const EXTRA: bool>(&self, m: &Model<S>, structure: &Structure, s: &mut State<S>) {
        if EXTRA && structure.link {
            m.extra.link.step(&mut s.extra.link, self.source, s.energy[E_SUPPLY] - self.drawn);
            s.bridge.tripped = s.bridge.tripped.maximum(m.extra.link.tripped(&s.extra.link));
        }
    }
}

/// The shaft under the motor's torque, and the windings with their new currents.
#[inline(always)]
pub(crate) fn move_on<S: Scalar, const FULL: bool, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    x: &Instant<S>,
    s: &mut State<S>,
    (torque, current): (S, [S; 3]),
) {
    if FULL && structure.shaft.flanks {
        m.shaft.hold_flank::<EXTRA>(&structure.shaft, x, &mut s.shaft, torque);
    }
    let loads = m.shaft.loads::<FULL, EXTRA>(&structure.shaft, x, &s.shaft, torque);
    m.shaft.step::<FULL, EXTRA>(&structure.shaft, x, &mut s.shaft, &loads, torque);
    s.star.current = current;
}

/// The filters of the acquisition: currents (q, d) and the quadrature voltage.
#[inline(always)]
pub(crate) fn acquire<S: Scalar>(m: &Model<S>, s: &mut State<S>, (q, d): (S, S), v_q: S) {
    s.filtered[0] = low_pass(m.filter, s.filtered[0], q);
    s.filtered[1] = low_pass(m.filter, s.filtered[1], d);
    s.filtered[2] = low_pass(m.filter, s.filtered[2], v_q);
}

#[inline(always)]
fn step<S: Scalar, const FULL: bool, const EXTRA: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
    // Sensors and control electronics.
    let reading = sense::<S, FULL, EXTRA>(m, structure, x, s);
    let (sin, cos) = m.star.electrical_angle(s.shaft.motor_position).sin_cos();
    let measured = measure::<S, FULL, EXTRA>(m, structure, s);
    let (sin_c, cos_c) = if FULL && structure.sensing.distorts() && (!EXTRA || structure.sensing.commutated) {
        m.star.electrical_angle(reading.angle).sin_cos()
    } else {
        (sin, cos)
    };
    let (sin_phases, cos_phases) = three_phase(sin_c, cos_c);

    // Power electronics.
    let feed = Feed::begin::<EXTRA>(m, structure, x, s);
    let half_supply = S::splat(0.5) * feed.supply;
    let old_legs = three!(|j| s.legs[j]);
    let mut legs;
    if FULL && structure.drive == DriveKind::Off {
        legs = [S::zero(); 3];
    } else {
        let shape = if EXTRA && structure.six_step { six_step(sin_phases) } else { sin_phases };
        let error = three!(|j| s.current_ref * shape[j] - measured[j]);
        legs = relays(m.half_band, old_legs, error);
    }
    if EXTRA && structure.stops {
        let lost = m.sensing.lost();
        legs = three!(|j| S::select(lost, S::zero(), legs[j]));
    }
    if transition(old_legs, legs) {
        // Most steps have none: then the processor goes on with the old legs, and does not wait for the sensors.
        s.transitions = count_transitions(s.transitions, old_legs, legs);
        s.legs = legs;
    }
    if EXTRA && structure.switching {
        lose_switching(m, s, feed.supply, old_legs, s.legs);
    }

    // Motor electromagnetics.
    let c = coupling::<S, FULL>(m, structure, s, sin, cos);
    let torque = motor_torque::<S, EXTRA>(m, structure, &c, s.star.current);
    let (i, v) = electric_step::<S, FULL, EXTRA>(m, structure, s, &c, half_supply, old_legs);
    let (current, voltage) = (three!(|j| i[j]), three!(|j| v[j]));
    feed.end::<EXTRA>(m, structure, s);
    if structure.acquisition {
        let (v_q, _) = park(voltage, sin_phases, cos_phases);
        acquire(m, s, park(measured, sin_phases, cos_phases), v_q);
    }

    // Motor and transmission dynamics.
    move_on::<S, FULL, EXTRA>(m, structure, x, s, (torque, current));
}

/// Behind relays, or without a drive.
pub(super) struct ByRelays<const FULL: bool, const EXTRA: bool>;

impl<const FULL: bool, const EXTRA: bool> Behind for ByRelays<FULL, EXTRA> {
    const FULL: bool = FULL;
    #[inline(always)]
    fn step<S: Scalar>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
        step::<S, FULL, EXTRA>(m, structure, x, s);
    }
}
