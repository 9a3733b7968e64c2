//! What happens at the ticks of a run: samplings of controllers, noise, heat, debris. It depends on no form of servo, so that
//! all forms share its code.

use super::model::{Model, State, E_INVERTER};
use super::shorted::discrete;
use super::start::{limit, lubricate};
use super::step::{control_step, link_voltage, park, seen_current, shaft_reading};
use crate::actuator::servo::details::{sample_steps, Structure};
use crate::actuator::servo::layout::*;
use crate::actuator::{Event, Inputs, Tick};
use crate::control::current_dq::{CurrentSample, PwmParameter};
use crate::control::position_speed::ControlParameter;
use crate::motor::thermal::ThermalParameter;
use crate::scalar::{three_phase, Kernel, Scalar};
use crate::sensor::current::CurrentSensorParameter;
use crate::sensor::resolver::ResolverParameter;
use crate::three;

const COMMAND_NOISE: u8 = 0;
const CURRENT_NOISE: u8 = 1;
const CONTROL: u8 = 2;
const CURRENT_CONTROL: u8 = 3;
const THERMAL: u8 = 4;
const DEBRIS: u8 = 5;
const DUTIES: u8 = 6;
const RESOLVER_NOISE: u8 = 7;

/// The ticks of a run, in their order within a step.
pub(super) fn all(raw: &[f64], structure: &Structure) -> Vec<Tick> {
    let mut ticks = Vec::new();
    if structure.duty_delay > 0 {
        // Before the next sampling, where both fall on one step.
        let period = sample_steps(raw, PwmParameter::SampleTime.at()).max(1);
        ticks.push(Tick { period, first: structure.duty_delay, kind: DUTIES });
    }
    let mut add = |present: bool, index: usize, kind: u8| {
        if present {
            ticks.push(Tick::every(sample_steps(raw, index).max(1), kind));
        }
    };
    add(raw[ControlParameter::NoiseDeviation.at()] != 0.0, ControlParameter::NoiseSampleTime.at(), COMMAND_NOISE);
    add(raw[CurrentSensorParameter::NoiseDeviation.at()] != 0.0, CurrentSensorParameter::NoiseSampleTime.at(), CURRENT_NOISE);
    add(structure.sensing.noisy, ResolverParameter::NoiseSampleTime.at(), RESOLVER_NOISE);
    add(!structure.control_every_step, ControlParameter::SampleTime.at(), CONTROL);
    add(structure.drive == DriveKind::Pwm, PwmParameter::SampleTime.at(), CURRENT_CONTROL);
    add(structure.heat, ThermalParameter::SampleTime.at(), THERMAL);
    add(structure.shaft.debris, ControlParameter::SampleTime.at(), DEBRIS);
    ticks
}

impl<S: Scalar> Kernel for Event<'_, Structure, Model<S>, State<S>, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { kind, structure, model: m, inputs, state: s, t, noise } = self;
        match kind {
            COMMAND_NOISE => s.command_noise = m.noise_deviation * noise(0),
            CURRENT_NOISE => s.current_noise = three!(|j| noise(1 + j as u64)),
            CONTROL => {
                let reading = shaft_reading::<S, true>(m, structure, s);
                control_step::<S, true>(m, structure, inputs[COMMAND].at(t), s, &reading);
            }
            THERMAL => warm(structure, m, s),
            DEBRIS => s.shaft.scatter(&m.shaft.screw, noise(4)),
            RESOLVER_NOISE => s.sensed.noise = [noise(5), noise(6)],
            DUTIES => update_duties(s),
            _ => control_current(structure, m, inputs, s, t),
        }
    }
}

/// The heat of the last period flows, and warms windings and magnets.
#[inline(always)]
fn warm<S: Scalar>(structure: &Structure, m: &Model<S>, s: &mut State<S>) {
    m.extra.network.tick(&mut s.extra.network, s.shaft.work.iron);
    m.shaft.nut.tick(&mut s.shaft.nut);
    m.extra.drive_heat.tick(&mut s.extra.drive_heat, s.energy[E_INVERTER]);
    (s.star.resistance_factor, s.star.flux_factor) = m.extra.network.factors(&s.extra.network);
    if structure.limits.derates {
        s.extra.derated = m.extra.limits.derated(s.extra.network.winding);
        limit(m, structure, s);
    }
    lubricate(m, structure, s);
    if structure.shorted {
        s.extra.contacts = discrete(m, &s.star);
    }
}

/// The current controller of a carrier drive samples the currents and computes its voltages.
#[inline(always)]
fn control_current<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &mut State<S>, t: S) {
    let reading = shaft_reading::<S, true>(m, structure, s);
    let (angle, speed) =
        if structure.sensing.separate { (s.shaft.motor_position, s.shaft.motor_speed) } else { (reading.angle, reading.speed) };
    let angle = m.star.electrical_angle(angle);
    let (sin, cos) = angle.sin_cos();
    let (sines, cosines) = three_phase(sin, cos);
    let (current_q, current_d) = park(seen_current(m, structure, s), sines, cosines);
    let supply = link_voltage(m, structure, s, inputs[SUPPLY].at(t) * m.supply_scale);
    let limits = &m.extra.limits;
    let reference_d = if structure.limits.direct { limits.reference(s.extra.weakening) } else { S::zero() };
    let sample = CurrentSample { reference_d, reference_q: s.current_ref, current_d, current_q, speed, angle, supply };
    m.current_control.step(&mut s.current_control, &sample);
    if structure.limits.weakens {
        s.extra.weakening = limits.weaken(s.extra.weakening, speed, s.current_control.wanted, supply);
        limit(m, structure, s);
    }
    if structure.duty_delay == 0 {
        update_duties(s);
    }
}

/// The duties computed from the last sample act from now on.
#[inline(always)]
fn update_duties<S: Scalar>(s: &mut State<S>) {
    s.current_control.update();
    s.window.renew();
}
