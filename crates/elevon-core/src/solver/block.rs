//! One block of lanes from start to end: events cut the run, the inner loop runs between them.

use super::batch::Monitor;
use super::rows::Rows;
use super::spec::{Clock, RunOutput, RunSpec, Status};
use crate::actuator::{Inputs, Overheat, Setup, Tick, Watch, Wiring};
use crate::command::SourceLanes;
use crate::fault::FaultLanes;
use crate::noise::Key;
use crate::scalar::{Kernel, Scalar};
use crate::time::Steps;
use std::time::Instant;

/// Longest uninterrupted stretch of steps: bounds the delay of Ctrl-C and of the watch on divergence.
const STRETCH: Steps = 4096;

/// Turns the plain numbers of a run into scalars: lanes by default, dual numbers with their seeds otherwise.
pub trait Lift<S> {
    fn parameter(&self, first: usize, index: usize) -> S;
    fn severity(&self, lane: usize, fault: usize) -> S;
    /// Numbers written per value and lane.
    fn emit(&self, x: S, lane: usize, out: &mut Vec<f64>);
    fn width(&self) -> usize;
}

/// Lanes of plain runs.
pub struct Plain<'a>(pub &'a [&'a RunSpec]);

impl<S: Scalar> Lift<S> for Plain<'_> {
    fn parameter(&self, first: usize, index: usize) -> S {
        S::from_fn(|i| self.0[first + i].parameters[index])
    }
    fn severity(&self, lane: usize, fault: usize) -> S {
        S::splat(self.0[lane].faults[fault].severity)
    }
    #[inline(always)]
    fn emit(&self, x: S, lane: usize, out: &mut Vec<f64>) {
        out.push(x.lane(lane));
    }
    fn width(&self) -> usize {
        1
    }
}

/// The structure of a run, which all runs of its block must share.
pub fn structure<W: Wiring>(run: &RunSpec, recorded: &[usize]) -> W::Structure {
    let mut touched = vec![false; run.parameters.len()];
    for index in run.faults.iter().flat_map(|f| f.touched()) {
        touched[index] = true;
    }
    W::structure(&Setup { raw: &run.parameters, touched: &touched, driven: &run.driven, recorded })
}

struct Advance<'a, W: Wiring, S: Scalar> {
    structure: &'a W::Structure,
    models: &'a [W::Model<S>],
    inputs: &'a [Inputs<S>],
    states: &'a mut [W::State<S>],
    from: Steps,
    count: Steps,
}

impl<W: Wiring, S: Scalar> Kernel for Advance<'_, W, S> {
    /// Some lane has left its limits or tripped.
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        W::advance(self.structure, self.models, self.inputs, self.states, self.from, self.count);
        let mut trouble = S::mask(false);
        for state in self.states.iter() {
            trouble = trouble | S::zero().lt(W::tripped(state));
            for watch in W::watch(state) {
                trouble = trouble | !watch.value.abs().le(S::splat(watch.limit));
            }
        }
        S::any(trouble)
    }
}

struct Observe<'a, W: Wiring, S: Scalar> {
    structure: &'a W::Structure,
    model: &'a W::Model<S>,
    inputs: &'a Inputs<S>,
    state: &'a W::State<S>,
    t: f64,
    out: &'a mut [S],
}

impl<W: Wiring, S: Scalar> Kernel for Observe<'_, W, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        W::observe(self.structure, self.model, self.inputs, self.state, S::splat(self.t), self.out);
    }
}

/// Observes one chunk and appends a row to every clock that is due.
struct Record<'a, W: Wiring, S: Scalar, L: Lift<S>> {
    observe: Observe<'a, W, S>,
    clocks: &'a [Clock],
    due: &'a [Steps],
    k: Steps,
    faults: &'a FaultLanes,
    lift: &'a L,
    rows: &'a mut Rows<S>,
}

impl<W: Wiring, S: Scalar, L: Lift<S>> Kernel for Record<'_, W, S, L> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Observe { structure, model, inputs, state, t, out } = self.observe;
        W::observe(structure, model, inputs, state, S::splat(t), out);
        for (i, (clock, &due)) in self.clocks.iter().zip(self.due).enumerate() {
            if due <= self.k {
                self.rows.append(i, clock, out, self.faults, self.lift);
            }
        }
    }
}

struct Ticking<'a, W: Wiring, S: Scalar> {
    kind: u8,
    structure: &'a W::Structure,
    model: &'a W::Model<S>,
    inputs: &'a Inputs<S>,
    state: &'a mut W::State<S>,
    t: f64,
    noise: &'a mut dyn FnMut(u64) -> S,
}

impl<W: Wiring, S: Scalar> Kernel for Ticking<'_, W, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        W::tick(self.kind, self.structure, self.model, self.inputs, self.state, S::splat(self.t), self.noise);
    }
}

/// A block of lanes in progress.
pub struct Block<'a, W: Wiring, S: Scalar, L: Lift<S>> {
    runs: &'a [&'a RunSpec],
    /// Runs before the padding of the last chunk.
    real: usize,
    lift: L,
    clocks: &'a [Clock],
    structure: W::Structure,
    dt: f64,
    steps: Steps,
    healthy: Vec<Vec<S>>,
    models: Vec<W::Model<S>>,
    states: Vec<W::State<S>>,
    inputs: Vec<Inputs<S>>,
    sources: Vec<SourceLanes>,
    faults: FaultLanes,
    ticks: Vec<Tick>,
    /// Steps at which each tick and each clock is due next.
    tick_due: Vec<Steps>,
    clock_due: Vec<Steps>,
    status: Vec<Status>,
    stopped: Vec<Option<Steps>>,
    rows: Vec<Rows<S>>,
    wall: f64,
}

impl<'a, W: Wiring, S: Scalar, L: Lift<S>> Block<'a, W, S, L> {
    /// `runs` is padded to whole chunks; the first `real` are kept.
    pub fn new(runs: &'a [&'a RunSpec], real: usize, lift: L, clocks: &'a [Clock], recorded: &[usize]) -> Self {
        let first = runs[0];
        let dt = W::step(&first.parameters);
        let steps = (first.duration / dt).round() as Steps;
        let structure = structure::<W>(first, recorded);
        let chunks = runs.len() / S::LANES;
        let count = first.parameters.len();
        let healthy: Vec<Vec<S>> = (0..chunks).map(|c| (0..count).map(|i| lift.parameter(c * S::LANES, i)).collect()).collect();
        let grid = (W::fault_grid(&first.parameters) / dt).round() as Steps;
        let faults = FaultLanes::new(runs.iter().map(|r| r.faults.clone()).collect(), grid);
        let sources = (0..W::PORTS.len()).map(|p| SourceLanes::new(runs.iter().map(|r| r.ports[p].clone()).collect())).collect();
        let ticks = W::ticks(&first.parameters, &structure);
        let rows = (0..chunks).map(|c| Rows::new(c * S::LANES, real, clocks, &faults, steps, &lift)).collect();
        let mut block = Self {
            tick_due: vec![0; ticks.len()],
            clock_due: vec![0; clocks.len()],
            runs,
            real,
            lift,
            clocks,
            dt,
            steps,
            healthy,
            faults,
            sources,
            ticks,
            rows,
            models: Vec::new(),
            states: Vec::new(),
            inputs: vec![Vec::new(); chunks],
            status: vec![Status::Ok; runs.len()],
            stopped: vec![None; runs.len()],
            structure,
            wall: 0.0,
        };
        block.begin();
        block
    }

    fn begin(&mut self) {
        self.faults.renew(0, self.dt);
        for chunk in 0..self.healthy.len() {
            let raw = self.parameters_now(chunk);
            let model = W::derive(&raw, &self.structure);
            let count = W::INITIAL.len();
            let first = chunk * S::LANES;
            let initial: Vec<S> = (0..count).map(|i| S::from_fn(|l| self.runs[first + l].initial[i])).collect();
            self.states.push(W::start(&model, &raw, &initial));
            self.models.push(model);
        }
    }

    fn parameters_now(&self, chunk: usize) -> Vec<S> {
        let mut raw = self.healthy[chunk].clone();
        self.faults.apply(chunk * S::LANES, &mut raw, &|lane, fault| self.lift.severity(lane, fault));
        raw
    }

    /// Runs to the end or until interrupted.
    pub fn run(mut self, monitor: &Monitor) -> Vec<RunOutput> {
        let began = Instant::now();
        let (mut k, mut trouble): (Steps, bool) = (0, true);
        let mut out = vec![S::zero(); W::signals().len()];
        loop {
            self.renew(k);
            self.tick(k);
            self.record(k, &mut out);
            if trouble && !self.watch(k) || k >= self.steps {
                break;
            }
            let next = self.next_event(k);
            trouble = self.advance(k, next - k);
            let advanced = next - k;
            k = next;
            if !monitor.advance(advanced * self.real as u64) {
                self.interrupt(k);
                break;
            }
        }
        self.wall = began.elapsed().as_secs_f64();
        self.finish(k, out)
    }

    fn advance(&mut self, from: Steps, count: Steps) -> bool {
        S::vectorize(Advance::<W, S> {
            structure: &self.structure,
            models: &self.models,
            inputs: &self.inputs,
            states: &mut self.states,
            from,
            count,
        })
    }

    /// Inputs and parameters that change at step `k`.
    fn renew(&mut self, k: Steps) {
        let mut renewed = k == 0;
        for source in &mut self.sources {
            if source.next() <= k {
                renewed |= source.renew(k, self.dt);
            }
        }
        if renewed {
            for chunk in 0..self.inputs.len() {
                self.inputs[chunk] = self.sources.iter().map(|s| s.pack(chunk * S::LANES)).collect();
            }
        }
        if k > 0 && self.faults.next() <= k {
            self.faults.renew(k, self.dt);
            for chunk in 0..self.models.len() {
                let raw = self.parameters_now(chunk);
                self.models[chunk] = W::derive(&raw, &self.structure);
                W::refresh(&raw, &mut self.states[chunk]);
            }
        }
    }

    fn tick(&mut self, k: Steps) {
        for (tick, due) in self.ticks.iter().zip(&mut self.tick_due) {
            if k < *due {
                continue;
            }
            *due += tick.period;
            let count = k / tick.period;
            for chunk in 0..self.states.len() {
                let first = chunk * S::LANES;
                let runs = self.runs;
                let mut noise = |channel: u64| S::from_fn(|i| Key::new(runs[first + i].seed, runs[first + i].run, channel).gaussian(count));
                S::vectorize(Ticking::<W, S> {
                    kind: tick.kind,
                    structure: &self.structure,
                    model: &self.models[chunk],
                    inputs: &self.inputs[chunk],
                    state: &mut self.states[chunk],
                    t: k as f64 * self.dt,
                    noise: &mut noise,
                });
            }
        }
    }

    fn record(&mut self, k: Steps, out: &mut [S]) {
        if self.clock_due.iter().all(|&due| k < due) {
            return;
        }
        for chunk in 0..self.states.len() {
            S::vectorize(Record::<W, S, L> {
                observe: Observe {
                    structure: &self.structure,
                    model: &self.models[chunk],
                    inputs: &self.inputs[chunk],
                    state: &self.states[chunk],
                    t: k as f64 * self.dt,
                    out,
                },
                clocks: self.clocks,
                due: &self.clock_due,
                k,
                faults: &self.faults,
                lift: &self.lift,
                rows: &mut self.rows[chunk],
            });
        }
        for (due, clock) in self.clock_due.iter_mut().zip(self.clocks) {
            if k >= *due {
                *due += clock.period;
            }
        }
    }

    fn observe(&self, chunk: usize, k: Steps, out: &mut [S]) {
        let t = k as f64 * self.dt;
        S::vectorize(Observe::<W, S> {
            structure: &self.structure,
            model: &self.models[chunk],
            inputs: &self.inputs[chunk],
            state: &self.states[chunk],
            t,
            out,
        });
    }

    /// Marks lanes that diverged or tripped; false when no lane is left.
    fn watch(&mut self, k: Steps) -> bool {
        let time = k as f64 * self.dt;
        for chunk in 0..self.states.len() {
            let watched = W::watch(&self.states[chunk]);
            let tripped = W::tripped(&self.states[chunk]);
            let heat = W::overheated(&self.states[chunk]);
            self.mark(chunk, time, k, &watched, tripped, heat);
        }
        self.stopped[..self.real].iter().any(|s| s.is_none())
    }

    /// Marks the lanes of a chunk that just diverged or tripped.
    fn mark(&mut self, chunk: usize, time: f64, k: Steps, watched: &[Watch<S>], tripped: S, heat: Option<Overheat<S>>) {
        for i in 0..S::LANES {
            let lane = chunk * S::LANES + i;
            if self.stopped[lane].is_some() {
                continue;
            }
            // Not a number is beyond every limit.
            let beyond = watched.iter().find(|w| w.value.lane(i).is_nan() || w.value.lane(i).abs() > w.limit);
            if let Some(watch) = beyond {
                self.status[lane] = Status::Diverged { time, signal: watch.name };
                self.stop(lane, k);
            } else if let Some(heat) = heat.filter(|h| h.over.lane(i) > 0.0) {
                self.status[lane] = Status::Overheated { time, temperature: heat.temperature.lane(i) };
                self.stop(lane, k);
            } else if self.status[lane] == Status::Ok && tripped.lane(i) > 0.0 {
                let reason = W::trip_reason(&self.models[chunk], &self.states[chunk], i).unwrap_or_default();
                self.status[lane] = Status::Tripped { time, reason };
            }
        }
    }

    /// The lane neither moves nor records from step `k` on.
    fn stop(&mut self, lane: usize, k: Steps) {
        self.stopped[lane] = Some(k);
        self.rows[lane / S::LANES].end(lane % S::LANES, &self.lift);
    }

    fn next_event(&self, k: Steps) -> Steps {
        let mut next = self.steps.min(k + STRETCH).min(self.faults.next());
        for source in &self.sources {
            next = next.min(source.next());
        }
        let due = self.tick_due.iter().chain(&self.clock_due).copied().min();
        next = next.min(due.unwrap_or(Steps::MAX));
        next.max(k + 1)
    }

    fn interrupt(&mut self, k: Steps) {
        for lane in 0..self.real {
            if self.stopped[lane].is_none() {
                self.status[lane] = Status::Interrupted;
                self.stop(lane, k);
            }
        }
    }

    fn finish(mut self, k: Steps, mut out: Vec<S>) -> Vec<RunOutput> {
        let mut results = Vec::with_capacity(self.real);
        for lane in 0..self.real {
            if lane % S::LANES == 0 {
                self.observe(lane / S::LANES, k, &mut out);
            }
            let steps = self.stopped[lane].unwrap_or(k);
            let width = self.lift.width();
            let labels = self.faults.count(lane);
            let mut last = Vec::with_capacity(out.len() * width);
            for &x in &out {
                self.lift.emit(x, lane % S::LANES, &mut last);
            }
            results.push(RunOutput {
                status: self.status[lane].clone(),
                steps,
                time: steps as f64 * self.dt,
                wall: self.wall / self.real as f64,
                columns: self.clocks.iter().map(|c| (c.signals.len() + labels) * width).collect(),
                clocks: self.rows[lane / S::LANES].take(lane % S::LANES, &self.lift),
                last,
            });
        }
        results
    }
}
