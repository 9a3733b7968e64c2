//! Many runs: sorted into lane blocks of one structure, blocks shared between threads.

use super::block::{structure, Block};
use super::kernels::Plain;
use super::spec::{Clock, RunOutput, RunSpec, Status};
use super::width::{with_lanes, Width};
use crate::actuator::{Tick, Wiring, MAX_CHUNKS};
use crate::panics::caught;
use crate::scalar::Scalar;
use crate::time::Steps;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// Progress out, interruption in; shared between threads.
#[derive(Debug, Default)]
pub struct Monitor {
    done: AtomicU64,
    cancelled: AtomicBool,
}

impl Monitor {
    pub fn done(&self) -> u64 {
        self.done.load(Relaxed)
    }
    pub fn cancel(&self) {
        self.cancelled.store(true, Relaxed);
    }
    /// Counts steps; false once the caller wants to stop.
    pub(super) fn advance(&self, steps: u64) -> bool {
        self.done.fetch_add(steps, Relaxed);
        !self.cancelled.load(Relaxed)
    }
}

/// What the runs of a block must have in common.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Shape<T> {
    structure: T,
    dt: u64,
    steps: Steps,
    grid: u64,
    ticks: Vec<Tick>,
    /// Of each port.
    pub(super) oscillators: Vec<usize>,
    choices: Vec<u8>,
}

pub(super) fn shape<W: Wiring>(run: &RunSpec, recorded: &[usize]) -> Shape<W::Structure> {
    let structure = structure::<W>(run, recorded);
    let dt = W::step(&run.parameters);
    let choices = W::groups()
        .iter()
        .flat_map(|g| g.variables)
        .zip(&run.parameters)
        .filter(|(v, _)| matches!(v.range, crate::variable::Range::Choice(_)))
        .map(|(_, &x)| x as u8)
        .collect();
    Shape {
        ticks: W::ticks(&run.parameters, &structure),
        structure,
        dt: dt.to_bits(),
        steps: (run.duration / dt).round() as Steps,
        grid: W::fault_grid(&run.parameters).to_bits(),
        oscillators: run.ports.iter().map(|p| p.oscillators()).collect(),
        choices,
    }
}

/// The runs, the last of them repeated up to whole chunks.
pub(super) fn padded<'a, S: Scalar>(runs: &[&'a RunSpec]) -> Vec<&'a RunSpec> {
    let count = runs.len().next_multiple_of(S::LANES);
    (0..count).map(|i| runs[i.min(runs.len() - 1)]).collect()
}

fn run_block<W: Wiring, S: Scalar>(runs: &[&RunSpec], clocks: &[Clock], recorded: &[usize], monitor: &Monitor) -> Vec<RunOutput> {
    Block::<W, S, Plain>::new(&padded::<S>(runs), runs.len(), Plain, clocks, recorded).run(monitor)
}

fn run_width<W: Wiring>(width: Width, runs: &[&RunSpec], clocks: &[Clock], recorded: &[usize], monitor: &Monitor) -> Vec<RunOutput> {
    with_lanes!(width.of(runs.len()), Lanes => run_block::<W, Lanes>(runs, clocks, recorded, monitor))
}

/// The runs of one block. What panics in company is run alone: a defect may cost the runs that have it, no others.
fn run_caught<W: Wiring>(width: Width, runs: &[&RunSpec], clocks: &[Clock], recorded: &[usize], monitor: &Monitor) -> Vec<RunOutput> {
    let work = || run_width::<W>(width, runs, clocks, recorded, monitor);
    match (caught(work), runs) {
        (Ok(outputs), _) => outputs,
        (Err(_), [run]) => vec![broken::<W>(run, clocks)],
        (Err(_), _) => runs.iter().flat_map(|run| run_caught::<W>(width, &[run], clocks, recorded, monitor)).collect(),
    }
}

/// What is left of a run in which the core panicked.
fn broken<W: Wiring>(run: &RunSpec, clocks: &[Clock]) -> RunOutput {
    RunOutput {
        status: Status::Broken,
        steps: 0,
        time: 0.0,
        wall: 0.0,
        clocks: vec![Vec::new(); clocks.len()],
        columns: clocks.iter().map(|c| c.signals.len() + run.faults.len()).collect(),
        features: clocks.iter().map(|c| vec![f64::NAN; c.features.as_ref().map_or(0, |plan| plan.len())]).collect(),
        last: vec![f64::NAN; W::signals().len()],
    }
}

/// The signals any clock keeps.
pub(super) fn recorded(clocks: &[Clock]) -> Vec<usize> {
    let mut all: Vec<usize> = clocks.iter().flat_map(|c| c.signals.iter().copied()).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Runs everything; the outputs stand in the order of the runs. `threads` 0 means all cores.
pub fn run_all<W: Wiring>(runs: &[RunSpec], clocks: &[Clock], threads: usize, width: Width, monitor: &Monitor) -> Vec<RunOutput> {
    let recorded = recorded(clocks);
    if let [run] = runs {
        return run_caught::<W>(width, &[run], clocks, &recorded, monitor);
    }
    let blocks = blocks::<W>(runs, &recorded, width, threads);
    let work = || -> Vec<(Vec<usize>, Vec<RunOutput>)> {
        blocks
            .into_par_iter()
            .map(|indices| {
                let members: Vec<&RunSpec> = indices.iter().map(|&i| &runs[i]).collect();
                let outputs = run_caught::<W>(width, &members, clocks, &recorded, monitor);
                (indices, outputs)
            })
            .collect()
    };
    let finished = match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    };
    let mut ordered: Vec<Option<RunOutput>> = runs.iter().map(|_| None).collect();
    for (indices, outputs) in finished {
        for (i, output) in indices.into_iter().zip(outputs) {
            ordered[i] = Some(output);
        }
    }
    ordered.into_iter().flatten().collect()
}

/// Groups runs by shape and cuts the groups into blocks: large enough to hide latencies, enough of them for
/// the threads.
pub(super) fn blocks<W: Wiring>(runs: &[RunSpec], recorded: &[usize], width: Width, threads: usize) -> Vec<Vec<usize>> {
    let mut order: Vec<Shape<W::Structure>> = Vec::new();
    let mut groups: HashMap<Shape<W::Structure>, Vec<usize>> = HashMap::new();
    for (i, run) in runs.iter().enumerate() {
        let key = shape::<W>(run, recorded);
        if !groups.contains_key(&key) {
            order.push(key.clone());
        }
        groups.entry(key).or_default().push(i);
    }
    let threads = if threads == 0 { rayon::current_num_threads() } else { threads };
    let lanes = width.lanes();
    let mut all = Vec::new();
    for key in order {
        let members = groups.remove(&key).unwrap_or_default();
        let fair = members.len().div_ceil(threads).div_ceil(lanes).max(1);
        let size = lanes * fair.min(MAX_CHUNKS);
        all.extend(members.chunks(size).map(<[usize]>::to_vec));
    }
    all
}
