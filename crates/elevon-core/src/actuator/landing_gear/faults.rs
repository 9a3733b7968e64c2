//! The fault catalogue of the landing-gear actuator.

use crate::fault::rate::{BEARINGS, CONNECTOR, MECHANISM, MOTOR, POSITION_SENSOR, SWITCH};
use crate::fault::{Attribute, FaultKind};
use crate::variable::Range;
use crate::{phases, places};

fn motor() -> Vec<FaultKind> {
    const PHASE: &[Attribute] = &[Attribute::new(
        "phase",
        "rad",
        "motor.eccentricity_static_phase",
        "phase angle of the narrow gap: electrical in the published law, round the stator in the periodic one",
    )];
    const PHASE_DYNAMIC: &[Attribute] =
        &[Attribute::new("phase", "rad", "motor.eccentricity_dynamic_phase", "mechanical phase angle of the narrow gap")];
    vec![
        FaultKind {
            kind: "short",
            unit: "1",
            range: Range::Between(0.0, 0.95),
            attributes: &[],
            places: phases!("motor.phase_": "motor.turns_" Lose),
            effect: "fraction of the turns of a phase shorted: R ~ N, L ~ N^2, k ~ N; torque falls in four of six sectors",
            source: "T2 (fault coefficients N_j)",
            rate: MOTOR,
        },
        FaultKind {
            kind: "open_phase",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: phases!("motor.phase_": "motor.open_" Set),
            effect: "1: the phase is interrupted, from its next current zero on; two sectors are left with torque",
            source: "T3 Table 1.1 (open circuit)",
            rate: MOTOR,
        },
        FaultKind {
            kind: "motor_shorted",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("motor": "inverter.terminals_shorted" Set),
            effect: "1: the motor's terminals are shorted: it brakes whatever turns it, and the next drive shoots through and trips",
            source: "P Fig. 5.4 (shorted motor)",
            rate: MOTOR,
        },
        FaultKind {
            kind: "eccentricity_static",
            unit: "1",
            range: Range::Between(0.0, 0.9),
            attributes: PHASE,
            places: places!("motor": "motor.eccentricity_static" Add),
            effect: "motor.eccentricity_law = published: k_j (1 + zeta cos(theta_e - phi + 2 pi (j-1)/3)), torque ripple at the electrical frequency and an EMF with a mean over a turn; periodic: k_j (1 + zeta cos(phi - 2 pi (j-1)/3)), unequal amplitudes",
            source: "T2 (eccentricity coefficient zeta, phi); periodic law ASSUMED: a phase's coils stand together",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "eccentricity_dynamic",
            unit: "1",
            range: Range::Between(0.0, 0.9),
            attributes: PHASE_DYNAMIC,
            places: places!("motor": "motor.eccentricity_dynamic" Add),
            effect: "fraction of the air gap; the modulation of k_j turns with the shaft, or that of the flux (motor.eccentricity_law; both ASSUMED: the paper names the fault only)",
            source: "N 4.4 and 5.1",
            rate: BEARINGS,
        },
        FaultKind {
            kind: "demagnetisation",
            unit: "1",
            range: Range::Between(0.0, 0.95),
            attributes: &[],
            places: places!("motor": "motor.flux_fraction" Lose),
            effect: "fraction of the magnets' flux lost: more current for the same torque",
            source: "ASSUMED: uniform loss of flux, the usual first model",
            rate: MOTOR,
        },
        FaultKind {
            kind: "bearing_wear",
            unit: "N m",
            range: Range::Between(0.0, 1.0),
            attributes: &[],
            places: places!("motor.bearing": "motor.bearing_torque" Add),
            effect: "dry friction on the motor shaft",
            source: "ASSUMED: wear as dry friction",
            rate: BEARINGS,
        },
    ]
}

fn power() -> Vec<FaultKind> {
    vec![
        FaultKind {
            kind: "open_switch",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!(each [a_high a_low b_high b_low c_high c_low] "inverter.": "inverter.open_" Set),
            effect: "1: the switch never closes; two of six sectors lose their torque",
            source: "T3 Table 1.1 (open circuit)",
            rate: SWITCH,
        },
        FaultKind {
            kind: "shorted_switch",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!(each [a_high a_low b_high b_low c_high c_low] "inverter.": "inverter.shorted_" Set),
            effect: "1: the switch is always closed; the first gate of its partner shoots through and the drive trips",
            source: "T3 Table 1.1 (short)",
            rate: SWITCH,
        },
        FaultKind {
            kind: "sag",
            unit: "1",
            range: Range::Between(0.0, 0.99),
            attributes: &[],
            places: places!("supply": "inverter.supply_scale" Lose),
            effect: "fraction of the supply voltage lost: slower, below control.undervoltage moves are refused",
            source: "T3 Table 1.1 (power connector)",
            rate: CONNECTOR,
        },
    ]
}

fn sensors() -> Vec<FaultKind> {
    const PERIOD: &[Attribute] =
        &[Attribute { name: "period", unit: "s", default: Some(0.1), path: "", flag: "", text: "period of the interruptions" }];
    vec![
        FaultKind {
            kind: "hall_high",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: phases!("sensor.hall_": "hall.stuck_high_" Set),
            effect: "1: the sensor always reads high: wrong sectors, the code 111, a hall fault of the control unit",
            source: "T3 Table 1.1 (position sensor)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "hall_low",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: phases!("sensor.hall_": "hall.stuck_low_" Set),
            effect: "1: the sensor always reads low: wrong sectors, the code 000, a hall fault of the control unit",
            source: "T3 Table 1.1 (position sensor)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "offset",
            unit: "rad",
            range: Range::Between(-0.5, 0.5),
            attributes: &[],
            places: places!("sensor.hall": "hall.offset" Add, "sensor.hall_a": "hall.offset_a" Add, "sensor.hall_b": "hall.offset_b" Add, "sensor.hall_c": "hall.offset_c" Add),
            effect: "electrical angle by which the sensors switch early: torque ripple, less torque per ampere",
            source: "T3 Table 1.1 (position sensor)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "dropout",
            unit: "1",
            range: Range::Between(0.0, 1.0),
            attributes: PERIOD,
            places: places!("sensor.hall": "hall.power_off" Pulse),
            effect: "duty of the Hall sensors' power lost: the code 000, no commutation, speed reported as zero",
            source: "N 4.5 (resolver power, here the Hall sensors')",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "proximity_on",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.proximity_0": "proximity.on_0" Set, "sensor.proximity_25": "proximity.on_25" Set, "sensor.proximity_75": "proximity.on_75" Set, "sensor.proximity_100": "proximity.on_100" Set, "sensor.weight_on_wheels": "proximity.on_wheels" Set),
            effect: "1: the switch always reads on",
            source: "ASSUMED: the usual failure of an inductive switch",
            rate: SWITCH,
        },
        FaultKind {
            kind: "proximity_off",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.proximity_0": "proximity.off_0" Set, "sensor.proximity_25": "proximity.off_25" Set, "sensor.proximity_75": "proximity.off_75" Set, "sensor.proximity_100": "proximity.off_100" Set, "sensor.weight_on_wheels": "proximity.off_wheels" Set),
            effect: "1: the switch never reads on",
            source: "ASSUMED: broken wire",
            rate: SWITCH,
        },
    ]
}

fn mechanical() -> Vec<FaultKind> {
    const JAM: &[Attribute] = &[
        Attribute {
            name: "position",
            unit: "m",
            default: Some(0.0),
            path: "screw.jam_position",
            flag: "",
            text: "nut position in the middle of the jam",
        },
        Attribute {
            name: "width",
            unit: "m",
            default: Some(0.0),
            path: "screw.jam_width",
            flag: "",
            text: "length of the jammed travel; 0: jammed wherever it is",
        },
    ];
    vec![
        FaultKind {
            kind: "friction_growth",
            unit: "N",
            range: Range::Between(0.0, 5000.0),
            attributes: &[],
            places: places!("screw": "friction.growth" Add),
            effect: "force added to the friction of the screw, in FF and FFM: more current, no free fall at the end",
            source: "N 6.1 (wear of the screw: insufficient lubrication, spalling)",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "efficiency_loss",
            unit: "1",
            range: Range::Between(0.0, 0.5),
            attributes: &[],
            places: places!("screw": "screw.efficiency_scale" Lose, "gear_first": "gear.efficiency_first" Lose, "gear_second": "gear.efficiency_second" Lose),
            effect: "fraction of an efficiency lost; the load cannot drive back once the train's is below one half",
            source: "N 5.3 (what a jam takes from the screw; of the gears ASSUMED alike)",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "jam",
            unit: "N",
            range: Range::Between(0.0, 1e5),
            attributes: JAM,
            places: places!("screw": "screw.jam_force" Add),
            effect: "resistive force on the nut: the motor stalls, retries, the control unit faults",
            source: "N 4.2 and 5.3 (jam; as a force on the nut ASSUMED)",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "brake_dragging",
            unit: "N m",
            range: Range::Between(0.0, 10.0),
            attributes: &[],
            places: places!("brake": "brake.drag" Add),
            effect: "torque left when released",
            source: "ASSUMED: worn or swollen disc",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "brake_slipping",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("brake": "brake.torque" Lose),
            effect: "fraction of the holding torque lost: the leg creeps down when the drive is off",
            source: "ASSUMED: oil on the disc",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "brake_not_releasing",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("brake": "brake.stuck" Set),
            effect: "1: the brake stays set under power: the motor drives through it or stalls; a drag warning or a fault",
            source: "ASSUMED: open coil or stuck armature",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "release_cable_failed",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("release": "release.cable_failed" Set),
            effect: "1: the free-fall release does not open, the leg stays; seen by the lock's switch that never comes",
            source: "ASSUMED: broken or slack cable",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "lock_spring_weak",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("lock": "lock.spring_scale" Lose),
            effect: "fraction of the sleeve spring's force lost: a free fall no longer locks, the motor still works the lock",
            source: "ASSUMED: relaxed or broken spring",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "lock_not_engaging",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("lock": "lock.blocked" Set),
            effect: "1: the sleeve blocks and the down-lock does not engage: retries, then a fault",
            source: "ASSUMED: dirt under the sleeve",
            rate: MECHANISM,
        },
        FaultKind {
            kind: "lock_not_releasing",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("lock": "lock.stuck" Set),
            effect: "1: the segments of an engaged lock stay: retries, then a fault",
            source: "ASSUMED: sticking segments",
            rate: MECHANISM,
        },
    ]
}

pub fn catalogue() -> Vec<FaultKind> {
    let mut all = motor();
    all.extend(power());
    all.extend(mechanical());
    all.extend(sensors());
    all
}
