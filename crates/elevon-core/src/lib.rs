//! Electromechanical actuators: components, wirings, solver and faults. Pure computation: no files, no clock in
//! the physics, no global random numbers.

pub mod actuator;
pub mod command;
pub mod control;
pub mod fault;
pub mod features;
pub mod inverter;
pub mod kept;
pub mod motor;
pub mod noise;
pub mod panics;
pub mod piecewise;
pub mod registry;
pub mod scalar;
pub mod sensor;
pub mod solver;
pub mod time;
pub mod transmission;
pub mod variable;
