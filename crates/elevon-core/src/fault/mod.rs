//! Faults are data: a kind, a place, a severity in a physical unit over time, mapped to parameters that every
//! component always contains in their healthy form.

mod catalogue;
mod profile;
pub mod rate;
mod schedule;

pub use catalogue::{Attribute, FaultKind, Op, Place, Target};
pub use profile::{profiles, Profile, ProfileRecord};
pub use schedule::{whole, FaultLanes, FaultSpec, Write};
