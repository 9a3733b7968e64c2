//! Fixed-step solver: one run, lanes of runs, threads of lane blocks, dual numbers; all the same source.

mod batch;
mod block;
mod ending;
mod kernels;
mod rows;
mod spec;
mod summing;
mod width;

pub use batch::{run_all, sensitivities, Monitor, DERIVATIVES};
pub use spec::{Clock, RunOutput, RunSpec, Status};
pub use width::Width;
