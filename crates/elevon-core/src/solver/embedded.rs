//! One run for whoever embeds it: stepped, read and changed by numbers, kept as bytes. Its inputs are held values, its
//! faults' severities too. What it needs of memory it takes when it is made; only a fault or an input that was not
//! announced and becomes active takes more, once, since it chooses another form of the equations.

use super::batch::Monitor;
use super::block::{structure, Block};
use super::kernels::Plain;
use super::spec::{RunSpec, Status};
use crate::actuator::{Machine, Signals, Wiring};
use crate::command::SourcePlan;
use crate::kept::{Kept, Store};
use crate::time::Steps;

/// How a run stands, without texts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Standing {
    Ok,
    /// The drive tripped, or its control unit gave up, at this time; the run goes on.
    Tripped {
        time: f64,
    },
    /// The winding passed its limit: the run stands.
    Overheated {
        time: f64,
        temperature: f64,
    },
    /// A signal left all bounds or the numbers: the run stands.
    Diverged {
        time: f64,
        signal: &'static str,
    },
}

/// A single run that is stepped from outside.
pub trait Embedded: Send {
    /// Steps done.
    fn reached(&self) -> Steps;
    fn dt(&self) -> f64;
    /// Steps on by `count`; what happens at the step reached waits for the next call, as in a session.
    fn advance(&mut self, count: Steps);
    /// Signals as they stand now, by their indices.
    fn read(&mut self, signals: &[usize], out: &mut [f64]);
    fn standing(&self) -> Standing;
    /// Why the drive tripped. Takes memory.
    fn trip_text(&self) -> Option<String>;
    /// Holds a port at a value from now on.
    fn set_port(&mut self, port: usize, value: f64);
    /// Gives a fault a severity from now on.
    fn set_severity(&mut self, fault: usize, severity: f64);
    /// Writes all that changes during the run to a store, or becomes what is read there. What is read must be of a run made
    /// alike; afterwards the run is as that one was, to the bit.
    fn keep(&mut self, store: &mut Store);
}

struct Single<W: Wiring> {
    block: Block<'static, W, f64, Plain>,
    /// As it stands now: what is tunable, driven and faulty decides the form of the equations.
    run: RunSpec,
    recorded: Vec<usize>,
    ports: Vec<f64>,
    severities: Vec<f64>,
    /// Parameters that change or may: those of `run.tunable`.
    touched: Vec<bool>,
    observed: Vec<f64>,
}

impl<W: Wiring> Single<W> {
    fn new(mut run: RunSpec, recorded: &[usize]) -> Self {
        for &port in W::Machine::LATE_PORTS {
            run.driven[port] = true;
        }
        for port in 0..run.driven.len() {
            drive_where_equal::<W>(&mut run, port, recorded);
        }
        let ports: Vec<f64> = run.ports.iter().map(|plan| plan.value(0, 1.0)).collect();
        run.ports = ports.iter().map(|&value| SourcePlan::constant(value)).collect();
        let (parameters, signals) = (run.parameters.len(), W::signals().len());
        let mut block = Block::new(&[&run], 1, Plain, &[], recorded);
        block.embed(signals);
        block.renew(0);
        let mut touched = vec![false; parameters];
        run.tunable.iter().for_each(|&index| touched[index] = true);
        run.tunable = collected(&touched, Vec::with_capacity(parameters));
        let severities = run.faults.iter().map(|fault| fault.severity).collect();
        Self { block, recorded: recorded.to_vec(), ports, severities, touched, observed: vec![0.0; signals], run }
    }

    /// The equations that the run needs as it stands now.
    fn reform(&mut self) {
        let structure = structure::<W>(&self.run, &self.recorded);
        self.block.reform(structure, &self.run.parameters, &self.recorded);
    }

    /// Notes what a fault moves as changing from now on; true where that is new.
    fn announce(&mut self, fault: usize) -> bool {
        let before = self.run.tunable.len();
        for index in self.run.faults[fault].touched(self.block.dt) {
            if !self.touched[index] {
                self.touched[index] = true;
                self.run.tunable.push(index);
            }
        }
        self.run.tunable.len() > before
    }

    /// Inputs, severities and announcements as a store has them.
    fn keep_changes(&mut self, store: &mut Store) {
        self.ports.keep(store);
        self.severities.keep(store);
        let mut same = store.unchanged(&mut self.run.driven);
        same &= store.unchanged(&mut self.touched);
        if store.reads() {
            for (fault, &severity) in self.run.faults.iter_mut().zip(&self.severities) {
                fault.severity = severity;
            }
            self.run.tunable = collected(&self.touched, std::mem::take(&mut self.run.tunable));
        }
        if !same {
            self.reform();
        }
    }
}

/// Counts a port as driven where that needs no other equations: the first value that is set then takes no memory.
fn drive_where_equal<W: Wiring>(run: &mut RunSpec, port: usize, recorded: &[usize]) {
    let (before, driven) = (structure::<W>(run, recorded), run.driven[port]);
    run.driven[port] = true;
    run.driven[port] = driven || structure::<W>(run, recorded) == before;
}

/// The places that are marked, in memory that is there.
fn collected(marks: &[bool], mut places: Vec<usize>) -> Vec<usize> {
    places.clear();
    places.extend((0..marks.len()).filter(|&index| marks[index]));
    places
}

impl<W: Wiring> Embedded for Single<W> {
    fn reached(&self) -> Steps {
        self.block.k
    }

    fn dt(&self) -> f64 {
        self.block.dt
    }

    fn advance(&mut self, count: Steps) {
        let until = self.block.k.saturating_add(count);
        self.block.proceed(until, &Monitor::default(), &mut self.observed);
        self.block.judge(&mut self.observed);
    }

    fn read(&mut self, signals: &[usize], out: &mut [f64]) {
        let ended = !self.block.last[0].is_empty();
        if !ended {
            self.block.observe(0, self.block.k, Signals::of(signals), &mut self.observed);
        }
        let now = if ended { &self.block.last[0] } else { &self.observed };
        for (value, &signal) in out.iter_mut().zip(signals) {
            *value = now[signal];
        }
    }

    fn standing(&self) -> Standing {
        match self.block.status[0] {
            Status::Tripped { time, .. } => Standing::Tripped { time },
            Status::Overheated { time, temperature } => Standing::Overheated { time, temperature },
            Status::Diverged { time, signal } => Standing::Diverged { time, signal },
            _ => Standing::Ok,
        }
    }

    fn trip_text(&self) -> Option<String> {
        W::trip_reason(&self.block.models[0], &self.block.states[0], 0)
    }

    fn set_port(&mut self, port: usize, value: f64) {
        if self.ports[port].to_bits() == value.to_bits() {
            return;
        }
        self.ports[port] = value;
        if !self.run.driven[port] {
            self.run.driven[port] = true;
            self.reform();
        }
        self.block.hold(port, value);
    }

    fn set_severity(&mut self, fault: usize, severity: f64) {
        if self.severities[fault].to_bits() == severity.to_bits() {
            return;
        }
        self.severities[fault] = severity;
        self.run.faults[fault].severity = severity;
        if self.announce(fault) {
            self.reform();
        }
        self.block.set_severity(fault, severity);
    }

    fn keep(&mut self, store: &mut Store) {
        self.keep_changes(store);
        self.block.keep(store);
    }
}

/// A run by itself for whoever embeds it; `run` starts with its inputs' values at the start, and its faults may change.
/// `recorded` are signals that will be read and need equations of their own.
pub fn embedded<W: Wiring>(run: RunSpec, recorded: &[usize]) -> Box<dyn Embedded> {
    Box::new(Single::<W>::new(run, recorded))
}
