//! Reduced-order model: one equivalent phase (reference sheet 1.9). Same blocks, same parameters where shared; PID
//! without anti-windup and derivative filter; the shaft and its loads are those of the switching model.

mod control;
mod driven;
mod jump;
mod loops;
mod model;
mod observe;
mod passive;
mod phase;
mod relays;
mod step;
mod structure;
mod windings;

use self::model::{Model, State};
use self::step::LowStep;
use self::structure::Structure;
use super::advance::march;
use super::form::Form;
use super::layout::*;
use crate::actuator::{Event, EventOf, Finding, ObservationOf, Overheat, Setup, StretchOf, Tick, Watch, Wiring, WATCHED};
use crate::control::position_speed::ControlParameter;
use crate::kept::{Kept, Store};
use crate::motor::equivalent::LowParameter;
use crate::motor::thermal::ThermalParameter;
use crate::scalar::{apart, Scalar};
use crate::sensor::resolver::ResolverParameter;
use crate::time::Steps;
use crate::variable::Signal;
use std::marker::PhantomData;

/// The reduced-order model of a servo.
#[derive(Clone)]
pub struct Low<F>(PhantomData<F>);

const TICK_THERMAL: u8 = 0;
const TICK_DEBRIS: u8 = 1;
const TICK_COMMAND_NOISE: u8 = 2;

impl<F: Form> Wiring for Low<F> {
    type Structure = Structure;
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    type Machine = F;
    const INITIAL: &'static [&'static str] =
        &["motor_position", "motor_speed", "output_position", "winding_temperature", "surface_temperature"];

    fn signals() -> &'static [Signal] {
        F::LOW
    }
    fn step(raw: &[f64]) -> f64 {
        raw[LowParameter::Step.at()]
    }
    fn fault_grid(raw: &[f64]) -> f64 {
        raw[SolverParameter::FaultGrid.at()].max(raw[LowParameter::Step.at()])
    }

    /// An open winding of the resolver is none of its details: its angle changes within a step.
    fn structure(setup: &Setup) -> Structure {
        let (mut raw, mut touched) = (setup.raw.to_vec(), setup.touched.to_vec());
        for winding in [ResolverParameter::SineOpen, ResolverParameter::CosineOpen] {
            raw[winding.at()] = 0.0;
            touched[winding.at()] = false;
        }
        Structure::read::<F>(Parts(&Setup { raw: &raw, touched: &touched, ..*setup }))
    }

    fn ticks(raw: &[f64], structure: &Structure) -> Vec<Tick> {
        let period = |seconds: f64| ((seconds / raw[LowParameter::Step.at()]).round() as Steps).max(1);
        let mut ticks = Vec::new();
        if structure.heat {
            ticks.push(Tick::every(period(raw[ThermalParameter::SampleTime.at()]), TICK_THERMAL));
        }
        if structure.shaft.debris {
            ticks.push(Tick::every(period(raw[ControlParameter::SampleTime.at()]), TICK_DEBRIS));
        }
        if structure.noisy_command {
            ticks.push(Tick::every(period(raw[ControlParameter::NoiseSampleTime.at()]), TICK_COMMAND_NOISE));
        }
        ticks
    }
    fn check(raw: &[f64]) -> Vec<Finding> {
        super::checks::low::<F>(raw)
    }

    fn check_faulted(raw: &[f64]) -> Vec<Finding> {
        super::checks::faulted_low::<F>(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure) -> Model<S> {
        Model::derive::<F>(raw, structure)
    }
    fn keep(state: &mut State<f64>, store: &mut Store) {
        state.keep(store);
    }
    fn refuses_start(raw: &[f64], initial: &[f64]) -> Option<String> {
        crate::actuator::servo::shaft::refuses_start::<F>(raw, [initial[0], initial[2]], false)
    }
    fn start<S: Scalar>(model: &Model<S>, raw: &[S], initial: &[S]) -> State<S> {
        model.start(raw, initial)
    }
    fn refresh<S: Scalar>(model: &Model<S>, structure: &Structure, raw: &[S], state: &mut State<S>) {
        state.refresh(raw);
        model.limit(structure, state);
        model.lubricate(structure, state);
    }

    fn join<S: Scalar>(m: &Model<S>, before: &Structure, after: &Structure, state: &mut State<S>) {
        m.sensing.join(&before.sensing, &after.sensing, &state.shaft, &mut state.sensed);
    }

    fn tick<S: Scalar>(event: EventOf<'_, Self, S>) {
        let Event { kind, structure, model: m, state: s, noise, .. } = event;
        match kind {
            TICK_THERMAL => {
                m.network.tick(&mut s.network, s.shaft.work.iron);
                m.shaft.nut.tick(&mut s.shaft.nut);
                (s.resistance_factor, s.flux_factor) = m.network.factors(&s.network);
                if structure.limits.derates {
                    s.derated = m.limits.derated(s.network.winding);
                    m.limit(structure, s);
                }
                m.lubricate(structure, s);
            }
            TICK_COMMAND_NOISE => s.command_noise = m.control.noise_deviation * noise(0),
            _ => s.shaft.scatter(&m.shaft.screw, noise(4)),
        }
    }

    #[inline(always)]
    fn advance<S: Scalar>(x: StretchOf<'_, Self, S>) {
        if !S::FORMS {
            return march::<LowStep<true, true>, S>(x);
        }
        match (x.structure.full, x.structure.extra) {
            (false, _) => march::<LowStep<false, false>, S>(x),
            (true, false) => march::<LowStep<true, false>, S>(x),
            (true, true) => march::<LowStep<true, true>, S>(x),
        }
    }

    fn observe<S: Scalar>(observation: ObservationOf<'_, Self, S>) {
        apart::<S, _>(observation);
    }

    #[inline(always)]
    fn watch<S: Scalar>(s: &State<S>) -> [Watch<S>; WATCHED] {
        [
            Watch { name: "motor_speed", value: s.shaft.motor_speed.abs().maximum(s.shaft.fastest), limit: 1e6 },
            Watch { name: "current_q", value: s.current, limit: 1e7 },
            Watch { name: "output_position", value: s.shaft.output_position, limit: 1e9 },
            Watch { name: "torque_ref", value: s.integral, limit: 1e12 },
        ]
    }
    #[inline(always)]
    fn tripped<S: Scalar>(s: &State<S>) -> S {
        s.tripped.maximum(s.network.over)
    }
    fn trip_reason<S: Scalar>(m: &Model<S>, s: &State<S>, lane: usize) -> Option<String> {
        m.drive.link.trip_reason(&s.link, lane)
    }
    fn overheated<S: Scalar>(s: &State<S>) -> Option<Overheat<S>> {
        Some(Overheat { over: s.network.over, temperature: s.network.winding })
    }
}
