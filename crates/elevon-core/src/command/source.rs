//! A sum of waveforms, compiled for a lane block.

use super::term::{Oscillation, Term};
use crate::kept::{Kept, Store};
use crate::scalar::Scalar;
use crate::time::{step_at, Steps};

/// The terms of one port of one run.
#[derive(Clone, Debug, Default)]
pub struct SourcePlan {
    pub terms: Vec<Term>,
}

/// What the inner loop evaluates: a parabola and oscillators, one value a lane.
#[derive(Clone, Debug)]
pub struct Source<S> {
    at: S,
    value: S,
    slope: S,
    curve: S,
    /// No slope, no curve and no oscillator in any lane: the value is all there is.
    flat: bool,
    oscillators: Vec<[S; 5]>,
}

impl SourcePlan {
    pub fn constant(value: f64) -> Self {
        let term = Term { wave: super::Wave::Constant, enabled: true, parameters: vec![value], times: [].into(), values: [].into() };
        Self { terms: vec![term] }
    }

    pub fn oscillators(&self) -> usize {
        self.terms.iter().filter(|t| t.oscillates()).count()
    }

    /// Value at step `k`.
    pub fn value(&self, k: Steps, dt: f64) -> f64 {
        let ([t, value, ..], _) = self.line(k, dt);
        let swing = |o: Oscillation| o.amplitude * Scalar::sin_cos((o.sweep * (t - o.at) + o.rate) * (t - o.at) + o.phase).0;
        value + self.oscillations(k, dt).map(swing).sum::<f64>()
    }

    /// Parabola at step `k` as (at, value, slope, curve) and the step of the next breakpoint.
    fn line(&self, k: Steps, dt: f64) -> ([f64; 4], Steps) {
        let t = k as f64 * dt;
        // Half a step of grace: a breakpoint that falls on the step belongs to what follows it.
        let looked_up = t + 0.5 * dt;
        let (mut value, mut slope, mut curve, mut next) = (0.0, 0.0, 0.0, Steps::MAX);
        for term in &self.terms {
            let line = term.line(looked_up);
            let since = t - line.at;
            value += line.value + (line.slope + line.curve * since) * since;
            slope += line.slope + 2.0 * line.curve * since;
            curve += line.curve;
            next = next.min(step_at(line.until, dt).max(k + 1));
        }
        ([t, value, slope, curve], next)
    }

    fn oscillations(&self, k: Steps, dt: f64) -> impl Iterator<Item = Oscillation> + '_ {
        let looked_up = (k as f64 + 0.5) * dt;
        self.terms.iter().filter(|t| t.oscillates()).map(move |t| t.oscillation(looked_up))
    }
}

/// The ports of one kind over the lanes of a block, each lane renewed at its own breakpoints.
#[derive(Clone, Debug)]
pub struct SourceLanes {
    plans: Vec<SourcePlan>,
    lines: Vec<[f64; 4]>,
    oscillations: Vec<Vec<Oscillation>>,
    next: Vec<Steps>,
    soonest: Steps,
    /// Step at which a lane was renewed last.
    renewed: Steps,
}

impl SourceLanes {
    pub fn new(plans: Vec<SourcePlan>) -> Self {
        let n = plans.len();
        Self { plans, lines: vec![[0.0; 4]; n], oscillations: vec![Vec::new(); n], next: vec![0; n], soonest: 0, renewed: 0 }
    }

    pub fn next(&self) -> Steps {
        self.soonest
    }

    /// Do all lanes keep their values up to the next breakpoint?
    pub fn still(&self) -> bool {
        self.lines.iter().all(|line| line[2..] == [0.0; 2]) && self.oscillations.iter().all(Vec::is_empty)
    }

    /// Step at which a lane was renewed last.
    pub fn renewed(&self) -> Steps {
        self.renewed
    }

    /// Gives a lane another plan; it acts at the next renewal.
    pub fn replace(&mut self, lane: usize, plan: SourcePlan) {
        self.plans[lane] = plan;
        (self.next[lane], self.soonest) = (0, 0);
    }

    /// Gives a lane that holds a value another one; it acts at the next renewal.
    pub fn hold(&mut self, lane: usize, value: f64) {
        if let Some(held) = self.plans[lane].terms.first_mut().and_then(|term| term.parameters.first_mut()) {
            *held = value;
        }
        (self.next[lane], self.soonest) = (0, 0);
    }

    /// A single lane that holds a value, as a store has it.
    pub fn keep(&mut self, store: &mut Store) {
        let mut value = self.lines[0][1];
        value.keep(store);
        self.renewed.keep(store);
        if store.reads() {
            self.hold(0, value);
            self.lines[0] = [0.0, value, 0.0, 0.0];
            (self.next[0], self.soonest) = (Steps::MAX, Steps::MAX);
        }
    }

    /// Renews the lanes whose breakpoint is step `k`; true if any did.
    pub fn renew(&mut self, k: Steps, dt: f64) -> bool {
        let mut renewed = false;
        for lane in 0..self.plans.len() {
            if self.next[lane] > k {
                continue;
            }
            let (line, mut next) = self.plans[lane].line(k, dt);
            self.lines[lane] = line;
            self.oscillations[lane] = self.plans[lane].oscillations(k, dt).collect();
            for o in &self.oscillations[lane] {
                next = next.min(step_at(o.until, dt).max(k + 1));
            }
            self.next[lane] = next;
            renewed = true;
            self.renewed = k;
        }
        self.soonest = self.next.iter().copied().min().unwrap_or(Steps::MAX);
        renewed
    }

    /// Packs the present parabolas and oscillators of lanes `first..first + S::LANES`.
    pub fn pack<S: Scalar>(&self, first: usize) -> Source<S> {
        let lane = |f: &dyn Fn(usize) -> f64| S::from_fn(|i| f(first + i));
        // Lanes with fewer have oscillators of no amplitude.
        let count = self.oscillations[first..first + S::LANES].iter().map(Vec::len).max().unwrap_or(0);
        let oscillators = (0..count)
            .map(|j| {
                let get = |f: &dyn Fn(&Oscillation) -> f64| lane(&|i| self.oscillations[i].get(j).map_or(0.0, f));
                [get(&|o| o.at), get(&|o| o.amplitude), get(&|o| o.phase), get(&|o| o.rate), get(&|o| o.sweep)]
            })
            .collect();
        let flat = count == 0 && (0..S::LANES).all(|i| self.lines[first + i][2..] == [0.0; 2]);
        Source {
            flat,
            at: lane(&|i| self.lines[i][0]),
            value: lane(&|i| self.lines[i][1]),
            slope: lane(&|i| self.lines[i][2]),
            curve: lane(&|i| self.lines[i][3]),
            oscillators,
        }
    }
}

impl<S: Scalar> Source<S> {
    /// One value for good.
    pub fn constant(value: S) -> Self {
        let zero = S::zero();
        Self { at: zero, value, slope: zero, curve: zero, flat: true, oscillators: Vec::new() }
    }

    /// The value does not change before the next breakpoint.
    #[inline(always)]
    pub fn flat(&self) -> bool {
        self.flat
    }

    #[inline(always)]
    pub fn at(&self, t: S) -> S {
        if self.flat {
            return self.value;
        }
        let since = t - self.at;
        let mut sum = self.curve.fma(since, self.slope).fma(since, self.value);
        for oscillator in &self.oscillators {
            sum = oscillate(oscillator, t, sum);
        }
        sum
    }

    /// At several instants: instant by instant in the innermost loop, which the compiler turns into vectors for a single run.
    #[inline(always)]
    pub fn at_each<const N: usize>(&self, t: &[S; N], out: &mut [S; N]) {
        for (sum, &t) in out.iter_mut().zip(t) {
            let since = t - self.at;
            *sum = self.curve.fma(since, self.slope).fma(since, self.value);
        }
        for oscillator in &self.oscillators {
            for (sum, &t) in out.iter_mut().zip(t) {
                *sum = oscillate(oscillator, t, *sum);
            }
        }
    }
}

/// Adds an oscillator at the instant `t`.
#[inline(always)]
fn oscillate<S: Scalar>([at, amplitude, phase, rate, sweep]: &[S; 5], t: S, sum: S) -> S {
    let tau = t - *at;
    let (sin, _) = sweep.fma(tau, *rate).fma(tau, *phase).sin_cos();
    amplitude.fma(sin, sum)
}
