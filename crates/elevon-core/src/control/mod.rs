//! Controllers: objects of their own, stepped at their own sample time, sample and hold between.

pub mod current_dq;
pub mod position_speed;
