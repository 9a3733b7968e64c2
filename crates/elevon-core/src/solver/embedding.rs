//! What an embedded run asks of its block: changes in place, another form of the equations, its state as bytes.

use super::block::Block;
use super::kernels::Plain;
use super::spec::Status;
use crate::actuator::Wiring;
use crate::kept::{Kept, Store};
use crate::time::Steps;

impl<W: Wiring> Block<'_, W, f64, Plain> {
    /// Takes the memory that a run needs later on; no text is made while it runs.
    pub(super) fn embed(&mut self, signals: usize) {
        self.texts = false;
        self.last[0].reserve(signals);
    }

    /// Goes on by other equations from the present step on, where they are others.
    pub(super) fn reform(&mut self, structure: W::Structure, raw: &[f64], recorded: &[usize]) {
        if structure != self.structure {
            self.widen(structure, raw, recorded);
        }
    }

    /// Holds a port at a value from the present step on.
    pub(super) fn hold(&mut self, port: usize, value: f64) {
        self.sources[port].hold(0, value);
        for held in self.held.iter_mut().filter(|held| held.port == port) {
            held.driven[0] = true;
            self.stale = true;
        }
        self.renew(self.k);
    }

    /// Gives a fault a severity from the present step on.
    pub(super) fn set_severity(&mut self, fault: usize, severity: f64) {
        self.faults.set_severity(0, fault, severity);
        self.stale = true;
        self.renew(self.k);
    }

    pub(super) fn keep(&mut self, store: &mut Store) {
        self.k.keep(store);
        self.trouble.keep(store);
        self.keep_ending(store);
        self.tick_due.keep(store);
        for source in &mut self.sources {
            source.keep(store);
        }
        for held in &mut self.held {
            held.driven.keep(store);
        }
        self.faults.keep(0, store);
        if store.reads() {
            self.stale = false;
            self.pack_inputs();
            self.derive(0);
        }
        W::keep(&mut self.states[0], store);
    }

    /// Status, and where the run has ended its signals then.
    fn keep_ending(&mut self, store: &mut Store) {
        let (mut code, mut time, mut value) = match self.status[0] {
            Status::Tripped { time, .. } => (1_u8, time, 0.0),
            Status::Overheated { time, temperature } => (2, time, temperature),
            Status::Diverged { time, signal } => (3, time, self.watched(signal)),
            _ => (0, 0.0, 0.0),
        };
        code.keep(store);
        time.keep(store);
        value.keep(store);
        self.status[0] = match code {
            0 => Status::Ok,
            1 => Status::Tripped { time, reason: String::new() },
            2 => Status::Overheated { time, temperature: value },
            _ => Status::Diverged { time, signal: W::watch(&self.states[0]).get(value as usize).map_or("", |watch| watch.name) },
        };
        let mut ended: Steps = self.stopped[0].map_or(0, |step| step + 1);
        ended.keep(store);
        self.stopped[0] = ended.checked_sub(1);
        let signals = if self.stopped[0].is_some() { W::signals().len() } else { 0 };
        self.last[0].resize(signals, 0.0);
        // As much room whether it has ended or not.
        for place in 0..W::signals().len() {
            self.last[0].get_mut(place).unwrap_or(&mut 0.0).keep(store);
        }
    }

    /// Place of a signal among those that are watched.
    fn watched(&self, signal: &str) -> f64 {
        W::watch(&self.states[0]).iter().position(|watch| watch.name == signal).unwrap_or_default() as f64
    }
}
