//! The fault catalogue of a servo.

mod control;
mod electrical;
mod mechanical;

use crate::fault::{Attribute, FaultKind};

/// What differs between a turning and a travelling output.
#[derive(Clone, Copy, Debug)]
pub struct Side {
    coordinate: &'static str,
    /// Largest backlash that a fault may add.
    backlash: f64,
    jam: &'static [Attribute],
}

const fn jam_position(unit: &'static str) -> Attribute {
    Attribute {
        name: "position",
        unit,
        default: None,
        path: "friction.jam_position",
        flag: "friction.jam_anywhere",
        text: "output position at which it seizes when first reached; not given: at once",
    }
}

pub const ROTARY: Side = Side { coordinate: "rad", backlash: 1.0, jam: &[jam_position("rad")] };
pub const LINEAR: Side = Side { coordinate: "m", backlash: 5e-3, jam: &[jam_position("m")] };

/// The whole catalogue.
pub fn catalogue(side: Side) -> Vec<FaultKind> {
    let mut all = electrical::electrical();
    all.extend(mechanical::mechanical(side));
    all.extend(control::control_and_sensors(side));
    all
}
