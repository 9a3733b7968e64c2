//! Faults of the motor's windings and magnets, of the inverter and of its current sensors.

use crate::fault::rate::{BEARINGS, CONNECTOR, MOTOR, SWITCH};
use crate::fault::{Attribute, FaultKind};
use crate::variable::Range;
use crate::{phases, places};

/// Faults of a star motor and its inverter.
pub fn electrical() -> Vec<FaultKind> {
    const PHASE: &[Attribute] = &[Attribute::new(
        "phase",
        "rad",
        "motor.eccentricity_static_phase",
        "phase angle of the narrow gap: electrical in the published law, round the stator in the periodic one",
    )];
    const PHASE_DYNAMIC: &[Attribute] =
        &[Attribute::new("phase", "rad", "motor.eccentricity_dynamic_phase", "mechanical phase angle of the narrow gap")];
    const REFERENCE: &[Attribute] = &[Attribute {
        default: Some(25.0),
        ..Attribute::new("reference", "ohm", "motor.tap_reference", "resistance that stands for a level of one half")
    }];
    const UNBALANCE: &[Attribute] = &[
        Attribute::new("phase", "rad", "motor.unbalance_phase", "mechanical angle of the excess mass"),
        Attribute {
            default: Some(1.0),
            ..Attribute::new("gap_share", "1", "motor.unbalance_gap_share", "dynamic eccentricity per share of excess inertia")
        },
    ];
    const CONTACT: &[Attribute] = &[Attribute::new(
        "contact_resistance",
        "ohm",
        "motor.short_contact_resistance",
        "resistance of the short itself (loop model); without limit it is the healthy motor",
    )];
    const POLE: &[Attribute] = &[
        Attribute::new("phase", "rad", "motor.pole_loss_phase", "mechanical angle of the weak pole pair"),
        Attribute::new(
            "concentration",
            "1",
            "motor.pole_concentration",
            "1: a phase's coils stand under one pole pair, 0: evenly under all",
        ),
    ];
    const TOUCHING: &[Attribute] = &[Attribute::new(
        "turns",
        "1",
        "motor.phase_short_turns",
        "fraction of the turns between neutral and contact, of all pairs; 1: the terminals",
    )];
    const GROUNDED: &[Attribute] = &[
        Attribute::new(
            "turns",
            "1",
            "motor.ground_short_turns",
            "fraction of the turns between neutral and contact, of all phases; 1: the terminal",
        ),
        Attribute::new("potential", "1", "motor.ground_potential", "place of ground in the link: 0 lower rail, 1 upper rail"),
    ];
    vec![
        FaultKind {
            kind: "short", unit: "1", range: Range::Between(0.0, 0.95), attributes: CONTACT,
            places: phases!("motor.phase_": "motor.turns_" Lose),
            effect: "fraction of the turns of a phase shorted: R ~ N, L ~ N^2, k ~ N; ripple at twice the electrical frequency; with motor.short_model = loop the turns are there, carry a current of their own, brake and heat",
            source: "T2 (fault coefficients N_j), N 5.2",
            rate: MOTOR,
        },
        FaultKind {
            kind: "eccentricity_static", unit: "1", range: Range::Between(0.0, 0.9), attributes: PHASE,
            places: places!("motor": "motor.eccentricity_static" Add),
            effect: "fraction of the air gap by which the rotor stands out of centre, at rest; motor.eccentricity_law = published: k_j (1 + zeta cos(theta_e - phi + 2 pi (j-1)/3)), torque ripple at the electrical frequency and an EMF with a mean over a turn; periodic: k_j (1 + zeta cos(phi - 2 pi (j-1)/3)), unequal amplitudes, torque ripple at twice the electrical frequency",
            source: "T2 (eccentricity coefficient zeta, phi); periodic law ASSUMED: a phase's coils stand together",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "eccentricity_dynamic", unit: "1", range: Range::Between(0.0, 0.9), attributes: PHASE_DYNAMIC,
            places: places!("motor": "motor.eccentricity_dynamic" Add),
            effect: "fraction of the air gap by which the rotor stands out of centre, turning with the shaft: the modulation of k_j turns, too, or that of the flux (motor.eccentricity_law; both ASSUMED: the paper names the fault only)",
            source: "N 4.4 and 5.1",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "resistor_short", unit: "1", range: Range::Between(0.0, 0.5), attributes: REFERENCE,
            places: phases!("motor.phase_": "motor.tap_level_" Add),
            effect: "level f of a resistor ref (1 - f)/f from a terminal to the centre tap: it draws V/R whatever the speed and leaves the winding alone",
            source: "N 4.3 (seeded winding short)",
            rate: MOTOR,
        },
        FaultKind {
            kind: "phase_short", unit: "S", range: Range::Between(0.0, 1e3), attributes: TOUCHING,
            places: places!(each [ab bc ca] "motor.phases_": "motor.phase_short_" Add),
            effect: "conductance of a contact between the windings of two phases: the drive feeds it with them, their torque falls, the contact heats",
            source: "T3 Table 1.1 (phase-to-phase short); place and circuit ASSUMED",
            rate: MOTOR,
        },
        FaultKind {
            kind: "ground_short", unit: "S", range: Range::Between(0.0, 1e3), attributes: GROUNDED,
            places: phases!("motor.phase_": "motor.ground_short_" Add),
            effect: "conductance of a contact from a winding to the drive's ground: its current returns by the link, so the phase currents no longer sum to zero",
            source: "T3 Table 1.1 (turn-to-ground short); N 4.3 (resistance from a leg to the drive's ground)",
            rate: MOTOR,
        },
        FaultKind {
            kind: "unbalance", unit: "kg m2", range: Range::Between(0.0, 2e-3), attributes: UNBALANCE,
            places: places!("motor.rotor": "motor.unbalance_inertia" Add),
            effect: "excess inertia of a mass on one side of the rotor: inertia, gravity torque once a turn, dynamic eccentricity",
            source: "N 4.4 (mass imbalance)",
            rate: MOTOR,
        },
        FaultKind {
            kind: "open_phase", unit: "1", range: Range::Unit, attributes: &[],
            places: phases!("motor.phase_": "motor.open_" Set),
            effect: "1: the phase is interrupted, from its next current zero on; the other two form one loop",
            source: "T3 Table 1.1 (open circuit)",
            rate: MOTOR,
        },
        FaultKind {
            kind: "open_switch", unit: "1", range: Range::Unit, attributes: &[],
            places: places!(each [a_high a_low b_high b_low c_high c_low] "inverter.": "inverter.open_" Set),
            effect: "1: the switch never closes; half waves of its phase current are missing",
            source: "T3 Table 1.1 (open circuit)",
            rate: SWITCH,
        },
        FaultKind {
            kind: "shorted_switch", unit: "1", range: Range::Unit, attributes: &[],
            places: places!(each [a_high a_low b_high b_low c_high c_low] "inverter.": "inverter.shorted_" Set),
            effect: "1: the switch is always closed; the first gate of its partner shoots through and the drive trips",
            source: "T3 Table 1.1 (short)",
            rate: SWITCH,
        },
        FaultKind {
            kind: "demagnetisation", unit: "1", range: Range::Between(0.0, 0.95), attributes: &[],
            places: places!("motor": "motor.flux_fraction" Lose),
            effect: "fraction of the magnets' flux lost: more current for the same torque, higher no-load speed",
            source: "ASSUMED: uniform loss of flux, the usual first model",
            rate: MOTOR,
        },
        FaultKind {
            kind: "local_demagnetisation", unit: "1", range: Range::Unit, attributes: POLE,
            places: places!("motor": "motor.pole_loss" Add),
            effect: "fraction of the flux that one pole pair has lost: k_j dips once a turn while it passes, EMF sidebands at the electrical frequency +- multiples of the shaft's",
            source: "N 4.3 (demagnetised permanent magnets); window and place of the coils ASSUMED",
            rate: MOTOR,
        },
        FaultKind {
            kind: "sag", unit: "1", range: Range::Between(0.0, 0.99), attributes: &[],
            places: places!("supply": "inverter.supply_scale" Lose),
            effect: "fraction of the supply voltage lost: less speed and torque reserve",
            source: "T3 Table 1.1 (power connector)",
            rate: CONNECTOR,
        },
        FaultKind {
            kind: "connector_open", unit: "1", range: Range::Unit, attributes: &[],
            places: places!("supply": "inverter.connector_open" Set),
            effect: "1: the power connector is open; the link's capacitor alone feeds the bridge: it empties under load and rises when the motor brakes (no brake chopper)",
            source: "T3 Table 1.1 (power connector open, 6.64e-7 per hour)",
            rate: CONNECTOR,
        },
        FaultKind {
            kind: "gain", unit: "1", range: Range::Between(-1.0, 10.0), attributes: &[],
            places: phases!("sensor.current_": "sensor.current.gain_" Grow),
            effect: "relative gain error of a current sensor: the drive controls the wrong current, ripple at twice the electrical frequency",
            source: "T2 (acquisition)",
            rate: SWITCH,
        },
        FaultKind {
            kind: "offset", unit: "A", range: Range::Any, attributes: &[],
            places: phases!("sensor.current_": "sensor.current.offset_" Add),
            effect: "offset of a current sensor: torque ripple at the electrical frequency",
            source: "T2 (acquisition)",
            rate: SWITCH,
        },
    ]
}
