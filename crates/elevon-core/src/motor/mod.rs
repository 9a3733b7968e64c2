//! Motor electromagnetics.

pub mod equivalent;
pub mod star;
