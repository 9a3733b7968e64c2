//! What the clocks of one chunk of lanes recorded. Rows gather as whole vectors while the run goes on and are sorted into
//! one table a lane some hundred rows at a time: a store a signal instead of one a signal and lane. A clock with features
//! sums them up from the sorted rows and keeps none.

use super::kernels::Lift;
use super::spec::Clock;
use super::summing::Summing;
use crate::fault::FaultLanes;
use crate::scalar::Scalar;
use crate::time::Steps;

/// Rows of a clock with features that gather before they are sorted by lane.
const SUMMED: usize = 256;
/// Vectors of other clocks that gather: they stay in the nearest cache.
const GATHERED: usize = 384;

/// One clock of one chunk: rows of the clock's signals, then of the fault labels (as many as the lane with most of them has).
#[derive(Clone, Debug)]
struct Table<S> {
    columns: usize,
    /// Rows that gather.
    most: usize,
    /// Columns of fault labels.
    labels: usize,
    gathered: Vec<S>,
    /// Row-major tables of the lanes that are recorded.
    lanes: Vec<Vec<f64>>,
    summing: Option<Summing>,
}

/// The tables of one chunk, one a clock.
#[derive(Clone, Debug)]
pub(super) struct Rows<S> {
    first: usize,
    /// Fault labels of each lane.
    labels: Vec<usize>,
    /// Lanes that have stopped, and padding.
    ended: Vec<bool>,
    tables: Vec<Table<S>>,
}

impl<S: Scalar> Rows<S> {
    /// For the lanes `first..first + S::LANES`, of which those from `real` on are padding; capacity for a run of `steps`.
    pub fn new<L: Lift<S>>(first: usize, real: usize, clocks: &[Clock], faults: &FaultLanes, steps: Steps, lift: &L) -> Self {
        let all = first..first + S::LANES;
        let labels: Vec<usize> = all.clone().map(|lane| faults.count(lane)).collect();
        let most_labels = labels.iter().copied().max().unwrap_or(0);
        let ended: Vec<bool> = all.map(|lane| lane >= real).collect();
        let table = |clock: &Clock| {
            let summing = clock.features.as_ref().map(|plan| Summing::new(plan, clock.signals.len(), S::LANES, SUMMED));
            let kept = if summing.is_some() { 0 } else { (steps / clock.period + 1) as usize };
            let labelled = if summing.is_some() { 0 } else { most_labels };
            let capacity = |(labels, &ended): (&usize, &bool)| if ended { 0 } else { kept * (clock.signals.len() + labels) * lift.width() };
            let columns = clock.signals.len() + labelled;
            let most = if summing.is_some() { SUMMED } else { (GATHERED / columns.max(1)).max(1) };
            Table {
                columns,
                most,
                labels: labelled,
                gathered: Vec::with_capacity(most.min((steps / clock.period + 1) as usize) * columns),
                lanes: labels.iter().zip(&ended).map(|lane| Vec::with_capacity(capacity(lane))).collect(),
                summing,
            }
        };
        let tables = clocks.iter().map(table).collect();
        Self { first, labels, ended, tables }
    }

    /// Appends a row to the table of clock `index`.
    #[inline(always)]
    pub fn append<L: Lift<S>>(&mut self, index: usize, clock: &Clock, observed: &[S], faults: &FaultLanes, lift: &L) {
        let Table { columns, most, labels, gathered, .. } = &mut self.tables[index];
        gathered.extend(clock.signals.iter().map(|&signal| observed[signal]));
        for label in 0..*labels {
            gathered.push(S::from_fn(|lane| faults.label(self.first + lane, label)));
        }
        if gathered.len() >= *most * *columns {
            self.sort(index, lift);
        }
    }

    /// The gathered rows of clock `index` go to the tables of the lanes that still record.
    #[inline(never)]
    fn sort<L: Lift<S>>(&mut self, index: usize, lift: &L) {
        let Table { columns, labels, gathered, lanes, summing, .. } = &mut self.tables[index];
        for (lane, out) in lanes.iter_mut().enumerate().filter(|(lane, _)| !self.ended[*lane]) {
            if let Some(summing) = summing {
                summing.push(lane, gathered);
                continue;
            }
            let used = *columns - *labels + self.labels[lane];
            if used == *columns {
                lift.emit_row(gathered, lane, out);
                continue;
            }
            for row in gathered.chunks_exact((*columns).max(1)) {
                lift.emit_row(&row[..used], lane, out);
            }
        }
        gathered.clear();
    }

    /// Ends the lanes whose row of `clock` is not all numbers, and states in which signal each of them is not.
    #[inline(never)]
    pub fn lose<L: Lift<S>>(&mut self, clock: &Clock, observed: &[S], lift: &L, lost: &mut Vec<(usize, usize)>) {
        for lane in 0..S::LANES {
            let wrong = clock.signals.iter().find(|&&signal| !observed[signal].lane(lane).is_finite());
            if let Some(&signal) = wrong.filter(|_| !self.ended[lane]) {
                self.end(lane, lift);
                lost.push((lane, signal));
            }
        }
    }

    /// The lane records nothing from now on.
    pub fn end<L: Lift<S>>(&mut self, lane: usize, lift: &L) {
        for index in 0..self.tables.len() {
            self.sort(index, lift);
        }
        self.ended[lane] = true;
    }

    /// The tables of one lane, row-major: its signals, then its fault labels; and its features, where a clock has them.
    pub fn take<L: Lift<S>>(&mut self, lane: usize, lift: &L) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        for index in 0..self.tables.len() {
            self.sort(index, lift);
        }
        let one = |table: &mut Table<S>| {
            let features = table.summing.as_ref().map_or(Vec::new(), |summing| summing.finish(lane));
            (std::mem::take(&mut table.lanes[lane]), features)
        };
        self.tables.iter_mut().map(one).unzip()
    }
}
