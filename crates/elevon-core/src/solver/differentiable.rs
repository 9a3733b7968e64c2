//! What has no derivative, and why: switches, choices, whole numbers, times that are counted in solver steps, and a few
//! values at which a law begins.

use crate::fault::{FaultSpec, Op};
use crate::variable::{Range, Variable};

/// Ends of the paths of times that are counted in whole solver steps.
const STEPPED: &[&str] = &["step", "fault_grid", "sample_time", "computation_delay"];

/// Zero leaves these parts out altogether: a small value is another machine, not nearly the same one.
const OFF_AT_ZERO: &[&str] = &["inverter.link_capacitance", "inverter.trip_current", "control.integral_time", "control.pid_integral_time"];

/// Friction scatters as the root of the debris.
const ROOT_AT_ZERO: &[&str] = &["screw.debris"];

/// Why a run has no derivative by a parameter at its value.
pub fn parameter_refusal(path: &str, record: &Variable, value: f64) -> Option<&'static str> {
    match record.range {
        Range::Choice(_) => Some("it is a choice"),
        Range::Count(..) => Some("it is a whole number"),
        Range::Flag => Some("it is a switch"),
        _ if STEPPED.iter().any(|end| path.ends_with(end)) => Some("it is counted in whole solver steps"),
        _ if value == 0.0 && OFF_AT_ZERO.contains(&path) => Some("0 leaves that part out, a small value does not: no derivative at 0"),
        _ if value == 0.0 && ROOT_AT_ZERO.contains(&path) => Some("what it does grows as its root: no derivative at 0"),
        _ => None,
    }
}

/// Why a run has no derivative by the severity of a fault among `records` of all parameters and their values.
pub fn fault_refusal(fault: &FaultSpec, raw: &[f64], records: &[(String, &Variable)]) -> Option<&'static str> {
    fault.writes.iter().find_map(|write| match write.op {
        Op::Set => Some("it is a switch"),
        Op::AddWhole => Some("it counts whole things"),
        Op::Pulse => Some("it is the duty of a switch"),
        Op::Add | Op::Grow | Op::Lose => {
            let (path, variable) = &records[write.index];
            let value = if fault.severity == 0.0 { raw[write.index] } else { fault.severity };
            parameter_refusal(path, variable, value)
        }
    })
}

/// Parameters that put a force on the output.
const FORCES: &[&str] = &["load.constant", "load.stiffness", "load.friction"];

/// Why a run whose output bears no force (`loaded`: a waveform puts one on it) has no derivative by one. `at` gives the values
/// of parameters.
pub fn force_refusal(path: &str, at: impl Fn(&str) -> f64, loaded: bool) -> Option<&'static str> {
    let first = FORCES.contains(&path) && !loaded && FORCES.iter().all(|force| at(force) == 0.0);
    (first && at("backlash.total") != 0.0).then_some("the first force on the output chooses a flank of the backlash: no derivative at 0")
}
