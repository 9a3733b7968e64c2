//! Runs that go on from call to call: their caller steps them, reads their signals, changes inputs, parameters and faults
//! between steps, copies them whole. They have no clock of their own.

use super::batch::{blocks, padded, shape, Monitor, Shape};
use super::block::{feeds, structure, Block};
use super::kernels::Plain;
use super::spec::{RunSpec, Status};
use super::width::{with_lanes, Width};
use crate::actuator::{Machine, Signals, Wiring};
use crate::command::SourcePlan;
use crate::fault::FaultSpec;
use crate::scalar::Scalar;
use crate::time::Steps;

/// What a caller may change between two steps.
#[derive(Clone, Debug)]
pub enum Change {
    /// A port gets another sum of waveforms, in time from the start of the run.
    Input { port: usize, plan: SourcePlan },
    /// A parameter gets another value, beneath the faults.
    Parameter { index: usize, value: f64 },
    /// The fault in a place of the run's list; one behind the last is new.
    Fault { place: usize, spec: FaultSpec },
}

/// Why a change is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The equations in use leave out what it needs: it must be announced before the start (`RunSpec::tunable`).
    LeftOut,
    /// The parameter is the value of this port where nothing drives it; something does.
    Driven(usize),
}

/// A block of runs in progress.
pub trait Live: Send + Sync {
    /// Steps done.
    fn reached(&self) -> Steps;
    fn dt(&self) -> f64;
    /// Steps on by `count`, or until all runs have stopped. What happens at the step reached (ticks of the drive, changes
    /// of inputs) waits for the next call, so that its caller may see and change what it begins with. The status of a run
    /// is that of the step reached; one that has left its limits stands there.
    fn advance(&mut self, count: Steps);
    /// Signals of every run, row-major, as they stand now or when a run stopped.
    fn read(&self, signals: &[usize]) -> Vec<f64>;
    fn status(&self, run: usize) -> &Status;
    /// Does the structure hold what these signals need?
    fn carries(&self, signals: &[usize]) -> bool;
    fn change(&mut self, run: usize, change: Change) -> Result<(), Refusal>;
    /// From now on the equations hold these parameters' changes and these signals, too, in every run.
    fn widen(&mut self, tunable: &[usize], signals: &[usize]);
    fn copy(&self) -> Box<dyn Live>;
}

/// Lanes of runs and their specification.
struct Session<W: Wiring, S: Scalar> {
    block: Block<'static, W, S, Plain>,
    runs: Vec<RunSpec>,
    recorded: Vec<usize>,
    shape: Shape<W::Structure>,
}

impl<W: Wiring, S: Scalar> Session<W, S> {
    fn new(runs: Vec<RunSpec>, recorded: &[usize]) -> Self {
        let members: Vec<&RunSpec> = runs.iter().collect();
        let mut block = Block::new(&padded::<S>(&members), runs.len(), Plain, &[], recorded);
        block.renew(0);
        let shape = shape::<W>(&runs[0], recorded);
        Self { block, recorded: recorded.to_vec(), shape, runs }
    }

    /// Is the structure of a changed run the one in use? Oscillators may come and go.
    fn fits(&self, run: &RunSpec, recorded: &[usize]) -> bool {
        let mut shape = shape::<W>(run, recorded);
        shape.oscillators.clone_from(&self.shape.oscillators);
        shape == self.shape
    }

    /// A lane and, behind the last, those that repeat it to fill its chunk.
    fn lanes(&self, run: usize) -> std::ops::Range<usize> {
        let last = run + 1 == self.runs.len();
        run..if last { self.runs.len().next_multiple_of(S::LANES) } else { run + 1 }
    }
}

/// The run as it is after a change.
fn changed(run: &RunSpec, change: &Change) -> RunSpec {
    let mut run = run.clone();
    match change {
        Change::Input { port, plan } => {
            run.ports[*port] = plan.clone();
            run.driven[*port] = true;
        }
        Change::Parameter { index, value } => run.parameters[*index] = *value,
        Change::Fault { place, spec } if *place < run.faults.len() => run.faults[*place] = spec.clone(),
        Change::Fault { spec, .. } => run.faults.push(spec.clone()),
    }
    run
}

impl<W: Wiring, S: Scalar> Live for Session<W, S> {
    fn reached(&self) -> Steps {
        self.block.k
    }

    fn dt(&self) -> f64 {
        self.block.dt
    }

    fn advance(&mut self, count: Steps) {
        let mut out = vec![S::zero(); W::signals().len()];
        self.block.proceed(self.block.k + count, &Monitor::default(), &mut out);
        self.block.judge(&mut out);
    }

    fn read(&self, signals: &[usize]) -> Vec<f64> {
        let mut observed = vec![S::zero(); W::signals().len()];
        let mut table = Vec::with_capacity(self.runs.len() * signals.len());
        for run in 0..self.runs.len() {
            if run.is_multiple_of(S::LANES) {
                self.block.observe(run / S::LANES, self.block.k, Signals::of(signals), &mut observed);
            }
            let last = &self.block.last[run];
            let now = |&signal: &usize| if last.is_empty() { observed[signal].lane(run % S::LANES) } else { last[signal] };
            table.extend(signals.iter().map(now));
        }
        table
    }

    fn status(&self, run: usize) -> &Status {
        &self.block.status[run]
    }

    fn carries(&self, signals: &[usize]) -> bool {
        let mut recorded = self.recorded.clone();
        recorded.extend_from_slice(signals);
        self.fits(&self.runs[0], &recorded)
    }

    fn change(&mut self, run: usize, change: Change) -> Result<(), Refusal> {
        let next = changed(&self.runs[run], &change);
        if !self.fits(&next, &self.recorded) {
            return Err(Refusal::LeftOut);
        }
        let fed = if let Change::Parameter { index, .. } = change { feeds::<W>(index) } else { None };
        if let Some(port) = fed.filter(|&port| next.driven[port]) {
            return Err(Refusal::Driven(port));
        }
        self.runs[run] = next;
        if let (Some(port), Change::Parameter { value, .. }) = (fed, &change) {
            self.runs[run].ports[port] = SourcePlan::constant(*value);
        }
        for lane in self.lanes(run) {
            match change.clone() {
                Change::Input { port, plan } => self.block.drive(lane, port, plan),
                Change::Parameter { index, value } => {
                    self.block.set(lane, index, value);
                    if let Some(port) = fed {
                        self.block.feed(lane, port, SourcePlan::constant(value));
                    }
                }
                Change::Fault { place, spec } => self.block.replace_fault(lane, place, spec),
            }
        }
        self.block.renew(self.block.k);
        Ok(())
    }

    fn widen(&mut self, tunable: &[usize], signals: &[usize]) {
        for run in &mut self.runs {
            run.tunable.extend_from_slice(tunable);
        }
        self.recorded.extend_from_slice(signals);
        self.shape = shape::<W>(&self.runs[0], &self.recorded);
        self.block.widen(structure::<W>(&self.runs[0], &self.recorded), &self.runs[0].parameters, &self.recorded);
    }

    fn copy(&self) -> Box<dyn Live> {
        Box::new(Self { block: self.block.clone(), runs: self.runs.clone(), recorded: self.recorded.clone(), shape: self.shape.clone() })
    }
}

/// Blocks of runs that go on from call to call: which runs each holds, and the block. `recorded` are signals that will be
/// read and need equations of their own.
pub fn live<W: Wiring>(runs: &[RunSpec], recorded: &[usize], width: Width) -> Vec<(Vec<usize>, Box<dyn Live>)> {
    let mut runs = runs.to_vec();
    for run in &mut runs {
        for &port in W::Machine::LATE_PORTS {
            run.driven[port] = true;
        }
    }
    let one = |indices: Vec<usize>| {
        let members: Vec<RunSpec> = indices.iter().map(|&i| runs[i].clone()).collect();
        (indices, block::<W>(width, members, recorded))
    };
    blocks::<W>(&runs, recorded, width, 1).into_iter().map(one).collect()
}

fn block<W: Wiring>(width: Width, runs: Vec<RunSpec>, recorded: &[usize]) -> Box<dyn Live> {
    with_lanes!(width.of(runs.len()), Lanes => Box::new(Session::<W, Lanes>::new(runs, recorded)))
}
