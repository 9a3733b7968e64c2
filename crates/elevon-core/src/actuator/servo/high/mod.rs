//! High fidelity: three phases, switching inverter, fixed step (reference sheet 1.2 to 1.7).

mod crossing;
mod electric;
pub(crate) mod model;
pub(crate) mod observe;
mod shorted;
mod start;
mod step;

use self::model::{Model, State, E_INVERTER};
use self::shorted::discrete;
use self::step::{control_step, link_voltage, park, seen_current, shaft_reading, HighStep};
use crate::actuator::servo::advance::Stretch;
use crate::actuator::servo::details::{sample_steps, Needs, Structure};
use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::actuator::{Finding, Inputs, Overheat, Port, Setup, Signals, Tick, Watch, Wiring, WATCHED};
use crate::control::current_dq::{CurrentSample, PwmParameter};
use crate::control::position_speed::ControlParameter;
use crate::fault::FaultKind;
use crate::motor::thermal::ThermalParameter;
use crate::scalar::{three_phase, Scalar};
use crate::sensor::current::CurrentSensorParameter;
use crate::sensor::resolver::ResolverParameter;
use crate::three;
use crate::time::Steps;
use crate::variable::{Group, Signal};
use std::marker::PhantomData;

/// A servo at high fidelity.
pub struct High<F>(PhantomData<F>);

const TICK_COMMAND_NOISE: u8 = 0;
const TICK_CURRENT_NOISE: u8 = 1;
const TICK_CONTROL: u8 = 2;
const TICK_CURRENT_CONTROL: u8 = 3;
const TICK_THERMAL: u8 = 4;
const TICK_DEBRIS: u8 = 5;
const TICK_DUTIES: u8 = 6;
const TICK_RESOLVER_NOISE: u8 = 7;

impl<F: Form> Wiring for High<F> {
    type Structure = Structure;
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    const PORTS: &'static [Port] = F::PORTS;
    const INITIAL: &'static [&'static str] = start::INITIAL;

    fn groups() -> &'static [Group] {
        F::GROUPS
    }
    fn signals() -> &'static [Signal] {
        F::HIGH
    }
    fn faults() -> Vec<FaultKind> {
        F::faults()
    }
    fn step(raw: &[f64]) -> f64 {
        raw[SolverParameter::Step.at()]
    }
    fn fault_grid(raw: &[f64]) -> f64 {
        raw[SolverParameter::FaultGrid.at()]
    }
    fn structure(setup: &Setup) -> Structure {
        Structure::read::<F>(&Needs::new(setup))
    }

    fn ticks(raw: &[f64], structure: &Structure) -> Vec<Tick> {
        let mut ticks = Vec::new();
        if structure.duty_delay > 0 {
            // Before the next sampling, where both fall on one step.
            let period = sample_steps(raw, PwmParameter::SampleTime.at()).max(1);
            ticks.push(Tick { period, first: structure.duty_delay, kind: TICK_DUTIES });
        }
        let mut add = |present: bool, index: usize, kind: u8| {
            if present {
                ticks.push(Tick::every(sample_steps(raw, index).max(1), kind));
            }
        };
        add(raw[ControlParameter::NoiseDeviation.at()] != 0.0, ControlParameter::NoiseSampleTime.at(), TICK_COMMAND_NOISE);
        add(raw[CurrentSensorParameter::NoiseDeviation.at()] != 0.0, CurrentSensorParameter::NoiseSampleTime.at(), TICK_CURRENT_NOISE);
        add(structure.sensing.noisy, ResolverParameter::NoiseSampleTime.at(), TICK_RESOLVER_NOISE);
        add(!structure.control_every_step, ControlParameter::SampleTime.at(), TICK_CONTROL);
        add(structure.drive == DriveKind::Pwm, PwmParameter::SampleTime.at(), TICK_CURRENT_CONTROL);
        add(structure.heat, ThermalParameter::SampleTime.at(), TICK_THERMAL);
        add(structure.shaft.debris, ControlParameter::SampleTime.at(), TICK_DEBRIS);
        ticks
    }

    fn check(raw: &[f64]) -> Vec<Finding> {
        crate::actuator::servo::checks::high::<F>(raw)
    }

    fn check_faulted(raw: &[f64]) -> Vec<Finding> {
        crate::actuator::servo::checks::faulted_high::<F>(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure) -> Model<S> {
        Model::derive::<F>(raw, structure)
    }
    fn start<S: Scalar>(model: &Model<S>, raw: &[S], initial: &[S]) -> State<S> {
        start::start(model, raw, initial)
    }
    fn refresh<S: Scalar>(model: &Model<S>, structure: &Structure, raw: &[S], state: &mut State<S>) {
        start::refresh(model, structure, raw, state);
    }

    fn tick<S: Scalar>(
        kind: u8,
        structure: &Structure,
        m: &Model<S>,
        inputs: &Inputs<S>,
        s: &mut State<S>,
        t: S,
        noise: &mut dyn FnMut(u64) -> S,
    ) {
        match kind {
            TICK_COMMAND_NOISE => s.command_noise = m.noise_deviation * noise(0),
            TICK_CURRENT_NOISE => s.current_noise = three!(|j| noise(1 + j as u64)),
            TICK_CONTROL => {
                let reading = shaft_reading::<S, true>(m, structure, s);
                control_step::<S, true>(m, structure, inputs[COMMAND].at(t), s, &reading);
            }
            TICK_THERMAL => {
                m.extra.network.tick(&mut s.extra.network);
                m.shaft.nut.tick(&mut s.shaft.nut);
                m.extra.drive_heat.tick(&mut s.extra.drive_heat, s.energy[E_INVERTER]);
                (s.star.resistance_factor, s.star.flux_factor) = m.extra.network.factors(&s.extra.network);
                if structure.shorted {
                    s.extra.contacts = discrete(m, &s.star);
                }
            }
            TICK_DEBRIS => s.shaft.scatter(&m.shaft.screw, noise(4)),
            TICK_RESOLVER_NOISE => s.sensed.noise = [noise(5), noise(6)],
            TICK_DUTIES => s.current_control.update(),
            _ => {
                let reading = shaft_reading::<S, true>(m, structure, s);
                let (angle, speed) =
                    if structure.sensing.separate { (s.shaft.motor_position, s.shaft.motor_speed) } else { (reading.angle, reading.speed) };
                let angle = m.star.electrical_angle(angle);
                let (sin, cos) = angle.sin_cos();
                let (sines, cosines) = three_phase(sin, cos);
                let (current_q, current_d) = park(seen_current(m, structure, s), sines, cosines);
                let supply = link_voltage(m, structure, s, inputs[SUPPLY].at(t) * m.supply_scale);
                let sample =
                    CurrentSample { reference_d: S::zero(), reference_q: s.current_ref, current_d, current_q, speed, angle, supply };
                m.current_control.step(&mut s.current_control, &sample);
                if structure.duty_delay == 0 {
                    s.current_control.update();
                }
            }
        }
    }

    #[inline(always)]
    fn advance<S: Scalar>(
        structure: &Structure,
        models: &[Model<S>],
        inputs: &[Inputs<S>],
        states: &mut [State<S>],
        from: Steps,
        count: Steps,
    ) {
        let x = Stretch { structure, models, inputs, states, from, count };
        match (structure.full, structure.extra, structure.drive == DriveKind::Pwm) {
            (false, _, false) => x.run::<HighStep<false, false, false>>(),
            (false, _, true) => x.run::<HighStep<false, false, true>>(),
            (true, false, _) => x.run::<HighStep<true, false, false>>(),
            (true, true, _) => x.run::<HighStep<true, true, false>>(),
        }
    }

    #[inline(always)]
    fn observe<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, state: &State<S>, t: S, _asked: Signals, out: &mut [S]) {
        // A row costs what a step does, and there are hundreds of steps to a row.
        observe::high::<F, S>(structure, m, inputs, state, t, out);
    }

    #[inline(always)]
    fn watch<S: Scalar>(s: &State<S>) -> [Watch<S>; WATCHED] {
        let currents = s.star.current[0].abs()
            + s.star.current[1].abs()
            + s.star.current[2].abs()
            + s.star.contact.iter().flatten().fold(S::zero(), |sum, c| sum + c.abs());
        [
            Watch { name: "motor_speed", value: s.shaft.motor_speed, limit: 1e6 },
            Watch { name: "current_a", value: currents, limit: 1e7 },
            Watch { name: "user_position", value: s.shaft.user_position, limit: 1e9 },
            Watch { name: "torque_ref", value: s.control.integral + s.control.filtered_error, limit: 1e12 },
        ]
    }

    #[inline(always)]
    fn tripped<S: Scalar>(s: &State<S>) -> S {
        s.bridge.tripped.maximum(s.extra.network.over)
    }
    fn overheated<S: Scalar>(s: &State<S>) -> Option<Overheat<S>> {
        let network = &s.extra.network;
        Some(Overheat { over: network.over, temperature: network.winding })
    }
}
