//! Switching model: three phases, switching inverter, fixed step (reference sheet 1.2 to 1.7).

mod carrier;
mod crossing;
mod electric;
mod located;
pub(crate) mod model;
pub(crate) mod observe;
mod shorted;
mod start;
mod step;
mod tick;

use self::carrier::CarrierStep;
use self::located::LocatedStep;
use self::model::{Model, State};
use self::observe::Observation;
use self::step::HighStep;
use crate::actuator::servo::advance::Stretch;
use crate::actuator::servo::details::{Needs, Structure};
use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::actuator::{Finding, Inputs, Overheat, Setup, Signals, Tick, Watch, Wiring, WATCHED};
use crate::kept::{Kept, Store};
use crate::scalar::{apart, Scalar};
use crate::time::Steps;
use crate::variable::Signal;
use std::marker::PhantomData;

/// The switching model of a servo.
#[derive(Clone)]
pub struct High<F>(PhantomData<F>);

impl<F: Form> Wiring for High<F> {
    type Structure = Structure;
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    type Machine = F;
    const INITIAL: &'static [&'static str] = start::INITIAL;

    fn signals() -> &'static [Signal] {
        F::HIGH
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
        tick::all(raw, structure)
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
    fn join<S: Scalar>(model: &Model<S>, before: &Structure, after: &Structure, state: &mut State<S>) {
        model.sensing.join(&before.sensing, &after.sensing, &state.shaft, &mut state.sensed);
        if after.measured_current && !before.measured_current {
            (state.current_reading, state.extra.sensed) = (state.star.current, state.star.current);
        }
    }
    fn keep(state: &mut State<f64>, store: &mut Store) {
        state.keep(store);
    }
    fn refuses_start(raw: &[f64], initial: &[f64]) -> Option<String> {
        crate::actuator::servo::shaft::refuses_start::<F>(raw, [initial[0], initial[2]], true)
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
        model: &Model<S>,
        inputs: &Inputs<S>,
        state: &mut State<S>,
        t: S,
        noise: &mut dyn FnMut(u64) -> S,
    ) {
        apart::<S, _>(tick::Event { kind, structure, model, inputs, state, t, noise });
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
        let (full, extra) = (structure.full || !S::FORMS, structure.extra || !S::FORMS);
        if structure.drive == DriveKind::Pwm {
            return if full { x.run::<CarrierStep<true>>() } else { x.run::<CarrierStep<false>>() };
        }
        if structure.located {
            return if full { x.run::<LocatedStep<true>>() } else { x.run::<LocatedStep<false>>() };
        }
        match (full, extra) {
            (false, _) => x.run::<HighStep<false, false>>(),
            (true, false) => x.run::<HighStep<true, false>>(),
            (true, true) => x.run::<HighStep<true, true>>(),
        }
    }

    fn observe<S: Scalar>(
        structure: &Structure,
        model: &Model<S>,
        inputs: &Inputs<S>,
        state: &State<S>,
        t: S,
        _selection: Signals,
        out: &mut [S],
    ) {
        // A row costs what a step does, and there are hundreds of steps to a row.
        apart::<S, _>(Observation { structure, model, inputs, state, t, linear: F::LINEAR, out });
    }

    #[inline(always)]
    fn watch<S: Scalar>(s: &State<S>) -> [Watch<S>; WATCHED] {
        let currents = s.star.current[0].abs()
            + s.star.current[1].abs()
            + s.star.current[2].abs()
            + s.star.contact.iter().flatten().fold(S::zero(), |sum, c| sum + c.abs());
        [
            Watch { name: "motor_speed", value: s.shaft.motor_speed.abs().maximum(s.shaft.fastest), limit: 1e6 },
            Watch { name: "current_a", value: currents, limit: 1e7 },
            Watch { name: "output_position", value: s.shaft.output_position, limit: 1e9 },
            Watch { name: "torque_ref", value: s.control.integral + s.control.filtered_error, limit: 1e12 },
        ]
    }

    #[inline(always)]
    fn tripped<S: Scalar>(s: &State<S>) -> S {
        s.bridge.tripped.maximum(s.extra.network.over)
    }
    fn trip_reason<S: Scalar>(m: &Model<S>, s: &State<S>, lane: usize) -> Option<String> {
        m.extra.link.trip_reason(&s.extra.link, lane)
    }
    fn overheated<S: Scalar>(s: &State<S>) -> Option<Overheat<S>> {
        let network = &s.extra.network;
        Some(Overheat { over: network.over, temperature: network.winding })
    }
}
