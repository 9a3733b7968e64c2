//! Faults of the transmission, the bearings and the gap.

use super::Side;
use crate::fault::rate::{BEARINGS, MECHANISM};
use crate::fault::{Attribute, FaultKind};
use crate::places;
use crate::variable::Range;

/// Faults of a transmission with friction and backlash.
pub fn mechanical(side: Side) -> Vec<FaultKind> {
    const DEPTH: &[Attribute] = &[Attribute {
        default: Some(2e-4),
        ..Attribute::new("depth", "m", "bearing.defect_depth", "depth, unless the sag of a ball over the length is less")
    }];
    const CHIP: &[Attribute] = &[Attribute {
        default: Some(0.0),
        ..Attribute::new("angle", "rad", "gear.tooth_chip_angle", "angle of the wheel at which the chipped tooth carries")
    }];
    vec![
        FaultKind {
            kind: "friction",
            unit: "1",
            range: Range::Between(0.0, 100.0),
            attributes: &[],
            places: places!("transmission": "friction.dry_scale" Grow),
            effect: "fraction added to the dry friction, static and dynamic: the moving current rises",
            source: "T2 (friction fault)",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "lubrication",
            unit: "1",
            range: Range::Between(-1.0, 1000.0),
            attributes: &[],
            places: places!("transmission": "friction.viscous_scale" Grow),
            effect: "fraction added to the viscous friction (negative: thinner lubricant)",
            source: "N 6.1 (insufficient lubrication)",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "backlash",
            unit: side.coordinate,
            range: Range::Between(0.0, side.backlash),
            attributes: &[],
            places: places!("transmission": "backlash.extra" Add),
            effect: "total backlash added at the output: flat tops of the output position widen",
            source: "T1 eq. 3",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "bearing", unit: "m", range: Range::Between(0.0, 5e-3), attributes: DEPTH,
            places: places!("bearing.outer": "bearing.outer_defect" Add, "bearing.inner": "bearing.inner_defect" Add, "bearing.ball": "bearing.ball_defect" Add),
            effect: "length of a defect: torque pulses at the ball-pass order of its ring (or twice a ball's spin), growing with size and load, and added friction",
            source: "T3 Table 1.1 (bearings); pulse law ASSUMED",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "stator_rub", unit: "1", range: Range::Unit, attributes: &[],
            places: places!("motor": "motor.rub_filled" Add),
            effect: "share of the air gap that something fills; where it and the eccentricities reach motor.rub_clearance the rotor presses on the stator: dry friction, once a turn where static and dynamic eccentricity meet",
            source: "N 4.4 (rubbing named as a consequence of eccentricity); contact ASSUMED: linear spring, Coulomb",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "bearing", unit: "N m", range: Range::Between(0.0, 1e3), attributes: &[],
            places: places!("bearing.cage": "bearing.cage_drag" Add),
            effect: "dry friction of a worn cage where it rubs most: friction modulated once a turn of the cage",
            source: "T3 Table 1.1 (bearings: wear and galling); law ASSUMED",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "tooth_wear", unit: side.coordinate, range: Range::Between(0.0, side.backlash), attributes: &[],
            places: places!("gear": "gear.tooth_wear" Add),
            effect: "total backlash added at the output where worn flanks slide most: lost motion and torque ripple at the order of the mesh",
            source: "ASSUMED: wear follows the sliding speed of the flanks",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "chipped_tooth", unit: side.coordinate, range: Range::Between(0.0, side.backlash), attributes: CHIP,
            places: places!("gear": "gear.tooth_chip" Add),
            effect: "total backlash added at the output while one tooth carries: a jerk once a turn of its wheel",
            source: "ASSUMED: cos^2 over one mesh",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "jam",
            unit: "N m",
            range: Range::NonNegative,
            attributes: side.jam,
            places: places!("transmission": "friction.jam_torque" Add),
            effect: "seizure torque on the motor shaft, resistive",
            source: "N 4.2 and 5.3 (jam; as a torque on the motor shaft ASSUMED)",
            rate: MECHANISM,
        },
    ]
}
