//! Power electronics: relays, six-step modulation, the six-switch bridge, the supply.

pub mod bridge;
pub mod carrier;
pub mod hysteresis;
pub mod link;
pub mod losses;
pub mod six_step;
pub mod supply;
