//! All signals of the switching model from its state. Nothing here feeds back.

use super::electric::{coupling, motor_torque};
use super::model::*;
use super::step::{leg_current, link_voltage, park, seen_current};
use crate::actuator::servo::advance::Instant;
use crate::actuator::servo::details::Structure;
use crate::actuator::servo::layout::*;
use crate::actuator::servo::shaft::ShaftSignals;
use crate::actuator::servo::signals::{shared, HighSignal as Q, HIGH, HIGH_SPECIFIC};
use crate::actuator::{Inputs, Observation};
use crate::motor::short::{GROUND, PAIR, TAPPED};
use crate::scalar::{three_phase, Kernel, Scalar};
use crate::three;

impl<S: Scalar> Kernel for Observation<'_, Structure, Model<S>, State<S>, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { structure, model, inputs, state, t, selection: _, out } = self;
        states(structure, model, state, t, out);
        out[Q::Command as usize] = inputs[COMMAND].at(t) + state.command_noise;
        electrical(structure, model, inputs, state, t, out);
        let x = Instant::at(inputs, t);
        let signals = mechanical(structure, model, &x, state, out);
        energies(model, structure, state, out);
        if structure.shaft.linear {
            screw(structure, model, &x, state, &signals, out);
        } else {
            let [first, second] = state.shaft.bodies.position;
            let [sun, ring, output] = signals.meshes;
            out[HIGH.len()..].copy_from_slice(&[first, second, sun, ring, output]);
        }
    }
}

/// What stands in the state.
#[inline(always)]
fn states<S: Scalar>(structure: &Structure, m: &Model<S>, s: &State<S>, t: S, out: &mut [S]) {
    let mut set = |q: Q, x: S| out[q as usize] = x;
    set(Q::OutputPosition, s.shaft.output_position);
    set(Q::MotorPosition, s.shaft.motor_position);
    set(Q::MotorSpeed, s.shaft.motor_speed);
    set(Q::SpeedRef, s.control.speed_ref);
    set(Q::TorqueRef, s.control.torque_ref);
    set(Q::CurrentRef, s.current_ref);
    set(Q::LegTransitions, if structure.drive == DriveKind::Pwm { m.carrier.edges(&s.window, t) } else { s.transitions });
    set(Q::Tripped, s.bridge.tripped.maximum(s.extra.network.over));
    let warm = &s.extra.network;
    set(Q::WindingTemperature, if structure.heat { warm.winding } else { m.temperature });
    set(Q::WindingTemperatureHottest, if structure.heat { m.extra.network.hottest(warm) } else { m.temperature });
    set(Q::SurfaceTemperature, m.extra.network.housing(structure.heat, warm));
    set(Q::AmbientTemperature, m.extra.network.air());
    let [copper, loops, hottest] = if structure.heat { [warm.power[0], warm.power[1], warm.hottest] } else { copper_heat(structure, m, s) };
    set(Q::HeatPhaseHottest, hottest);
    set(Q::HeatCopper, copper);
    set(Q::HeatLoop, loops);
    set(Q::HeatContact, warm.power[2]);
    set(Q::HeatAir, warm.power[3]);
    set(Q::DriveTemperature, s.extra.drive_heat.temperature);
    set(Q::HeatDrive, s.extra.drive_heat.power);
    set(Q::ThermalWarning, m.extra.network.warns(warm));
    set(Q::Limited, m.control.limited(&s.control));
    let [encoder, resolver, speed, signal] = m.sensing.readings(&structure.sensing, &s.shaft, s.sensed);
    set(Q::EncoderPosition, encoder);
    set(Q::ResolverPosition, resolver);
    set(Q::ResolverSpeed, speed);
    set(Q::ResolverSignal, signal);
}

/// Copper heat of the present currents: of the phases, of shorted turns, of the phase that has most.
#[inline(always)]
fn copper_heat<S: Scalar>(structure: &Structure, m: &Model<S>, s: &State<S>) -> [S; 3] {
    let (shorts, turns, contact) = (&m.extra.shorts, s.star.current, &s.star.contact);
    let (phases, loops) = (shorts.phases(&structure.shorts, turns, contact), shorts.loops(&structure.shorts, turns, contact));
    let (share, factor) = (shorts.looped(), if structure.thermal { s.star.resistance_factor } else { S::one() });
    let of = |share: [S; 3], i: [S; 3]| -> [S; 3] { three!(|j| share[j] * m.star.resistance[j] * factor * i[j].square()) };
    let copper = of(three!(|j| S::one() - share[j]), phases);
    let looped = of(share, loops);
    [copper[0] + copper[1] + copper[2], looped[0] + looped[1] + looped[2], copper[0].maximum(copper[1]).maximum(copper[2])]
}

#[inline(always)]
fn screw<S: Scalar>(structure: &Structure, m: &Model<S>, x: &Instant<S>, s: &State<S>, signals: &ShaftSignals<S>, out: &mut [S]) {
    let [position, speed, torque, efficiency, aiding] = m.shaft.observe_screw(&s.shaft, signals);
    let [friction, spall] = m.shaft.observe_load_side(&structure.shaft, x, &s.shaft, signals);
    out[HIGH.len()..].copy_from_slice(&[
        position,
        speed,
        friction,
        torque,
        spall,
        efficiency,
        aiding,
        s.shaft.nut.temperature,
        s.shaft.nut.power,
        s.shaft.vibration.acceleration,
    ]);
}

#[inline(always)]
fn electrical<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
    let mut set = |q: Q, x: S| out[q as usize] = x;
    let (sin, cos) = m.star.electrical_angle(s.shaft.motor_position).sin_cos();
    let (sines, cosines) = three_phase(sin, cos);
    let supply = link_voltage(m, structure, s, inputs[SUPPLY].at(t) * m.supply_scale);
    set(Q::SupplyVoltage, supply);
    let (turns, contact, shorts) = (s.star.current, &s.star.contact, &m.extra.shorts);
    let phases = shorts.phases(&structure.shorts, turns, contact);
    let loops = shorts.loops(&structure.shorts, turns, contact);
    let (q, d) = park(phases, sines, cosines);
    set(Q::CurrentQ, q);
    set(Q::CurrentD, d);
    set(Q::GroundCurrent, contact[GROUND][0] + contact[GROUND][1] + contact[GROUND][2]);
    let voltage = if structure.bridge || structure.shorted { s.voltage } else { ideal_voltage(structure, m, s, supply, sin, cos) };
    let measured = seen_current(m, structure, s);
    let legs = leg_current(m, structure, s);
    for j in 0..3 {
        out[Q::LegCurrentA as usize + j] = legs[j];
        out[Q::TapCurrentA as usize + j] = contact[TAPPED][j];
        out[Q::CurrentA as usize + j] = phases[j];
        out[Q::PhaseShortCurrentAb as usize + j] = contact[PAIR][j];
        out[Q::VoltageA as usize + j] = voltage[j];
        out[Q::CurrentAMeas as usize + j] = measured[j];
        out[Q::CurrentQMeas as usize + j] = s.filtered[j];
        out[Q::LoopCurrentA as usize + j] = loops[j];
    }
    out[Q::VoltageQRef as usize] = s.current_control.voltage_q;
}

/// Phase-to-neutral voltages of an ideal bridge in its present switching state.
#[inline(always)]
fn ideal_voltage<S: Scalar>(structure: &Structure, m: &Model<S>, s: &State<S>, supply: S, sin: S, cos: S) -> [S; 3] {
    let c = coupling::<S, true>(m, structure, s, sin, cos);
    let terminal = three!(|j| s.legs[j] * S::splat(0.5) * supply);
    let drop: [S; 3] =
        three!(|j| terminal[j] - c.k[j] * s.shaft.motor_speed - m.star.resistance[j] * s.star.resistance_factor * s.star.current[j]);
    let neutral = m.star.neutral(drop);
    three!(|j| terminal[j] - neutral)
}

#[inline(always)]
fn mechanical<S: Scalar>(structure: &Structure, m: &Model<S>, x: &Instant<S>, s: &State<S>, out: &mut [S]) -> ShaftSignals<S> {
    let (sin, cos) = m.star.electrical_angle(s.shaft.motor_position).sin_cos();
    let c = coupling::<S, true>(m, structure, s, sin, cos);
    let torque = motor_torque::<S, true>(m, structure, &c, s.star.current);
    let signals = m.shaft.observe(&structure.shaft, x, &s.shaft, torque);
    let mut set = |q: Q, x: S| out[q as usize] = x;
    set(Q::OutputSpeed, signals.output_speed);
    set(Q::MotorTorque, torque);
    set(Q::UnbalanceTorque, signals.unbalance);
    set(Q::HeatIron, signals.iron);
    set(Q::FrictionTorque, signals.friction);
    set(Q::BrakeTorque, signals.brake);
    set(Q::LoadTorque, signals.load);
    set(Q::StopTorque, signals.stop);
    set(Q::OutputTorque, signals.output_torque);
    set(Q::TransmissionTorque, signals.through);
    shared(HIGH_SPECIFIC, signals.added.signals(), out);
    signals
}

#[inline(always)]
fn energies<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, out: &mut [S]) {
    let (e, w, link) = (&s.energy, &s.shaft.work, &s.extra.link);
    for (q, value) in [
        (Q::EnergySupply, if structure.link { link.given } else { e[E_SUPPLY] }),
        (Q::EnergySource, link.lost),
        (Q::EnergyLink, m.extra.link.stored(link)),
        (Q::EnergyCopper, e[E_COPPER]),
        (Q::EnergyInverter, e[E_INVERTER]),
        (Q::EnergyTap, e[E_TAP]),
        (Q::EnergyContact, e[E_CONTACT]),
        (Q::EnergyFriction, w.friction),
        (Q::EnergyBrake, w.brake),
        (Q::EnergyLoad, w.load),
        (Q::EnergyImpact, w.impact),
        (Q::EnergyIron, w.iron),
        (Q::EnergyKinetic, m.shaft.kinetic(&structure.shaft, &s.shaft)),
    ] {
        out[q as usize] = value;
    }
    let drive = &s.extra.drive_heat;
    out[Q::EnergyHeatStored as usize] = m.extra.network.stored(&s.extra.network) + m.extra.drive_heat.stored(drive);
    out[Q::EnergyAir as usize] = s.extra.network.heat_out + drive.heat_out;
    let half = S::splat(0.5);
    let magnetic = (0..3).fold(S::zero(), |sum, j| sum + half * s.star.current[j] * s.star.current[j] / m.star.per_inductance[j]);
    let magnetic = if structure.mapped {
        let (sin, cos) = m.star.electrical_angle(s.shaft.motor_position).sin_cos();
        m.extra.map.energy(m.extra.map.currents([sin, cos], s.star.current))
    } else {
        magnetic
    };
    out[Q::EnergyMagnetic as usize] = magnetic + m.extra.shorts.magnetic(&structure.shorts, &s.star.contact);
}
