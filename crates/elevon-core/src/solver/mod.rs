//! Fixed-step solver: one run, lanes of runs, threads of lane blocks, dual numbers; all the same source.

mod batch;
mod block;
mod changes;
mod differentiable;
mod dual;
mod embedded;
mod embedding;
mod ending;
mod kernels;
mod live;
mod rows;
mod spec;
mod summing;
mod width;

pub use batch::{run_all, Monitor};
pub use differentiable::{fault_refusal, force_refusal, parameter_refusal};
pub use dual::{derivatives, sensitivities};
pub use embedded::{embedded, Embedded, Standing};
pub use live::{live, Change, Live, Refusal};
pub use spec::{Clock, RunOutput, RunSpec, Status};
pub use width::Width;
