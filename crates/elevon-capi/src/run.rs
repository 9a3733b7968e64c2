//! A run with all checks of what its caller gives: nothing that the core does not expect reaches it.

use crate::spec::{digest, Spec};
use crate::text::Text;
use elevon_core::actuator::Severity;
use elevon_core::fault::{make_whole, FaultKind, FaultSpec};
use elevon_core::kept::{Kept, Store};
use elevon_core::registry::Model;
use elevon_core::solver::{Embedded, Standing};
use elevon_core::variable::Range;

/// Why a call was refused; the run is as it was, except after `Ended`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A number, an index or a pointer that cannot be.
    Argument,
    /// A value outside its range, alone or with the others.
    Range,
    /// A time that is no whole number of solver steps.
    Step,
    /// The run has left the finite numbers, and stands where that was found.
    Ended,
    /// Bytes that are no state of a run made alike.
    State,
}

/// How a step ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Ok,
    /// The drive tripped, or its control unit gave up; the run goes on.
    Tripped,
    /// The winding passed its limit: the run stands.
    Overheated,
}

/// Steps are counted in whole numbers that a double holds exactly.
const MOST_STEPS: f64 = 4.0e15;
/// Length, digest of the document, digest of the state.
const HEADER: usize = 24;

/// One run. All that it needs of memory it has once it is made, but for a fault or an input that was not announced: the first
/// time such a one acts.
pub struct Run {
    embedded: Box<dyn Embedded>,
    model: Model,
    identity: u64,
    outputs: Vec<usize>,
    inputs: Vec<f64>,
    severities: Vec<f64>,
    faults: Vec<FaultSpec>,
    fault_ranges: Vec<Range>,
    /// Of the parameter that a port sets.
    port_ranges: Vec<Option<Range>>,
    exclusive: Vec<(usize, usize)>,
    healthy: Vec<f64>,
    ranges: Vec<Range>,
    /// Memory for the parameters with their faults.
    whole: Vec<f64>,
    pub text: Text,
}

impl Run {
    /// # Errors
    /// What cannot be, with place, value and limit.
    pub fn new(spec: &Spec) -> Result<Self, String> {
        let resolved = spec.resolved()?;
        let model = spec.model;
        let path = |at: usize| spec.path(at);
        in_range(&resolved.parameters, spec.ranges(), path)?;
        if let Some(finding) = model.check(&resolved.parameters).into_iter().find(|f| f.severity == Severity::Error) {
            return Err(finding.message);
        }
        if let Some(message) = model.refuses_start(&resolved.parameters, &resolved.initial) {
            return Err(message);
        }
        let ports = 0..model.ports().len();
        let mut run = Self {
            model,
            identity: identity(spec),
            outputs: spec.outputs.clone(),
            inputs: ports.clone().map(|port| spec.inputs[port].unwrap_or_else(|| spec.fallback(port))).collect(),
            severities: resolved.faults.iter().map(|fault| fault.severity).collect(),
            faults: resolved.faults.clone(),
            fault_ranges: fault_ranges(spec),
            port_ranges: ports.map(|port| port_range(spec, port)).collect(),
            exclusive: spec.exclusive.clone(),
            healthy: resolved.parameters.clone(),
            ranges: spec.ranges().collect(),
            whole: resolved.parameters.clone(),
            text: Text::default(),
            embedded: model.embedded(resolved, &spec.outputs).ok_or("this processor has no fused multiply-add (AVX2 and FMA)")?,
        };
        for port in 0..run.inputs.len() {
            run.check_input(port, run.inputs[port]).map_err(|_| run.text.to_string())?;
        }
        run.check_together().map_err(|_| run.text.to_string())?;
        Ok(run)
    }

    /// Is it a run of this specification?
    pub fn fits(&self, spec: &Spec) -> bool {
        self.identity == identity(spec)
    }

    /// s.
    pub fn time(&self) -> f64 {
        self.embedded.reached() as f64 * self.embedded.dt()
    }

    /// Solver step, s.
    pub fn dt(&self) -> f64 {
        self.embedded.dt()
    }

    pub fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    pub fn severities(&self) -> &[f64] {
        &self.severities
    }

    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Steps on by a whole number of solver steps.
    ///
    /// # Errors
    /// `Step`, or `Ended` where the run has left the finite numbers.
    pub fn advance(&mut self, seconds: f64) -> Result<Verdict, Fault> {
        let dt = self.embedded.dt();
        let count = (seconds / dt).round();
        let fits =
            count >= 1.0 && count + (self.embedded.reached() as f64) < MOST_STEPS && (seconds - count * dt).abs() <= 1e-6 * dt * count;
        if !fits {
            self.text.set(format_args!("step {seconds:e} s: a whole number of solver steps of {dt:e} s expected"));
            return Err(Fault::Step);
        }
        self.embedded.advance(count as u64);
        self.verdict()
    }

    /// How the run stands.
    ///
    /// # Errors
    /// `Ended`.
    pub fn verdict(&mut self) -> Result<Verdict, Fault> {
        match self.embedded.standing() {
            Standing::Ok => Ok(Verdict::Ok),
            Standing::Tripped { .. } => Ok(Verdict::Tripped),
            Standing::Overheated { time, temperature } => {
                self.text.set(format_args!("the winding passed its limit at {time} s: {temperature:.1} K"));
                Ok(Verdict::Overheated)
            }
            Standing::Diverged { time, signal } => {
                self.text.set(format_args!("{signal} left the finite numbers or all bounds at {time} s"));
                Err(Fault::Ended)
            }
        }
    }

    /// Why the drive tripped; takes memory.
    pub fn trip_text(&mut self) {
        let text = self.embedded.trip_text().unwrap_or_else(|| "the drive tripped".to_string());
        self.text.set(format_args!("{text}"));
    }

    /// Outputs as they stand now, in their order.
    pub fn read(&mut self, out: &mut [f64]) {
        self.embedded.read(&self.outputs, out);
    }

    /// One of them.
    pub fn read_one(&mut self, output: usize) -> f64 {
        let mut value = [0.0];
        self.embedded.read(&self.outputs[output..=output], &mut value);
        value[0]
    }

    /// Would an input take a value?
    ///
    /// # Errors
    /// `Argument` or `Range`.
    pub fn check_input(&mut self, port: usize, value: f64) -> Result<(), Fault> {
        let record = &self.model.ports()[port];
        if !value.is_finite() {
            self.text.set(format_args!("{}: {value} is not a number", record.name));
            return Err(Fault::Argument);
        }
        if let Some(range) = self.port_ranges[port].filter(|range| !range.contains(value)) {
            let (low, high, _) = range.bounds();
            self.text.set(format_args!("{}: {value} is outside {low} to {high} {}", record.name, record.unit));
            return Err(Fault::Range);
        }
        Ok(())
    }

    /// Holds an input at a value from now on.
    ///
    /// # Errors
    /// As `check_input`.
    pub fn set_input(&mut self, port: usize, value: f64) -> Result<(), Fault> {
        self.check_input(port, value)?;
        self.inputs[port] = value;
        self.embedded.set_port(port, value);
        Ok(())
    }

    /// Gives faults severities from now on, all or none of them.
    ///
    /// # Errors
    /// `Argument` or `Range`, of one severity or of all together.
    pub fn set_severities(&mut self, changes: impl Iterator<Item = (usize, f64)> + Clone) -> Result<(), Fault> {
        for (fault, severity) in changes.clone() {
            self.check_severity(fault, severity)?;
        }
        for (fault, severity) in changes.clone() {
            self.faults[fault].severity = severity;
        }
        if let Err(refused) = self.check_together() {
            for (fault, &severity) in self.faults.iter_mut().zip(&self.severities) {
                fault.severity = severity;
            }
            return Err(refused);
        }
        for (fault, severity) in changes {
            self.severities[fault] = severity;
            self.embedded.set_severity(fault, severity);
        }
        Ok(())
    }

    fn check_severity(&mut self, fault: usize, severity: f64) -> Result<(), Fault> {
        let range = self.fault_ranges[fault];
        if range.contains(severity) {
            return Ok(());
        }
        let (low, high, _) = range.bounds();
        self.text.set(format_args!("fault {fault}: severity {severity} is outside {low} to {high}, or no whole number of what is counted"));
        Err(Fault::Range)
    }

    /// Can the severities be together, with these parameters?
    fn check_together(&mut self) -> Result<(), Fault> {
        let acts = |fault: usize| self.faults[fault].severity != 0.0;
        if let Some((a, b)) = self.exclusive.iter().find(|&&(a, b)| acts(a) && acts(b)) {
            self.text.set(format_args!("faults {a} and {b} contradict each other"));
            return Err(Fault::Range);
        }
        self.whole.clone_from(&self.healthy);
        make_whole(&mut self.whole, self.faults.iter().filter(|fault| fault.severity != 0.0));
        if let Some(at) = (0..self.whole.len()).find(|&at| !self.ranges[at].contains(self.whole[at])) {
            let (low, high, _) = self.ranges[at].bounds();
            self.text.set(format_args!("the faults at their severities: parameter {at}: {} is outside {low} to {high}", self.whole[at]));
            return Err(Fault::Range);
        }
        match self.model.check_faulted(&self.whole).into_iter().find(|f| f.severity == Severity::Error) {
            Some(finding) => {
                self.text.set(format_args!("{}", finding.message));
                Err(Fault::Range)
            }
            None => Ok(()),
        }
    }

    /// Bytes of a state.
    pub fn state_size(&mut self) -> usize {
        let mut count = Store::to(&mut []);
        self.embedded.keep(&mut count);
        HEADER + count.at()
    }

    /// Writes the state; `bytes` has room for all of it.
    ///
    /// # Errors
    /// `Argument` where it has not.
    pub fn save(&mut self, bytes: &mut [u8]) -> Result<usize, Fault> {
        let size = self.state_size();
        if bytes.len() < size {
            self.text.set(format_args!("{} bytes for a state of {size}", bytes.len()));
            return Err(Fault::Argument);
        }
        let (header, body) = bytes[..size].split_at_mut(HEADER);
        self.embedded.keep(&mut Store::to(body));
        let mut head = [size as u64, self.identity, digest(body)];
        head.keep(&mut Store::to(header));
        Ok(size)
    }

    /// Goes back, or forth, to a state.
    ///
    /// # Errors
    /// `State`: the bytes are none of a run made from the same document, or were changed.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        let size = self.state_size();
        if !whole_state(bytes, size, self.identity) {
            self.text.set(format_args!("no state of an instance made from the same document, or a damaged one"));
            return Err(Fault::State);
        }
        let mut store = Store::from(&bytes[HEADER..size]);
        self.embedded.keep(&mut store);
        // Inputs and severities stand first.
        let mut first = Store::from(&bytes[HEADER..size]);
        self.inputs.keep(&mut first);
        self.severities.keep(&mut first);
        for (fault, &severity) in self.faults.iter_mut().zip(&self.severities) {
            fault.severity = severity;
        }
        if store.sound() {
            Ok(())
        } else {
            self.text.set(format_args!("the state has entries that cannot be"));
            Err(Fault::State)
        }
    }
}

/// Of the document with what has been set since.
fn identity(spec: &Spec) -> u64 {
    let attributes = spec.faults.iter().flat_map(|fault| &fault.attributes).map(|(_, value)| *value);
    let numbers = spec.parameters.iter().copied().chain(attributes).map(f64::to_bits);
    let all = [spec.identity, spec.seed, spec.number, spec.prepared].into_iter().chain(numbers);
    all.fold(0, |hash: u64, number| digest(&(hash ^ number).to_le_bytes()))
}

/// Do the bytes begin with a state of this size, of this document, as it was written?
fn whole_state(bytes: &[u8], size: usize, identity: u64) -> bool {
    let Some(state) = bytes.get(..size) else {
        return false;
    };
    let (header, body) = state.split_at(HEADER);
    let mut head = [0_u64; 3];
    head.keep(&mut Store::from(header));
    head == [size as u64, identity, digest(body)]
}

fn in_range(parameters: &[f64], ranges: impl Iterator<Item = Range>, path: impl Fn(usize) -> String) -> Result<(), String> {
    let wrong = parameters.iter().zip(ranges).enumerate().find(|(_, (&x, range))| !range.contains(x));
    match wrong {
        Some((at, (x, range))) => {
            let (low, high, _) = range.bounds();
            Err(format!("{}: {x} is outside {low} to {high}, or no whole number of what is counted", path(at)))
        }
        None => Ok(()),
    }
}

fn fault_ranges(spec: &Spec) -> Vec<Range> {
    let known = spec.model.faults();
    let carries = |f: &FaultKind, kind: &str, place: &str| f.kind == kind && f.places.iter().any(|p| p.name == place);
    let range = |kind: &str, place: &str| known.iter().find(|f| carries(f, kind, place)).map_or(Range::Any, |f| f.range);
    spec.faults.iter().map(|fault| range(&fault.kind, &fault.place)).collect()
}

/// Range of the parameter that a port sets.
fn port_range(spec: &Spec, port: usize) -> Option<Range> {
    let sets = spec.model.held_ports().contains(&port);
    let index = spec.index(spec.model.ports()[port].parameter).filter(|_| sets)?;
    spec.ranges().nth(index)
}
