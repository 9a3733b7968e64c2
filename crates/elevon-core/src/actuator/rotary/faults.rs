//! The fault catalogue of the rotary actuator.

use crate::fault::{Attribute, FaultKind, Op, Place, Target};
use crate::variable::Range;

macro_rules! targets {
    ($($path:literal $op:ident),*) => {{
        const TARGETS: &[Target] = &[$(Target { path: $path, op: Op::$op }),*];
        TARGETS
    }};
}
macro_rules! places {
    ($($name:literal: $path:literal $op:ident),* $(,)?) => {{
        const PLACES: &[Place] = &[$(Place { name: $name, targets: targets!($path $op) }),*];
        PLACES
    }};
}

const fn attribute(name: &'static str, unit: &'static str, path: &'static str, text: &'static str) -> Attribute {
    Attribute { name, unit, default: None, path, flag: "", text }
}

/// Faults of a star motor and its inverter.
pub fn electrical() -> Vec<FaultKind> {
    const PHASE: &[Attribute] = &[attribute("phase", "rad", "motor.eccentricity_static_phase", "electrical phase angle of the narrow gap")];
    const PHASE_DYNAMIC: &[Attribute] = &[attribute("phase", "rad", "motor.eccentricity_dynamic_phase", "mechanical phase angle of the narrow gap")];
    const CONTACT: &[Attribute] = &[attribute("contact_resistance", "ohm", "motor.short_contact_resistance", "resistance of the short itself (loop model)")];
    vec![
        FaultKind {
            kind: "short", unit: "1", range: Range::Between(0.0, 0.95), low: true, attributes: CONTACT,
            places: places!("motor.phase_a": "motor.turns_a" Lose, "motor.phase_b": "motor.turns_b" Lose, "motor.phase_c": "motor.turns_c" Lose),
            effect: "fraction of the turns of a phase shorted: R ~ N, L ~ N^2, k ~ N; ripple at twice the electrical frequency",
            source: "T2 (fault coefficients N_j)",
        },
        FaultKind {
            kind: "eccentricity_static", unit: "1", range: Range::Between(0.0, 0.9), low: true, attributes: PHASE,
            places: places!("motor": "motor.eccentricity_static" Add),
            effect: "k_j (1 + zeta cos(theta_e - phi + 2 pi (j-1)/3)); torque ripple at the electrical frequency",
            source: "T2 (eccentricity coefficient zeta, phi)",
        },
        FaultKind {
            kind: "eccentricity_dynamic", unit: "1", range: Range::Between(0.0, 0.9), low: true, attributes: PHASE_DYNAMIC,
            places: places!("motor": "motor.eccentricity_dynamic" Add),
            effect: "fraction of the air gap; the modulation turns with the shaft (law ASSUMED: the paper names the fault only)",
            source: "N 4.3",
        },
        FaultKind {
            kind: "open_phase", unit: "1", range: Range::Unit, low: true, attributes: &[],
            places: places!("motor.phase_a": "motor.open_a" Set, "motor.phase_b": "motor.open_b" Set, "motor.phase_c": "motor.open_c" Set),
            effect: "1: the phase is interrupted, from its next current zero on; the other two form one loop",
            source: "T3 Table 1.1 (open circuit)",
        },
        FaultKind {
            kind: "open_switch", unit: "1", range: Range::Unit, low: false, attributes: &[],
            places: places!(
                "inverter.a_high": "inverter.open_a_high" Set, "inverter.a_low": "inverter.open_a_low" Set,
                "inverter.b_high": "inverter.open_b_high" Set, "inverter.b_low": "inverter.open_b_low" Set,
                "inverter.c_high": "inverter.open_c_high" Set, "inverter.c_low": "inverter.open_c_low" Set,
            ),
            effect: "1: the switch never closes; half waves of its phase current are missing",
            source: "T3 Table 1.1 (open circuit)",
        },
        FaultKind {
            kind: "shorted_switch", unit: "1", range: Range::Unit, low: true, attributes: &[],
            places: places!(
                "inverter.a_high": "inverter.shorted_a_high" Set, "inverter.a_low": "inverter.shorted_a_low" Set,
                "inverter.b_high": "inverter.shorted_b_high" Set, "inverter.b_low": "inverter.shorted_b_low" Set,
                "inverter.c_high": "inverter.shorted_c_high" Set, "inverter.c_low": "inverter.shorted_c_low" Set,
            ),
            effect: "1: the switch is always closed; the first gate of its partner shoots through and the drive trips",
            source: "T3 Table 1.1 (short)",
        },
        FaultKind {
            kind: "demagnetisation", unit: "1", range: Range::Between(0.0, 0.95), low: true, attributes: &[],
            places: places!("motor": "motor.flux_fraction" Lose),
            effect: "fraction of the magnets' flux lost: more current for the same torque, higher no-load speed",
            source: "ASSUMED: uniform loss of flux, the usual first model",
        },
        FaultKind {
            kind: "sag", unit: "1", range: Range::Between(0.0, 0.99), low: true, attributes: &[],
            places: places!("supply": "inverter.supply_scale" Lose),
            effect: "fraction of the supply voltage lost: less speed and torque reserve",
            source: "T3 Table 1.1 (power connector)",
        },
        FaultKind {
            kind: "gain", unit: "1", range: Range::Between(-1.0, 10.0), low: false, attributes: &[],
            places: places!("sensor.current_a": "sensor.current.gain_a" Grow, "sensor.current_b": "sensor.current.gain_b" Grow, "sensor.current_c": "sensor.current.gain_c" Grow),
            effect: "relative gain error of a current sensor: the drive controls the wrong current, ripple at twice the electrical frequency",
            source: "T2 (acquisition)",
        },
        FaultKind {
            kind: "offset", unit: "A", range: Range::Any, low: false, attributes: &[],
            places: places!("sensor.current_a": "sensor.current.offset_a" Add, "sensor.current_b": "sensor.current.offset_b" Add, "sensor.current_c": "sensor.current.offset_c" Add),
            effect: "offset of a current sensor: torque ripple at the electrical frequency",
            source: "T2 (acquisition)",
        },
    ]
}

/// Faults of controller and position sensors.
pub fn control_and_sensors() -> Vec<FaultKind> {
    const PERIOD: &[Attribute] = &[Attribute { name: "period", unit: "s", default: Some(0.1), path: "", flag: "", text: "period of the interruptions" }];
    vec![
        FaultKind {
            kind: "gain_drift", unit: "1", range: Range::Between(-1.0, 10.0), low: true, attributes: &[],
            places: places!("control.position": "control.position_gain_scale" Grow, "control.speed": "control.speed_gain_scale" Grow),
            effect: "relative drift of a loop gain: -0.2 means gain x 0.8",
            source: "T1 (proportional gain drift)",
        },
        FaultKind {
            kind: "dropout", unit: "1", range: Range::Between(0.0, 1.0), low: true, attributes: PERIOD,
            places: places!("sensor.resolver": "sensor.resolver.power_off" Pulse),
            effect: "duty of the resolver's power lost: while off the drive sees a shaft at rest, then the position jumps back",
            source: "N 4.5",
        },
        FaultKind {
            kind: "mismatch", unit: "1", range: Range::Between(0.0, 0.99), low: true, attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.mismatch" Add),
            effect: "amplitude lost by one resolver channel: atan2(g sin, cos), an angle error at twice the shaft frequency",
            source: "N 4.5",
        },
        FaultKind {
            kind: "offset", unit: "rad", range: Range::Any, low: true, attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.offset" Add, "sensor.encoder": "sensor.encoder.offset" Add),
            effect: "offset of a position sensor; on the resolver it also misplaces the commutation",
            source: "T3 Table 1.1 (position sensor)",
        },
        FaultKind {
            kind: "gain", unit: "1", range: Range::Between(-1.0, 10.0), low: true, attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.gain" Grow, "sensor.encoder": "sensor.encoder.gain" Grow),
            effect: "relative gain error of a position sensor",
            source: "T3 Table 1.1 (position sensor)",
        },
        FaultKind {
            kind: "missing_counts", unit: "1", range: Range::Unit, low: true, attributes: &[],
            places: places!("sensor.encoder": "sensor.encoder.missing_counts" Add),
            effect: "fraction of the encoder's counts lost, spread evenly: the shown travel is too short",
            source: "N 4.5",
        },
    ]
}

/// Faults of a transmission with friction and play.
pub fn mechanical() -> Vec<FaultKind> {
    const JAM: &[Attribute] = &[Attribute {
        name: "position", unit: "rad", default: None, path: "friction.jam_position", flag: "friction.jam_anywhere",
        text: "user position at which it seizes when first reached; not given: at once",
    }];
    vec![
        FaultKind {
            kind: "friction", unit: "1", range: Range::Between(0.0, 100.0), low: true, attributes: &[],
            places: places!("transmission": "friction.dry_scale" Grow),
            effect: "fraction added to the dry friction, static and dynamic: the moving current rises",
            source: "T2 (friction fault)",
        },
        FaultKind {
            kind: "lubrication", unit: "1", range: Range::Between(-1.0, 1000.0), low: true, attributes: &[],
            places: places!("transmission": "friction.viscous_scale" Grow),
            effect: "fraction added to the viscous friction (negative: thinner lubricant)",
            source: "N 4.1",
        },
        FaultKind {
            kind: "play", unit: "rad", range: Range::Between(0.0, 1.0), low: true, attributes: &[],
            places: places!("transmission": "play.extra" Add),
            effect: "total play added at the output: flat tops of the user position widen",
            source: "T1 eq. 3",
        },
        FaultKind {
            kind: "jam", unit: "N m", range: Range::NonNegative, low: true, attributes: JAM,
            places: places!("transmission": "friction.jam_torque" Add),
            effect: "seizure torque on the fast shaft, resistive",
            source: "N 4.2",
        },
    ]
}

pub fn catalogue() -> Vec<FaultKind> {
    let mut all = electrical();
    all.extend(mechanical());
    all.extend(control_and_sensors());
    all
}
