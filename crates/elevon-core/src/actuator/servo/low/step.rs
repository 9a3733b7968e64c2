//! One step of the reduced-order model: sensors, control electronics, equivalent phase, shaft. The derivative of the measured
//! speed is solved with the acceleration (docs/explanation/theory/low-fidelity.md, "The speed derivative as inertia").

use super::control::{demand, integrate};
use super::driven::driven_step;
use super::model::{Model, Phase, State};
use super::passive::passive_step;
use super::phase::phase;
use super::relays::{mean_error, within_band, TorqueDemand};
use super::structure::Structure;
use crate::actuator::servo::advance::{Instant, Stepper};
use crate::actuator::servo::layout::DriveKind;
use crate::inverter::hysteresis::ripple_square;
use crate::scalar::{apart, three_phase, Kernel, Scalar};
use crate::sensor::filter::low_pass;
use crate::three;

/// What the drive has of its supply: its source, the link's voltage, and the mean error that its relays leave.
struct Supply<S> {
    source: S,
    link: S,
    band: S,
}

#[inline(always)]
fn supply<S: Scalar, const EXTRA: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &State<S>, p: &Phase<S>) -> Supply<S> {
    let source = x.supply * m.drive.supply_scale;
    let link = if EXTRA && structure.link { m.drive.link.voltage(&s.link, source) } else { source };
    let band = if structure.drive == DriveKind::Hysteresis { mean_error(m, s, p, link) } else { S::zero() };
    Supply { source, link, band }
}

/// Current and voltage of the phase after a step towards the torque reference.
#[inline(always)]
fn electric_step<S: Scalar, const EXTRA: bool>(m: &Model<S>, structure: &Structure, supply: &Supply<S>, s: &mut State<S>, p: &Phase<S>) {
    let Supply { source, link: supply, band } = *supply;
    let speed = s.shaft.motor_speed;
    let mut emf = S::splat(2.0 / 3.0) * p.magnets * speed;
    let field = if EXTRA && structure.field { Field::of(m, structure, s) } else { Field::none() };
    if EXTRA && structure.field {
        emf = emf + m.star.pole_pairs * speed * field.linked[0];
    }
    if EXTRA && structure.loops {
        emf = emf + m.circuits.voltage(s, p);
    }
    let current_ref = s.torque_ref * m.control.per_torque_constant;
    let circuit = &p.circuit;
    let coasting = circuit.current(s.current, -emf);
    let target = match structure.drive {
        // The relays act only at the edges of their band; inside it the EMF drives the current.
        DriveKind::Hysteresis => coasting.clamp(current_ref - band, current_ref + band),
        DriveKind::Pwm => s.current + m.drive.tracking * (current_ref - s.current),
        DriveKind::Off => S::zero(),
    };
    let driving = circuit.voltage(s.current, target);
    let mut cross = m.drive.electrical_inductance * speed * s.current;
    if EXTRA && structure.field {
        cross = m.star.pole_pairs * speed * field.linked[1] - p.circuit.resistance * s.direct;
    }
    if EXTRA && structure.angle {
        cross = cross - p.direct * speed;
    }
    let largest = m.drive.voltage_ratio * supply;
    // v_q^2 + v_d^2 stays inside the largest phase voltage; v_d is the cross coupling p omega L i_q, and
    // the EMF where the references are misplaced.
    let margin = largest * largest - cross * cross;
    s.voltage = driving + emf;
    let limited = margin.lt(s.voltage * s.voltage);
    let wanted = s.voltage;
    let mut reached = target;
    if S::any(limited) {
        let clamped = s.voltage.clamp_abs(margin.maximum(S::zero()).sqrt());
        s.voltage = S::select(limited, clamped, s.voltage);
        reached = S::select(limited, circuit.current(s.current, clamped - emf), target);
    }
    let before = s.current;
    s.current = reached;
    s.current_q = reached * p.quadrature;
    s.current_seen = reached * p.seen;
    s.motor_torque = p.torque_constant * reached;
    // Sum of R_j i_j^2 of the three phases, at the step's middle.
    let middle = S::splat(0.5) * (before + reached);
    let mut loss = S::splat(1.5) * middle * middle * p.circuit.resistance;
    // Terminal power of the three phases, 3/2 v_q i_q.
    let mut power = S::splat(1.5) * s.voltage * middle;
    if EXTRA && structure.field {
        s.motor_torque = p.magnets * reached + m.map.torque([field.direct, reached]);
        let [heat, drawn] = field.settle(m, structure, s, p, [wanted, cross, supply]);
        (loss, power) = (loss + heat, power + drawn);
    }
    let mut windings = if EXTRA && structure.heat { of_phases(m, structure, s, p, middle) } else { [S::zero(); 3] };
    let phases = s.phases;
    if EXTRA && structure.angle {
        s.phases = three!(|j| p.imposed[j] * reached);
    }
    if EXTRA && structure.driven {
        s.phases = phases;
        let imposed: [S; 3] = three!(|j| p.imposed[j] * reached);
        let x = driven_step(m, structure, [supply, band], s, p, current_ref);
        let mix = |one: S, three: S| m.drive.share(one, three);
        s.phases = three!(|j| mix(imposed[j], x.phases[j]));
        s.current = mix(s.current, x.seen);
        s.current_q = mix(s.current_q, x.quadrature);
        s.current_seen = mix(s.current_seen, x.seen);
        s.motor_torque = mix(s.motor_torque, x.torque);
        s.voltage = mix(s.voltage, x.voltage);
        (loss, power) = (mix(loss, x.copper), mix(power, x.drawn));
        windings = three!(|j| mix(windings[j], x.windings[j]));
    }
    let counts = EXTRA && (structure.heat || structure.accounts);
    if counts && structure.drive == DriveKind::Hysteresis {
        // Relays that switch leave a ripple, which heats and makes no mean torque.
        let idle = if structure.driven { resting(&s.driven.legs) } else { target.equals(coasting) | limited };
        let ripple = ripple_square(m.drive.half_band, m.drive.filter_time, supply / m.cold[2]) * p.circuit.resistance;
        let heat = S::select(idle, S::zero(), ripple);
        (loss, power) = (loss + heat, power + heat);
    }
    if EXTRA && structure.passive {
        (loss, power, windings) = without_gates(m, structure, supply, s, p, phases, (loss, power, windings));
    }
    if EXTRA && structure.link {
        m.drive.link.step(&mut s.link, source, power * m.dt);
        s.tripped = s.tripped.maximum(m.drive.link.tripped(&s.link));
    }
    if EXTRA && structure.loops {
        let added = m.circuits.step(s, p, phases, s.phases);
        s.motor_torque = s.motor_torque + added.torque;
        let copper = added.copper[0] + added.copper[1] + added.copper[2];
        windings = three!(|j| windings[j] + added.copper[j]);
        s.network.collected[1] = m.dt.fma(copper, s.network.collected[1]);
        s.network.collected[2] = m.dt.fma(added.contact, s.network.collected[2]);
        s.copper = m.dt.fma(copper, s.copper);
    }
    if counts {
        let heat = loss * m.dt;
        s.network.collected[0] = s.network.collected[0] + heat;
        s.network.windings = three!(|j| m.dt.fma(windings[j], s.network.windings[j]));
        s.copper = s.copper + heat;
        s.drawn = m.dt.fma(power, s.drawn);
    }
}

/// The direct current of a step and what the currents before it link.
struct Field<S> {
    direct: S,
    linked: [S; 2],
}

impl<S: Scalar> Field<S> {
    #[inline(always)]
    fn none() -> Self {
        Self { direct: S::zero(), linked: [S::zero(); 2] }
    }

    #[inline(always)]
    fn of(m: &Model<S>, structure: &Structure, s: &State<S>) -> Self {
        let reference = if structure.limits.direct { m.limits.reference(s.weakening) } else { S::zero() };
        let direct = m.drive.tracking.fma(reference - s.direct, s.direct);
        Self { direct, linked: m.map.at([s.direct, s.current]).flux }
    }

    /// Steps the direct current and its reference; copper loss and power of the direct axis in the step. `wanted` is the quadrature
    /// voltage that the current controller asks for, `cross` less the direct one at rest.
    #[inline(always)]
    fn settle(&self, m: &Model<S>, structure: &Structure, s: &mut State<S>, p: &Phase<S>, [wanted, cross, supply]: [S; 3]) -> [S; 2] {
        let half = S::splat(0.5);
        let middle = half * (s.direct + self.direct);
        let after = m.map.at([self.direct, s.current]).flux;
        let changing = (after[0] - self.linked[0]) / m.dt;
        let turning = m.star.pole_pairs * s.shaft.motor_speed * half * (after[1] + self.linked[1]);
        let loss = S::splat(1.5) * p.circuit.resistance * middle * middle;
        let power = loss + S::splat(1.5) * (changing - turning) * middle;
        if structure.limits.weakens {
            let size = (wanted * wanted + cross * cross).sqrt();
            s.weakening = m.limits.weaken(s.weakening, s.shaft.motor_speed, size, supply);
            m.limit(structure, s);
        }
        s.direct = self.direct;
        [loss, power]
    }
}

/// Copper loss of each phase with a mean current over the step.
#[inline(always)]
fn of_phases<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, p: &Phase<S>, mean: S) -> [S; 3] {
    let shape = if structure.angle {
        p.imposed
    } else {
        let (sin, cos) = m.star.electrical_angle(s.shaft.motor_position).sin_cos();
        three_phase(sin, cos).0
    };
    three!(|j| m.resistance[j] * s.resistance_factor * (shape[j] * mean).square())
}

/// Do all legs rest, by their mean voltages?
#[inline(always)]
fn resting<S: Scalar>(legs: &[S; 3]) -> S::Mask {
    let zero = S::zero();
    legs[0].equals(zero) & legs[1].equals(zero) & legs[2].equals(zero)
}

/// Trips the drive, and where the bridge has no gates lets the EMFs drive the windings. Copper loss of the step and power drawn from
/// the link.
#[inline(always)]
fn without_gates<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    supply: S,
    s: &mut State<S>,
    p: &Phase<S>,
    before: [S; 3],
    (loss, power, windings): (S, S, [S; 3]),
) -> (S, S, [S; 3]) {
    let (zero, half) = (S::zero(), S::splat(0.5));
    let imposed = s.phases;
    if structure.drive != DriveKind::Off {
        let largest = imposed[0].abs().maximum(imposed[1].abs()).maximum(imposed[2].abs()) + m.drive.half_band;
        let over = zero.lt(m.drive.trip_current) & m.drive.trip_current.lt(largest);
        s.tripped = s.tripped.maximum(m.drive.shorted).maximum(S::indicator(over));
    }
    let mut passive = S::mask(structure.drive == DriveKind::Off) | half.lt(s.tripped);
    if structure.stops {
        passive = passive | m.sensing.lost();
    }
    if !S::any(passive) {
        return (loss, power, windings);
    }
    let x = passive_step(m, structure, supply, s, p, before);
    s.phases = three!(|j| S::select(passive, x.phases[j], imposed[j]));
    s.current = S::select(passive, x.seen, s.current);
    s.current_q = S::select(passive, x.quadrature, s.current_q);
    s.current_seen = S::select(passive, x.seen, s.current_seen);
    s.motor_torque = S::select(passive, x.torque, s.motor_torque);
    s.voltage = S::select(passive, x.voltage, s.voltage);
    let windings = three!(|j| S::select(passive, x.windings[j], windings[j]));
    (S::select(passive, x.copper, loss), S::select(passive, x.drawn, power), windings)
}

#[inline(always)]
fn step<S: Scalar, const FULL: bool, const EXTRA: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
    if !EXTRA && m.star.saturates(m.healthy.torque_constant * s.current) {
        // Of a copy: a state whose address goes elsewhere does not stay in registers.
        *s = apart::<S, _>(Saturated::<S, FULL> { m, structure, x, s: *s });
        return;
    }
    step_with::<S, FULL, EXTRA, false>(m, structure, x, s);
}

/// A step whose current saturates the flux, apart from those of most steps.
struct Saturated<'a, S, const FULL: bool> {
    m: &'a Model<S>,
    structure: &'a Structure,
    x: &'a Instant<S>,
    s: State<S>,
}

impl<S: Scalar, const FULL: bool> Kernel for Saturated<'_, S, FULL> {
    type Output = State<S>;
    #[inline(always)]
    fn run(mut self) -> State<S> {
        step_with::<S, FULL, false, true>(self.m, self.structure, self.x, &mut self.s);
        self.s
    }
}

#[inline(always)]
fn step_with<S: Scalar, const FULL: bool, const EXTRA: bool, const SATURATED: bool>(
    m: &Model<S>,
    structure: &Structure,
    x: &Instant<S>,
    s: &mut State<S>,
) {
    // Sensors and control electronics.
    let reading = m.sensing.shaft::<FULL>(&structure.sensing, &s.shaft, &mut s.sensed);
    if FULL && structure.sensing.counting {
        m.sensing.count::<FULL>(&structure.sensing, &s.shaft, &mut s.sensed);
    }
    let position = m.sensing.output::<FULL>(&structure.sensing, &s.shaft, &mut s.sensed, &reading, m.shaft.gear.per_ratio);
    let demand = demand::<S, FULL>(m, structure, s, x, position, &reading);

    // Loads, and the acceleration that the derivative of the speed takes part in.
    let here;
    let p = if EXTRA && (structure.angle || structure.heat) {
        here = phase(m, structure, s, &reading);
        &here
    } else {
        &m.healthy
    };
    let weakened;
    let torque = p.torque_constant * s.current;
    let p = if SATURATED || EXTRA && m.star.saturates(torque) {
        weakened = p.weakened(m.star.unsaturated(torque), &m.control, m.shaft.inertia);
        &weakened
    } else {
        p
    };
    let in_field;
    let p = if EXTRA && structure.field {
        in_field = p.in_field(m, [s.direct, s.current]);
        &in_field
    } else {
        p
    };
    let (mut derivative_inertia, mut per_inertia) = (m.control.derivative_inertia, p.per_effective_inertia);
    let (mut shaft_inertia, mut per_shaft) = (m.shaft.inertia, m.per_inertia);
    if FULL && structure.shaft.flanks {
        m.shaft.hold_flank::<EXTRA>(&structure.shaft, x, &mut s.shaft, s.motor_torque);
        shaft_inertia = m.shaft.moving_inertia(&structure.shaft, &s.shaft);
        per_shaft = S::one() / shaft_inertia;
        per_inertia = S::one() / p.efficacy.fma(derivative_inertia, shaft_inertia);
    }
    let mut torque = p.efficacy * demand.torque;
    let mut answer = p.efficacy;
    if EXTRA && structure.driven {
        // The windings make of a reference what they can: the torque there is, and what a step adds to it.
        let adds = answer.maximum(S::zero()) * m.drive.tracking;
        torque = m.drive.share(torque, adds.fma(demand.torque - s.torque_ref, s.motor_torque));
        answer = m.drive.share(answer, adds);
        per_inertia = S::one() / answer.fma(derivative_inertia, shaft_inertia);
    }
    if FULL && structure.sensing.resolver {
        // The derivative acts on the acceleration that the resolver reports.
        derivative_inertia = derivative_inertia * m.sensing.follows();
        per_inertia = S::one() / answer.fma(derivative_inertia, shaft_inertia);
    }
    let mut loads = m.shaft.loads::<FULL, EXTRA>(&structure.shaft, x, &s.shaft, torque);
    let aided;
    let felt = if EXTRA && structure.loops {
        aided = loads.aided(m.circuits.torque(s, p));
        &aided
    } else {
        &loads
    };
    let supply = supply::<S, EXTRA>(m, structure, x, s, p);
    let relays = structure.drive == DriveKind::Hysteresis && structure.control.derivative;
    let three = EXTRA && structure.driven;
    let mut acceleration = S::zero();
    if three || !relays {
        acceleration = m.shaft.acceleration::<FULL, EXTRA>(&structure.shaft, &s.shaft, felt, torque, per_inertia);
    }
    if relays && (!three || structure.gradual) {
        let per_inertia = if three { S::one() / p.efficacy.fma(derivative_inertia, shaft_inertia) } else { per_inertia };
        let demand = TorqueDemand { torque: demand.torque, inertia: derivative_inertia, per_inertia, per_shaft };
        let one = within_band::<S, FULL, EXTRA>(m, structure, s, p, &demand, supply.band, felt);
        acceleration = if three { m.drive.share(one, acceleration) } else { one };
    }
    let unlimited = demand.torque - derivative_inertia * acceleration;
    s.torque_ref = unlimited.clamp_abs(s.torque_limit);
    integrate(m, structure, s, &demand, unlimited);

    // Equivalent phase, motor and transmission dynamics.
    electric_step::<S, EXTRA>(m, structure, &supply, s, p);
    s.motor_torque = m.star.saturate(s.motor_torque);
    if EXTRA && structure.shaft.train.law.knows_torque() {
        // The friction knows the torque that acts, not the one that was demanded.
        loads = m.shaft.loads::<FULL, EXTRA>(&structure.shaft, x, &s.shaft, s.motor_torque);
    }
    m.shaft.step::<FULL, EXTRA>(&structure.shaft, x, &mut s.shaft, &loads, s.motor_torque);

    // Acquisition.
    s.filtered[0] = low_pass(m.filter, s.filtered[0], s.current_seen);
    s.filtered[1] = low_pass(m.filter, s.filtered[1], s.voltage);
}

/// The step of the inner loop: plain, with the loads of the shaft and the sensors, with every detail.
pub(super) struct LowStep<const FULL: bool, const EXTRA: bool>;

impl<S: Scalar, const FULL: bool, const EXTRA: bool> Stepper<S> for LowStep<FULL, EXTRA> {
    type Model = Model<S>;
    type Structure = Structure;
    type State = State<S>;
    const IN_REGISTERS: bool = !EXTRA;
    const LOOKS_AHEAD: bool = true;

    #[inline(always)]
    fn commanded(_structure: &Structure) -> bool {
        true
    }
    #[inline(always)]
    fn dt(model: &Model<S>) -> S {
        model.dt
    }
    #[inline(always)]
    fn step(model: &Model<S>, structure: &Structure, instant: &Instant<S>, state: &mut State<S>) {
        step::<S, FULL, EXTRA>(model, structure, instant, state);
    }
}
