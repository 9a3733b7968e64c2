//! What a session changes in a block between two steps.

use super::block::Block;
use super::kernels::Lift;
use crate::actuator::{Signals, Tick, Wiring};
use crate::command::SourcePlan;
use crate::fault::FaultSpec;
use crate::scalar::Scalar;

impl<W: Wiring, S: Scalar, L: Lift<S>> Block<'_, W, S, L> {
    /// Other equations from the present step on, in which all that runs so far goes on as it is; what is new ticks from the
    /// next of its own instants on.
    pub(super) fn widen(&mut self, structure: W::Structure, raw: &[f64], recorded: &[usize]) {
        let ticks = W::ticks(raw, &structure);
        let due = |tick: &Tick| {
            let running = self.ticks.iter().position(|other| other == tick);
            running.map_or_else(|| tick.first + self.k.saturating_sub(tick.first).next_multiple_of(tick.period), |at| self.tick_due[at])
        };
        self.tick_due = ticks.iter().map(due).collect();
        self.ticks = ticks;
        let before = std::mem::replace(&mut self.structure, structure);
        self.selection = Signals::of(recorded);
        self.stale = true;
        self.renew(self.k);
        for (model, state) in self.models.iter().zip(&mut self.states) {
            W::join(model, &before, &self.structure, state);
        }
    }

    /// A lane gets another value of a parameter, which acts from the present step on.
    pub(super) fn set(&mut self, lane: usize, index: usize, value: f64) {
        let place = &mut self.healthy[lane / S::LANES][index];
        let before = *place;
        *place = S::from_fn(|i| if i == lane % S::LANES { value } else { before.lane(i) });
        self.stale = true;
    }

    /// A port of a lane gets another value of its parameter.
    pub(super) fn feed(&mut self, lane: usize, port: usize, plan: SourcePlan) {
        self.sources[port].replace(lane, plan);
    }

    /// A port of a lane gets another sum of waveforms, which acts from the present step on.
    pub(super) fn drive(&mut self, lane: usize, port: usize, plan: SourcePlan) {
        self.feed(lane, port, plan);
        for held in self.held.iter_mut().filter(|held| held.port == port) {
            held.driven[lane] = true;
            self.stale = true;
        }
    }

    /// A lane gets another fault, which acts from the present step on.
    pub(super) fn replace_fault(&mut self, lane: usize, fault: usize, spec: FaultSpec) {
        self.faults.replace(lane, fault, spec);
        self.stale = true;
    }
}
