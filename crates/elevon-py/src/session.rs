//! Runs that go on from call to call: stepped, read and changed by the caller.

use crate::run::described;
use crate::seam::{bad, busy, failed, guarded};
use crate::spec::Resolver;
use elevon_core::command::SourcePlan;
use elevon_core::fault::FaultSpec;
use elevon_core::solver::{Change, Live, Refusal, Status, Width};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::{Mutex, TryLockError};

/// Steps of one stretch, all runs together, after which Ctrl-C is looked for: some ten milliseconds.
const WATCHED: u64 = 100_000;

/// The runs of a session, all at the same step.
struct Runs {
    resolver: &'static Resolver,
    blocks: Vec<(Vec<usize>, Box<dyn Live>)>,
    /// Block and place in it of each run.
    places: Vec<(usize, usize)>,
    parameters: Vec<Vec<f64>>,
    faults: Vec<Vec<FaultSpec>>,
}

impl Runs {
    /// `tunable` are paths of parameters that will change, `signals` those that will be read.
    fn new(
        wiring: &str,
        fidelity: &str,
        runs: &Bound<'_, PyList>,
        tunable: Vec<String>,
        signals: Vec<String>,
        lanes: &str,
    ) -> PyResult<Self> {
        let resolver = Resolver::of(wiring, fidelity)?;
        let width = Width::by_name(lanes).ok_or_else(|| bad(format!("lanes {lanes:?} are not known here")))?;
        let tunable = tunable.iter().map(|path| resolver.parameter(path)).collect::<PyResult<Vec<_>>>()?;
        let mut specs = Vec::new();
        for run in runs.iter() {
            let mut spec = resolver.run(&run.cast_into::<PyDict>()?)?;
            spec.tunable.clone_from(&tunable);
            specs.push(spec);
        }
        if specs.is_empty() {
            return Err(bad("a session needs at least one run"));
        }
        let dt = resolver.model.step(&specs[0].parameters);
        if specs.iter().any(|spec| resolver.model.step(&spec.parameters) != dt) {
            return Err(bad("the runs of a session must have one solver step"));
        }
        let blocks = resolver.model.live(&specs, &resolver.signals(&signals)?, width);
        let mut places = vec![(0, 0); specs.len()];
        for (block, (members, _)) in blocks.iter().enumerate() {
            for (place, &run) in members.iter().enumerate() {
                places[run] = (block, place);
            }
        }
        Ok(Self {
            resolver,
            blocks,
            places,
            parameters: specs.iter().map(|s| s.parameters.clone()).collect(),
            faults: specs.into_iter().map(|s| s.faults).collect(),
        })
    }

    /// Solver steps done.
    fn steps(&self) -> u64 {
        self.blocks.iter().map(|(_, block)| block.reached()).max().unwrap_or(0)
    }

    /// Solver step, s.
    fn step(&self) -> f64 {
        self.blocks[0].1.dt()
    }

    /// Steps every run on, without the GIL; the runs that have diverged by now.
    fn advance(&mut self, py: Python<'_>, count: u64) -> PyResult<Vec<usize>> {
        let most = (WATCHED / self.places.len() as u64).max(1);
        let mut left = count;
        while left > 0 {
            let part = left.min(most);
            let blocks = &mut self.blocks;
            py.detach(|| blocks.iter_mut().for_each(|(_, block)| block.advance(part)));
            left -= part;
            if left > 0 {
                py.check_signals()?;
            }
        }
        Ok((0..self.places.len()).filter(|&run| matches!(self.state(run), Status::Diverged { .. })).collect())
    }

    /// Signals by their index, shape (runs, signals).
    fn read<'py>(&self, py: Python<'py>, signals: Vec<usize>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let known = self.resolver.model.signals().len();
        if let Some(wrong) = signals.iter().find(|&&s| s >= known) {
            return Err(bad(format!("signal {wrong} of {known}")));
        }
        let mut table = vec![0.0; self.places.len() * signals.len()];
        for (members, block) in &self.blocks {
            let values = block.read(&signals);
            for (row, &run) in values.chunks_exact(signals.len().max(1)).zip(members) {
                table[run * signals.len()..][..signals.len()].copy_from_slice(row);
            }
        }
        PyArray1::from_vec(py, table).reshape([self.places.len(), signals.len()])
    }

    /// Do the equations in use carry these signals?
    fn carries(&self, signals: Vec<String>) -> PyResult<bool> {
        let signals = self.resolver.signals(&signals)?;
        Ok(self.blocks.iter().all(|(_, block)| block.carries(&signals)))
    }

    /// Status and message of a run.
    fn status(&self, run: usize) -> PyResult<(&'static str, String)> {
        self.place(run)?;
        Ok(described(self.state(run)))
    }

    /// When and in which signal a run diverged.
    fn divergence(&self, run: usize) -> PyResult<Option<(f64, &'static str)>> {
        self.place(run)?;
        Ok(match self.state(run) {
            Status::Diverged { time, signal } => Some((*time, signal)),
            _ => None,
        })
    }

    /// Gives a port of a run a sum of waveforms; false where that needs equations that are not in use.
    fn set_input(&mut self, run: usize, port: &str, terms: &Bound<'_, PyList>) -> PyResult<bool> {
        let (port, plan) = (self.port(port)?, self.resolver.plan(terms)?);
        self.settable(port, &plan)?;
        self.change(run, Change::Input { port, plan })
    }

    /// Gives a port of every run a value, held from now on; false as `set_input`.
    fn set_values(&mut self, port: &str, values: Vec<f64>) -> PyResult<bool> {
        let port = self.port(port)?;
        if values.len() != self.places.len() {
            return Err(bad(format!("{} values for {} runs", values.len(), self.places.len())));
        }
        if let Some(wrong) = values.iter().find(|x| !x.is_finite()) {
            return Err(bad(format!("{wrong} is not a number")));
        }
        for (run, &value) in values.iter().enumerate() {
            let plan = SourcePlan::constant(value);
            self.settable(port, &plan)?;
            if !self.change(run, Change::Input { port, plan })? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Gives a parameter of a run another value, beneath its faults; false as `set_input`.
    fn set_parameter(&mut self, run: usize, path: &str, value: f64) -> PyResult<bool> {
        let index = self.resolver.parameter(path)?;
        self.place(run)?;
        let mut next = self.parameters[run].clone();
        next[index] = value;
        self.resolver.allowed(&next, &self.faults[run])?;
        let done = self.change(run, Change::Parameter { index, value })?;
        if done {
            self.parameters[run] = next;
        }
        Ok(done)
    }

    /// Puts a fault in a place of a run's list, or behind the last; false as `set_input`.
    fn set_fault(&mut self, run: usize, place: usize, fault: &Bound<'_, PyDict>) -> PyResult<bool> {
        self.place(run)?;
        let given = PyList::new(fault.py(), [fault])?;
        let spec = self.resolver.faults(&given)?.remove(0);
        let (mut next, place) = (self.faults[run].clone(), place.min(self.faults[run].len()));
        next.splice(place..(place + 1).min(next.len()), [spec.clone()]);
        self.resolver.allowed(&self.parameters[run], &next)?;
        let done = self.change(run, Change::Fault { place, spec })?;
        if done {
            self.faults[run] = next;
        }
        Ok(done)
    }

    /// Equations from now on in which these parameters may change and these signals may be read.
    fn announce(&mut self, tunable: Vec<String>, signals: Vec<String>) -> PyResult<()> {
        let tunable = tunable.iter().map(|path| self.resolver.parameter(path)).collect::<PyResult<Vec<_>>>()?;
        let signals = self.resolver.signals(&signals)?;
        self.blocks.iter_mut().for_each(|(_, block)| block.widen(&tunable, &signals));
        Ok(())
    }

    /// A session in the same state, which goes on by itself.
    fn copy(&self) -> Self {
        Self {
            resolver: self.resolver,
            blocks: self.blocks.iter().map(|(members, block)| (members.clone(), block.copy())).collect(),
            places: self.places.clone(),
            parameters: self.parameters.clone(),
            faults: self.faults.clone(),
        }
    }

    /// Refuses waveforms that would set a parameter out of its range.
    fn settable(&self, port: usize, plan: &SourcePlan) -> PyResult<()> {
        let sets = self.resolver.model.held_ports().contains(&port);
        if sets {
            self.resolver.settable(port, plan, f64::INFINITY)
        } else {
            Ok(())
        }
    }

    fn port(&self, name: &str) -> PyResult<usize> {
        self.resolver.model.ports().iter().position(|p| p.name == name).ok_or_else(|| bad(format!("no input {name:?}")))
    }

    fn place(&self, run: usize) -> PyResult<(usize, usize)> {
        self.places.get(run).copied().ok_or_else(|| bad(format!("run {run} of {}", self.places.len())))
    }

    /// Status of a run that there is.
    fn state(&self, run: usize) -> &Status {
        let (block, place) = self.places[run];
        self.blocks[block].1.status(place)
    }

    fn change(&mut self, run: usize, change: Change) -> PyResult<bool> {
        let (block, place) = self.place(run)?;
        match self.blocks[block].1.change(place, change) {
            Ok(()) => Ok(true),
            Err(Refusal::LeftOut) => Ok(false),
            Err(Refusal::Driven(port)) => {
                let port = &self.resolver.model.ports()[port];
                Err(bad(format!("{} has no effect: {} is given from outside, by a waveform or a value", port.parameter, port.name)))
            }
        }
    }
}

/// Several runs of one wiring and fidelity, all at the same step; of one thread at a time.
#[pyclass(module = "elevon._core", frozen)]
pub struct Session(Mutex<Runs>);

impl Session {
    /// Works on the runs, unless another thread does, or a panic has left them half changed.
    fn on<T>(&self, work: impl FnOnce(&mut Runs) -> PyResult<T>) -> PyResult<T> {
        match self.0.try_lock() {
            Ok(mut runs) => guarded(move || work(&mut runs)),
            Err(TryLockError::WouldBlock) => Err(busy("the session is in use by another thread; it bears one at a time")),
            Err(TryLockError::Poisoned(_)) => Err(failed("the core panicked in this session: its state is lost; begin a new one")),
        }
    }
}

#[pymethods]
impl Session {
    /// `tunable` are paths of parameters that will change, `signals` those that will be read.
    #[new]
    fn new(
        wiring: &str,
        fidelity: &str,
        runs: &Bound<'_, PyList>,
        tunable: Vec<String>,
        signals: Vec<String>,
        lanes: &str,
    ) -> PyResult<Self> {
        guarded(|| Runs::new(wiring, fidelity, runs, tunable, signals, lanes).map(|runs| Self(Mutex::new(runs))))
    }

    /// Solver steps done.
    #[getter]
    fn steps(&self) -> PyResult<u64> {
        self.on(|runs| Ok(runs.steps()))
    }

    /// Solver step, s.
    #[getter]
    fn step(&self) -> PyResult<f64> {
        self.on(|runs| Ok(runs.step()))
    }

    /// Steps every run on, without the GIL; returns the runs that have diverged by now.
    fn advance(&self, py: Python<'_>, count: u64) -> PyResult<Vec<usize>> {
        self.on(|runs| runs.advance(py, count))
    }

    /// Signals by their index, shape (runs, signals).
    fn read<'py>(&self, py: Python<'py>, signals: Vec<usize>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.on(|runs| runs.read(py, signals))
    }

    /// Do the equations in use carry these signals?
    fn carries(&self, signals: Vec<String>) -> PyResult<bool> {
        self.on(|runs| runs.carries(signals))
    }

    /// Status and message of a run.
    fn status(&self, run: usize) -> PyResult<(&'static str, String)> {
        self.on(|runs| runs.status(run))
    }

    /// When and in which signal a run diverged.
    fn divergence(&self, run: usize) -> PyResult<Option<(f64, &'static str)>> {
        self.on(|runs| runs.divergence(run))
    }

    /// Gives a port of a run a sum of waveforms; false where that needs equations that are not in use.
    fn set_input(&self, run: usize, port: &str, terms: &Bound<'_, PyList>) -> PyResult<bool> {
        self.on(|runs| runs.set_input(run, port, terms))
    }

    /// Gives a port of every run a value, held from now on; false as `set_input`.
    fn set_values(&self, port: &str, values: Vec<f64>) -> PyResult<bool> {
        self.on(|runs| runs.set_values(port, values))
    }

    /// Gives a parameter of a run another value, beneath its faults; false as `set_input`.
    fn set_parameter(&self, run: usize, path: &str, value: f64) -> PyResult<bool> {
        self.on(|runs| runs.set_parameter(run, path, value))
    }

    /// Puts a fault in a place of a run's list, or behind the last; false as `set_input`.
    fn set_fault(&self, run: usize, place: usize, fault: &Bound<'_, PyDict>) -> PyResult<bool> {
        self.on(|runs| runs.set_fault(run, place, fault))
    }

    /// Equations from now on in which these parameters may change and these signals may be read.
    fn announce(&self, tunable: Vec<String>, signals: Vec<String>) -> PyResult<()> {
        self.on(|runs| runs.announce(tunable, signals))
    }

    /// A session in the same state, which goes on by itself.
    fn copy(&self) -> PyResult<Self> {
        self.on(|runs| Ok(Self(Mutex::new(runs.copy()))))
    }
}
