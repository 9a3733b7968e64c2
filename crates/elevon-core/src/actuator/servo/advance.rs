//! The inner loop of the servos: inputs some steps ahead, chunks of lanes side by side.

use super::layout::{BRAKE, COMMAND, OUTPUT, SHAFT, SUPPLY};
use crate::actuator::{Inputs, MAX_CHUNKS};
use crate::scalar::{Kernel, Scalar};
use crate::time::Steps;

/// Steps whose inputs are evaluated together.
const AHEAD: usize = 8;

/// The inputs at one instant.
#[derive(Clone, Copy)]
pub(super) struct Instant<S> {
    pub t: S,
    pub command: S,
    /// A brake cannot push: negative values count as zero.
    pub brake: S,
    pub shaft: S,
    pub output: S,
    pub supply: S,
}

impl<S: Scalar> Instant<S> {
    #[inline(always)]
    pub(super) fn at(inputs: &Inputs<S>, t: S) -> Self {
        let mut instant = Self { t, command: inputs[COMMAND].at(t), ..Self::none() };
        instant.load(inputs, t);
        instant
    }

    /// All but the command, which is evaluated ahead.
    #[inline(always)]
    fn load(&mut self, inputs: &Inputs<S>, t: S) {
        self.brake = inputs[BRAKE].at(t).maximum(S::zero());
        self.shaft = inputs[SHAFT].at(t);
        self.output = inputs[OUTPUT].at(t);
        self.supply = inputs[SUPPLY].at(t);
    }

    /// The instant of the next step: `steady` inputs but the command keep their values.
    #[inline(always)]
    fn move_to(&mut self, inputs: &Inputs<S>, steady: bool, t: S, command: S) {
        if !steady {
            self.load(inputs, t);
        }
        self.t = t;
        self.command = command;
    }

    #[inline(always)]
    fn none() -> Self {
        let zero = S::zero();
        Self { t: zero, command: zero, brake: zero, shaft: zero, output: zero, supply: zero }
    }
}

/// One step of a wiring, as the inner loop calls it.
pub(super) trait Stepper<S> {
    type Model;
    type Structure;
    type State: Copy;
    /// The state of one chunk may stay in registers over some steps: worth a copy of the step's code where that is short.
    const IN_REGISTERS: bool;
    fn dt(model: &Self::Model) -> S;
    fn step(model: &Self::Model, structure: &Self::Structure, instant: &Instant<S>, state: &mut Self::State);
}

/// A stretch of steps of a block. It depends on no form of servo, so that all forms share its code.
pub(super) struct Stretch<'a, M, Q, Z, S> {
    pub structure: &'a Q,
    pub models: &'a [M],
    pub inputs: &'a [Inputs<S>],
    pub states: &'a mut [Z],
    pub from: Steps,
    pub count: Steps,
}

impl<M, Q, Z: Copy, S: Scalar> Stretch<'_, M, Q, Z, S> {
    pub fn run<T: Stepper<S, Model = M, Structure = Q, State = Z>>(self) {
        S::vectorize(Run::<T, S>(self));
    }
}

struct Run<'a, T: Stepper<S>, S: Scalar>(Stretch<'a, T::Model, T::Structure, T::State, S>);

impl<T: Stepper<S>, S: Scalar> Kernel for Run<'_, T, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        advance::<T, S>(self.0);
    }
}

#[inline(always)]
fn advance<T: Stepper<S>, S: Scalar>(x: Stretch<'_, T::Model, T::Structure, T::State, S>) {
    let Stretch { structure, models, inputs, states, from, count } = x;
    // Commands depend on time alone: evaluated some steps ahead, they leave the chain from state to state.
    let mut commands = [[S::zero(); AHEAD]; MAX_CHUNKS];
    let mut instants = [Instant::none(); MAX_CHUNKS];
    let mut steady = [false; MAX_CHUNKS];
    for ((model, inputs), (instant, steady)) in models.iter().zip(inputs).zip(instants.iter_mut().zip(&mut steady)) {
        instant.load(inputs, S::splat(from as f64) * T::dt(model));
        *steady = inputs[COMMAND + 1..].iter().all(|source| source.flat());
    }
    if let (true, [model], [inputs], [state]) = (T::IN_REGISTERS, models, inputs, &mut *states) {
        // The state is large: copied once a stretch, which may be as short as a tick of a controller.
        let mut s = *state;
        alone::<T, S>(model, structure, inputs, &mut s, (instants[0], steady[0]), [from, from + count]);
        *state = s;
        return;
    }
    let mut k = from;
    while k < from + count {
        let some = (from + count - k).min(AHEAD as Steps) as usize;
        for ((model, inputs), commands) in models.iter().zip(inputs).zip(commands.iter_mut()) {
            ahead::<T, S>(model, inputs, k, &mut commands[..some]);
        }
        // Several chunks side by side hide each other's latencies.
        for i in 0..some {
            let number = S::splat((k + i as Steps) as f64);
            for (c, ((model, inputs), state)) in models.iter().zip(inputs).zip(states.iter_mut()).enumerate().take(MAX_CHUNKS) {
                instants[c].move_to(inputs, steady[c], number * T::dt(model), commands[c][i]);
                T::step(model, structure, &instants[c], state);
            }
        }
        k += some as Steps;
    }
}

/// Commands of the steps from `k` on.
#[inline(always)]
fn ahead<T: Stepper<S>, S: Scalar>(model: &T::Model, inputs: &Inputs<S>, k: Steps, commands: &mut [S]) {
    for (i, command) in commands.iter_mut().enumerate() {
        *command = inputs[COMMAND].at(S::splat((k + i as Steps) as f64) * T::dt(model));
    }
}

/// A single chunk.
#[inline(always)]
fn alone<T: Stepper<S>, S: Scalar>(
    model: &T::Model,
    structure: &T::Structure,
    inputs: &Inputs<S>,
    s: &mut T::State,
    (mut instant, steady): (Instant<S>, bool),
    [mut k, end]: [Steps; 2],
) {
    let mut commands = [S::zero(); AHEAD];
    while k < end {
        let some = (end - k).min(AHEAD as Steps) as usize;
        ahead::<T, S>(model, inputs, k, &mut commands[..some]);
        for (i, &command) in commands[..some].iter().enumerate() {
            let t = S::splat((k + i as Steps) as f64) * T::dt(model);
            instant.move_to(inputs, steady, t, command);
            T::step(model, structure, &instant, s);
        }
        k += some as Steps;
    }
}
