//! Mechanics between the motor shaft and the user.

pub mod brake;
pub mod friction;
pub mod gear;
pub mod lever;
pub mod lock;
pub mod planetary;
pub mod play;
pub mod roller_screw;
pub mod screw;
pub mod train_friction;
