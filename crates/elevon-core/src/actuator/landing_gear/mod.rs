//! The landing-gear actuator (Pisa): control unit, six-step bridge, star motor with Hall sensors, planetary gearbox with
//! free-fall release, roller screw, down-lock, leg on a lever.

mod body;
mod checks;
mod faults;
mod high;
mod layout;
mod low;
mod mechanics;
mod signals;
mod unit;

use crate::actuator::{Machine, Port, Tick, Watch, WATCHED};
use crate::control::sequence;
use crate::fault::FaultKind;
use crate::scalar::Scalar;
use crate::time::Steps;
use crate::variable::Group;

pub use high::High;
pub use low::Low;

const INITIAL: &[&str] = &["nut_position", "motor_speed"];

/// What both fidelities are.
#[derive(Clone)]
pub struct LandingGear;

impl Machine for LandingGear {
    const GROUPS: &'static [Group] = layout::GROUPS;
    const PORTS: &'static [Port] = layout::PORTS;
    const HELD_PORTS: &'static [usize] = &[layout::AMBIENT];
    const MODES: &'static [&'static str] = &["gear"];
    const MODE_UNITS: &'static [&'static str] = &[""];
    const ACTIONS: &'static [&'static str] = sequence::COMMANDS;

    fn faults() -> Vec<FaultKind> {
        faults::catalogue()
    }
}

fn control_tick(period: f64, dt: f64) -> Vec<Tick> {
    vec![Tick::every(((period / dt).round() as Steps).max(1), 0)]
}

fn watch<S: Scalar>(body: &body::Body<S>, current: S) -> [Watch<S>; WATCHED] {
    [
        Watch { name: "motor_speed", value: body.motion.motor_speed.abs().maximum(body.motion.fastest), limit: 1e6 },
        Watch { name: "current_line", value: current, limit: 1e6 },
        Watch { name: "supply_voltage", value: body.link, limit: 1e5 },
        // Share of the lock's strength in use.
        Watch { name: "lock_force", value: body.lock_use, limit: 1.0 },
    ]
}
