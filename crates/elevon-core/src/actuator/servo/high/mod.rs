//! Switching model: three phases, switching inverter, fixed step (reference sheet 1.2 to 1.7).

mod carrier;
mod crossing;
mod electric;
mod located;
mod mapped;
mod model;
mod observe;
mod shorted;
mod start;
mod step;
mod tick;

use self::carrier::ByCarrier;
use self::located::ByLocatedRelays;
use self::model::{Model, State};
use self::step::ByRelays;
use crate::actuator::servo::advance::{march, Instant, Stepper};
use crate::actuator::servo::details::{Needs, Structure};
use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::actuator::{EventOf, Finding, ObservationOf, Overheat, Setup, StretchOf, Tick, Watch, Wiring, WATCHED};
use crate::kept::{Kept, Store};
use crate::scalar::{apart, Scalar};
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

    fn tick<S: Scalar>(event: EventOf<'_, Self, S>) {
        apart::<S, _>(event);
    }

    #[inline(always)]
    fn advance<S: Scalar>(x: StretchOf<'_, Self, S>) {
        let (full, extra) = (x.structure.full || !S::FORMS, x.structure.extra || !S::FORMS);
        if x.structure.drive == DriveKind::Pwm {
            return if full { march::<HighStep<ByCarrier<true>>, S>(x) } else { march::<HighStep<ByCarrier<false>>, S>(x) };
        }
        if x.structure.located {
            return if full { march::<HighStep<ByLocatedRelays<true>>, S>(x) } else { march::<HighStep<ByLocatedRelays<false>>, S>(x) };
        }
        match (full, extra) {
            (false, _) => march::<HighStep<ByRelays<false, false>>, S>(x),
            (true, false) => march::<HighStep<ByRelays<true, false>>, S>(x),
            (true, true) => march::<HighStep<ByRelays<true, true>>, S>(x),
        }
    }

    /// A row costs what a step does, and there are hundreds of steps to a row: all signals, whatever the selection.
    fn observe<S: Scalar>(observation: ObservationOf<'_, Self, S>) {
        apart::<S, _>(observation);
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

/// One step of the switching model behind one kind of drive, with every detail or with none.
pub(super) trait Behind {
    /// The state leaves no registers for a detailed step.
    const FULL: bool;
    fn step<S: Scalar>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>);
}

/// That step as the inner loop calls it.
struct HighStep<D>(PhantomData<D>);

impl<S: Scalar, D: Behind> Stepper<S> for HighStep<D> {
    type Model = Model<S>;
    type Structure = Structure;
    type State = State<S>;
    const IN_REGISTERS: bool = !D::FULL;

    #[inline(always)]
    fn commanded(structure: &Structure) -> bool {
        structure.control_every_step
    }
    #[inline(always)]
    fn dt(model: &Model<S>) -> S {
        model.dt
    }
    #[inline(always)]
    fn step(model: &Model<S>, structure: &Structure, instant: &Instant<S>, state: &mut State<S>) {
        D::step(model, structure, instant, state);
    }
}
