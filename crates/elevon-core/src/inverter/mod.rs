//! Power electronics: relays, the six-switch bridge.

pub mod bridge;
pub mod hysteresis;
