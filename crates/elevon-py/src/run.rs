//! Runs without the GIL; the calling thread polls for progress and interruption.

use crate::seam::{bad, defect, failed, guarded};
use crate::spec::Resolver;
use elevon_core::panics::caught;
use elevon_core::solver::{derivatives, Clock, Monitor, RunOutput, RunSpec, Status, Width};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::HashMap;
use std::sync::mpsc::{sync_channel, Receiver, RecvTimeoutError};
use std::time::Duration;

const POLL: Duration = Duration::from_millis(100);

/// What the worker sends, if it lives to send it, and what `report` raised, after which it is not called again.
fn awaited<T>(receiver: &Receiver<T>, monitor: &Monitor, report: impl Fn(u64) -> PyResult<bool>) -> (Option<T>, Option<PyErr>) {
    let mut raised = None;
    loop {
        match receiver.recv_timeout(POLL) {
            Ok(outcome) => return (Some(outcome), raised),
            Err(RecvTimeoutError::Disconnected) => return (None, raised),
            Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
            Err(RecvTimeoutError::Timeout) => match report(monitor.done()) {
                Ok(true) => {}
                Ok(false) => monitor.cancel(),
                Err(error) => {
                    monitor.cancel();
                    raised = Some(error);
                }
            },
        }
    }
}

/// Runs `work` on a thread of its own and reports its progress about ten times a second. A callback that returns
/// False, or raises (Ctrl-C), stops the work; an exception goes on to the caller.
fn polled<T: Send>(
    py: Python<'_>,
    total: u64,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Monitor) -> T + Send,
) -> PyResult<T> {
    let monitor = Monitor::default();
    let callback = progress.map(|p| p.clone().unbind());
    let (result, raised) = py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, receiver) = sync_channel(1);
            let watched = &monitor;
            scope.spawn(move || {
                let outcome = caught(|| work(watched));
                // The receiver lives until the result has come: a failed send cannot happen.
                let _ = sender.send(outcome);
            });
            awaited(&receiver, &monitor, |done| {
                let fraction = done as f64 / total.max(1) as f64;
                Python::attach(|py| report(py, callback.as_ref(), fraction))
            })
        })
    });
    if let Some(error) = raised {
        return Err(error);
    }
    match result {
        Some(Ok(value)) => Ok(value),
        Some(Err(panicked)) => Err(defect(&panicked)),
        None => Err(failed("the core's thread ended without a result; this is a defect of elevon, please report it")),
    }
}

fn report(py: Python<'_>, callback: Option<&Py<PyAny>>, fraction: f64) -> PyResult<bool> {
    py.check_signals()?;
    match callback {
        Some(callback) => {
            let answer = callback.call1(py, (fraction.min(1.0),))?;
            Ok(!answer.bind(py).is_instance_of::<pyo3::types::PyBool>() || answer.extract::<bool>(py)?)
        }
        None => Ok(true),
    }
}

/// A status in a word and in a sentence.
pub fn described(status: &Status) -> (&'static str, String) {
    match status {
        Status::Ok => ("ok", String::new()),
        Status::Tripped { time, reason } if reason.is_empty() => ("tripped", format!("the drive tripped at {time} s")),
        Status::Tripped { time, reason } => ("tripped", format!("at {:.6} s: {reason}", time)),
        Status::Overheated { time, temperature } => {
            ("tripped", format!("the winding passed thermal.trip at {time} s, {temperature:.2} K: the drive opened its bridge"))
        }
        Status::Diverged { time, signal } => ("diverged", format!("{signal} diverged at {time} s")),
        Status::Broken => ("diverged", "the core panicked in this run; this is a defect of elevon, please report it".to_string()),
        Status::Interrupted => ("interrupted", "interrupted".to_string()),
    }
}

fn status(d: &Bound<'_, PyDict>, output: &RunOutput) -> PyResult<()> {
    let (name, mut message) = described(&output.status);
    match &output.status {
        Status::Diverged { signal, .. } => d.set_item("diverged_signal", *signal)?,
        Status::Interrupted => message = format!("interrupted at {} s", output.time),
        _ => {}
    }
    d.set_item("status", name)?;
    d.set_item("message", message)
}

/// The instants of the clocks: runs that recorded at the same instants share one array.
#[derive(Default)]
struct Times<'py>(HashMap<(u64, u64, usize), Bound<'py, PyArray1<f64>>>);

impl<'py> Times<'py> {
    fn get(&mut self, py: Python<'py>, dt: f64, period: u64, rows: usize) -> Bound<'py, PyArray1<f64>> {
        let instants = || PyArray1::from_iter(py, (0..rows).map(|i| (i as u64 * period) as f64 * dt));
        self.0.entry((dt.to_bits(), period, rows)).or_insert_with(instants).clone()
    }
}

/// The recording that was requested: the clocks and their names, and the names of all signals.
struct RecordPlan {
    clocks: Vec<Clock>,
    names: Vec<String>,
    signals: Vec<&'static str>,
}

/// A result as a dictionary. `width` numbers stand for each value (1, or 1 + derivatives).
fn result<'py>(
    py: Python<'py>,
    dt: f64,
    plan: &RecordPlan,
    width: usize,
    output: RunOutput,
    times: &mut Times<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    status(&d, &output)?;
    d.set_item("time", output.time)?;
    d.set_item("steps", output.steps)?;
    d.set_item("wall_s", output.wall)?;
    let last = PyDict::new(py);
    for (i, name) in plan.signals.iter().enumerate() {
        last.set_item(name, output.last[i * width])?;
    }
    d.set_item("final", last)?;
    let (kept, summed) = (PyDict::new(py), PyDict::new(py));
    let results = output.clocks.into_iter().zip(output.columns).zip(output.features);
    for ((clock, name), ((values, columns), features)) in plan.clocks.iter().zip(&plan.names).zip(results) {
        if clock.features.is_some() {
            summed.set_item(name, PyArray1::from_vec(py, features))?;
            continue;
        }
        let rows = values.len().checked_div(columns).unwrap_or(0);
        let entry = PyDict::new(py);
        entry.set_item("time", times.get(py, dt, clock.period, rows))?;
        entry.set_item("values", PyArray1::from_vec(py, values).reshape([rows, columns])? as Bound<'py, PyArray2<f64>>)?;
        kept.set_item(name, entry)?;
    }
    d.set_item("clocks", kept)?;
    d.set_item("features", summed)?;
    Ok(d)
}

fn read_runs(resolver: &Resolver, runs: &Bound<'_, PyList>) -> PyResult<Vec<RunSpec>> {
    runs.iter().map(|r| resolver.run(&r.cast_into::<PyDict>()?)).collect()
}

/// Runs everything; the results stand in the order of the runs.
#[pyfunction]
#[pyo3(signature = (wiring, fidelity, runs, record, threads=0, lanes="auto", progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn simulate<'py>(
    py: Python<'py>,
    wiring: &str,
    fidelity: &str,
    runs: &Bound<'py, PyList>,
    record: &Bound<'py, PyList>,
    threads: usize,
    lanes: &str,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    guarded(|| {
        let resolver = Resolver::of(wiring, fidelity)?;
        let specs = read_runs(resolver, runs)?;
        let (clocks, names) = resolver.clocks(record)?;
        let width =
            Width::by_name(lanes).ok_or_else(|| bad(format!("lanes {lanes:?} are not known here, or this processor cannot run them")))?;
        let model = resolver.model;
        let steps: Vec<f64> = specs.iter().map(|r| model.step(&r.parameters)).collect();
        let total = specs.iter().zip(&steps).map(|(r, dt)| (r.duration / dt).round() as u64).sum();
        let outputs = polled(py, total, progress, |monitor| model.run_all(&specs, &clocks, threads, width, monitor))?;
        let plan = RecordPlan { clocks, names, signals: model.signals().iter().map(|s| s.name).collect() };
        let list = PyList::empty(py);
        let mut times = Times::default();
        for (output, dt) in outputs.into_iter().zip(steps) {
            list.append(result(py, dt, &plan, 1, output, &mut times)?)?;
        }
        Ok(list)
    })
}

/// One run with exact derivatives. A list of results, one a pass of `derivatives_per_pass`; in each, every
/// value is followed by its derivatives.
#[pyfunction]
#[pyo3(signature = (wiring, fidelity, run, record, parameters, faults, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn sensitivities<'py>(
    py: Python<'py>,
    wiring: &str,
    fidelity: &str,
    run: &Bound<'py, PyDict>,
    record: &Bound<'py, PyList>,
    parameters: Vec<String>,
    faults: Vec<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    guarded(|| {
        let resolver = Resolver::of(wiring, fidelity)?;
        let spec = resolver.run(run)?;
        let (clocks, names) = resolver.clocks(record)?;
        if clocks.iter().any(|clock| clock.features.is_some()) {
            return Err(bad("features have no derivatives here"));
        }
        let wanted = parameters.iter().map(|p| resolver.parameter(p)).collect::<PyResult<Vec<_>>>()?;
        if let Some(missing) = faults.iter().find(|&&f| f >= spec.faults.len()) {
            return Err(bad(format!("fault {missing} of {}", spec.faults.len())));
        }
        resolver.differentiable(&spec, run, &wanted, &faults)?;
        let model = resolver.model;
        let dt = model.step(&spec.parameters);
        let chosen = wanted.len() + faults.len();
        let passes = chosen.div_ceil(derivatives()) as u64;
        let total = (spec.duration / dt).round() as u64 * passes;
        let outputs = polled(py, total, progress, |monitor| model.sensitivities(&spec, &wanted, &faults, &clocks, monitor))?;
        let outputs = outputs.ok_or_else(|| {
            bad("sensitivities need the reduced-order model (fidelity low) of an actuator without a state machine: switching has no useful derivative")
        })?;
        let plan = RecordPlan { clocks, names, signals: model.signals().iter().map(|s| s.name).collect() };
        let list = PyList::empty(py);
        let mut times = Times::default();
        for (i, output) in outputs.into_iter().enumerate() {
            let width = 1 + (chosen - derivatives() * i).min(derivatives());
            list.append(result(py, dt, &plan, width, output, &mut times)?)?;
        }
        Ok(list)
    })
}
