//! The low fidelity where one current does not stand for three: references turned away from the rotor by what the resolver
//! shows, relays with an interrupted phase or unlike sensors, a carrier drive with an interrupted phase. The three windings
//! are stepped behind mean leg voltages, exactly for voltages held over a part of a step (docs/theory/low-fidelity.md,
//! "Three windings behind mean legs").

use super::model::{Model, State, Structure};
use super::passive::{parts, per_winding};
use super::phase::{coefficients, Phase};
use crate::actuator::servo::layout::DriveKind;
use crate::inverter::hysteresis::six_step;
use crate::motor::equivalent::quadrature;
use crate::scalar::{three_phase, Scalar};
use crate::three;

/// Parts of a step at least: the current loop's lag is looked at by parts.
const LEAST_PARTS: f64 = 8.0;
/// Rounds in which the legs see what the others do.
const ROUNDS: usize = 3;

/// What a drive remembers of its legs and integrals, V.
#[derive(Clone, Copy, Debug)]
pub struct DrivenState<S> {
    legs: [S; 3],
    integral: [S; 2],
}

impl<S: Scalar> DrivenState<S> {
    pub(super) fn rest() -> Self {
        Self { legs: [S::zero(); 3], integral: [S::zero(); 2] }
    }
}

/// A step of the windings behind the drive.
pub(super) struct Driven<S> {
    pub phases: [S; 3],
    /// Means over the step: torque, copper loss, power drawn from the link, quadrature voltage in the drive's frame.
    pub torque: S,
    pub copper: S,
    pub drawn: S,
    pub voltage: S,
    /// Quadrature component at the step's end, in the rotor's frame and as the drive's sensors show it.
    pub quadrature: S,
    pub seen: S,
}

/// One part of a step: what the drive sees, and the windings without its voltage.
struct Part<S> {
    dt: S,
    half_supply: S,
    /// Current at the end with all legs at zero, but for the neutral.
    free: [S; 3],
    /// Current per volt held over the part; none of an interrupted phase.
    per_volt: [S; 3],
    sines: [S; 3],
    cosines: [S; 3],
    /// Speed that the drive believes.
    speed: S,
}

/// The windings over a step from the phase currents `i`, with the torque current that the drive wants.
#[inline(always)]
pub(super) fn driven_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    supply: S,
    s: &mut State<S>,
    p: &Phase<S>,
    wanted: S,
) -> Driven<S> {
    let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
    let (i, speed) = (s.phases, s.shaft.motor_speed);
    let parts = parts(m, speed).maximum(S::splat(LEAST_PARTS));
    let share = one / parts;
    let dt = share * m.dt;
    let resistance: [S; 3] = three!(|j| m.resistance[j] * s.resistance_factor);
    let held = per_winding(m, resistance, dt);
    let per_volt = three!(|j| S::select(half.le(m.star.open[j]), zero, held[j]));
    let mut x = Driven { phases: i, torque: zero, copper: zero, drawn: zero, voltage: zero, quadrature: zero, seen: zero };
    let mut k = zero;
    // Lanes that have all their parts wait for the others.
    while S::any(k.lt(parts)) {
        let running = k.lt(parts);
        let at = |instant: S| (instant * dt).fma(speed, s.shaft.motor_position);
        let along: [S; 3] = coefficients(m, structure, at(k + half));
        let emf: [S; 3] = three!(|j| along[j] * s.flux_factor * speed);
        let (sin, cos) = m.star.electrical_angle(shown(m, structure, s, at(k + one))).sin_cos();
        let (sines, cosines) = three_phase(sin, cos);
        let free = three!(|j| x.phases[j] - per_volt[j] * (emf[j] + resistance[j] * x.phases[j]));
        let part = Part { dt, half_supply: half * supply, free, per_volt, sines, cosines, speed: p.believed[1] };
        let mut memory = s.driven;
        let after = match structure.drive {
            DriveKind::Pwm => carried(m, &part, &mut memory, wanted, x.phases),
            DriveKind::Hysteresis | DriveKind::Off => relayed(m, structure, &part, &mut memory, wanted),
        };
        let middle: [S; 3] = three!(|j| half * (x.phases[j] + after[j]));
        let sum = |total: S, value: S| S::select(running, share.fma(value, total), total);
        for j in 0..3 {
            x.torque = sum(x.torque, along[j] * s.flux_factor * middle[j]);
            x.copper = sum(x.copper, resistance[j] * middle[j] * middle[j]);
            x.drawn = sum(x.drawn, memory.legs[j] * middle[j]);
        }
        x.voltage = sum(x.voltage, quadrature(memory.legs, sines));
        x.phases = three!(|j| S::select(running, after[j], x.phases[j]));
        s.driven.legs = three!(|j| S::select(running, memory.legs[j], s.driven.legs[j]));
        s.driven.integral = [0, 1].map(|a| S::select(running, memory.integral[a], s.driven.integral[a]));
        let seen = quadrature(three!(|j| m.drive.gain[j] * x.phases[j]), sines);
        x.seen = S::select(running, seen, x.seen);
        k = k + one;
    }
    let (sin, cos) = m.star.electrical_angle(speed.fma(m.dt, s.shaft.motor_position)).sin_cos();
    x.quadrature = quadrature(x.phases, three_phase(sin, cos).0);
    x
}

/// Angle of the shaft by which the drive places its references.
#[inline(always)]
fn shown<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, position: S) -> S {
    if structure.sensing.resolver && structure.sensing.commutated {
        m.sensing.angle(position, s.shaft.motor_speed, s.sensed)
    } else {
        position
    }
}

/// Mean legs of the relays: each leaves its voltage until its phase's error is out of the band, then gives what brings it
/// back to the edge, within the rails. A turned reference sweeps the band: no error is left over a cycle.
#[inline(always)]
fn relayed<S: Scalar>(m: &Model<S>, structure: &Structure, part: &Part<S>, memory: &mut DrivenState<S>, wanted: S) -> [S; 3] {
    let reference = if structure.six_step { six_step(part.sines) } else { part.sines };
    let edge = if structure.turned { S::zero() } else { m.drive.band };
    let mut after = settled(part, memory.legs);
    for _ in 0..ROUNDS {
        for j in 0..3 {
            let others = part.per_volt[(j + 1) % 3] + part.per_volt[(j + 2) % 3];
            let total = part.per_volt[j] + others;
            // Per volt of this leg, the neutral following.
            let reach = part.per_volt[j] * others / S::select(total.equals(S::zero()), S::one(), total) * m.drive.gain[j];
            let error = wanted * reference[j] - m.drive.gain[j] * after[j];
            let none = reach.equals(S::zero());
            let beyond = error - error.clamp_abs(edge);
            let change = S::select(none, S::zero(), beyond / S::select(none, S::one(), reach));
            memory.legs[j] = (memory.legs[j] + change).clamp_abs(part.half_supply);
            after = settled(part, memory.legs);
        }
    }
    after
}

/// The PI of a carrier drive with its zero on the winding's pole, decoupled, on the currents that the sensors show.
#[inline(always)]
fn carried<S: Scalar>(m: &Model<S>, part: &Part<S>, memory: &mut DrivenState<S>, wanted: S, i: [S; 3]) -> [S; 3] {
    let (zero, one) = (S::zero(), S::one());
    let (resistance, inductance) = (m.cold[1], m.cold[2]);
    let shown: [S; 3] = three!(|j| m.drive.gain[j] * i[j]);
    let (q, d) = (quadrature(shown, part.sines), -quadrature(shown, part.cosines));
    let error = [-d, wanted - q];
    // As a first-order lag looked at by parts.
    let bandwidth = m.drive.bandwidth;
    let gain = inductance / part.dt * (one - (-(bandwidth * part.dt)).exp());
    let electrical = m.drive.electrical_inductance * part.speed;
    let emf = m.cold[0] * S::splat(2.0 / 3.0) * part.speed;
    let asked = [gain.fma(error[0], memory.integral[0]) - electrical * q, gain.fma(error[1], memory.integral[1]) + electrical * d + emf];
    let size = (asked[0] * asked[0] + asked[1] * asked[1]).sqrt();
    let largest = m.drive.voltage_ratio * S::splat(2.0) * part.half_supply;
    let limited = largest.lt(size);
    let scale = S::select(limited, largest / S::select(limited, size, one), one);
    let step = S::select(limited, zero, bandwidth * resistance * part.dt);
    memory.integral = [0, 1].map(|a| step.fma(error[a], memory.integral[a]));
    memory.legs = three!(|j| scale * (asked[1] * part.sines[j] - asked[0] * part.cosines[j]));
    settled(part, memory.legs)
}

/// Currents after a part under leg voltages; the neutral keeps their sum at zero.
#[inline(always)]
fn settled<S: Scalar>(part: &Part<S>, legs: [S; 3]) -> [S; 3] {
    let (zero, one) = (S::zero(), S::one());
    let g = part.per_volt;
    let total = g[0] + g[1] + g[2];
    let raised: [S; 3] = three!(|j| g[j].fma(legs[j], part.free[j]));
    let closed: [S; 3] = three!(|j| S::select(g[j].equals(zero), zero, one));
    let neutral = (closed[0] * raised[0] + closed[1] * raised[1] + closed[2] * raised[2]) / S::select(total.equals(zero), one, total);
    // One closed phase alone carries nothing.
    let alone = (closed[0] + closed[1] + closed[2]).lt(S::splat(1.5));
    three!(|j| S::select(alone, zero, closed[j] * (raised[j] - g[j] * neutral)))
}
