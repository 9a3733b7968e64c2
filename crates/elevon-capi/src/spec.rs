//! The document of a run: an actuator resolved to numbers, its inputs, faults and outputs, and the variables of an FMU.

use crate::json::Json;
use elevon_core::command::SourcePlan;
use elevon_core::fault::{FaultKind, FaultSpec, Named, Profile};
use elevon_core::registry::Model;
use elevon_core::solver::RunSpec;
use elevon_core::variable::Range;
use std::collections::HashMap;
use std::sync::Arc;

/// The form of the document that is read here.
const SCHEMA: f64 = 1.0;
/// Solver steps: a run has no end of its own.
const FOREVER: f64 = 4.0e15;

/// What a variable of an FMU is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Time,
    /// Place in the vector of parameters.
    Parameter(usize),
    Seed,
    /// Which faults the equations hold from the start: none, all, or one.
    Prepared,
    /// A further number of a fault: the fault and the place of its attribute.
    Attribute(usize, usize),
    Input(usize),
    /// Severity of a fault.
    Fault(usize),
    /// Place among the outputs.
    Output(usize),
}

/// A variable of an FMU; its value reference is its place.
#[derive(Clone, Debug)]
pub struct Variable {
    pub name: String,
    pub kind: Kind,
    /// Its values are named choices, numbered from one.
    pub choice: bool,
    /// Its values are whole numbers.
    pub whole: bool,
}

/// A fault that may act: its names, its numbers, and whether the equations hold it from the start.
#[derive(Clone, Debug)]
pub struct FaultEntry {
    pub kind: String,
    pub place: String,
    pub severity: f64,
    pub attributes: Vec<(String, f64)>,
    pub announced: bool,
}

/// All that a run is made from.
#[derive(Clone, Debug)]
pub struct Spec {
    pub model: Model,
    pub parameters: Vec<f64>,
    /// Of each port the value that is given; else that of its parameter, or zero.
    pub inputs: Vec<Option<f64>>,
    pub faults: Vec<FaultEntry>,
    /// Faults that contradict each other.
    pub exclusive: Vec<(usize, usize)>,
    pub initial: Vec<f64>,
    pub seed: u64,
    pub number: u64,
    /// Signals that are read.
    pub outputs: Vec<usize>,
    pub token: String,
    /// 0: those that are announced; 1: all; 2 and more: that fault, too.
    pub prepared: u64,
    pub variables: Vec<Variable>,
    /// Of the document, whatever has been set since: states are exchanged among instances of one.
    pub identity: u64,
    /// Places of the parameters by their paths: made once, for writing out the paths takes as long as a short run.
    places: Arc<HashMap<String, usize>>,
}

type Read<T> = Result<T, String>;

fn need<'a>(json: &'a Json, key: &str) -> Read<&'a Json> {
    json.get(key).ok_or_else(|| format!("{key:?} is missing"))
}

fn number(json: &Json, what: &str) -> Read<f64> {
    match json {
        Json::Number(x) => Ok(*x),
        _ => Err(format!("{what}: a number expected")),
    }
}

fn text<'a>(json: &'a Json, what: &str) -> Read<&'a str> {
    match json {
        Json::Text(x) => Ok(x),
        _ => Err(format!("{what}: a text expected")),
    }
}

fn list<'a>(json: &'a Json, what: &str) -> Read<&'a [Json]> {
    match json {
        Json::List(x) => Ok(x),
        _ => Err(format!("{what}: a list expected")),
    }
}

/// A whole number from 0 to below `limit`.
fn whole(json: &Json, what: &str, limit: f64) -> Read<u64> {
    let x = number(json, what)?;
    if x >= 0.0 && x < limit && x.fract() == 0.0 {
        Ok(x as u64)
    } else {
        Err(format!("{what}: {x} is no whole number from 0 to below {limit}"))
    }
}

fn place(json: &Json, what: &str, count: usize) -> Read<usize> {
    Ok(whole(json, what, count as f64)? as usize)
}

/// Entries of an object of numbers, each found among names.
fn numbers<T: Copy>(json: &Json, what: &str, find: impl Fn(&str) -> Option<T>) -> Read<Vec<(T, f64)>> {
    let Json::Object(entries) = json else {
        return Err(format!("{what}: an object expected"));
    };
    let one = |(name, value): &(String, Json)| {
        let found = find(name).ok_or_else(|| format!("{what}: {name:?} is not known"))?;
        Ok((found, number(value, name)?))
    };
    entries.iter().map(one).collect()
}

/// FNV-1a.
pub fn digest(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

impl Spec {
    /// # Errors
    /// What is wrong in the document.
    pub fn read(document: &str) -> Read<Self> {
        let json = Json::read(document)?;
        let schema = number(need(&json, "schema")?, "schema")?;
        if schema != SCHEMA {
            return Err(format!("schema {schema}; this binary reads {SCHEMA}"));
        }
        let (wiring, fidelity) = (text(need(&json, "wiring")?, "wiring")?, text(need(&json, "fidelity")?, "fidelity")?);
        let model = Model::find(wiring, fidelity).ok_or_else(|| format!("no wiring {wiring:?} of fidelity {fidelity:?}"))?;
        let faults = list(need(&json, "faults")?, "faults")?.iter().map(fault).collect::<Read<Vec<_>>>()?;
        let mut spec = Self {
            model,
            parameters: list(need(&json, "parameters")?, "parameters")?.iter().map(|x| number(x, "parameters")).collect::<Read<_>>()?,
            inputs: vec![None; model.ports().len()],
            exclusive: pairs(need(&json, "exclusive")?, faults.len())?,
            faults,
            initial: vec![f64::NAN; model.initial().len()],
            seed: whole(need(&json, "seed")?, "seed", 9.0e15)?,
            number: whole(need(&json, "number")?, "number", 9.0e15)?,
            outputs: signals(need(&json, "outputs")?, model)?,
            token: text(need(&json, "token")?, "token")?.to_string(),
            prepared: 0,
            variables: Vec::new(),
            identity: digest(document.as_bytes()),
            places: Arc::new(places(model)),
        };
        for (port, value) in numbers(need(&json, "inputs")?, "inputs", |name| model.ports().iter().position(|p| p.name == name))? {
            spec.inputs[port] = Some(value);
        }
        for (at, value) in numbers(need(&json, "initial")?, "initial", |name| model.initial().iter().position(|n| *n == name))? {
            spec.initial[at] = value;
        }
        spec.set_mode(text(need(&json, "mode")?, "mode")?)?;
        if let Some(rows) = json.get("variables") {
            spec.variables = list(rows, "variables")?.iter().map(|row| spec.variable(row)).collect::<Read<_>>()?;
        }
        Ok(spec)
    }

    fn set_mode(&mut self, mode: &str) -> Read<()> {
        let modes = self.model.modes();
        let choice = modes.iter().position(|m| *m == mode).ok_or_else(|| format!("no mode {mode:?}; {}", modes.join(", ")))?;
        let place = self.index("control.mode").filter(|_| modes.len() > 1);
        if let Some(value) = place.and_then(|at| self.parameters.get_mut(at)) {
            *value = choice as f64;
        }
        Ok(())
    }

    /// A row `[name, kind, places..., form]` of the table of variables.
    fn variable(&self, row: &Json) -> Read<Variable> {
        let row = list(row, "variables")?;
        let what = "variables";
        let [name, kind, places @ .., form] = row else {
            return Err(format!("{what}: a row is too short"));
        };
        let at = |i: usize, count: usize| place(places.get(i).ok_or_else(|| format!("{what}: a place is missing"))?, what, count);
        let kind = match text(kind, what)? {
            "time" => Kind::Time,
            "seed" => Kind::Seed,
            "prepared" => Kind::Prepared,
            "parameter" => Kind::Parameter(at(0, self.parameters.len())?),
            "input" => Kind::Input(at(0, self.inputs.len())?),
            "fault" => Kind::Fault(at(0, self.faults.len())?),
            "output" => Kind::Output(at(0, self.outputs.len())?),
            "attribute" => {
                let fault = at(0, self.faults.len())?;
                Kind::Attribute(fault, at(1, self.faults[fault].attributes.len())?)
            }
            other => return Err(format!("{what}: no kind {other:?}")),
        };
        let form = text(form, what)?;
        Ok(Variable { name: text(name, what)?.to_string(), kind, choice: form == "choice", whole: form == "whole" })
    }

    /// Place of a parameter by its path.
    pub fn index(&self, path: &str) -> Option<usize> {
        self.places.get(path).copied()
    }

    /// Path of the parameter in a place.
    pub fn path(&self, index: usize) -> String {
        let groups = self.model.groups();
        groups.iter().flat_map(|g| (0..g.variables.len()).map(|i| g.path(i))).nth(index).unwrap_or_default()
    }

    /// Ranges of all parameters.
    pub fn ranges(&self) -> impl Iterator<Item = Range> {
        self.model.groups().iter().flat_map(|g| g.variables).map(|v| v.range)
    }

    /// The value of a port where none is given.
    pub fn fallback(&self, port: usize) -> f64 {
        let path = self.model.ports()[port].parameter;
        self.index(path).and_then(|at| self.parameters.get(at)).copied().unwrap_or(0.0)
    }

    /// What the core runs.
    ///
    /// # Errors
    /// A number too many or too few, a fault that the model lacks.
    pub fn resolved(&self) -> Read<RunSpec> {
        let expected = self.ranges().count();
        if self.parameters.len() != expected {
            return Err(format!("{} parameters given, {expected} expected", self.parameters.len()));
        }
        let known = self.model.faults();
        let faults = self.faults.iter().map(|fault| self.fault(&known, fault)).collect::<Read<Vec<_>>>()?;
        let prepared = |at: usize| self.prepared == 1 || self.prepared == at as u64 + 2;
        let announced = (0..faults.len()).filter(|&at| self.faults[at].announced || prepared(at));
        let mut tunable: Vec<usize> = announced.flat_map(|at| faults[at].writes.iter().map(|w| w.index)).collect();
        tunable.sort_unstable();
        tunable.dedup();
        let fallback: Vec<f64> = (0..self.inputs.len()).map(|port| self.fallback(port)).collect();
        let value = |port: usize| self.inputs[port].unwrap_or(fallback[port]);
        let ports = 0..self.inputs.len();
        Ok(RunSpec {
            ports: ports.clone().map(|port| SourcePlan::constant(value(port))).collect(),
            // A port that is given what it has anyway stays undriven: the same bits, and no equations for nothing.
            driven: ports.map(|port| value(port).to_bits() != fallback[port].to_bits()).collect(),
            faults,
            tunable,
            initial: self.initial.clone(),
            duration: FOREVER * self.model.step(&self.parameters),
            seed: self.seed,
            run: self.number,
            parameters: self.parameters.clone(),
        })
    }

    fn fault(&self, known: &[FaultKind], entry: &FaultEntry) -> Read<FaultSpec> {
        let attribute = |name: &str| entry.attributes.iter().find(|(other, _)| other == name).map(|(_, value)| *value);
        let named = Named { kind: &entry.kind, place: &entry.place, severity: entry.severity, attribute: &attribute };
        named.resolved(known, &|path| self.index(path), Profile::Constant)
    }
}

fn places(model: Model) -> HashMap<String, usize> {
    let paths = model.groups().iter().flat_map(|g| (0..g.variables.len()).map(|i| g.path(i)));
    paths.enumerate().map(|(index, path)| (path, index)).collect()
}

fn fault(json: &Json) -> Read<FaultEntry> {
    let Json::Object(attributes) = need(json, "attributes")? else {
        return Err("attributes: an object expected".to_string());
    };
    Ok(FaultEntry {
        kind: text(need(json, "kind")?, "kind")?.to_string(),
        place: text(need(json, "place")?, "place")?.to_string(),
        severity: number(need(json, "severity")?, "severity")?,
        attributes: attributes.iter().map(|(name, x)| Ok((name.clone(), number(x, name)?))).collect::<Read<_>>()?,
        announced: json.get("announced") == Some(&Json::Flag(true)),
    })
}

fn pairs(json: &Json, count: usize) -> Read<Vec<(usize, usize)>> {
    let one = |pair: &Json| match list(pair, "exclusive")? {
        [a, b] => Ok((place(a, "exclusive", count)?, place(b, "exclusive", count)?)),
        _ => Err("exclusive: a pair expected".to_string()),
    };
    list(json, "exclusive")?.iter().map(one).collect()
}

fn signals(json: &Json, model: Model) -> Read<Vec<usize>> {
    let find = |name: &str| model.signals().iter().position(|s| s.name == name);
    let one = |x: &Json| text(x, "outputs").and_then(|name| find(name).ok_or_else(|| format!("outputs: no signal {name:?}")));
    list(json, "outputs")?.iter().map(one).collect()
}
