//! Wirings: how components make an actuator. A wiring reads like the paper's block diagram.

pub mod ballscrew;
pub mod landing_gear;
pub mod rotary;
pub mod servo;
mod wiring;

pub use wiring::{Finding, Inputs, Machine, Overheat, Port, Setup, Severity, Signals, Tick, Watch, Wiring, HELD, MAX_CHUNKS, WATCHED};
