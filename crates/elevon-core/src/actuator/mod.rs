//! Wirings: how components make an actuator. A wiring reads like the paper's block diagram.

pub mod landing_gear;
pub mod rotary;
mod wiring;

pub use wiring::{Finding, Inputs, Port, Setup, Tick, Watch, Wiring, MAX_CHUNKS, WATCHED};
