//! Faults are data: a kind, a place, a severity in a physical unit over time, mapped to parameters that every
//! component always contains in their healthy form.

mod catalogue;
mod named;
mod profile;
pub mod rate;
mod schedule;

pub use catalogue::{Attribute, FaultKind, Op, Place, Target};
pub use named::Named;
pub use profile::{profiles, Profile, ProfileRecord};
pub use schedule::{make_whole, whole, FaultLanes, FaultSpec, Write};
