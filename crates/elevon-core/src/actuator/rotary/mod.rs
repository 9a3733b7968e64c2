//! The rotary actuator (Torino): command, control electronics, inverter, star motor, gearbox with friction and
//! play, sensors.

mod checks;
mod faults;
mod high;
mod layout;
mod low;
mod march;
mod observe;
mod signals;

pub use high::High;
pub use low::Low;
