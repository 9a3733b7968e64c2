//! Runs as the caller describes them, resolved to the core's indices. Everything is checked here, so that the
//! core never sees a name or a length it does not expect.

use crate::features;
use crate::seam::bad;
use elevon_core::actuator::Severity;
use elevon_core::command::{catalogue, SourcePlan, Term, Wave};
use elevon_core::fault::{whole, FaultKind, FaultSpec, Named, Profile};
use elevon_core::registry::Model;
use elevon_core::solver::{fault_refusal, force_refusal, parameter_refusal, Clock, RunSpec};
use elevon_core::variable::{acts::records, Range};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

pub fn model(wiring: &str, fidelity: &str) -> PyResult<Model> {
    Model::find(wiring, fidelity).ok_or_else(|| bad(format!("no wiring {wiring:?} of fidelity {fidelity:?}")))
}

/// Paths of all parameters of a model and their places.
fn paths(model: Model) -> HashMap<String, usize> {
    let groups = model.groups();
    let all = groups.iter().flat_map(|g| (0..g.variables.len()).map(|i| g.path(i)));
    all.enumerate().map(|(i, p)| (p, i)).collect()
}

pub fn vector(model: Model, given: &PyReadonlyArray1<'_, f64>) -> PyResult<Vec<f64>> {
    let raw = given.as_slice()?.to_vec();
    let expected: usize = model.groups().iter().map(|g| g.variables.len()).sum();
    if raw.len() != expected {
        return Err(bad(format!("{} parameters given, {expected} expected", raw.len())));
    }
    in_range(model, &raw, "")?;
    Ok(raw)
}

/// The first parameter outside its range, as an error.
fn in_range(model: Model, raw: &[f64], start: &str) -> PyResult<()> {
    let all = model.groups().iter().flat_map(|g| (0..g.variables.len()).map(move |i| (g, i)));
    for (&x, (group, i)) in raw.iter().zip(all) {
        let range = group.variables[i].range;
        if !range.contains(x) {
            let (low, high, _) = range.bounds();
            if matches!(range, Range::Count(..)) && x >= low && x <= high {
                let path = group.path(i);
                return Err(bad(format!("{start}{path}: {x} is not a whole number; {} or {}", x.floor(), x.ceil())));
            }
            return Err(bad(format!("{start}{}: {x} is outside {low} to {high}", group.path(i))));
        }
    }
    Ok(())
}

/// Runs without an end are looked at over a day, s.
const LONGEST_LOOK: f64 = 86_400.0;

/// Bounds of the parameter in place `index`, where the value is beyond them.
fn outside(model: Model, index: usize, value: f64) -> Option<(f64, f64)> {
    let range = model.groups().iter().flat_map(|g| g.variables).nth(index)?.range;
    let (low, high, _) = range.bounds();
    (!range.contains(value)).then_some((low, high))
}

/// Steps are counted in whole numbers that a double holds exactly.
const MOST_STEPS: f64 = 9.0e15;

const WHOLE: &str = "the faults at their whole severity: ";

/// A required entry of a dictionary.
pub fn need<'py>(d: &Bound<'py, PyDict>, key: &str) -> PyResult<Bound<'py, PyAny>> {
    d.get_item(key)?.ok_or_else(|| bad(format!("missing {key:?}")))
}

fn points(d: &Bound<'_, PyDict>, key: &str) -> PyResult<Arc<[f64]>> {
    match d.get_item(key)? {
        Some(x) if !x.is_none() => Ok(x.extract::<Vec<f64>>()?.into()),
        _ => Ok(Arc::from([])),
    }
}

fn term(d: &Bound<'_, PyDict>) -> PyResult<Term> {
    let kind: String = need(d, "kind")?.extract()?;
    let record = catalogue().iter().find(|w| w.kind == kind).ok_or_else(|| bad(format!("no waveform {kind:?}")))?;
    let parameters: Vec<f64> = need(d, "parameters")?.extract()?;
    if parameters.len() != record.parameters.len() {
        return Err(bad(format!("{kind}: {} parameters given, {} expected", parameters.len(), record.parameters.len())));
    }
    let (times, values) = (points(d, "times")?, points(d, "values")?);
    let rising = times.windows(2).all(|w| w[0] < w[1]);
    if record.wave == Wave::Table && (times.is_empty() || times.len() != values.len() || !rising) {
        return Err(bad("table: times and values must be of one length and times rising"));
    }
    // Instants may lie at infinity, nothing else may.
    if let Some((p, x)) = record.parameters.iter().zip(&parameters).find(|(p, x)| x.is_nan() || (x.is_infinite() && p.unit != "s")) {
        return Err(bad(format!("{kind}: {} = {x} is not a number", p.name)));
    }
    if let Some(x) = times.iter().chain(values.iter()).find(|x| !x.is_finite()) {
        return Err(bad(format!("{kind}: {x} among its points is not a number")));
    }
    Ok(Term { wave: record.wave, enabled: need(d, "enabled")?.extract()?, parameters, times, values })
}

fn fault(model: &[FaultKind], places: &HashMap<String, usize>, d: &Bound<'_, PyDict>) -> PyResult<FaultSpec> {
    let kind: String = need(d, "kind")?.extract()?;
    let place: String = need(d, "place")?.extract()?;
    let given: HashMap<String, f64> = need(d, "attributes")?.extract()?;
    let profile = need(d, "profile")?.cast_into::<PyDict>()?;
    let shape: String = need(&profile, "kind")?.extract()?;
    let numbers: Vec<f64> = need(&profile, "parameters")?.extract()?;
    let profile = Profile::new(&shape, &numbers, points(&profile, "times")?, points(&profile, "values")?)
        .ok_or_else(|| bad(format!("profile {shape:?} with {} parameters", numbers.len())))?;
    let severity: f64 = need(d, "severity")?.extract()?;
    let named = Named { kind: &kind, place: &place, severity, attribute: &|name| given.get(name).copied() };
    named.resolved(model, &|path| places.get(path).copied(), profile).map_err(bad)
}

/// How the faults of a run are called.
fn names_of(faults: &Bound<'_, PyList>) -> PyResult<Vec<String>> {
    let name = |d: &Bound<'_, PyDict>| -> PyResult<String> {
        let (kind, place): (String, String) = (need(d, "kind")?.extract()?, need(d, "place")?.extract()?);
        Ok(format!("{kind}@{place}"))
    };
    faults.iter().map(|f| name(&f.cast_into::<PyDict>()?)).collect()
}

/// What a caller's runs are resolved against.
pub struct Resolver {
    pub model: Model,
    faults: Vec<FaultKind>,
    places: HashMap<String, usize>,
    signals: HashMap<&'static str, usize>,
}

impl Resolver {
    /// That of a model: made once, since writing out the paths of its catalogues takes as long as a short run.
    pub fn of(wiring: &str, fidelity: &str) -> PyResult<&'static Self> {
        static MADE: [OnceLock<Resolver>; Model::COUNT] = [const { OnceLock::new() }; Model::COUNT];
        let model = model(wiring, fidelity)?;
        Ok(MADE[model as usize].get_or_init(|| Self::new(model)))
    }

    fn new(model: Model) -> Self {
        let signals = model.signals().iter().enumerate().map(|(i, s)| (s.name, i)).collect();
        Self { model, faults: model.faults(), places: paths(model), signals }
    }

    pub fn parameter(&self, path: &str) -> PyResult<usize> {
        self.places.get(path).copied().ok_or_else(|| bad(format!("no parameter {path:?}")))
    }

    pub fn run(&self, d: &Bound<'_, PyDict>) -> PyResult<RunSpec> {
        let array = need(d, "parameters")?.extract::<PyReadonlyArray1<'_, f64>>()?;
        let mut parameters = vector(self.model, &array)?;
        if let Some(mode) = d.get_item("command_mode")? {
            self.set_mode(&mode.extract::<String>()?, &mut parameters)?;
        }
        let inputs = need(d, "inputs")?.cast_into::<PyDict>()?;
        let (ports, driven) = self.ports(&parameters, &inputs)?;
        let duration = self.duration(d, &parameters)?;
        for &port in self.model.held_ports() {
            self.settable(port, &ports[port], duration)?;
        }
        let initial: HashMap<String, f64> = need(d, "initial")?.extract()?;
        let names = self.model.initial();
        if let Some(unknown) = initial.keys().find(|k| !names.contains(&k.as_str())) {
            return Err(bad(format!("no initial value {unknown:?}")));
        }
        let initial: Vec<f64> = names.iter().map(|n| initial.get(*n).copied().unwrap_or(f64::NAN)).collect();
        if let Some(message) = self.model.refuses_start(&parameters, &initial) {
            return Err(bad(message));
        }
        let given = need(d, "faults")?.cast_into::<PyList>()?;
        let faults = self.faults(&given)?;
        in_range(self.model, &whole(&parameters, &faults), WHOLE)?;
        if let Some(message) = self.refused(&parameters, &faults, &names_of(&given)?) {
            return Err(bad(message));
        }
        Ok(RunSpec {
            parameters,
            ports,
            driven,
            faults,
            tunable: Vec::new(),
            initial,
            duration,
            seed: need(d, "seed")?.extract()?,
            run: need(d, "run")?.extract()?,
        })
    }

    /// What the command sets, where there is a choice.
    fn set_mode(&self, mode: &str, parameters: &mut [f64]) -> PyResult<()> {
        let modes = self.model.modes();
        let choice =
            modes.iter().position(|&m| m == mode).ok_or_else(|| bad(format!("command mode {mode:?}; modes: {}", modes.join(", "))))?;
        if modes.len() > 1 {
            parameters[self.parameter("control.mode")?] = choice as f64;
        }
        Ok(())
    }

    fn duration(&self, d: &Bound<'_, PyDict>, parameters: &[f64]) -> PyResult<f64> {
        let duration: f64 = need(d, "duration")?.extract()?;
        let steps = duration / self.model.step(parameters);
        if !(duration > 0.0 && steps < MOST_STEPS) {
            return Err(bad(format!("duration: {duration} s is {steps:e} solver steps; above 0 and below {MOST_STEPS:e} of them")));
        }
        Ok(duration)
    }

    pub fn faults(&self, given: &Bound<'_, PyList>) -> PyResult<Vec<FaultSpec>> {
        given.iter().map(|f| fault(&self.faults, &self.places, &f.cast_into::<PyDict>()?)).collect()
    }

    /// Refuses parameters or faults, changed while a run goes on, that no run could have begun with.
    pub fn allowed(&self, parameters: &[f64], faults: &[FaultSpec]) -> PyResult<()> {
        in_range(self.model, parameters, "")?;
        in_range(self.model, &whole(parameters, faults), WHOLE)?;
        let healthy = self.model.check(parameters).into_iter();
        let faulty = self.model.check_faulted(&whole(parameters, faults)).into_iter();
        match healthy.chain(faulty).find(|f| f.severity == Severity::Error) {
            Some(finding) => Err(bad(finding.message)),
            None => Ok(()),
        }
    }

    /// Why the faults cannot run at their whole severity: the one that alone is too much, and how much of it is not.
    fn refused(&self, parameters: &[f64], faults: &[FaultSpec], names: &[String]) -> Option<String> {
        let first =
            |some: &[FaultSpec]| self.model.check_faulted(&whole(parameters, some)).into_iter().find(|f| f.severity == Severity::Error);
        let finding = first(faults)?;
        let Some(alone) = (0..faults.len()).find(|&i| first(&faults[i..=i]).is_some()) else {
            return Some(format!("{} together at their whole severity: {}", names.join(" and "), finding.message));
        };
        let finding = first(&faults[alone..=alone])?;
        let scaled = |share: f64| FaultSpec { severity: share * faults[alone].severity, ..faults[alone].clone() };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            *(if first(&[scaled(middle)]).is_none() { &mut low } else { &mut high }) = middle;
        }
        let most = scaled(low).severity;
        let digits = 10f64.powf(3.0 - most.abs().log10().floor());
        let hint = if low > 0.0 { format!("; or a severity of at most {}", (most * digits).trunc() / digits) } else { String::new() };
        Some(format!("{} at its whole severity: {}{hint}", names[alone], finding.message))
    }

    /// Refuses parameters and faults by which a run has no derivative.
    pub fn differentiable(&self, run: &RunSpec, given: &Bound<'_, PyDict>, parameters: &[usize], faults: &[usize]) -> PyResult<()> {
        let all: Vec<_> = records(self.model.groups()).collect();
        let at = |path: &str| self.places.get(path).map_or(0.0, |&index| run.parameters[index]);
        let loaded = self.model.ports().iter().zip(&run.driven).any(|(port, &driven)| port.name == "output" && driven);
        for &index in parameters {
            let (path, record) = &all[index];
            let refused = parameter_refusal(path, record, run.parameters[index]).or_else(|| force_refusal(path, at, loaded));
            if let Some(reason) = refused {
                return Err(bad(format!("sensitivities: {path} = {}: {reason}", run.parameters[index])));
            }
        }
        let names = names_of(&need(given, "faults")?.cast_into::<PyList>()?)?;
        for &fault in faults {
            if let Some(reason) = fault_refusal(&run.faults[fault], &run.parameters, &all) {
                return Err(bad(format!("sensitivities: {} = {}: {reason}", names[fault], run.faults[fault].severity)));
            }
        }
        Ok(())
    }

    /// Signals by their names.
    pub fn signals(&self, names: &[String]) -> PyResult<Vec<usize>> {
        names.iter().map(|n| self.signals.get(n.as_str()).copied().ok_or_else(|| bad(format!("no signal {n:?}")))).collect()
    }

    /// A sum of waveforms.
    pub fn plan(&self, terms: &Bound<'_, PyList>) -> PyResult<SourcePlan> {
        let terms = terms.iter().map(|d| term(&d.cast_into::<PyDict>()?)).collect::<PyResult<Vec<_>>>()?;
        Ok(SourcePlan { terms })
    }

    fn ports(&self, parameters: &[f64], inputs: &Bound<'_, PyDict>) -> PyResult<(Vec<SourcePlan>, Vec<bool>)> {
        let (mut ports, mut driven) = (Vec::new(), Vec::new());
        for port in self.model.ports() {
            let plan = match inputs.get_item(port.name)? {
                Some(list) => self.plan(&list.cast_into::<PyList>()?)?,
                None => SourcePlan::default(),
            };
            driven.push(!plan.terms.is_empty());
            let constant = plan.terms.is_empty() && !port.parameter.is_empty();
            ports.push(if constant { SourcePlan::constant(parameters[self.parameter(port.parameter)?]) } else { plan });
        }
        for name in inputs.keys() {
            let name: String = name.extract()?;
            if !self.model.ports().iter().any(|p| p.name == name) {
                return Err(bad(format!("no input {name:?}")));
            }
        }
        Ok((ports, driven))
    }

    /// Refuses waveforms by which a port would set its parameter out of its range within `duration`, looked at a thousand times.
    pub fn settable(&self, port: usize, plan: &SourcePlan, duration: f64) -> PyResult<()> {
        let port = &self.model.ports()[port];
        let index = self.parameter(port.parameter)?;
        let looks = 1000;
        let dt = duration.min(LONGEST_LOOK) / looks as f64;
        for (k, value) in (0..=looks).map(|k| (k, plan.value(k, dt))) {
            if let Some((low, high)) = outside(self.model, index, value) {
                let (name, unit, time) = (port.name, port.unit, k as f64 * dt);
                return Err(bad(format!("{name}: {value:.6} {unit} at {time:.6} s is outside {low} to {high} {unit}")));
            }
        }
        Ok(())
    }

    /// Clocks and their names.
    pub fn clocks(&self, record: &Bound<'_, PyList>) -> PyResult<(Vec<Clock>, Vec<String>)> {
        let (mut clocks, mut names) = (Vec::new(), Vec::new());
        for item in record.iter() {
            let d = item.cast_into::<PyDict>()?;
            let period: u64 = need(&d, "period_steps")?.extract()?;
            if period == 0 {
                return Err(bad("period_steps: 0"));
            }
            let wanted: Vec<String> = need(&d, "signals")?.extract()?;
            let signals = self.signals(&wanted)?;
            let features = features::plan(&d)?.map(Arc::new);
            clocks.push(Clock { period, signals, features });
            names.push(need(&d, "clock")?.extract()?);
        }
        Ok((clocks, names))
    }
}
