//! Motor electromagnetics.

pub mod air_gap;
pub mod cogging;
pub mod equivalent;
pub mod flux_map;
pub mod iron_loss;
pub mod magnetic_pull;
pub mod pole;
pub mod rub;
pub mod short;
pub mod star;
pub mod thermal;
pub mod unbalance;
