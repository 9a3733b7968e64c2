//! Specification and outcome of a run.

use crate::command::SourcePlan;
use crate::fault::FaultSpec;
use crate::features;
use crate::time::Steps;
use std::sync::Arc;

/// One run, all in SI.
#[derive(Clone, Debug)]
pub struct RunSpec {
    /// In the order of the wiring's groups.
    pub parameters: Vec<f64>,
    /// One per port of the wiring.
    pub ports: Vec<SourcePlan>,
    /// Ports that waveforms drive.
    pub driven: Vec<bool>,
    pub faults: Vec<FaultSpec>,
    /// Parameters that the caller may change while the run goes on: what depends on them is in its structure from the start.
    pub tunable: Vec<usize>,
    /// In the order of the wiring's `INITIAL`; NaN where not given.
    pub initial: Vec<f64>,
    pub duration: f64,
    pub seed: u64,
    /// Number of the run, part of the key of its random numbers.
    pub run: u64,
}

/// Signals kept every `period` steps, from the start on; or features of them, and no rows.
#[derive(Clone, Debug)]
pub struct Clock {
    pub period: Steps,
    pub signals: Vec<usize>,
    pub features: Option<Arc<features::Plan>>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    Ok,
    /// The drive tripped at this time; the run went on without it.
    Tripped {
        time: f64,
        reason: String,
    },
    /// The winding passed its limit at this time: the drive opened its bridge, the run ended.
    Overheated {
        time: f64,
        temperature: f64,
    },
    /// A signal left all bounds, or the numbers, at this time.
    Diverged {
        time: f64,
        signal: &'static str,
    },
    Interrupted,
    /// The core panicked: a defect, and nothing is left of the run.
    Broken,
}

/// What is left of a run.
#[derive(Clone, Debug)]
pub struct RunOutput {
    pub status: Status,
    pub steps: Steps,
    pub time: f64,
    /// Seconds the block of this run spent integrating, divided by its runs.
    pub wall: f64,
    /// One per clock, row-major: the clock's signals, then the fault labels.
    pub clocks: Vec<Vec<f64>>,
    pub columns: Vec<usize>,
    /// One per clock: its features, none where it keeps rows.
    pub features: Vec<Vec<f64>>,
    /// All signals at the end.
    pub last: Vec<f64>,
}
