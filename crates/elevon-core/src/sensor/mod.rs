//! Sensors: what they do to a signal, faults included in their healthy form.

pub mod current;
pub mod encoder;
pub mod filter;
pub mod hall;
pub mod proximity;
pub mod resolver;
