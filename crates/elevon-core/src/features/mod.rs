//! Features of a motion, summed up while its rows pass by: rows of a running simulation or of a log, by the same code.
//!
//! A [`Plan`] states which features, of which columns, at which rate; an [`Accumulator`] takes the rows, block by block,
//! and holds sums of a fixed size. How the rows are cut into blocks changes no bit.

mod bands;
mod catalogue;
mod fft;
mod friction;
mod level;
mod lost_motion;
mod moments;
mod moving;
mod orders;
mod phases;
mod plan;
mod rows;
mod slow;

pub use catalogue::{records, Record};
pub use plan::{Accumulator, Plan, Settings};
pub use rows::{Columns, Role};
