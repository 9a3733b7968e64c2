//! How runs end: by their time, by leaving the numbers or the limits, by heat, or interrupted.

use super::block::Block;
use super::kernels::Lift;
use super::spec::{RunOutput, Status};
use crate::actuator::{Signals, Wiring};
use crate::scalar::Scalar;
use crate::time::Steps;

/// Judges a lane at a time from the state of its chunk; true where it ends.
type Mark<B, T> = fn(&mut B, usize, f64, &T) -> bool;

impl<W: Wiring, S: Scalar, L: Lift<S>> Block<'_, W, S, L> {
    /// Lets `mark` judge every lane that still runs; what it stops keeps its signals of this instant.
    pub(super) fn watch(&mut self, k: Steps, out: &mut [S], mark: Mark<Self, W::State<S>>) {
        let time = k as f64 * self.dt;
        for chunk in 0..self.states.len() {
            let mut observed = false;
            for lane in chunk * S::LANES..((chunk + 1) * S::LANES).min(self.real) {
                if self.stopped[lane].is_none() && self.marked(lane, time, mark) {
                    if !observed {
                        self.observe(chunk, k, Signals::ALL, out);
                        observed = true;
                    }
                    self.stop(lane, k, out);
                }
            }
        }
    }

    fn marked(&mut self, lane: usize, time: f64, mark: Mark<Self, W::State<S>>) -> bool {
        let states = std::mem::take(&mut self.states);
        let marked = mark(self, lane, time, &states[lane / S::LANES]);
        self.states = states;
        marked
    }

    /// Has the lane left its limits? Not a number is beyond every limit.
    pub(super) fn mark_diverged(&mut self, lane: usize, time: f64, state: &W::State<S>) -> bool {
        let i = lane % S::LANES;
        let watched = W::watch(state);
        let beyond = watched.iter().find(|w| w.value.lane(i).is_nan() || w.value.lane(i).abs() > w.limit);
        if let Some(watch) = beyond {
            self.status[lane] = Status::Diverged { time, signal: watch.name };
        }
        beyond.is_some()
    }

    /// Marks a lane that tripped; true where that ends it.
    pub(super) fn mark_tripped(&mut self, lane: usize, time: f64, state: &W::State<S>) -> bool {
        let i = lane % S::LANES;
        if let Some(heat) = W::overheated(state).filter(|h| h.over.lane(i) > 0.0) {
            self.status[lane] = Status::Overheated { time, temperature: heat.temperature.lane(i) };
            return true;
        }
        if self.status[lane] == Status::Ok && W::tripped(state).lane(i) > 0.0 {
            let text = || W::trip_reason(&self.models[lane / S::LANES], state, i).unwrap_or_default();
            let reason = if self.texts { text() } else { String::new() };
            self.status[lane] = Status::Tripped { time, reason };
        }
        false
    }

    /// The lane neither moves nor records from step `k` on; it ends with the signals `out` of its chunk.
    pub(super) fn stop(&mut self, lane: usize, k: Steps, out: &[S]) {
        self.stopped[lane] = Some(k);
        self.rows[lane / S::LANES].end(lane % S::LANES, &self.lift);
        for &x in out {
            self.lift.emit(x, lane % S::LANES, &mut self.last[lane]);
        }
    }

    pub(super) fn interrupt(&mut self, k: Steps) {
        for lane in 0..self.real {
            if self.stopped[lane].is_none() {
                self.status[lane] = Status::Interrupted;
                self.stopped[lane] = Some(k);
            }
        }
    }

    pub(super) fn finish(mut self, k: Steps, mut out: Vec<S>) -> Vec<RunOutput> {
        let width = self.lift.width();
        let mut results = Vec::with_capacity(self.real);
        for lane in 0..self.real {
            if lane % S::LANES == 0 {
                self.observe(lane / S::LANES, k, Signals::ALL, &mut out);
            }
            if self.last[lane].is_empty() {
                let reached = self.stopped[lane];
                self.stop(lane, reached.unwrap_or(k), &out);
                self.mark_unfinished(lane, width);
            }
            let steps = self.stopped[lane].unwrap_or(k);
            let labels = self.faults.count(lane);
            let (clocks, features) = self.rows[lane / S::LANES].take(lane % S::LANES, &self.lift);
            results.push(RunOutput {
                status: self.status[lane].clone(),
                steps,
                time: steps as f64 * self.dt,
                wall: self.wall / self.real as f64,
                columns: self.clocks.iter().map(|c| (c.signals.len() + labels) * width).collect(),
                clocks,
                features,
                last: std::mem::take(&mut self.last[lane]),
            });
        }
        results
    }

    /// A run whose final signals are not all numbers has not come to its end.
    fn mark_unfinished(&mut self, lane: usize, width: usize) {
        if self.status[lane] == Status::Interrupted {
            return;
        }
        if let Some(at) = self.last[lane].iter().position(|x| !x.is_finite()) {
            let time = self.stopped[lane].unwrap_or_default() as f64 * self.dt;
            self.status[lane] = Status::Diverged { time, signal: W::signals()[at / width].name };
        }
    }
}
