//! Features of a chunk of lanes, summed up from the rows of a clock as they gather.

use crate::features::{Accumulator, Plan};
use crate::scalar::Scalar;
use std::sync::Arc;

/// The features of a clock, which keeps no rows.
#[derive(Clone, Debug)]
pub(super) struct Summing {
    plan: Arc<Plan>,
    /// The gathered rows of one lane, column by column.
    sorted: Vec<Vec<f64>>,
    lanes: Vec<Accumulator>,
}

impl Summing {
    /// `most` rows come at a time.
    pub fn new(plan: &Arc<Plan>, columns: usize, lanes: usize, most: usize) -> Self {
        let sorted = vec![Vec::with_capacity(most); columns];
        Self { plan: Arc::clone(plan), sorted, lanes: vec![Accumulator::new(plan); lanes] }
    }

    /// Takes the gathered rows of one lane.
    pub fn push<S: Scalar>(&mut self, lane: usize, gathered: &[S]) {
        let columns = self.sorted.len();
        for (i, column) in self.sorted.iter_mut().enumerate() {
            column.clear();
            column.extend(gathered.iter().skip(i).step_by(columns).map(|x| x.lane(lane)));
        }
        self.lanes[lane].push(&self.plan.columns(self.sorted.iter().map(Vec::as_slice)));
    }

    pub fn finish(&self, lane: usize) -> Vec<f64> {
        self.lanes[lane].finish()
    }
}
