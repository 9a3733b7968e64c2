//! All signals of the high fidelity from its state. Nothing here feeds back.

use super::electric::{coupling, motor_torque};
use super::model::*;
use super::step::{leg_current, park, seen_current};
use crate::actuator::servo::advance::Instant;
use crate::actuator::servo::details::Structure;
use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::actuator::servo::shaft::{contact_torque, disturbance, load_side_friction, shaft_loads};
use crate::actuator::servo::signals::{HighSignal as Q, HIGH};
use crate::actuator::Inputs;
use crate::scalar::{three_phase, Scalar};
use crate::sensor::resolver::Reading;
use crate::three;
use crate::transmission::friction::Friction;

#[inline(always)]
pub(crate) fn high<F: Form, S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
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
    set(Q::Tripped, s.bridge.tripped.maximum(s.extra.network.over));
    let warm = &s.extra.network;
    set(Q::WindingTemperature, if structure.heat { warm.winding } else { m.temperature });
    set(Q::SurfaceTemperature, warm.surface);
    set(Q::HeatCopper, warm.power[0]);
    set(Q::HeatLoop, warm.power[1]);
    set(Q::HeatAir, warm.power[2]);
    set(Q::ThermalWarning, m.extra.network.warns(warm));
    set(Q::Limited, m.control.limited(&s.control));
    set(Q::EncoderPosition, m.encoder.read(s.user_position));
    let mut held = s.held_angle;
    let ideal = Reading { angle: s.motor_position, position: s.motor_position, speed: s.motor_speed };
    let reading = if structure.resolver { m.resolver.read(s.motor_position, s.motor_speed, &mut held) } else { ideal };
    set(Q::ResolverPosition, reading.position);
    set(Q::ResolverSpeed, reading.speed);
    electrical(structure, m, inputs, s, t, out);
    mechanical(structure, m, inputs, s, t, out);
    energies(m, s, out);
    if F::LINEAR {
        let own = screw(structure, m, inputs, s, t);
        out[HIGH.len()..].copy_from_slice(&own);
    }
}

/// What a ballscrew adds, in the order of its further signals.
#[inline(always)]
fn screw<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S) -> [S; 7] {
    let x = Instant::at(inputs, t);
    let user = m.gear.stiffness.fma(s.user_position - m.gear.spring_zero, x.user);
    let through = if structure.elastic { contact_torque(m, s) } else { user };
    let unbalance = if structure.unbalance { m.extra.unbalance.torque(s.motor_position) } else { S::zero() };
    let limit = load_side_friction(m, structure, &x);
    let dry = Friction::dry_torque(through - user, s.user_speed, limit, limit);
    [
        s.motor_position * m.gear.per_ratio,
        s.motor_speed * m.gear.per_ratio,
        dry + m.extra.load_damping * s.user_speed,
        through * m.gear.per_ratio,
        disturbance(m, structure, s, through).0 - unbalance,
        m.extra.screw.efficiency,
        m.extra.screw.efficiency_aiding,
    ]
}

/// The same for the low fidelity, and current and voltage of the printed L-R circuit.
#[inline(always)]
pub(crate) fn low_screw<S: Scalar>(per_ratio: S, angle: S, speed: S, force: S, efficiency: [S; 2], current: S, voltage: S) -> [S; 7] {
    let root = S::splat(1.5_f64.sqrt());
    [angle * per_ratio, speed * per_ratio, force * per_ratio, efficiency[0], efficiency[1], root * current, root * voltage]
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
    let voltage = if structure.bridge || structure.tap { s.voltage } else { ideal_voltage(structure, m, s, supply, sin, cos) };
    let measured = seen_current(m, structure, s);
    let drawn = if structure.tap { m.extra.tap.currents(s.voltage) } else { [S::zero(); 3] };
    let legs = leg_current(m, structure, s);
    for j in 0..3 {
        out[Q::LegCurrentA as usize + j] = legs[j];
        out[Q::TapCurrentA as usize + j] = drawn[j];
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
    let drop: [S; 3] =
        three!(|j| terminal[j] - c.k[j] * s.motor_speed - m.star.resistance[j] * s.star.resistance_factor * s.star.current[j]);
    let neutral = m.star.neutral(drop);
    three!(|j| terminal[j] - neutral)
}

#[inline(always)]
fn mechanical<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
    let (sin, cos) = m.star.electrical_angle(s.motor_position).sin_cos();
    let c = coupling::<S, true>(m, structure, s, sin, cos);
    let torque = motor_torque::<S, true>(m, structure, s, &c);
    let loads = shaft_loads::<S, true, true>(m, structure, &Instant::at(inputs, t), s, torque);
    let dry = Friction::dry_torque(torque - loads.load, s.motor_speed, loads.static_limit, loads.dynamic);
    let mut set = |q: Q, x: S| out[q as usize] = x;
    set(Q::MotorTorque, torque);
    let unbalance = if structure.unbalance { m.extra.unbalance.torque(s.motor_position) } else { S::zero() };
    set(Q::UnbalanceTorque, unbalance);
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
        (Q::EnergyTap, E_TAP),
    ] {
        out[q as usize] = s.energy[i];
    }
    out[Q::EnergyHeatStored as usize] = m.extra.network.stored(&s.extra.network);
    out[Q::EnergyAir as usize] = s.extra.network.heat_out;
    let half = S::splat(0.5);
    let kinetic = half * m.inertia * s.motor_speed * s.motor_speed + half * m.user_inertia * s.user_speed * s.user_speed;
    out[Q::EnergyKinetic as usize] = kinetic;
    let magnetic = (0..3).fold(S::zero(), |sum, j| sum + half * s.star.current[j] * s.star.current[j] / m.star.per_inductance[j]);
    out[Q::EnergyMagnetic as usize] = magnetic;
}
