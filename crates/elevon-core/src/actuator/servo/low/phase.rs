//! The equivalent phase at one rotor angle (docs/explanation/theory/low-fidelity.md, "From three phases to one").

use super::model::{Model, Phase, State};
use super::structure::Structure;
use crate::inverter::hysteresis::six_step;
use crate::motor::equivalent::{equivalent, imposed_shape, quadrature, Circuit};
use crate::scalar::{three_phase, Scalar};
use crate::sensor::resolver::Reading;
use crate::three;

/// k_j at a motor position and the reference temperature.
#[inline(always)]
pub(super) fn coefficients<S: Scalar>(m: &Model<S>, structure: &Structure, position: S) -> [S; 3] {
    let (sin, cos) = m.star.electrical_angle(position).sin_cos();
    m.star.coefficients::<true>(&structure.motor, Some(&m.pole), position, [sin, cos], None)
}

/// The phase at the shaft's angle, its currents imposed at the angle that the drive reads.
#[inline(always)]
pub(super) fn phase<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, reading: &Reading<S>) -> Phase<S> {
    if !structure.angle {
        return warm(m, s);
    }
    let k = coefficients(m, structure, s.shaft.motor_position);
    let (sin, cos) = m.star.electrical_angle(s.shaft.motor_position).sin_cos();
    let (rotor, across) = three_phase(sin, cos);
    let commutated = structure.sensing.resolver && structure.sensing.commutated;
    let believed = if commutated { [reading.angle, reading.speed] } else { [s.shaft.motor_position, s.shaft.motor_speed] };
    let (sines, cosines) = if commutated {
        let (sin, cos) = m.star.electrical_angle(believed[0]).sin_cos();
        three_phase(sin, cos)
    } else {
        (rotor, across)
    };
    let reference = if structure.six_step { six_step(sines) } else { sines };
    let imposed = imposed_shape(reference, m.drive.weight);
    let resistance = three!(|j| m.resistance[j] * s.resistance_factor);
    let e = equivalent(k, resistance, m.inductance, imposed);
    // No current has a place where two phases are interrupted.
    let none = e.inductance.equals(S::zero());
    let [_, healthy, inductance] = m.cold;
    let circuit = Circuit::new(S::select(none, healthy, e.resistance), S::select(none, inductance, e.inductance), m.dt);
    let reading = three!(|j| m.drive.gain[j] * imposed[j]);
    Phase {
        coefficients: three!(|j| k[j] * s.flux_factor),
        direct: if commutated { -(quadrature(k, cosines) * s.flux_factor) } else { S::zero() },
        imposed,
        believed,
        quadrature: quadrature(imposed, rotor),
        seen: quadrature(reading, sines),
        ..Phase::new(e.torque_constant * s.flux_factor, circuit, &m.control, m.shaft.inertia)
    }
}

/// The healthy phase at the present temperatures.
#[inline(always)]
fn warm<S: Scalar>(m: &Model<S>, s: &State<S>) -> Phase<S> {
    let [constant, resistance, inductance] = m.cold;
    let circuit = Circuit::new(resistance * s.resistance_factor, inductance, m.dt);
    Phase::new(constant * s.flux_factor, circuit, &m.control, m.shaft.inertia)
}
