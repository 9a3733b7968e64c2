//! The reduced-order model without gates: a bridge that has tripped, lost its feedback or is off leaves diodes and shorted
//! switches on the three windings, which carry what the EMFs drive. The current of one phase cannot stand for that: the
//! windings are stepped one by one through the switching model's bridge, exactly for voltages held over a part of the
//! step. The diodes follow the EMFs as they turn, so that a step is cut into parts of a small electrical angle.

use super::model::{Model, Phase, State};
use super::phase::coefficients;
use super::structure::Structure;
use super::windings::{parts, per_winding};
use crate::inverter::bridge::{extinguish, Windings};
use crate::motor::equivalent::quadrature;
use crate::scalar::{three_phase, Scalar};
use crate::three;

/// A step behind the bridge without gates.
pub(super) struct Passive<S> {
    pub phases: [S; 3],
    /// Means over the step: torque, copper loss, power drawn from the link.
    pub torque: S,
    pub copper: S,
    /// Copper loss of each phase.
    pub windings: [S; 3],
    pub drawn: S,
    /// Quadrature component of the phase-to-neutral voltages, in the drive's frame.
    pub voltage: S,
    /// Quadrature component at the step's end, in the rotor's frame and in the drive's.
    pub quadrature: S,
    pub seen: S,
}

/// One part of a step: how long, and what does not change in it.
struct Part<S> {
    dt: S,
    half_supply: S,
    resistance: [S; 3],
    /// (1 - exp(-R dt / L)) / R of each winding: exact for voltages held.
    per_winding: [S; 3],
}

/// The windings over a step from the phase currents `i`.
#[inline(always)]
pub(super) fn passive_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    supply: S,
    s: &mut State<S>,
    p: &Phase<S>,
    i: [S; 3],
) -> Passive<S> {
    let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
    let speed = s.shaft.motor_speed;
    let parts = parts(m, speed);
    let share = one / parts;
    let resistance: [S; 3] = three!(|j| m.resistance[j] * s.resistance_factor);
    let dt = share * m.dt;
    let part = Part { dt, half_supply: half * supply, resistance, per_winding: per_winding(m, resistance, dt) };
    let mut x =
        Passive { phases: i, torque: zero, copper: zero, windings: [zero; 3], drawn: zero, voltage: zero, quadrature: zero, seen: zero };
    let mut k = zero;
    // Lanes that have all their parts wait for the others.
    while S::any(k.lt(parts)) {
        let running = k.lt(parts);
        let position = ((k + half) * dt).fma(speed, s.shaft.motor_position);
        let cold = coefficients(m, structure, position);
        let along = m.star.under_load(three!(|j| cold[j] * s.flux_factor), x.phases);
        let (after, rail, voltage) = part_step(m, structure, s, &part, along, x.phases);
        let (sin, cos) = m.star.electrical_angle(((k + half) * dt).fma(p.believed[1], p.believed[0])).sin_cos();
        x.voltage = S::select(running, share.fma(quadrature(voltage, three_phase(sin, cos).0), x.voltage), x.voltage);
        let middle: [S; 3] = three!(|j| half * (x.phases[j] + after[j]));
        for j in 0..3 {
            let sum = |total: S, value: S| S::select(running, share.fma(value, total), total);
            x.torque = sum(x.torque, along[j] * middle[j]);
            x.copper = sum(x.copper, resistance[j] * middle[j] * middle[j]);
            x.windings[j] = sum(x.windings[j], resistance[j] * middle[j] * middle[j]);
            x.drawn = sum(x.drawn, rail[j] * middle[j]);
        }
        x.phases = three!(|j| S::select(running, after[j], x.phases[j]));
        k = k + one;
    }
    let component = |angle: S| {
        let (sin, cos) = angle.sin_cos();
        quadrature(x.phases, three_phase(sin, cos).0)
    };
    x.quadrature = component(m.star.electrical_angle(speed.fma(m.dt, s.shaft.motor_position)));
    x.seen = component(m.star.electrical_angle(p.believed[1].fma(m.dt, p.believed[0])));
    x
}

/// Phase currents after a part of a step, the rails that they come from, and the phase-to-neutral voltages.
#[inline(always)]
fn part_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    part: &Part<S>,
    along: [S; 3],
    i: [S; 3],
) -> ([S; 3], [S; 3], [S; 3]) {
    let (g, open) = (part.per_winding, [S::zero(); 3]);
    let emf: [S; 3] = three!(|j| along[j] * s.shaft.motor_speed);
    let w = Windings { current: i, emf, per_inductance: g, resistance: part.resistance, open: m.star.open };
    let connection = m.drive.bridge.connect(&mut s.bridge, &structure.bridge, open, open, part.half_supply, &w, part.dt);
    let legs = connection.legs;
    let drop: [S; 3] = three!(|j| legs.voltage[j] - emf[j] - part.resistance[j] * i[j]);
    let neutral = match connection.loose {
        Some(neutral) => neutral,
        None => (g[0] * drop[0] + g[1] * drop[1] + g[2] * drop[2]) / (g[0] + g[1] + g[2]),
    };
    let next = three!(|j| i[j] + g[j] * (drop[j] - neutral));
    let voltage = three!(|j| S::select(legs.connected[j], legs.voltage[j] - neutral, emf[j]));
    (extinguish(&legs, i, next), legs.rail, voltage)
}
