//! Motor electromagnetics.

pub mod cogging;
pub mod equivalent;
pub mod magnetic_pull;
pub mod star;
pub mod tap;
pub mod thermal;
pub mod unbalance;
