//! Control electronics: position and speed loops, the current controller, a landing gear's control unit.

pub mod current_dq;
pub mod derivative;
pub mod limits;
pub mod pi_rate;
pub mod position_speed;
pub mod sequence;
