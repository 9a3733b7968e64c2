//! What the solver does to one chunk of lanes with their instruction set enabled, and how numbers become scalars.

use super::rows::Rows;
use super::spec::{Clock, RunSpec};
use crate::actuator::{EventOf, ObservationOf, Stretch, StretchOf, Wiring};
use crate::fault::FaultLanes;
use crate::scalar::{Kernel, Scalar};
use crate::time::Steps;

/// Turns the plain numbers of a run into scalars: lanes by default, dual numbers with their seeds otherwise.
pub trait Lift<S> {
    /// Numbers carry slopes: parameters must reach the equations as scalars wherever they act.
    const SLOPES: bool = false;
    /// A parameter of the lanes from `first` on.
    fn parameter(&self, runs: &[&RunSpec], first: usize, index: usize) -> S;
    fn severity(&self, faults: &FaultLanes, lane: usize, fault: usize) -> S;
    fn emit(&self, x: S, lane: usize, out: &mut Vec<f64>);
    /// A row of values of one lane.
    #[inline(always)]
    fn emit_row(&self, row: &[S], lane: usize, out: &mut Vec<f64>)
    where
        S: Copy,
    {
        for &x in row {
            self.emit(x, lane, out);
        }
    }
    /// Numbers written per value and lane.
    fn width(&self) -> usize;
}

/// Lanes of plain runs.
#[derive(Clone, Copy)]
pub struct Plain;

impl<S: Scalar> Lift<S> for Plain {
    fn parameter(&self, runs: &[&RunSpec], first: usize, index: usize) -> S {
        S::from_fn(|i| runs[first + i].parameters[index])
    }
    fn severity(&self, faults: &FaultLanes, lane: usize, fault: usize) -> S {
        S::splat(faults.severity(lane, fault))
    }
    #[inline(always)]
    fn emit(&self, x: S, lane: usize, out: &mut Vec<f64>) {
        out.push(x.lane(lane));
    }
    #[inline(always)]
    fn emit_row(&self, row: &[S], lane: usize, out: &mut Vec<f64>) {
        out.extend(row.iter().map(|x| x.lane_at(lane)));
    }
    fn width(&self) -> usize {
        1
    }
}

pub(super) struct Advance<'a, W: Wiring, S: Scalar>(pub StretchOf<'a, W, S>);

impl<W: Wiring, S: Scalar> Kernel for Advance<'_, W, S> {
    /// Some lane has left its limits or tripped.
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        let Stretch { structure, models, inputs, states, from, count } = self.0;
        W::advance(Stretch { structure, models, inputs, states: &mut *states, from, count });
        let mut trouble = S::mask(false);
        for state in states.iter() {
            trouble = trouble | S::zero().lt(W::tripped(state));
            for watch in W::watch(state) {
                trouble = trouble | !watch.value.abs().le(S::splat(watch.limit));
            }
        }
        S::any(trouble)
    }
}

pub(super) struct Observe<'a, W: Wiring, S: Scalar>(pub ObservationOf<'a, W, S>);

impl<W: Wiring, S: Scalar> Kernel for Observe<'_, W, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        W::observe(self.0);
    }
}

/// Appends what was observed of one chunk to every clock that is due. A lane whose row is not all numbers ends before it.
pub(super) struct Record<'a, S: Scalar, L: Lift<S>> {
    pub observed: &'a [S],
    pub clocks: &'a [Clock],
    pub due: &'a [Steps],
    pub k: Steps,
    pub faults: &'a FaultLanes,
    pub lift: &'a L,
    pub rows: &'a mut Rows<S>,
}

impl<S: Scalar, L: Lift<S>> Kernel for Record<'_, S, L> {
    /// The lanes that ended, each with the signal in which it left the numbers.
    type Output = Vec<(usize, usize)>;
    #[inline(always)]
    fn run(self) -> Self::Output {
        let mut lost = Vec::new();
        for (i, (clock, &due)) in self.clocks.iter().zip(self.due).enumerate() {
            if due <= self.k {
                if !numbers(clock, self.observed) {
                    self.rows.lose(clock, self.observed, self.lift, &mut lost);
                }
                self.rows.append(i, clock, self.observed, self.faults, self.lift);
            }
        }
        lost
    }
}

pub(super) struct Ticking<'a, W: Wiring, S: Scalar>(pub EventOf<'a, W, S>);

impl<W: Wiring, S: Scalar> Kernel for Ticking<'_, W, S> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        W::tick(self.0);
    }
}

/// Is all of a row numbers, in every lane?
#[inline(always)]
fn numbers<S: Scalar>(clock: &Clock, observed: &[S]) -> bool {
    let largest = S::splat(f64::MAX);
    let mut all = S::mask(true);
    for &signal in &clock.signals {
        all = all & observed[signal].abs().le(largest);
    }
    !S::any(!all)
}
