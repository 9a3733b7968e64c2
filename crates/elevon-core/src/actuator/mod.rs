//! Wirings: how components make an actuator. A wiring reads like the paper's block diagram.

pub mod ballscrew;
pub mod landing_gear;
pub mod rotary;
pub mod servo;
mod wiring;

pub use wiring::{
    Event, EventOf, Finding, Inputs, Machine, Observation, ObservationOf, Overheat, Port, Setup, Severity, Signals, Stretch, StretchOf,
    Tick, Watch, Wiring, HELD, MAX_CHUNKS, WATCHED,
};
