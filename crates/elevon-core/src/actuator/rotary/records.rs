//! The records of the rotary actuator: those of a servo, and the bodies of its gear.

use crate::actuator::servo::layout;
use crate::actuator::servo::signals;
use crate::actuator::Finding;
use crate::groups;
use crate::transmission::backlash::{BacklashParameter as P, BACKLASH};
use crate::transmission::gear::GearParameter;
use crate::transmission::gear_train::{wolfrom_ratio, GearLayout, GearTrainParameter, GEAR_TRAIN};
use crate::variable::acts::{high_only, when, When};
use crate::variable::{extended, relabelled, Relabel, Signal, Variable};
use layout::At as _;

const OPERATOR: &str = "it has rigid flanks on a stiffness: two masses on a contact need the steps of the switching model";
const LUMPED: When = When::Chosen("gear.model", &["lumped"]);
const ELASTIC: &[When] = &[When::Chosen("backlash.model", &["elastic"]), LUMPED];

/// The meshes of several bodies have backlashes of their own.
const LUMPED_BACKLASH: [Variable; BACKLASH.len()] = relabelled(
    BACKLASH,
    &[
        Relabel::acts(P::Total as usize, when(&[LUMPED])),
        Relabel::acts(P::Model as usize, when(&[LUMPED])),
        Relabel::acts(P::Stiffness as usize, when(ELASTIC)),
        Relabel::acts(P::Damping as usize, high_only(OPERATOR).when(ELASTIC)),
    ],
);

groups! {
    over layout {
        backlash: &LUMPED_BACKLASH;
    }
    train: "gear", GEAR_TRAIN, GearTrainParameter;
}

const fn signal(name: &'static str, unit: &'static str, text: &'static str) -> Signal {
    Signal { name, symbol: "-", unit, text, role: None }
}

/// Of a gear of several bodies; zero with one backlash at the output.
const BODIES: &[Signal] = &[
    signal(
        "gear_body_1_position",
        "rad",
        "angle of the body behind the first of several stages, or of the planets about the gear's axis (gear.model)",
    ),
    signal(
        "gear_body_2_position",
        "rad",
        "angle of the body behind the second of three stages, or of a planet about its own axis (gear.model)",
    ),
    signal("mesh_1_torque", "N m", "torque of the first mesh at the wheel of its backlash (gear.model)"),
    signal("mesh_2_torque", "N m", "torque of the second mesh at the wheel of its backlash (gear.model)"),
    signal("mesh_3_torque", "N m", "torque of the third mesh, at the output (gear.model)"),
];

pub const HIGH: &[Signal] = &extended::<{ signals::HIGH.len() + BODIES.len() }>(signals::HIGH, &[], BODIES);

/// What a gear of several bodies cannot be.
pub fn check(raw: &[f64]) -> Vec<Finding> {
    if GearLayout::read(train(raw)) != GearLayout::Wolfrom {
        return Vec::new();
    }
    let (ratio, teeth) = (raw[GearParameter::Ratio.at()], wolfrom_ratio(train(raw)));
    if (teeth / ratio - 1.0).abs() < 1e-9 {
        return Vec::new();
    }
    let message = format!(
        "gear.ratio: {ratio} is not that of the teeth (gear.sun_teeth, gear.planet_teeth, gear.fixed_ring_teeth, \
         gear.output_planet_teeth, gear.output_ring_teeth), {teeth:.9}"
    );
    vec![Finding::error("gear.ratio", ratio, teeth, message)]
}
