//! The functions of FMI 2.0 and 3.0 for co-simulation, over one component.

mod component;
mod fmi2;
mod fmi3;
mod fmi3_absent;
mod instance;
