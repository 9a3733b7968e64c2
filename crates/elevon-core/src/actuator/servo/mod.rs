//! A positioning servo: command, control electronics, inverter, star motor with its thermal network, transmission with
//! friction and backlash, sensors. What turns and what travels are one machine: with the output's coordinate in metres and
//! the ratio in radians per metre every equation holds. A `Form` states which of the two it is.

mod advance;
mod checks;
mod details;
pub mod faults;
mod form;
mod heat;
mod high;
pub mod layout;
mod low;
mod sensing;
mod shaft;
pub mod signals;

pub use form::Form;
pub use high::High;
pub use low::Low;
