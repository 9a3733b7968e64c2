//! The inner loop of the servos: inputs some steps ahead, chunks of lanes side by side.

use super::layout::{BRAKE, COMMAND, OUTPUT, PORTS, SHAFT, SUPPLY};
use crate::actuator::{Inputs, Stretch, MAX_CHUNKS};
use crate::scalar::{Kernel, Scalar};
use crate::time::Steps;

/// Steps whose inputs are evaluated together.
const AHEAD: usize = 8;

/// The inputs at one instant.
#[derive(Clone, Copy)]
pub(super) struct Instant<S> {
    pub t: S,
    pub command: S,
    /// The command at the step's end, before what sets in there; of steppers that look ahead.
    pub next: S,
    /// A brake cannot push: negative values count as zero.
    pub brake: S,
    pub shaft: S,
    pub output: S,
    pub supply: S,
}

impl<S: Scalar> Instant<S> {
    #[inline(always)]
    pub(super) fn at(inputs: &Inputs<S>, t: S) -> Self {
        let command = inputs[COMMAND].at(t);
        Self {
            t,
            command,
            next: command,
            brake: inputs[BRAKE].at(t).maximum(S::zero()),
            shaft: inputs[SHAFT].at(t),
            output: inputs[OUTPUT].at(t),
            supply: inputs[SUPPLY].at(t),
        }
    }

    #[inline(always)]
    fn none() -> Self {
        let zero = S::zero();
        Self { t: zero, command: zero, next: zero, brake: zero, shaft: zero, output: zero, supply: zero }
    }
}

/// The inputs some steps ahead. They depend on time alone: evaluated together they leave the chain from state to state.
#[derive(Clone, Copy)]
struct Ahead<S> {
    ports: [[S; AHEAD]; PORTS.len()],
    /// The command behind them.
    beyond: S,
    /// Does the command change between its breakpoints, and does anything look at it? Does any other input?
    commanded: bool,
    loaded: bool,
}

impl<S: Scalar> Ahead<S> {
    #[inline(always)]
    fn new() -> Self {
        Self { ports: [[S::zero(); AHEAD]; PORTS.len()], beyond: S::zero(), commanded: false, loaded: false }
    }

    /// What of the inputs changes in a stretch.
    #[inline(always)]
    fn begin(&mut self, inputs: &Inputs<S>, commanded: bool) {
        self.commanded = commanded && !inputs[COMMAND].flat();
        self.loaded = [BRAKE, SHAFT, OUTPUT, SUPPLY].iter().any(|&port| !inputs[port].flat());
    }

    /// That, from step `k` on.
    #[inline(always)]
    fn look(&mut self, inputs: &Inputs<S>, k: Steps, dt: S, beyond: bool) {
        let mut t = [S::zero(); AHEAD];
        for (i, t) in t.iter_mut().enumerate() {
            *t = S::splat((k + i as Steps) as f64) * dt;
        }
        if self.commanded {
            inputs[COMMAND].at_each(&t, &mut self.ports[COMMAND]);
            if beyond {
                self.beyond = inputs[COMMAND].at(S::splat((k + AHEAD as Steps) as f64) * dt);
            }
        }
        if self.loaded {
            for port in [BRAKE, SHAFT, OUTPUT, SUPPLY] {
                inputs[port].at_each(&t, &mut self.ports[port]);
            }
        }
    }

    /// The instant `t`, `i` steps on.
    #[inline(always)]
    fn put(&self, i: usize, t: S, instant: &mut Instant<S>) {
        instant.t = t;
        if self.commanded {
            instant.command = self.ports[COMMAND][i];
            instant.next = if i + 1 < AHEAD { self.ports[COMMAND][i + 1] } else { self.beyond };
        }
        if self.loaded {
            instant.brake = self.ports[BRAKE][i].maximum(S::zero());
            instant.shaft = self.ports[SHAFT][i];
            instant.output = self.ports[OUTPUT][i];
            instant.supply = self.ports[SUPPLY][i];
        }
    }
}

/// One step of a wiring, as the inner loop calls it.
pub(super) trait Stepper<S> {
    type Model;
    type Structure;
    type State: Copy;
    /// The state of one chunk may stay in registers over some steps: worth a copy of the step's code where that is short.
    const IN_REGISTERS: bool;
    /// It needs the command at the end of its step.
    const LOOKS_AHEAD: bool = false;
    /// Does every step look at the command?
    fn commanded(structure: &Self::Structure) -> bool;
    fn dt(model: &Self::Model) -> S;
    fn step(model: &Self::Model, structure: &Self::Structure, instant: &Instant<S>, state: &mut Self::State);
}

/// Takes the steps of a stretch. It depends on no form of servo, so that all forms share its code.
pub(super) fn march<T: Stepper<S>, S: Scalar>(x: Stretch<'_, T::Structure, T::Model, T::State, S>) {
    S::vectorize(Run::<T, S>(x));
}

struct Run<'a, T: Stepper<S>, S: Scalar>(Stretch<'a, T::Structure, T::Model, T::State, S>);

impl<T: Stepper<S>, S: Scalar> Kernel for Run<'_, T, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        advance::<T, S>(self.0);
    }
}

#[inline(always)]
fn advance<T: Stepper<S>, S: Scalar>(x: Stretch<'_, T::Structure, T::Model, T::State, S>) {
    let Stretch { structure, models, inputs, states, from, count } = x;
    let (commanded, end) = (T::commanded(structure), from + count);
    if let (true, [model], [inputs], [state]) = (T::IN_REGISTERS, models, inputs, &mut *states) {
        // The state is large: copied once a stretch, which may be as short as a tick of a controller.
        let mut s = *state;
        alone::<T, S>(model, structure, inputs, &mut s, [from, end]);
        *state = s;
        return;
    }
    let mut ahead = [Ahead::new(); MAX_CHUNKS];
    let mut instants = [Instant::none(); MAX_CHUNKS];
    for ((model, inputs), (ahead, instant)) in models.iter().zip(inputs).zip(ahead.iter_mut().zip(&mut instants)) {
        ahead.begin(inputs, commanded);
        *instant = Instant::at(inputs, S::splat(from as f64) * T::dt(model));
    }
    let mut k = from;
    while k < end {
        let some = (end - k).min(AHEAD as Steps) as usize;
        for ((model, inputs), ahead) in models.iter().zip(inputs).zip(&mut ahead) {
            ahead.look(inputs, k, T::dt(model), T::LOOKS_AHEAD);
        }
        // Several chunks side by side hide each other's latencies.
        for i in 0..some {
            let number = S::splat((k + i as Steps) as f64);
            for (c, (model, state)) in models.iter().zip(states.iter_mut()).enumerate().take(MAX_CHUNKS) {
                ahead[c].put(i, number * T::dt(model), &mut instants[c]);
                T::step(model, structure, &instants[c], state);
            }
        }
        k += some as Steps;
    }
}

/// A single chunk.
#[inline(always)]
fn alone<T: Stepper<S>, S: Scalar>(
    model: &T::Model,
    structure: &T::Structure,
    inputs: &Inputs<S>,
    s: &mut T::State,
    [mut k, end]: [Steps; 2],
) {
    let mut ahead = Ahead::new();
    ahead.begin(inputs, T::commanded(structure));
    let mut instant = Instant::at(inputs, S::splat(k as f64) * T::dt(model));
    while k < end {
        let some = (end - k).min(AHEAD as Steps) as usize;
        ahead.look(inputs, k, T::dt(model), T::LOOKS_AHEAD);
        for i in 0..some {
            ahead.put(i, S::splat((k + i as Steps) as f64) * T::dt(model), &mut instant);
            T::step(model, structure, &instant, s);
        }
        k += some as Steps;
    }
}
