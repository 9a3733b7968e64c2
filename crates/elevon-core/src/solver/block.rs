//! One block of lanes from start to end: events cut the run, the inner loop runs between them.

use super::batch::Monitor;
use super::kernels::{Advance, Lift, Observe, Record, Ticking};
use super::rows::Rows;
use super::spec::{Clock, RunOutput, RunSpec, Status};
use crate::actuator::{Event, Inputs, Machine, Observation, Setup, Signals, Stretch, Tick, Wiring, HELD};
use crate::command::{Source, SourceLanes};
use crate::fault::FaultLanes;
use crate::noise::Key;
use crate::scalar::Scalar;
use crate::time::Steps;
use std::time::Instant;

/// Longest uninterrupted stretch of steps: bounds the delay of Ctrl-C and of the watch on divergence.
const STRETCH: Steps = 4096;

/// The structure of a run, which all runs of its block must share.
pub fn structure<W: Wiring>(run: &RunSpec, recorded: &[usize]) -> W::Structure {
    let mut touched = vec![false; run.parameters.len()];
    let dt = W::step(&run.parameters);
    for index in run.faults.iter().flat_map(|f| f.touched(dt)).chain(run.tunable.iter().copied()) {
        touched[index] = true;
    }
    W::structure(&Setup { raw: &run.parameters, touched: &touched, driven: &run.driven, recorded })
}

/// Ports that have a parameter's value where nothing drives them, each with the parameter's place.
fn fallbacks<W: Wiring>() -> impl Iterator<Item = (usize, usize)> {
    let paths: Vec<String> = W::groups().iter().flat_map(|g| (0..g.variables.len()).map(|i| g.path(i))).collect();
    W::PORTS.iter().enumerate().filter_map(move |(port, p)| Some((port, paths.iter().position(|path| path == p.parameter)?)))
}

/// The port that has a parameter's value where nothing drives it.
pub(super) fn feeds<W: Wiring>(index: usize) -> Option<usize> {
    fallbacks::<W>().find(|&(_, place)| place == index).map(|(port, _)| port)
}

/// A port that sets a parameter.
#[derive(Clone)]
pub(super) struct Held {
    pub(super) port: usize,
    index: usize,
    /// Lanes in which waveforms drive it.
    pub(super) driven: Vec<bool>,
}

fn held<W: Wiring>(runs: &[&RunSpec]) -> Vec<Held> {
    let all = |(port, index)| Held { port, index, driven: runs.iter().map(|r| r.driven[port]).collect() };
    fallbacks::<W>().filter(|(port, _)| W::Machine::HELD_PORTS.contains(port)).map(all).collect()
}

/// A block of lanes in progress.
#[derive(Clone)]
pub struct Block<'a, W: Wiring, S: Scalar, L: Lift<S>> {
    /// Seed and number of each run: the keys of its random numbers.
    keys: Vec<(u64, u64)>,
    /// Runs before the padding of the last chunk.
    pub(super) real: usize,
    pub(super) lift: L,
    pub(super) clocks: &'a [Clock],
    pub(super) structure: W::Structure,
    /// The recorded signals.
    pub(super) selection: Signals,
    pub(super) dt: f64,
    steps: Steps,
    /// The step that comes next.
    pub(super) k: Steps,
    /// Something was seen to have left its limits, or nothing was looked at so far.
    pub(super) trouble: bool,
    /// Parameters were changed from outside.
    pub(super) stale: bool,
    pub(super) healthy: Vec<Vec<S>>,
    /// Memory for those of a chunk with its faults.
    raw: Vec<S>,
    /// Texts of trips are wanted.
    pub(super) texts: bool,
    pub(super) models: Vec<W::Model<S>>,
    pub(super) states: Vec<W::State<S>>,
    inputs: Vec<Inputs<S>>,
    /// Where numbers carry slopes: ports whose value is a parameter's, and which.
    constants: Vec<(usize, usize)>,
    pub(super) sources: Vec<SourceLanes>,
    pub(super) held: Vec<Held>,
    /// Steps over which those hold their values.
    hold: Steps,
    pub(super) faults: FaultLanes,
    pub(super) ticks: Vec<Tick>,
    /// Steps at which each tick and each clock is due next.
    pub(super) tick_due: Vec<Steps>,
    clock_due: Vec<Steps>,
    pub(super) status: Vec<Status>,
    pub(super) stopped: Vec<Option<Steps>>,
    pub(super) rows: Vec<Rows<S>>,
    /// Every signal of a lane when it stopped.
    pub(super) last: Vec<Vec<f64>>,
    pub(super) wall: f64,
}

impl<'a, W: Wiring, S: Scalar, L: Lift<S>> Block<'a, W, S, L> {
    /// `runs` is padded to whole chunks; the first `real` are kept.
    pub fn new(runs: &[&RunSpec], real: usize, lift: L, clocks: &'a [Clock], recorded: &[usize]) -> Self {
        let first = runs[0];
        let dt = W::step(&first.parameters);
        let steps = (first.duration / dt).round() as Steps;
        let structure = structure::<W>(first, recorded);
        let chunks = runs.len() / S::LANES;
        let grid = (W::fault_grid(&first.parameters) / dt).round() as Steps;
        let faults = FaultLanes::new(runs.iter().map(|r| r.faults.clone()).collect(), grid);
        let ticks = W::ticks(&first.parameters, &structure);
        let rows = (0..chunks).map(|c| Rows::new(c * S::LANES, real, clocks, &faults, steps, &lift)).collect();
        let mut block = Self {
            tick_due: ticks.iter().map(|tick| tick.first).collect(),
            clock_due: vec![0; clocks.len()],
            keys: runs.iter().map(|r| (r.seed, r.run)).collect(),
            real,
            healthy: (0..chunks).map(|c| (0..first.parameters.len()).map(|i| lift.parameter(runs, c * S::LANES, i)).collect()).collect(),
            lift,
            clocks,
            dt,
            steps,
            k: 0,
            trouble: true,
            stale: false,
            raw: Vec::with_capacity(first.parameters.len()),
            texts: true,
            faults,
            sources: (0..W::PORTS.len()).map(|p| SourceLanes::new(runs.iter().map(|r| r.ports[p].clone()).collect())).collect(),
            held: held::<W>(runs),
            hold: ((HELD / dt).round() as Steps).max(1),
            ticks,
            rows,
            models: Vec::new(),
            states: Vec::new(),
            inputs: vec![Vec::new(); chunks],
            constants: if L::SLOPES { fallbacks::<W>().filter(|&(port, _)| !first.driven[port]).collect() } else { Vec::new() },
            status: vec![Status::Ok; runs.len()],
            stopped: vec![None; runs.len()],
            last: vec![Vec::new(); runs.len()],
            structure,
            selection: Signals::of(recorded),
            wall: 0.0,
        };
        block.begin(runs);
        block
    }

    fn begin(&mut self, runs: &[&RunSpec]) {
        self.faults.renew(0, self.dt);
        for held in &self.held {
            self.sources[held.port].renew(0, self.dt);
        }
        for chunk in 0..self.healthy.len() {
            self.take_parameters(chunk);
            let raw = &self.raw;
            let model = W::derive(raw, &self.structure);
            let count = W::INITIAL.len();
            let first = chunk * S::LANES;
            let initial: Vec<S> = (0..count).map(|i| S::from_fn(|l| runs[first + l].initial[i])).collect();
            self.states.push(W::start(&model, raw, &initial));
            self.models.push(model);
        }
    }

    /// Those of a chunk as they are now, into `raw`.
    fn take_parameters(&mut self, chunk: usize) {
        let mut raw = std::mem::take(&mut self.raw);
        raw.clone_from(&self.healthy[chunk]);
        let first = chunk * S::LANES;
        for held in &self.held {
            let driven = &held.driven[first..first + S::LANES];
            if driven.contains(&true) {
                let (own, set) = (raw[held.index], self.sources[held.port].pack::<S>(first).at(S::splat(self.k as f64 * self.dt)));
                raw[held.index] = S::from_fn(|i| if driven[i] { set.lane(i) } else { own.lane(i) });
            }
        }
        self.faults.apply(chunk * S::LANES, &mut raw, L::SLOPES, &|lane, fault| self.lift.severity(&self.faults, lane, fault));
        self.raw = raw;
    }

    /// Runs to the end or until interrupted.
    pub fn run(mut self, monitor: &Monitor) -> Vec<RunOutput> {
        let began = Instant::now();
        let mut out = vec![S::zero(); W::signals().len()];
        if self.proceed(self.steps, monitor, &mut out) {
            self.events(&mut out);
        }
        self.wall = began.elapsed().as_secs_f64();
        let k = self.k;
        self.finish(k, out)
    }

    /// Steps on to step `until`, whose own events stay for whoever goes on from there; false when all lanes have stopped,
    /// or the caller wants to.
    pub(super) fn proceed(&mut self, until: Steps, monitor: &Monitor, out: &mut [S]) -> bool {
        while self.k < until {
            self.events(out);
            if self.ended() {
                return false;
            }
            let count = self.next_event(self.k).min(until) - self.k;
            self.trouble = self.advance(self.k, count);
            self.k += count;
            if !monitor.advance(count * self.real as u64) {
                self.interrupt(self.k);
                return false;
            }
        }
        true
    }

    /// Judges the lanes at the step reached as `events` does: for a caller who looks at them between two steps.
    pub(super) fn judge(&mut self, out: &mut [S]) {
        if self.trouble {
            self.watch(self.k, out, Self::mark_diverged);
            self.watch(self.k, out, Self::mark_tripped);
        }
    }

    /// Have all lanes stopped?
    fn ended(&self) -> bool {
        self.stopped[..self.real].iter().all(Option::is_some)
    }

    /// What happens at the present step before anything moves.
    fn events(&mut self, out: &mut [S]) {
        let k = self.k;
        // Looked for at instants that every run of this shape has, so that a run ends at the same one in any company.
        let look = self.trouble && self.shared(k);
        self.renew(k);
        if look {
            self.watch(k, out, Self::mark_diverged);
        }
        self.tick(k);
        self.record(k, out);
        if look {
            self.watch(k, out, Self::mark_tripped);
        }
    }

    /// Is step `k` an instant of every run of this shape, whatever its inputs and faults: a tick, a sample, a whole stretch
    /// or the end?
    fn shared(&self, k: Steps) -> bool {
        k.is_multiple_of(STRETCH) || k >= self.steps || self.tick_due.iter().chain(&self.clock_due).any(|&due| due == k)
    }

    fn advance(&mut self, from: Steps, count: Steps) -> bool {
        S::vectorize(Advance::<W, S>(Stretch {
            structure: &self.structure,
            models: &self.models,
            inputs: &self.inputs,
            states: &mut self.states,
            from,
            count,
        }))
    }

    /// Inputs and parameters that change at step `k`.
    pub(super) fn renew(&mut self, k: Steps) {
        let mut renewed = k == 0;
        for source in &mut self.sources {
            if source.next() <= k {
                renewed |= source.renew(k, self.dt);
            }
        }
        self.stale |= k > 0 && self.held.iter().any(|held| self.sets(held, k));
        if renewed {
            self.pack_inputs();
        }
        if self.stale || k > 0 && self.faults.next() <= k {
            self.stale = false;
            self.faults.renew(k, self.dt);
            for chunk in 0..self.models.len() {
                self.derive(chunk);
                W::refresh(&self.models[chunk], &self.structure, &self.raw, &mut self.states[chunk]);
            }
        }
    }

    /// The inputs as their sources have them.
    pub(super) fn pack_inputs(&mut self) {
        for chunk in 0..self.inputs.len() {
            self.inputs[chunk].resize_with(self.sources.len(), || Source::constant(S::zero()));
            for (input, source) in self.inputs[chunk].iter_mut().zip(&self.sources) {
                *input = source.pack(chunk * S::LANES);
            }
            for held in &self.held {
                // No step looks at it.
                self.inputs[chunk][held.port] = Source::constant(S::zero());
            }
            for &(port, index) in &self.constants {
                self.inputs[chunk][port] = Source::constant(self.healthy[chunk][index]);
            }
        }
    }

    /// The constants of a chunk from its parameters as they are now.
    pub(super) fn derive(&mut self, chunk: usize) {
        self.take_parameters(chunk);
        W::derive_anew(&mut self.models[chunk], &self.raw, &self.structure);
    }

    /// Does a port set its parameter anew at step `k`?
    fn sets(&self, held: &Held, k: Steps) -> bool {
        let source = &self.sources[held.port];
        source.renewed() == k || k.is_multiple_of(self.hold) && !source.still()
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
                let keys = &self.keys[first..];
                let mut noise = |channel: u64| S::from_fn(|i| Key::new(keys[i].0, keys[i].1, channel).gaussian(count));
                S::vectorize(Ticking::<W, S>(Event {
                    kind: tick.kind,
                    structure: &self.structure,
                    model: &self.models[chunk],
                    inputs: &self.inputs[chunk],
                    state: &mut self.states[chunk],
                    t: S::splat(k as f64 * self.dt),
                    noise: &mut noise,
                }));
            }
        }
    }

    fn record(&mut self, k: Steps, out: &mut [S]) {
        if self.clock_due.iter().all(|&due| k < due) {
            return;
        }
        for chunk in 0..self.states.len() {
            self.observe(chunk, k, self.selection, out);
            let lost = S::vectorize(Record::<S, L> {
                observed: out,
                clocks: self.clocks,
                due: &self.clock_due,
                k,
                faults: &self.faults,
                lift: &self.lift,
                rows: &mut self.rows[chunk],
            });
            if lost.is_empty() {
                continue;
            }
            // An ended lane keeps every signal.
            self.observe(chunk, k, Signals::ALL, out);
            for (i, signal) in lost {
                self.status[chunk * S::LANES + i] = Status::Diverged { time: k as f64 * self.dt, signal: W::signals()[signal].name };
                self.stop(chunk * S::LANES + i, k, out);
            }
        }
        for (due, clock) in self.clock_due.iter_mut().zip(self.clocks) {
            if k >= *due {
                *due += clock.period;
            }
        }
    }

    pub(super) fn observe(&self, chunk: usize, k: Steps, selection: Signals, out: &mut [S]) {
        S::vectorize(Observe::<W, S>(Observation {
            structure: &self.structure,
            model: &self.models[chunk],
            inputs: &self.inputs[chunk],
            state: &self.states[chunk],
            t: S::splat(k as f64 * self.dt),
            selection,
            out,
        }));
    }

    fn next_event(&self, k: Steps) -> Steps {
        let mut next = self.steps.min((k / STRETCH + 1) * STRETCH).min(self.faults.next());
        for source in &self.sources {
            next = next.min(source.next());
        }
        if self.held.iter().any(|held| !self.sources[held.port].still()) {
            next = next.min((k / self.hold + 1) * self.hold);
        }
        let due = self.tick_due.iter().chain(&self.clock_due).copied().min();
        next = next.min(due.unwrap_or(Steps::MAX));
        next.max(k + 1)
    }
}
