//! One step behind a carrier. Its edges lie within the step (`inverter::carrier`), so that nothing asks for a short one:
//! the windings' EMF and torque are those of the rotor's position at the middle of the step, the currents' means over it
//! make the torque, and the resistance acts on that mean. All of it is of second order in the step.

use super::electric::{book, connect, coupling_at, motor_torque, resistance, Coupling, Fed, Gates};
use super::mapped::mapped_step;
use super::model::{Model, State};
use super::shorted::shorted_step;
use super::step::{acquire, lose_switching, measure, move_on, park, sense, Feed};
use super::Behind;
use crate::actuator::servo::advance::Instant;
use crate::actuator::servo::details::Structure;
use crate::inverter::bridge::{extinguish, Legs, Pulses, Windings};
use crate::inverter::carrier::Pulse;
use crate::scalar::{three_phase, Scalar};
use crate::three;

/// Rotor position at the middle of this step, as the last one expected it. So its sine, the longest of a step's chains, waits
/// for nothing of the step before; the expectation lacks the acceleration of a step, of second order in it.
#[inline(always)]
pub(super) fn middle<S: Scalar>(m: &Model<S>, s: &mut State<S>) -> S {
    let position = s.middle;
    s.middle = (S::splat(1.5) * m.dt).fma(s.shaft.motor_speed, s.shaft.motor_position);
    position
}

/// Voltages of the legs over a step at the share in which each is high, and in the state what it leaves of the commands.
struct Commands<S: Scalar> {
    pulses: [Pulse<S>; 3],
    /// At the end of the last step.
    before: [S; 3],
    /// A lost resolver has opened the bridge.
    lost: S::Mask,
}

/// The legs' means over a step, and with `FULL` the commands within it.
#[inline(always)]
fn modulate<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) -> Option<Commands<S>> {
    let one = S::one();
    let modulation = s.current_control.modulation;
    if !FULL {
        let span = m.carrier.span(&mut s.window, modulation, one, x.t);
        s.legs = three!(|j| mean(m.carrier.share(&s.window, j, &span)));
        return None;
    }
    let lost = if structure.stops { m.sensing.lost() } else { S::mask(false) };
    let driven = S::select(lost, S::zero(), one);
    let span = m.carrier.span(&mut s.window, modulation, driven, x.t);
    let pulses = three!(|j| m.carrier.pulse(&s.window, j, &span));
    let before = s.commands;
    s.commands = three!(|j| driven * pulses[j].ends()[1]);
    s.legs = three!(|j| driven * mean(pulses[j].share));
    Some(Commands { pulses, before, lost })
}

/// Of a leg's voltage over half the supply's.
#[inline(always)]
fn mean<S: Scalar>(share: S) -> S {
    share - (S::one() - share)
}

/// Heat of the transitions within a step and at its begin.
#[inline(always)]
fn switch<S: Scalar>(m: &Model<S>, s: &mut State<S>, supply: S, commands: &Commands<S>) {
    let driven = S::select(commands.lost, S::zero(), S::one());
    let changes = three!(|j| {
        let [begin, _] = commands.pulses[j].ends();
        let at_begin = (driven * begin - commands.before[j]).abs();
        (S::splat(2.0) * driven).fma(commands.pulses[j].edges(), at_begin)
    });
    lose_switching(m, s, supply, [S::zero(); 3], changes);
}

/// What a step makes of the windings.
struct Wound<S> {
    current: [S; 3],
    /// Phase-to-neutral voltages.
    voltage: [S; 3],
    torque: S,
}

/// Windings that are linear in speed and voltages: their change over the step, and the torque of its mean currents.
struct Linear<S> {
    /// Neutral and changes of the currents at standstill, and how both fall with the speed.
    level: S,
    push: [S; 3],
    slope: S,
    back: [S; 3],
    /// Torque at standstill, and how it falls with the speed.
    stalled: S,
    brake: S,
}

impl<S: Scalar> Linear<S> {
    /// The speed enters all of it last: the chain from step to step is a single product long.
    #[inline(always)]
    fn new(m: &Model<S>, k: [S; 3], current: [S; 3], terminal: [S; 3], resistance: [S; 3]) -> Self {
        let (star, half) = (&m.star, S::splat(0.5));
        let pull = three!(|j| (-resistance[j]).fma(current[j], terminal[j]));
        let (level, slope) = (star.neutral(pull), star.neutral(k));
        let push: [S; 3] = three!(|j| star.dt_per_inductance[j] * (pull[j] - level));
        let back: [S; 3] = three!(|j| star.dt_per_inductance[j] * (k[j] - slope));
        let stalled = star.torque(k, three!(|j| half.fma(push[j], current[j])));
        Self { level, push, slope, back, stalled, brake: half * star.torque(k, back) }
    }

    #[inline(always)]
    fn at(&self, speed: S, current: [S; 3], terminal: [S; 3]) -> Wound<S> {
        Wound {
            current: three!(|j| (-speed).fma(self.back[j], current[j] + self.push[j])),
            voltage: three!(|j| speed.fma(self.slope, terminal[j] - self.level)),
            torque: (-speed).fma(self.brake, self.stalled),
        }
    }
}

/// Windings and bridge over a step.
#[inline(always)]
fn wind<S: Scalar, const FULL: bool>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    c: &Coupling<S>,
    half_supply: S,
    commands: &Option<Commands<S>>,
) -> Wound<S> {
    let resistance = resistance::<S, FULL>(m, structure, s);
    let (speed, old) = (s.shaft.motor_speed, three!(|j| s.star.current[j]));
    let terminal: [S; 3] = three!(|j| s.legs[j] * half_supply);
    let (true, Some(commands)) = (FULL, commands) else {
        return Linear::new(m, c.k, old, terminal, resistance).at(speed, old, terminal);
    };
    let gates = Gates::Within(Pulses { legs: &commands.pulses, before: commands.before, lost: commands.lost });
    if structure.shorted {
        let (turns, voltage) = shorted_step(m, structure, s, c, &Fed { half_supply, gates, resistance });
        return Wound { current: turns, voltage, torque: mean_torque(m, structure, c, [old, turns]) };
    }
    if structure.mapped {
        let (current, voltage) = mapped_step(m, structure, s, c, &Fed { half_supply, gates, resistance });
        return Wound { current, voltage, torque: mean_torque(m, structure, c, [old, current]) };
    }
    let (wound, rail, ends) = if structure.bridge {
        bridged(m, structure, s, c, &Fed { half_supply, gates, resistance })
    } else {
        (Linear::new(m, c.k, old, terminal, resistance).at(speed, old, terminal), terminal, terminal)
    };
    s.voltage = wound.voltage;
    book::<S, true>(m, structure, s, [old, wound.current], [rail, ends], resistance);
    wound
}

/// Windings behind the bridge in detail; with the rails and the terminals.
#[inline(always)]
fn bridged<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    c: &Coupling<S>,
    fed: &Fed<'_, S>,
) -> (Wound<S>, [S; 3], [S; 3]) {
    let (speed, old) = (s.shaft.motor_speed, three!(|j| s.star.current[j]));
    let emf = three!(|j| c.k[j] * speed);
    let windings = Windings { current: old, emf, per_inductance: m.star.weight, resistance: fed.resistance, open: m.star.open };
    let connection = connect(m, structure, &mut s.bridge, s.legs, fed.gates, fed.half_supply, &windings);
    let legs = &connection.legs;
    let mut wound = Linear::new(m, c.k, old, legs.voltage, fed.resistance).at(speed, old, legs.voltage);
    let Some(neutral) = connection.loose else {
        return (wound, legs.rail, legs.voltage);
    };
    let (loose, terminal) = afloat(m, structure, c, legs, neutral, &windings);
    let whole = legs.connected[0] & legs.connected[1] & legs.connected[2];
    let current = extinguish(legs, old, three!(|j| S::select(whole, wound.current[j], loose.current[j])));
    let same: [S::Mask; 3] = three!(|j| current[j].equals(wound.current[j]));
    wound.torque = S::select(whole & same[0] & same[1] & same[2], wound.torque, mean_torque(m, structure, c, [old, current]));
    wound.voltage = three!(|j| S::select(whole, wound.voltage[j], loose.voltage[j]));
    wound.current = current;
    (wound, legs.rail, terminal)
}

/// With legs that carry nothing, whose phases have their EMF over the neutral; and the terminals.
#[inline(always)]
fn afloat<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    c: &Coupling<S>,
    legs: &Legs<S>,
    neutral: S,
    w: &Windings<S>,
) -> (Wound<S>, [S; 3]) {
    let terminal: [S; 3] = three!(|j| S::select(legs.connected[j], legs.voltage[j], neutral + w.emf[j]));
    let drop = three!(|j| (-w.resistance[j]).fma(w.current[j], terminal[j] - w.emf[j]));
    let current = m.star.currents_after(w.current, drop, neutral);
    let torque = mean_torque(m, structure, c, [w.current, current]);
    let wound = Wound { current, voltage: three!(|j| terminal[j] - neutral), torque };
    (wound, terminal)
}

/// Torque of the currents' mean over a step.
#[inline(always)]
fn mean_torque<S: Scalar>(m: &Model<S>, structure: &Structure, c: &Coupling<S>, [old, new]: [[S; 3]; 2]) -> S {
    motor_torque::<S, true>(m, structure, c, three!(|j| S::splat(0.5) * (old[j] + new[j])))
}

/// Sines and cosines of the phases at a shaft angle.
#[inline(always)]
fn phases<S: Scalar>(m: &Model<S>, angle: S) -> ([S; 3], [S; 3]) {
    let (sin, cos) = m.star.electrical_angle(angle).sin_cos();
    three_phase(sin, cos)
}

#[inline(always)]
fn step<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
    // Sensors and control electronics.
    let reading = sense::<S, FULL, FULL>(m, structure, x, s);

    // Power electronics.
    let feed = Feed::begin::<FULL>(m, structure, x, s);
    let commands = modulate::<S, FULL>(m, structure, x, s);
    if let (true, true, Some(commands)) = (FULL, structure.switching, &commands) {
        switch(m, s, feed.supply, commands);
    }

    // Motor electromagnetics, at the middle of the step.
    let position = middle(m, s);
    let (sin, cos) = m.star.electrical_angle(position).sin_cos();
    let c = coupling_at::<S, FULL>(m, structure, s, position, [sin, cos]);
    let measured = measure::<S, FULL, FULL>(m, structure, s);
    let wound = wind::<S, FULL>(m, structure, s, &c, S::splat(0.5) * feed.supply, &commands);
    feed.end::<FULL>(m, structure, s);
    if structure.acquisition {
        // The drive's own angle, now and at the middle of the step.
        let shown =
            if FULL && structure.sensing.distorts() && structure.sensing.commutated { reading.angle } else { s.shaft.motor_position };
        let ahead = S::splat(0.5) * m.dt * s.shaft.motor_speed;
        let ((sines, cosines), (sines_mid, cosines_mid)) = (phases(m, shown), phases(m, shown + ahead));
        let (v_q, _) = park(wound.voltage, sines_mid, cosines_mid);
        acquire(m, s, park(measured, sines, cosines), v_q);
    }

    // Motor and transmission dynamics.
    move_on::<S, FULL, FULL>(m, structure, x, s, (wound.torque, wound.current));
}

/// Behind a carrier.
pub(super) struct ByCarrier<const FULL: bool>;

impl<const FULL: bool> Behind for ByCarrier<FULL> {
    const FULL: bool = FULL;
    #[inline(always)]
    fn step<S: Scalar>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
        step::<S, FULL>(m, structure, x, s);
    }
}
