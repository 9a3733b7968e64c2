//! The fault catalogue of the ballscrew actuator: the common one and the screw's own.

use crate::actuator::servo::faults::{catalogue as common, LINEAR};
use crate::fault::rate::MECHANISM;
use crate::fault::{Attribute, FaultKind};
use crate::places;
use crate::variable::Range;

pub fn catalogue() -> Vec<FaultKind> {
    const DEPTH: Attribute = Attribute {
        name: "depth",
        unit: "m",
        default: Some(2e-4),
        path: "screw.spall_depth",
        flag: "",
        text: "depth, unless the chord of its length is shallower",
    };
    const POSITION: Attribute = Attribute {
        name: "position",
        unit: "m",
        default: Some(0.0),
        path: "screw.spall_position",
        flag: "",
        text: "ram position at which the nut's middle stands over it (groove only)",
    };
    let mut all = common(LINEAR);
    for fault in &mut all {
        fault.effect = distinction(fault.kind).unwrap_or(fault.effect);
    }
    all.extend([
        FaultKind {
            kind: "return_jam", unit: "1", range: Range::Between(0.0, 64.0), attributes: &[],
            places: places!("screw.return_channel": "screw.blocked_circuits" AddWhole),
            effect: "whole number of return channels that are blocked, so that the balls of their circuits slide: the screw's efficiency falls and its preload rubs more, the nut warms; `jam` is the seizure of the whole mechanism",
            source: "N 4.2 and 5.3",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "lubrication_loss", unit: "1", range: Range::Unit, attributes: &[],
            places: places!("screw": "screw.lubricant_lost" Add),
            effect: "fraction of the screw's lubricant lost: friction coefficient up as the film thins, viscous drag down (laws ASSUMED); `lubrication` only scales the viscous drag",
            source: "N 6.1",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "contamination", unit: "1", range: Range::Between(0.0, 0.05), attributes: &[],
            places: places!("screw": "screw.debris" Add),
            effect: "mass of debris over mass of grease: friction coefficient up, dry friction scatters (slopes ASSUMED)",
            source: "N 6.1",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "spall", unit: "m", range: Range::Between(0.0, 5e-3), attributes: &[DEPTH, POSITION],
            places: places!("screw.groove": "screw.spall_groove" Add, "screw.nut": "screw.spall_nut" Add, "screw.ball": "screw.spall_ball" Add),
            effect: "length of a spall: torque locked to the ball passes and added friction, growing with size and load",
            source: "N 6.1",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "adapter_gap", unit: "m", range: Range::Between(0.0, 5e-3), attributes: &[],
            places: places!("adapter": "backlash.extra" Add),
            effect: "gap of the backlash adapter between load cell and ram, the stand's means to seed backlash: impacts at each reversal; `backlash` is the same lost motion of worn parts",
            source: "N 4.1",
            rate: MECHANISM,
        },
    ]);
    all
}

/// Sentences for kinds of the common catalogue that have a namesake among the screw's own.
fn distinction(kind: &str) -> Option<&'static str> {
    match kind {
        "jam" => Some("torque on the motor shaft at which the whole mechanism seizes; a blocked return channel of the nut is `return_jam`"),
        "lubrication" => Some("fraction added to the viscous drag (negative: thinner lubricant); a screw that loses its lubricant is `lubrication_loss`"),
        "backlash" => Some("total backlash added between ram and load by worn parts: lost motion and impacts; the gap that the stand sets on purpose is `adapter_gap`"),
        _ => None,
    }
}
