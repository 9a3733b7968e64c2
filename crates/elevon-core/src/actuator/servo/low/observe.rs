//! All signals of the reduced-order model from its state. Nothing here feeds back.

use super::model::{Model, State};
use super::structure::Structure;
use crate::actuator::servo::advance::Instant;
use crate::actuator::servo::layout::COMMAND;
use crate::actuator::servo::signals::{shared, LowSignal as Q, LOW, LOW_SPECIFIC};
use crate::actuator::{Observation, Signals};
use crate::scalar::{three_phase, Kernel, Scalar};
use crate::three;

/// What the loads on the shaft decide; what stands behind the own signals is theirs, too.
const OF_SHAFT: Signals = Signals::of(&[
    Q::OutputSpeed as usize,
    Q::FrictionTorque as usize,
    Q::LoadTorque as usize,
    Q::StopTorque as usize,
    Q::HeatIron as usize,
])
.and_from(LOW_SPECIFIC.len());
/// Heat of the present currents takes a sine.
const OF_COPPER: Signals = Signals::of(&[Q::HeatCopper as usize, Q::HeatPhaseHottest as usize]);
const OF_INPUTS: Signals = Signals::of(&[Q::BrakeTorque as usize, Q::SupplyVoltage as usize]);
const SENSORS: [Q; 4] = [Q::EncoderPosition, Q::ResolverPosition, Q::ResolverSpeed, Q::ResolverSignal];
const OF_SENSORS: Signals = Signals::of(&[SENSORS[0] as usize, SENSORS[1] as usize, SENSORS[2] as usize, SENSORS[3] as usize]);

impl<S: Scalar> Kernel for Observation<'_, Structure, Model<S>, State<S>, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { structure, model, inputs, state, t, selection, out } = self;
        states(structure, model, state, out);
        if selection.any(OF_COPPER) && !structure.heat {
            [out[Q::HeatCopper as usize], out[Q::HeatPhaseHottest as usize]] = copper_heat(structure, model, state);
        }
        if selection.any(Signals::of(&[Q::Command as usize])) {
            out[Q::Command as usize] = inputs[COMMAND].at(t) + state.command_noise;
        }
        if selection.any(OF_SENSORS) {
            let signals = model.sensing.readings(&structure.sensing, &state.shaft, state.sensed);
            for (q, value) in SENSORS.into_iter().zip(signals) {
                out[q as usize] = value;
            }
        }
        if selection.any(OF_INPUTS) || selection.any(OF_SHAFT) {
            loaded(structure, model, &Instant::at(inputs, t), state, out);
        }
    }
}

/// What stands in the state.
#[inline(always)]
fn states<S: Scalar>(structure: &Structure, m: &Model<S>, s: &State<S>, out: &mut [S]) {
    let limited = m.control.speed_limit.le(s.speed_ref.abs()) | s.torque_limit.le(s.torque_ref.abs());
    for (q, value) in [
        (Q::OutputPosition, s.shaft.output_position),
        (Q::MotorPosition, s.shaft.motor_position),
        (Q::MotorSpeed, s.shaft.motor_speed),
        (Q::SpeedRef, s.speed_ref),
        (Q::TorqueRef, s.torque_ref),
        (Q::CurrentRef, s.torque_ref * m.control.per_torque_constant),
        (Q::CurrentQ, s.current_q),
        (Q::CurrentQMeas, s.filtered[0]),
        (Q::VoltageQRef, s.voltage),
        (Q::VoltageQMeas, s.filtered[1]),
        (Q::MotorTorque, s.motor_torque),
        (Q::WindingTemperature, if structure.heat { s.network.winding } else { m.temperature }),
        (Q::WindingTemperatureHottest, if structure.heat { m.network.hottest(&s.network) } else { m.temperature }),
        (Q::SurfaceTemperature, m.network.housing(structure.heat, &s.network)),
        (Q::AmbientTemperature, m.network.air()),
        (Q::HeatPhaseHottest, s.network.hottest),
        (Q::HeatCopper, s.network.power[0]),
        (Q::HeatAir, s.network.power[3]),
        (Q::ThermalWarning, m.network.warns(&s.network)),
        (Q::Limited, S::indicator(limited)),
        (Q::Tripped, s.tripped.maximum(s.network.over)),
        (Q::EnergySupply, if structure.link { s.link.given } else { s.drawn }),
        (Q::EnergySource, s.link.lost),
        (Q::EnergyLink, m.drive.link.stored(&s.link)),
        (Q::EnergyCopper, s.copper),
        (Q::EnergyHeatStored, m.network.stored(&s.network)),
        (Q::EnergyAir, s.network.heat_out),
        (Q::EnergyIron, s.shaft.work.iron),
    ] {
        out[q as usize] = value;
    }
}

/// Copper heat of the present currents, of all phases and of the one that has most.
#[inline(always)]
fn copper_heat<S: Scalar>(structure: &Structure, m: &Model<S>, s: &State<S>) -> [S; 2] {
    let phases = if structure.angle {
        s.phases
    } else {
        let (sin, cos) = m.star.electrical_angle(s.shaft.motor_position).sin_cos();
        let shape = three_phase(sin, cos).0;
        three!(|j| shape[j] * s.current)
    };
    let loss: [S; 3] = three!(|j| m.resistance[j] * s.resistance_factor * phases[j].square());
    [loss[0] + loss[1] + loss[2], loss[0].maximum(loss[1]).maximum(loss[2])]
}

/// What inputs and loads decide.
#[inline(always)]
fn loaded<S: Scalar>(structure: &Structure, m: &Model<S>, x: &Instant<S>, s: &State<S>, out: &mut [S]) {
    let signals = m.shaft.observe(&structure.shaft, x, &s.shaft, s.motor_torque);
    let source = x.supply * m.drive.supply_scale;
    for (q, value) in [
        (Q::OutputSpeed, signals.output_speed),
        (Q::FrictionTorque, signals.friction),
        (Q::BrakeTorque, x.brake),
        (Q::LoadTorque, signals.load),
        (Q::StopTorque, signals.stop),
        (Q::HeatIron, signals.iron),
        (Q::SupplyVoltage, if structure.link { m.drive.link.voltage(&s.link, source) } else { source }),
    ] {
        out[q as usize] = value;
    }
    shared(LOW_SPECIFIC, signals.added.signals(), out);
    if structure.shaft.linear {
        let [position, speed, torque, efficiency, aiding] = m.shaft.observe_screw(&s.shaft, &signals);
        // Current and voltage of the printed L-R circuit.
        let root = S::splat(1.5_f64.sqrt());
        let nut = &s.shaft.nut;
        let circuit = [root * s.current, root * s.voltage];
        out[LOW.len()..].copy_from_slice(&[
            position,
            speed,
            torque,
            efficiency,
            aiding,
            circuit[0],
            circuit[1],
            nut.temperature,
            nut.power,
        ]);
    }
}
