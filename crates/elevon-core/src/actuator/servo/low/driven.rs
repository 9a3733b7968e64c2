//! The reduced-order model where one current does not stand for three: references turned away from the rotor by what the resolver
//! shows, relays with an interrupted phase or unlike sensors, a carrier drive with an interrupted phase. The three windings
//! are stepped behind mean leg voltages, exactly for voltages held over a part of a step (docs/explanation/theory/low-fidelity.md,
//! "Three windings behind mean legs").

use super::model::{DrivenState, Model, Phase, State};
use super::phase::coefficients;
use super::relays::{aligned, Relays};
use super::structure::Structure;
use super::windings::{parts, per_winding, phase_voltages, settled, Part};
use crate::actuator::servo::layout::DriveKind;
use crate::control::current_dq::Bounded;
use crate::motor::equivalent::quadrature;
use crate::scalar::{three_phase, Scalar};
use crate::three;

/// Parts of a step at least: the current loop's lag is looked at by parts.
const LEAST_PARTS: f64 = 8.0;

/// A step of the windings behind the drive.
pub(super) struct Driven<S> {
    pub phases: [S; 3],
    /// Means over the step: torque, copper loss, power drawn from the link, quadrature voltage in the drive's frame.
    pub torque: S,
    pub copper: S,
    /// Copper loss of each phase.
    pub windings: [S; 3],
    pub drawn: S,
    pub voltage: S,
    /// Quadrature component at the step's end, in the rotor's frame and as the drive's sensors report it.
    pub quadrature: S,
    pub seen: S,
}

/// The windings over a step from the phase currents `i`, with the torque current that the drive wants.
#[inline(always)]
pub(super) fn driven_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    [supply, band]: [S; 2],
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
    let gain = per_winding(m, resistance, dt);
    let per_volt = three!(|j| S::select(half.le(m.star.open[j]), zero, gain[j]));
    let mut x =
        Driven { phases: i, torque: zero, copper: zero, windings: [zero; 3], drawn: zero, voltage: zero, quadrature: zero, seen: zero };
    let mut k = zero;
    // Where the shaft's position takes the new speed, speed and currents stand half a step before it.
    let middle = if structure.shaft.middle { zero } else { half * parts };
    // Lanes that have all their parts wait for the others.
    while S::any(k.lt(parts)) {
        let running = k.lt(parts);
        let at = |instant: S| ((instant - middle) * dt).fma(speed, s.shaft.motor_position);
        let cold = coefficients(m, structure, at(k + half));
        let along: [S; 3] = m.star.under_load(three!(|j| cold[j] * s.flux_factor), x.phases);
        let emf: [S; 3] = three!(|j| along[j] * speed);
        let (sin, cos) = m.star.electrical_angle(angle_reading(m, structure, s, at(k + one))).sin_cos();
        let (sines, cosines) = three_phase(sin, cos);
        let free = three!(|j| x.phases[j] - per_volt[j] * (emf[j] + resistance[j] * x.phases[j]));
        let drift = three!(|j| emf[j] / resistance[j] + x.phases[j]);
        let part = Part { dt, half_supply: half * supply, free, per_volt, drift, sines, cosines, speed: p.believed[1] };
        let mut memory = s.driven;
        let after = match structure.drive {
            DriveKind::Pwm => Carrier::of(m).step(&part, &mut memory, wanted, x.phases),
            DriveKind::Hysteresis | DriveKind::Off => {
                Relays::of(m, structure, band * aligned(m, structure, at(k + one), sines)).step(&part, &mut memory, wanted)
            }
        };
        let mean: [S; 3] = three!(|j| half * (x.phases[j] + after[j]));
        let sum = |total: S, value: S| S::select(running, share.fma(value, total), total);
        for j in 0..3 {
            x.torque = sum(x.torque, along[j] * mean[j]);
            x.copper = sum(x.copper, resistance[j] * mean[j] * mean[j]);
            x.windings[j] = sum(x.windings[j], resistance[j] * mean[j] * mean[j]);
            x.drawn = sum(x.drawn, memory.legs[j] * mean[j]);
        }
        x.voltage = sum(x.voltage, quadrature(phase_voltages(&part, memory.legs, emf), sines));
        x.phases = three!(|j| S::select(running, after[j], x.phases[j]));
        s.driven.legs = three!(|j| S::select(running, memory.legs[j], s.driven.legs[j]));
        s.driven.integral = [0, 1].map(|a| S::select(running, memory.integral[a], s.driven.integral[a]));
        let seen = quadrature(three!(|j| m.drive.gain[j] * x.phases[j]), sines);
        x.seen = S::select(running, seen, x.seen);
        k = k + one;
    }
    let (sin, cos) = m.star.electrical_angle(((parts - middle) * dt).fma(speed, s.shaft.motor_position)).sin_cos();
    x.quadrature = quadrature(x.phases, three_phase(sin, cos).0);
    x
}

/// Angle of the shaft by which the drive places its references.
#[inline(always)]
fn angle_reading<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, position: S) -> S {
    if structure.sensing.resolver && structure.sensing.commutated {
        m.sensing.angle(position, s.shaft.motor_speed, s.sensed)
    } else {
        position
    }
}

/// The PI of a carrier drive with its zero on the winding's pole, decoupled, on the currents that the sensors report.
struct Carrier<S> {
    gain: [S; 3],
    emf_constant: S,
    resistance: S,
    inductance: S,
    bandwidth: S,
    electrical_inductance: S,
    voltage_ratio: S,
}

impl<S: Scalar> Carrier<S> {
    #[inline(always)]
    fn of(m: &Model<S>) -> Self {
        let [constant, resistance, inductance] = m.cold;
        Self {
            gain: m.drive.gain,
            emf_constant: constant * S::splat(2.0 / 3.0),
            resistance,
            inductance,
            bandwidth: m.drive.bandwidth,
            electrical_inductance: m.drive.electrical_inductance,
            voltage_ratio: m.drive.voltage_ratio,
        }
    }

    #[inline(always)]
    fn step(&self, part: &Part<S>, memory: &mut DrivenState<S>, wanted: S, i: [S; 3]) -> [S; 3] {
        let one = S::one();
        let reading: [S; 3] = three!(|j| self.gain[j] * i[j]);
        let (q, d) = (quadrature(reading, part.sines), -quadrature(reading, part.cosines));
        let error = [-d, wanted - q];
        // As a first-order lag looked at by parts.
        let gain = self.inductance / part.dt * (one - (-(self.bandwidth * part.dt)).exp());
        let electrical = self.electrical_inductance * part.speed;
        let emf = self.emf_constant * part.speed;
        let reference =
            [gain.fma(error[0], memory.integral[0]) - electrical * q, gain.fma(error[1], memory.integral[1]) + electrical * d + emf];
        let bounded = Bounded::within(self.voltage_ratio * S::splat(2.0) * part.half_supply, reference);
        let step = self.bandwidth * self.resistance * part.dt;
        memory.integral = [0, 1].map(|a| S::select(bounded.holds(a, error[a]), memory.integral[a], step.fma(error[a], memory.integral[a])));
        let [v_d, v_q] = bounded.voltage;
        memory.legs = three!(|j| v_q * part.sines[j] - v_d * part.cosines[j]);
        settled(part, memory.legs)
    }
}

#[cfg(test)]
mod tests {
    use super::super::windings::tests::{part, DT, L, R};
    use super::*;

    fn charging(parts: i32) -> f64 {
        1.0 - (-f64::from(parts) * DT * R / L).exp()
    }

    #[test]
    fn fixed_legs_charge_a_star_as_its_exponential() {
        let legs = [10.0, -2.0, 1.0];
        let mut i = [0.0; 3];
        for _ in 0..100 {
            i = settled(&part(i, [false; 3], 0.0), legs);
        }
        for j in 0..3 {
            assert!((i[j] - (legs[j] - 3.0) / R * charging(100)).abs() < 1e-12, "{i:?}");
        }
    }

    #[test]
    fn two_phases_are_one_loop_and_one_is_none() {
        let legs = [10.0, -2.0, 1.0];
        let (mut i, mut alone) = ([0.0; 3], [0.0; 3]);
        for _ in 0..100 {
            i = settled(&part(i, [false, false, true], 0.0), legs);
            alone = settled(&part(alone, [true, false, true], 0.0), legs);
        }
        let around = 12.0 / (2.0 * R) * charging(100);
        assert!((i[0] - around).abs() < 1e-12 && (i[1] + around).abs() < 1e-12, "{i:?}");
        assert_eq!(i[2], 0.0);
        assert_eq!(alone, [0.0; 3]);
    }

    #[test]
    fn a_carrier_drive_follows_as_a_lag_within_its_circle() {
        let drive = Carrier {
            gain: [1.0; 3],
            emf_constant: 0.1,
            resistance: R,
            inductance: L,
            bandwidth: 500.0,
            electrical_inductance: 0.04,
            voltage_ratio: 0.5,
        };
        let (mut i, mut memory, angle) = ([0.0; 3], DrivenState::initial(), 0.7);
        for k in 1..100 {
            let x = part(i, [false; 3], angle);
            i = drive.step(&x, &mut memory, 3.0, i);
            let lag = 1.0 - (-500.0 * DT * f64::from(k)).exp();
            assert!((quadrature(i, x.sines) - 3.0 * lag).abs() < 0.03, "{k}");
            assert!(quadrature(i, x.cosines).abs() < 1e-9);
        }
        drive.step(&part(i, [false; 3], angle), &mut memory, 300.0, i);
        let x = part(i, [false; 3], angle);
        let (q, d) = (quadrature(memory.legs, x.sines), quadrature(memory.legs, x.cosines));
        assert!((q.hypot(d) - 24.0).abs() < 1e-9);
    }
}
