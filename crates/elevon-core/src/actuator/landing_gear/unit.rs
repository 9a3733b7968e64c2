//! The control unit of one actuator: switches, state machine, speed control, brake coil. Plain numbers, one lane.

use super::layout::Raw;
use crate::control::pi_rate::{PiRate, PiRateParameter};
use crate::control::sequence::{Phase, Seen, Sequence, SequenceParameter, COMMANDS, FAULTS, REFUSALS};
use crate::sensor::proximity::{ProximityParameter, Switches};
use crate::transmission::brake::{BrakeParameter, Coil, Powered};
use crate::transmission::lever::LeverParameter;
use crate::transmission::lock::LockParameter;
use crate::transmission::planetary::{ReleaseOpen, ReleaseParameter};

#[derive(Clone, Copy, Debug)]
pub struct Unit {
    pub sequence: Sequence,
    pub speed: PiRate,
    pub switches: Switches,
    pub coil: Coil,
    pub demand: f64,
    pub driving: bool,
    pub speed_meas: f64,
    current: f64,
    origin: f64,
}

/// What the plant shows the unit at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    pub time: f64,
    pub command: f64,
    pub on_wheels: f64,
    pub supply: f64,
    pub bus: f64,
    pub speed: f64,
    pub ram: f64,
    pub locked: f64,
    /// Travel of the nut by the Hall count since the start.
    pub counted: f64,
    pub hall_errors: f64,
}

impl Unit {
    pub fn start(raw: &[f64], nut: f64) -> Self {
        let raw = Raw(raw);
        let stroke = raw.lever()[LeverParameter::Stroke as usize];
        let locked = nut - stroke >= raw.lock()[LockParameter::EngageTravel as usize];
        let released = ReleaseOpen::read(raw.release()[ReleaseParameter::Open as usize]) == ReleaseOpen::Yes;
        let switches = Switches::start(raw.proximity(), nut.min(stroke), locked);
        let phase = match switches.shown {
            [_, _, _, true] => Phase::Locked,
            _ if released => Phase::Released,
            [true, ..] => Phase::Retracted,
            _ => Phase::Stopped,
        };
        let coil = Coil::new(Powered::read(raw.brake()[BrakeParameter::Powered as usize]) == Powered::Always);
        Self {
            sequence: Sequence::start(phase, released),
            speed: PiRate::default(),
            switches,
            coil,
            demand: 0.0,
            driving: false,
            speed_meas: 0.0,
            current: 0.0,
            origin: nut,
        }
    }

    pub fn tick(&mut self, raw: &[f64], shown: &Shown) {
        let raw = Raw(raw);
        let (p, proximity) = (raw.sequence(), raw.proximity());
        let dt = raw.pi_rate()[PiRateParameter::Period as usize];
        self.switches.step(proximity, shown.ram, shown.locked > 0.5, dt);
        self.current += (shown.bus - self.current) * (dt / (dt + p[SequenceParameter::CurrentFilter as usize]));
        self.speed_meas = shown.speed;
        let travel = self.origin + shown.counted;
        let orders = self.sequence.step(
            p,
            &Seen {
                dt,
                time: shown.time,
                command: shown.command.round().clamp(0.0, COMMANDS.len() as f64 - 1.0) as u8,
                on_wheels: shown.on_wheels > 0.5,
                supply: shown.supply,
                current: self.current,
                speed: shown.speed,
                demand: self.demand,
                switches: self.switches.shown,
                travel,
                left: raw.lever()[LeverParameter::Stroke as usize] - travel,
                quarters: [proximity[ProximityParameter::Position25 as usize], proximity[ProximityParameter::Position75 as usize]],
                hall_errors: shown.hall_errors,
                release_time: raw.release()[ReleaseParameter::Time as usize],
            },
        );
        if orders.fresh {
            self.speed = PiRate::default();
        }
        self.driving = orders.drive;
        if orders.drive {
            self.demand = self.speed.step(raw.pi_rate(), orders.extending, orders.target, shown.speed, shown.supply);
        } else {
            self.demand = 0.0;
            self.speed = PiRate::default();
        }
        let brake = raw.brake();
        let powered = orders.brake_powered || Powered::read(brake[BrakeParameter::Powered as usize]) == Powered::Always;
        self.coil.step(powered, brake[BrakeParameter::ReleaseDelay as usize], brake[BrakeParameter::EngageDelay as usize], dt);
    }

    /// Why the unit gave up, if it did.
    pub fn reason(&self) -> Option<String> {
        let sequence = &self.sequence;
        if let Some((command, value)) = sequence.turned_down {
            let interlock = REFUSALS[usize::from(sequence.refused.max(1))];
            let shown = if matches!(sequence.refused, 3 | 4) { format!(" ({value:.1} V)") } else { String::new() };
            return Some(format!("{} refused: {interlock}{shown}", COMMANDS[usize::from(command)]));
        }
        (sequence.fault > 0).then(|| format!("the control unit is in its fault state: {}", FAULTS[usize::from(sequence.fault)]))
    }
}
