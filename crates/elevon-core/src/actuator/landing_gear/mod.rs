//! The landing-gear actuator (Pisa): control unit, six-step bridge, star motor with Hall sensors, planetary gearbox with
//! free-fall release, roller screw, down-lock, leg on a lever.

mod body;
mod checks;
mod faults;
mod high;
mod layout;
mod low;
mod mechanics;
mod signals;
mod unit;

use self::body::{Body, Constants, Structure};
use self::layout::{At as _, SolverParameter};
use crate::actuator::{
    Event, EventOf, Finding, Inputs, Machine, Observation, ObservationOf, Port, Setup, StretchOf, Tick, Watch, Wiring, WATCHED,
};
use crate::control::pi_rate::PiRateParameter;
use crate::control::sequence;
use crate::fault::FaultKind;
use crate::kept::{Kept, Store};
use crate::scalar::Scalar;
use crate::time::Steps;
use crate::variable::{Group, Signal};
use std::marker::PhantomData;

/// What both fidelities are.
#[derive(Clone)]
pub struct LandingGear;

impl Machine for LandingGear {
    const GROUPS: &'static [Group] = layout::GROUPS;
    const PORTS: &'static [Port] = layout::PORTS;
    const HELD_PORTS: &'static [usize] = &[layout::AMBIENT];
    const MODES: &'static [&'static str] = &["gear"];
    const MODE_UNITS: &'static [&'static str] = &[""];
    const ACTIONS: &'static [&'static str] = sequence::COMMANDS;

    fn faults() -> Vec<FaultKind> {
        faults::catalogue()
    }
}

/// What distinguishes one fidelity from the other.
pub trait Fidelity: Clone + Send + Sync + 'static {
    type Model<S: Scalar>: Clone + Send + Sync;
    type State<S: Scalar>: Clone + Send + Sync;

    fn signals() -> &'static [Signal];
    fn step(raw: &[f64]) -> f64;
    fn check(raw: &[f64]) -> Vec<Finding>;
    /// `plain` is memory for the parameters as plain numbers.
    fn derive<S: Scalar>(raw: &[S], structure: &Structure, plain: Vec<Vec<f64>>) -> Self::Model<S>;
    fn constants<S: Scalar>(model: &Self::Model<S>) -> &Constants<S>;
    /// Takes that memory back.
    fn plain<S: Scalar>(model: &mut Self::Model<S>) -> Vec<Vec<f64>>;
    fn body<S: Scalar>(state: &Self::State<S>) -> &Body<S>;
    fn body_mut<S: Scalar>(state: &mut Self::State<S>) -> &mut Body<S>;
    fn start<S: Scalar>(body: Body<S>) -> Self::State<S>;
    /// Step `k`.
    fn advance<S: Scalar>(model: &Self::Model<S>, structure: &Structure, inputs: &Inputs<S>, state: &mut Self::State<S>, k: Steps);
    /// Positive where the drive has tripped.
    fn tripped<S: Scalar>(state: &Self::State<S>) -> S;
    /// Of the motor, as it is watched.
    fn current<S: Scalar>(state: &Self::State<S>) -> S;
    fn observe<S: Scalar>(observation: Observation<'_, Structure, Self::Model<S>, Self::State<S>, S>);
}

/// The landing-gear actuator in one fidelity.
#[derive(Clone)]
pub struct Gear<X>(PhantomData<X>);

pub type High = Gear<high::High>;
pub type Low = Gear<low::Low>;

impl<X: Fidelity> Wiring for Gear<X>
where
    X::State<f64>: Kept,
{
    type Structure = Structure;
    type Model<S: Scalar> = X::Model<S>;
    type State<S: Scalar> = X::State<S>;

    type Machine = LandingGear;
    const INITIAL: &'static [&'static str] = &["nut_position", "motor_speed"];

    fn signals() -> &'static [Signal] {
        X::signals()
    }
    fn step(raw: &[f64]) -> f64 {
        X::step(raw)
    }
    fn fault_grid(raw: &[f64]) -> f64 {
        raw[SolverParameter::FaultGrid.at()].max(X::step(raw))
    }
    fn structure(setup: &Setup) -> Structure {
        Structure::read(setup)
    }
    fn ticks(raw: &[f64], _structure: &Structure) -> Vec<Tick> {
        let period = raw[PiRateParameter::Period.at()];
        vec![Tick::every(((period / X::step(raw)).round() as Steps).max(1), 0)]
    }
    fn check(raw: &[f64]) -> Vec<Finding> {
        X::check(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure) -> Self::Model<S> {
        X::derive(raw, structure, Vec::new())
    }
    fn derive_anew<S: Scalar>(model: &mut Self::Model<S>, raw: &[S], structure: &Structure) {
        let plain = X::plain(model);
        *model = X::derive(raw, structure, plain);
    }
    fn keep(state: &mut Self::State<f64>, store: &mut Store) {
        state.keep(store);
    }
    fn start<S: Scalar>(model: &Self::Model<S>, raw: &[S], initial: &[S]) -> Self::State<S> {
        X::start(X::constants(model).start(raw, initial))
    }

    fn tick<S: Scalar>(event: EventOf<'_, Self, S>) {
        let Event { structure, model, inputs, state, t, noise, .. } = event;
        let tripped = X::tripped(state);
        X::constants(model).tick(structure, X::body_mut(state), inputs, t, tripped, noise);
    }
    #[inline(always)]
    fn advance<S: Scalar>(x: StretchOf<'_, Self, S>) {
        for k in x.from..x.from + x.count {
            for ((model, inputs), state) in x.models.iter().zip(x.inputs).zip(x.states.iter_mut()) {
                X::advance(model, x.structure, inputs, state, k);
            }
        }
    }
    fn observe<S: Scalar>(observation: ObservationOf<'_, Self, S>) {
        X::observe(observation);
    }

    fn watch<S: Scalar>(state: &Self::State<S>) -> [Watch<S>; WATCHED] {
        let body = X::body(state);
        [
            Watch { name: "motor_speed", value: body.motion.motor_speed.abs().maximum(body.motion.fastest), limit: 1e6 },
            Watch { name: "current_line", value: X::current(state), limit: 1e6 },
            Watch { name: "supply_voltage", value: body.link, limit: 1e5 },
            // Share of the lock's strength in use.
            Watch { name: "lock_force", value: body.lock_use, limit: 1.0 },
        ]
    }
    fn tripped<S: Scalar>(state: &Self::State<S>) -> S {
        X::body(state).tripped()
    }
    fn trip_reason<S: Scalar>(model: &Self::Model<S>, state: &Self::State<S>, lane: usize) -> Option<String> {
        X::constants(model).trip_reason(X::body(state), lane)
    }
}
