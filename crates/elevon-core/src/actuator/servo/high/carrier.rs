//! One step behind a carrier. Its edges lie within the step (`inverter::carrier`), so that nothing asks for a short one:
//! the windings' EMF and torque are those of the rotor's position at the middle of the step, the currents' means over it
//! make the torque, and the resistance acts on that mean. All of it is of second order in the step.

use super::electric::{coupling_at, electric_step, Gates};
use super::model::{Model, State, E_INVERTER, E_SUPPLY};
use super::step::{acquire, link_voltage, measure, park, sense};
use crate::actuator::servo::advance::{Instant, Stepper};
use crate::actuator::servo::details::Structure;
use crate::inverter::bridge::Pulses;
use crate::inverter::carrier::Pulse;
use crate::inverter::losses::switching_loss;
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

/// Commands of a step.
struct Commands<S: Scalar> {
    pulses: [Pulse<S>; 3],
    /// At the end of the last step.
    before: [S; 3],
    /// A lost resolver has opened the bridge.
    lost: S::Mask,
    /// Transitions of each leg.
    edges: [S; 3],
}

/// The commands over a step, and in the state what is left of them: means, command at the end, transitions.
#[inline(always)]
fn modulate<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) -> Commands<S> {
    let control = &mut s.current_control;
    let pulses = m.carrier.pulses(control.modulation, s.commands, &mut control.next_edge, x.t);
    let lost = if FULL && structure.stops { m.sensing.lost() } else { S::mask(false) };
    let on = |value: S| if FULL { S::select(lost, S::zero(), value) } else { value };
    let before = s.commands;
    let ends: [[S; 2]; 3] = three!(|j| pulses[j].ends());
    let edges: [S; 3] = three!(|j| {
        let at_begin = S::splat(0.5) * (on(ends[j][0]) - before[j]).abs();
        at_begin + on(pulses[j].edges())
    });
    s.transitions = s.transitions + (edges[0] + edges[1] + edges[2]);
    s.commands = three!(|j| on(ends[j][1]));
    if FULL && structure.stops && S::any(lost) {
        s.current_control.look_for_edges();
    }
    s.legs = three!(|j| on(S::splat(2.0).fma(pulses[j].share(), -S::one())));
    Commands { pulses, before, lost, edges }
}

#[inline(always)]
fn step<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
    // Sensors and control electronics.
    let reading = sense::<S, FULL, FULL>(m, structure, x, s);
    let measured = measure::<S, FULL, FULL>(m, structure, s);

    // Power electronics.
    let source = x.supply * m.supply_scale;
    let supply = if FULL { link_voltage(m, structure, s, source) } else { source };
    let half = S::splat(0.5);
    let commands = modulate::<S, FULL>(m, structure, x, s);
    let drawn_before = s.energy[E_SUPPLY];
    if FULL && structure.switching {
        let twice = three!(|j| commands.edges[j] + commands.edges[j]);
        let lost = switching_loss(m.extra.switching_time, supply, s.star.current, [S::zero(); 3], twice);
        s.energy[E_SUPPLY] = s.energy[E_SUPPLY] + lost;
        s.energy[E_INVERTER] = s.energy[E_INVERTER] + lost;
    }

    // Motor electromagnetics, at the middle of the step.
    let position = middle(m, s);
    let (sin, cos) = m.star.electrical_angle(position).sin_cos();
    let c = coupling_at::<S, FULL>(m, structure, s, position, [sin, cos]);
    let old = three!(|j| s.star.current[j]);
    let gates = Gates::Within(Pulses { legs: &commands.pulses, before: commands.before, lost: commands.lost });
    let (i, v) = electric_step::<S, FULL, FULL>(m, structure, s, &c, half * supply, gates);
    let current = three!(|j| i[j]);
    let torque = m.star.saturate(m.star.torque(c.k, three!(|j| half * (old[j] + current[j]))));
    if FULL && structure.link {
        m.extra.link.step(&mut s.extra.link, source, s.energy[E_SUPPLY] - drawn_before);
        s.bridge.tripped = s.bridge.tripped.maximum(m.extra.link.tripped(&s.extra.link));
    }
    if structure.acquisition {
        // The drive's own angle, now and at the middle of the step.
        let shown =
            if FULL && structure.sensing.distorts() && structure.sensing.commutated { reading.angle } else { s.shaft.motor_position };
        let phases = |angle: S| {
            let (sin, cos) = m.star.electrical_angle(angle).sin_cos();
            three_phase(sin, cos)
        };
        let ((sines, cosines), (sines_mid, cosines_mid)) = (phases(shown), phases(shown + half * m.dt * s.shaft.motor_speed));
        let (v_q, _) = park(v, sines_mid, cosines_mid);
        acquire(m, s, park(measured, sines, cosines), v_q);
    }

    // Motor and transmission dynamics.
    if FULL && structure.shaft.flanks {
        m.shaft.hold_flank::<FULL>(&structure.shaft, x, &mut s.shaft, torque);
    }
    let loads = m.shaft.loads::<FULL, FULL>(&structure.shaft, x, &s.shaft, torque);
    m.shaft.step::<FULL, FULL>(&structure.shaft, x, &mut s.shaft, &loads, torque);
    s.star.current = current;
}

/// The step of the inner loop behind a carrier, with every detail or with none.
pub(crate) struct CarrierStep<const FULL: bool>;

impl<S: Scalar, const FULL: bool> Stepper<S> for CarrierStep<FULL> {
    type Model = Model<S>;
    type Structure = Structure;
    type State = State<S>;
    const IN_REGISTERS: bool = !FULL;

    #[inline(always)]
    fn dt(model: &Model<S>) -> S {
        model.dt
    }
    #[inline(always)]
    fn step(model: &Model<S>, structure: &Structure, instant: &Instant<S>, state: &mut State<S>) {
        step::<S, FULL>(model, structure, instant, state);
    }
}
