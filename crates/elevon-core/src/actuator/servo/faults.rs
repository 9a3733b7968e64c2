//! The fault catalogue of a servo.

use crate::fault::{Attribute, FaultKind};
use crate::variable::Range;

#[macro_export]
macro_rules! targets {
    ($($path:literal $op:ident),*) => {{
        const TARGETS: &[$crate::fault::Target] = &[$($crate::fault::Target { path: $path, op: $crate::fault::Op::$op }),*];
        TARGETS
    }};
}
#[macro_export]
macro_rules! places {
    ($($name:literal: $path:literal $op:ident),* $(,)?) => {{
        const PLACES: &[$crate::fault::Place] = &[$($crate::fault::Place { name: $name, targets: $crate::targets!($path $op) }),*];
        PLACES
    }};
}

pub const fn attribute(name: &'static str, unit: &'static str, path: &'static str, text: &'static str) -> Attribute {
    Attribute { name, unit, default: None, path, flag: "", text }
}

/// What differs between a turning and a travelling output.
#[derive(Clone, Copy, Debug)]
pub struct Side {
    coordinate: &'static str,
    /// Largest play that a fault may add.
    play: f64,
    jam: &'static [Attribute],
}

const fn jam_position(unit: &'static str) -> Attribute {
    Attribute {
        name: "position",
        unit,
        default: None,
        path: "friction.jam_position",
        flag: "friction.jam_anywhere",
        text: "user position at which it seizes when first reached; not given: at once",
    }
}

pub const ROTARY: Side = Side { coordinate: "rad", play: 1.0, jam: &[jam_position("rad")] };
pub const LINEAR: Side = Side { coordinate: "m", play: 5e-3, jam: &[jam_position("m")] };

/// Faults of a star motor and its inverter.
pub fn electrical() -> Vec<FaultKind> {
    const PHASE: &[Attribute] = &[attribute("phase", "rad", "motor.eccentricity_static_phase", "electrical phase angle of the narrow gap")];
    const PHASE_DYNAMIC: &[Attribute] =
        &[attribute("phase", "rad", "motor.eccentricity_dynamic_phase", "mechanical phase angle of the narrow gap")];
    const REFERENCE: &[Attribute] = &[Attribute {
        default: Some(25.0),
        ..attribute("reference", "ohm", "motor.tap_reference", "resistance that stands for a level of one half")
    }];
    const UNBALANCE: &[Attribute] = &[
        attribute("phase", "rad", "motor.unbalance_phase", "mechanical angle of the excess mass"),
        Attribute {
            default: Some(1.0),
            ..attribute("gap_share", "1", "motor.unbalance_gap_share", "dynamic eccentricity per share of excess inertia")
        },
    ];
    const CONTACT: &[Attribute] = &[attribute(
        "contact_resistance",
        "ohm",
        "motor.short_contact_resistance",
        "resistance of the short itself (loop model); without limit it is the healthy motor",
    )];
    const POLE: &[Attribute] = &[
        attribute("phase", "rad", "motor.pole_loss_phase", "mechanical angle of the weak pole pair"),
        attribute("concentration", "1", "motor.pole_concentration", "1: a phase's coils stand under one pole pair, 0: evenly under all"),
    ];
    const TOUCHING: &[Attribute] = &[attribute(
        "turns",
        "1",
        "motor.phase_short_turns",
        "fraction of the turns between neutral and contact, of all pairs; 1: the terminals",
    )];
    const GROUNDED: &[Attribute] = &[
        attribute(
            "turns",
            "1",
            "motor.ground_short_turns",
            "fraction of the turns between neutral and contact, of all phases; 1: the terminal",
        ),
        attribute("potential", "1", "motor.ground_potential", "place of ground in the link: 0 lower rail, 1 upper rail"),
    ];
    vec![
        FaultKind {
            kind: "short", unit: "1", range: Range::Between(0.0, 0.95), attributes: CONTACT,
            places: places!("motor.phase_a": "motor.turns_a" Lose, "motor.phase_b": "motor.turns_b" Lose, "motor.phase_c": "motor.turns_c" Lose),
            effect: "fraction of the turns of a phase shorted: R ~ N, L ~ N^2, k ~ N; ripple at twice the electrical frequency; with motor.short_model = loop the turns are there, carry a current of their own, brake and heat",
            source: "T2 (fault coefficients N_j), N 5.2",
        },
        FaultKind {
            kind: "eccentricity_static", unit: "1", range: Range::Between(0.0, 0.9), attributes: PHASE,
            places: places!("motor": "motor.eccentricity_static" Add),
            effect: "fraction of the air gap by which the rotor stands out of centre, at rest: k_j (1 + zeta cos(theta_e - phi + 2 pi (j-1)/3)), torque ripple at the electrical frequency",
            source: "T2 (eccentricity coefficient zeta, phi)",
        },
        FaultKind {
            kind: "eccentricity_dynamic", unit: "1", range: Range::Between(0.0, 0.9), attributes: PHASE_DYNAMIC,
            places: places!("motor": "motor.eccentricity_dynamic" Add),
            effect: "fraction of the air gap by which the rotor stands out of centre, turning with the shaft: the modulation of k_j turns, too (law ASSUMED: the paper names the fault only)",
            source: "N 4.4 and 5.1",
        },
        FaultKind {
            kind: "resistor_short", unit: "1", range: Range::Between(0.0, 0.5), attributes: REFERENCE,
            places: places!("motor.phase_a": "motor.tap_level_a" Add, "motor.phase_b": "motor.tap_level_b" Add, "motor.phase_c": "motor.tap_level_c" Add),
            effect: "level f of a resistor ref (1 - f)/f from a terminal to the centre tap: it draws V/R whatever the speed and leaves the winding alone",
            source: "N 4.3 (seeded winding short)",
        },
        FaultKind {
            kind: "phase_short", unit: "S", range: Range::Between(0.0, 1e3), attributes: TOUCHING,
            places: places!("motor.phases_ab": "motor.phase_short_ab" Add, "motor.phases_bc": "motor.phase_short_bc" Add, "motor.phases_ca": "motor.phase_short_ca" Add),
            effect: "conductance of a contact between the windings of two phases: the drive feeds it beside them, their torque falls, the contact heats",
            source: "T3 Table 1.1 (phase-to-phase short); place and circuit ASSUMED",
        },
        FaultKind {
            kind: "ground_short", unit: "S", range: Range::Between(0.0, 1e3), attributes: GROUNDED,
            places: places!("motor.phase_a": "motor.ground_short_a" Add, "motor.phase_b": "motor.ground_short_b" Add, "motor.phase_c": "motor.ground_short_c" Add),
            effect: "conductance of a contact from a winding to the drive's ground: its current returns by the link, so the phase currents no longer sum to zero",
            source: "T3 Table 1.1 (turn-to-ground short); N 4.3 (resistance from a leg to the drive's ground)",
        },
        FaultKind {
            kind: "unbalance", unit: "kg m2", range: Range::Between(0.0, 2e-3), attributes: UNBALANCE,
            places: places!("motor.rotor": "motor.unbalance_inertia" Add),
            effect: "excess inertia of a mass on one side of the rotor: inertia, gravity torque once a turn, dynamic eccentricity",
            source: "N 4.4 (mass imbalance)",
        },
        FaultKind {
            kind: "open_phase", unit: "1", range: Range::Unit, attributes: &[],
            places: places!("motor.phase_a": "motor.open_a" Set, "motor.phase_b": "motor.open_b" Set, "motor.phase_c": "motor.open_c" Set),
            effect: "1: the phase is interrupted, from its next current zero on; the other two form one loop",
            source: "T3 Table 1.1 (open circuit)",
        },
        FaultKind {
            kind: "open_switch", unit: "1", range: Range::Unit, attributes: &[],
            places: places!(
                "inverter.a_high": "inverter.open_a_high" Set, "inverter.a_low": "inverter.open_a_low" Set,
                "inverter.b_high": "inverter.open_b_high" Set, "inverter.b_low": "inverter.open_b_low" Set,
                "inverter.c_high": "inverter.open_c_high" Set, "inverter.c_low": "inverter.open_c_low" Set,
            ),
            effect: "1: the switch never closes; half waves of its phase current are missing",
            source: "T3 Table 1.1 (open circuit)",
        },
        FaultKind {
            kind: "shorted_switch", unit: "1", range: Range::Unit, attributes: &[],
            places: places!(
                "inverter.a_high": "inverter.shorted_a_high" Set, "inverter.a_low": "inverter.shorted_a_low" Set,
                "inverter.b_high": "inverter.shorted_b_high" Set, "inverter.b_low": "inverter.shorted_b_low" Set,
                "inverter.c_high": "inverter.shorted_c_high" Set, "inverter.c_low": "inverter.shorted_c_low" Set,
            ),
            effect: "1: the switch is always closed; the first gate of its partner shoots through and the drive trips",
            source: "T3 Table 1.1 (short)",
        },
        FaultKind {
            kind: "demagnetisation", unit: "1", range: Range::Between(0.0, 0.95), attributes: &[],
            places: places!("motor": "motor.flux_fraction" Lose),
            effect: "fraction of the magnets' flux lost: more current for the same torque, higher no-load speed",
            source: "ASSUMED: uniform loss of flux, the usual first model",
        },
        FaultKind {
            kind: "local_demagnetisation", unit: "1", range: Range::Unit, attributes: POLE,
            places: places!("motor": "motor.pole_loss" Add),
            effect: "fraction of the flux that one pole pair has lost: k_j dips once a turn while it passes, EMF sidebands at the electrical frequency +- multiples of the shaft's",
            source: "N 4.3 (demagnetised permanent magnets); window and place of the coils ASSUMED",
        },
        FaultKind {
            kind: "sag", unit: "1", range: Range::Between(0.0, 0.99), attributes: &[],
            places: places!("supply": "inverter.supply_scale" Lose),
            effect: "fraction of the supply voltage lost: less speed and torque reserve",
            source: "T3 Table 1.1 (power connector)",
        },
        FaultKind {
            kind: "connector_open", unit: "1", range: Range::Unit, attributes: &[],
            places: places!("supply": "inverter.connector_open" Set),
            effect: "1: the power connector is open; the link's capacitor alone feeds the bridge: it empties under load and rises when the motor brakes (no brake chopper)",
            source: "T3 Table 1.1 (power connector open, 6.64e-7 per hour)",
        },
        FaultKind {
            kind: "gain", unit: "1", range: Range::Between(-1.0, 10.0), attributes: &[],
            places: places!("sensor.current_a": "sensor.current.gain_a" Grow, "sensor.current_b": "sensor.current.gain_b" Grow, "sensor.current_c": "sensor.current.gain_c" Grow),
            effect: "relative gain error of a current sensor: the drive controls the wrong current, ripple at twice the electrical frequency",
            source: "T2 (acquisition)",
        },
        FaultKind {
            kind: "offset", unit: "A", range: Range::Any, attributes: &[],
            places: places!("sensor.current_a": "sensor.current.offset_a" Add, "sensor.current_b": "sensor.current.offset_b" Add, "sensor.current_c": "sensor.current.offset_c" Add),
            effect: "offset of a current sensor: torque ripple at the electrical frequency",
            source: "T2 (acquisition)",
        },
    ]
}

/// Faults of controller and position sensors.
pub fn control_and_sensors(side: Side) -> Vec<FaultKind> {
    const PERIOD: &[Attribute] =
        &[Attribute { name: "period", unit: "s", default: Some(0.1), path: "", flag: "", text: "period of the interruptions" }];
    const SECTORS: &[Attribute] = &[
        Attribute {
            default: Some(1.0),
            ..attribute("sectors", "1", "sensor.encoder.dark_sectors", "number of dark sectors, equal and evenly spread")
        },
        Attribute {
            default: Some(0.0),
            ..attribute("position", "rad", "sensor.encoder.dark_position", "angle of the disc at the middle of a dark sector")
        },
    ];
    vec![
        FaultKind {
            kind: "gain_drift",
            unit: "1",
            range: Range::Between(-1.0, 10.0),
            attributes: &[],
            places: places!("control.position": "control.position_gain_scale" Grow, "control.speed": "control.speed_gain_scale" Grow),
            effect: "relative drift of a loop gain: -0.2 means gain x 0.8",
            source: "T1 (proportional gain drift)",
        },
        FaultKind {
            kind: "dropout",
            unit: "1",
            range: Range::Between(0.0, 1.0),
            attributes: PERIOD,
            places: places!("sensor.resolver": "sensor.resolver.power_off" Pulse),
            effect: "duty of the resolver's power lost: while off the drive sees a shaft at rest, then the position jumps back",
            source: "N 4.5",
        },
        FaultKind {
            kind: "mismatch",
            unit: "1",
            range: Range::Between(0.0, 0.99),
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.mismatch" Add),
            effect: "amplitude lost by one resolver channel: atan2(g sin, cos), an angle error at twice the shaft frequency",
            source: "N 4.5",
        },
        FaultKind {
            kind: "offset",
            unit: "rad",
            range: Range::Any,
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.offset" Add),
            effect: "offset of the motor's position; it misplaces the commutation where the resolver gives its angle",
            source: "T3 Table 1.1 (position sensor)",
        },
        FaultKind {
            kind: "offset",
            unit: side.coordinate,
            range: Range::Any,
            attributes: &[],
            places: places!("sensor.encoder": "sensor.encoder.offset" Add),
            effect: "offset of the shown user position; the position loop feels it where control.position_feedback = encoder",
            source: "T3 Table 1.1 (position sensor)",
        },
        FaultKind {
            kind: "gain",
            unit: "1",
            range: Range::Between(-1.0, 10.0),
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.gain" Grow, "sensor.encoder": "sensor.encoder.gain" Grow),
            effect: "relative gain error of a position sensor; the position loop feels the encoder's where control.position_feedback = encoder, the resolver's where it is resolver",
            source: "T3 Table 1.1 (position sensor)",
        },
        FaultKind {
            kind: "missing_counts",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.encoder": "sensor.encoder.missing_counts" Add),
            effect: "fraction of the encoder's counts lost, spread evenly: the shown travel is too short; the position loop feels it where control.position_feedback = encoder",
            source: "N 4.5",
        },
        FaultKind {
            kind: "dark_sectors",
            unit: "1",
            range: Range::Unit,
            attributes: SECTORS,
            places: places!("sensor.encoder": "sensor.encoder.dark_share" Add),
            effect: "share of the encoder's disc that gives no counts: the shown position stands in a dark sector, and what was lost stays lost until the disc turns back through it or the drive is referenced anew; the position loop feels it where control.position_feedback = encoder",
            source: "N 4.5 (sectors of the disc)",
        },
        FaultKind {
            kind: "winding_short",
            unit: "1",
            range: Range::Between(0.0, 0.99),
            attributes: &[],
            places: places!(
                "sensor.resolver.sine": "sensor.resolver.sine_short" Add, "sensor.resolver.cosine": "sensor.resolver.cosine_short" Add,
                "sensor.resolver.excitation": "sensor.resolver.excitation_short" Add,
            ),
            effect: "fraction of a resolver winding's turns shorted: a secondary one falsifies the angle twice a turn, the excitation turns no angle until less than sensor.resolver.least_signal is left, then the drive sees a shaft at rest",
            source: "N 4.5 (windings of the resolver; amplitude alone, no phase shift: ASSUMED)",
        },
        FaultKind {
            kind: "winding_open",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!(
                "sensor.resolver.sine": "sensor.resolver.sine_open" Set, "sensor.resolver.cosine": "sensor.resolver.cosine_open" Set,
                "sensor.resolver.excitation": "sensor.resolver.power_off" Set,
            ),
            effect: "1: the winding is interrupted; with one channel dead the shown angle leaps by half a turn, without excitation the shaft seems to rest",
            source: "N 4.5 (windings of the resolver)",
        },
        FaultKind {
            kind: "stuck",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.stuck" Set, "sensor.encoder": "sensor.encoder.stuck" Set),
            effect: "1: the reading stands still at its value of the onset, afterwards it is the true one again; of the encoder the position loop feels it where control.position_feedback = encoder",
            source: "T3 Table 1.1 (position sensor)",
        },
        FaultKind {
            kind: "stuck",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.current_a": "sensor.current.stuck_a" Set, "sensor.current_b": "sensor.current.stuck_b" Set, "sensor.current_c": "sensor.current.stuck_c" Set),
            effect: "1: the current sensor stands still at its value of the onset: its leg controls nothing; between relays the other two legs leave its phase what the star allows, a carrier drive controls a wrong current",
            source: "ASSUMED: the usual failure of a sensor's electronics, beside gain and offset of T2",
        },
        FaultKind {
            kind: "dead",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.encoder": "sensor.encoder.dead" Set),
            effect: "1: no counts come: the shown position stands still, and what was lost stays lost until the drive is referenced anew; the position loop feels it where control.position_feedback = encoder",
            source: "N 4.5",
        },
        FaultKind {
            kind: "dead",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.current_a": "sensor.current.dead_a" Set, "sensor.current_b": "sensor.current.dead_b" Set, "sensor.current_c": "sensor.current.dead_c" Set),
            effect: "1: the current sensor shows nothing: its leg controls nothing; between relays the other two legs leave its phase what the star allows, a carrier drive controls a wrong current",
            source: "ASSUMED: broken wire, beside gain and offset of T2",
        },
    ]
}

/// Faults of a transmission with friction and play.
pub fn mechanical(side: Side) -> Vec<FaultKind> {
    const DEPTH: &[Attribute] = &[Attribute {
        default: Some(2e-4),
        ..attribute("depth", "m", "bearing.defect_depth", "depth, unless the sag of a ball over the length is less")
    }];
    const CHIP: &[Attribute] = &[Attribute {
        default: Some(0.0),
        ..attribute("angle", "rad", "gear.tooth_chip_angle", "angle of the wheel at which the chipped tooth carries")
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
        },
        FaultKind {
            kind: "lubrication",
            unit: "1",
            range: Range::Between(-1.0, 1000.0),
            attributes: &[],
            places: places!("transmission": "friction.viscous_scale" Grow),
            effect: "fraction added to the viscous friction (negative: thinner lubricant)",
            source: "N 6.1 (insufficient lubrication)",
        },
        FaultKind {
            kind: "play",
            unit: side.coordinate,
            range: Range::Between(0.0, side.play),
            attributes: &[],
            places: places!("transmission": "play.extra" Add),
            effect: "total play added at the output: flat tops of the user position widen",
            source: "T1 eq. 3",
        },
        FaultKind {
            kind: "bearing", unit: "m", range: Range::Between(0.0, 5e-3), attributes: DEPTH,
            places: places!("bearing.outer": "bearing.outer_defect" Add, "bearing.inner": "bearing.inner_defect" Add, "bearing.ball": "bearing.ball_defect" Add),
            effect: "length of a defect: torque pulses at the ball-pass order of its ring (or twice a ball's spin), growing with size and load, and added friction",
            source: "T3 Table 1.1 (bearings); pulse law ASSUMED",
        },
        FaultKind {
            kind: "stator_rub", unit: "1", range: Range::Unit, attributes: &[],
            places: places!("motor": "motor.rub_filled" Add),
            effect: "share of the air gap that something fills; where it and the eccentricities reach motor.rub_clearance the rotor presses on the stator: dry friction, once a turn where static and dynamic eccentricity meet",
            source: "N 4.4 (rubbing named as a consequence of eccentricity); contact ASSUMED: linear spring, Coulomb",
        },
        FaultKind {
            kind: "bearing", unit: "N m", range: Range::Between(0.0, 1e3), attributes: &[],
            places: places!("bearing.cage": "bearing.cage_drag" Add),
            effect: "dry friction of a worn cage where it rubs most: friction modulated once a turn of the cage",
            source: "T3 Table 1.1 (bearings: wear and galling); law ASSUMED",
        },
        FaultKind {
            kind: "tooth_wear", unit: side.coordinate, range: Range::Between(0.0, side.play), attributes: &[],
            places: places!("gear": "gear.tooth_wear" Add),
            effect: "total play added at the output where worn flanks slide most: lost motion and torque ripple at the order of the mesh",
            source: "ASSUMED: wear follows the sliding speed of the flanks",
        },
        FaultKind {
            kind: "chipped_tooth", unit: side.coordinate, range: Range::Between(0.0, side.play), attributes: CHIP,
            places: places!("gear": "gear.tooth_chip" Add),
            effect: "total play added at the output while one tooth carries: a jerk once a turn of its wheel",
            source: "ASSUMED: cos^2 over one mesh",
        },
        FaultKind {
            kind: "jam",
            unit: "N m",
            range: Range::NonNegative,
            attributes: side.jam,
            places: places!("transmission": "friction.jam_torque" Add),
            effect: "seizure torque on the fast shaft, resistive",
            source: "N 4.2 and 5.3 (jam; as a torque on the fast shaft ASSUMED)",
        },
    ]
}

pub fn catalogue(side: Side) -> Vec<FaultKind> {
    let mut all = electrical();
    all.extend(mechanical(side));
    all.extend(control_and_sensors(side));
    all
}
