//! All signals of the high fidelity from its state. Nothing here feeds back.

use super::high::*;
use super::layout::*;
use super::march::Moment;
use super::signals::HighSignal as Q;
use crate::actuator::Inputs;
use crate::scalar::{three_phase, Scalar};
use crate::sensor::resolver::Reading;
use crate::transmission::friction::Friction;
use crate::three;

#[inline(always)]
pub(super) fn high<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
    let mut set = |q: Q, x: S| out[q as usize] = x;
    set(Q::Command, inputs[COMMAND].at(t) + s.command_noise);
    set(Q::UserPosition, s.user_position);
    set(Q::UserSpeed, user_speed(structure, m, s));
    set(Q::MotorPosition, s.motor_position);
    set(Q::MotorSpeed, s.motor_speed);
    set(Q::SpeedRef, s.control.speed_ref);
    set(Q::TorqueRef, s.control.torque_ref);
    set(Q::CurrentRef, s.current_ref);
    set(Q::LegTransitions, s.transitions);
    set(Q::Tripped, s.bridge.tripped);
    set(Q::WindingTemperature, m.temperature);
    set(Q::EncoderPosition, m.encoder.read(s.user_position));
    let mut held = s.held_angle;
    let ideal = Reading { angle: s.motor_position, position: s.motor_position, speed: s.motor_speed };
    let reading = if structure.resolver { m.resolver.read(s.motor_position, s.motor_speed, &mut held) } else { ideal };
    set(Q::ResolverPosition, reading.position);
    set(Q::ResolverSpeed, reading.speed);
    electrical(structure, m, inputs, s, t, out);
    mechanical(structure, m, inputs, s, t, out);
    energies(m, s, out);
}

/// In the operator model the user moves with the motor while the play is taken up, else it rests.
#[inline(always)]
fn user_speed<S: Scalar>(structure: &Structure, m: &Model<S>, s: &State<S>) -> S {
    if structure.elastic {
        return s.user_speed;
    }
    let lag = s.motor_position * m.gear.per_ratio - s.user_position;
    let edge = m.play.half * S::splat(1.0 - 1e-9);
    let pushing = edge.le(lag.abs()) & S::zero().le(lag * s.motor_speed);
    S::select(pushing, s.motor_speed * m.gear.per_ratio, S::zero())
}

#[inline(always)]
fn electrical<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
    let mut set = |q: Q, x: S| out[q as usize] = x;
    let (sin, cos) = m.star.electrical_angle(s.motor_position).sin_cos();
    let (sines, cosines) = three_phase(sin, cos);
    let supply = inputs[SUPPLY].at(t) * m.supply_scale;
    set(Q::SupplyVoltage, supply);
    let (q, d) = park(s.star.current, sines, cosines);
    set(Q::CurrentQ, q);
    set(Q::CurrentD, d);
    let voltage = if structure.bridge { s.voltage } else { ideal_voltage(structure, m, s, supply, sin, cos) };
    let measured = measured_current::<S, true>(m, structure, s);
    for j in 0..3 {
        out[Q::CurrentA as usize + j] = s.star.current[j];
        out[Q::VoltageA as usize + j] = voltage[j];
        out[Q::CurrentAMeas as usize + j] = measured[j];
        out[Q::CurrentQMeas as usize + j] = s.filtered[j];
        out[Q::LoopCurrentA as usize + j] = s.star.loop_current[j];
    }
    out[Q::VoltageQRef as usize] = s.current_control.voltage_q;
}

/// Phase-to-neutral voltages of an ideal bridge in its present switching state.
#[inline(always)]
fn ideal_voltage<S: Scalar>(structure: &Structure, m: &Model<S>, s: &State<S>, supply: S, sin: S, cos: S) -> [S; 3] {
    let c = coupling::<S, true>(m, structure, s, sin, cos);
    let terminal = three!(|j| s.legs[j] * S::splat(0.5) * supply);
    let drop: [S; 3] = three!(|j| terminal[j] - c.k[j] * s.motor_speed - m.star.resistance[j] * s.star.resistance_factor * s.star.current[j]);
    let neutral = m.star.neutral(drop);
    three!(|j| terminal[j] - neutral)
}

#[inline(always)]
fn mechanical<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
    let (sin, cos) = m.star.electrical_angle(s.motor_position).sin_cos();
    let c = coupling::<S, true>(m, structure, s, sin, cos);
    let torque = motor_torque::<S, true>(m, structure, s, &c);
    let loads = shaft_loads::<S, true>(m, structure, &Moment::at(inputs, t), s, torque);
    let dry = Friction::dry_torque(torque - loads.load, s.motor_speed, loads.static_limit, loads.dynamic);
    let mut set = |q: Q, x: S| out[q as usize] = x;
    set(Q::MotorTorque, torque);
    set(Q::FrictionTorque, dry + m.friction.viscous_torque(s.motor_speed));
    set(Q::BrakeTorque, loads.brake);
    set(Q::LoadTorque, loads.load);
    set(Q::UserTorque, loads.user_torque);
    set(Q::TransmissionTorque, if structure.elastic { contact_torque(m, s) } else { loads.user_torque });
}

#[inline(always)]
fn energies<S: Scalar>(m: &Model<S>, s: &State<S>, out: &mut [S]) {
    for (q, i) in [
        (Q::EnergySupply, E_SUPPLY),
        (Q::EnergyCopper, E_COPPER),
        (Q::EnergyInverter, E_INVERTER),
        (Q::EnergyFriction, E_FRICTION),
        (Q::EnergyBrake, E_BRAKE),
        (Q::EnergyLoad, E_LOAD),
        (Q::EnergyImpact, E_IMPACT),
    ] {
        out[q as usize] = s.energy[i];
    }
    let half = S::splat(0.5);
    let kinetic = half * m.inertia * s.motor_speed * s.motor_speed + half * m.user_inertia * s.user_speed * s.user_speed;
    out[Q::EnergyKinetic as usize] = kinetic;
    let magnetic = (0..3).fold(S::zero(), |sum, j| sum + half * s.star.current[j] * s.star.current[j] / m.star.per_inductance[j]);
    out[Q::EnergyMagnetic as usize] = magnetic;
}
