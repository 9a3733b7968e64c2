//! Motor electromagnetics.

pub mod equivalent;
pub mod star;
pub mod tap;
pub mod thermal;
pub mod unbalance;
