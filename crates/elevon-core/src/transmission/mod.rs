//! Mechanics between the motor shaft and the output.

pub mod backlash;
pub mod bearing;
pub mod brake;
pub mod friction;
pub mod friction_law;
pub mod gear;
pub mod gear_train;
pub mod lever;
pub mod lock;
pub mod lubricant;
pub mod nut_heat;
pub mod planetary;
pub mod roller_screw;
pub mod screw;
pub mod stop;
pub mod tooth;
pub mod train_friction;
pub mod vibration;
