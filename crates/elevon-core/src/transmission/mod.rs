//! Mechanics between the motor shaft and the user.

pub mod friction;
pub mod gear;
pub mod play;
pub mod screw;
