//! The control unit of one actuator: switches, state machine, speed control, brake coil. Plain numbers, one lane.

use super::layout::Raw;
use crate::control::pi_rate::{PiRate, PiRateParameter};
use crate::control::sequence::{BrakeReading, Note, Orders, Phase, Places, Seen, Sequence, SequenceParameter, COMMANDS};
use crate::kept;
use crate::sensor::proximity::{ProximityParameter, Scene, Switches};
use crate::transmission::brake::{BrakeParameter, Coil, Feed, Powered};
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
    /// All low switches on.
    pub short: bool,
    pub speed_meas: f64,
    current: f64,
    line: f64,
    hall_errors: f64,
    hanging: f64,
    reported: bool,
    /// Time for which the supply has not carried the unit, and, once it is off, for which it has again.
    dead: f64,
    starting: f64,
}

kept!(Unit as Unit {
    sequence, speed, switches, coil, demand, driving, short, speed_meas, current, line, hall_errors, hanging, reported, dead, starting
});

/// The plant's signals that the unit reads at a tick.
#[derive(Clone, Copy, Debug)]
pub struct PlantSignals {
    pub time: f64,
    pub command: f64,
    pub on_wheels: bool,
    pub supply: f64,
    pub bus: f64,
    pub speed: f64,
    pub ram: f64,
    pub locked: f64,
    /// Mean line current since the last tick.
    pub line: f64,
    /// Travel of the nut by the Hall count since the start, and per motor angle and edge.
    pub counted: f64,
    pub travel: f64,
    pub pitch: f64,
    pub hall_errors: f64,
    pub hall_valid: bool,
    pub tripped: bool,
    pub rig: bool,
    /// For the verdict on the run alone, no input of the unit: the nut's speed.
    pub nut_speed: f64,
}

/// A released ram that stands for this long (s) short of its lock hangs.
const HANGING: f64 = 0.5;
/// Edges that a wrong Hall code may hide.
const HIDDEN: f64 = 3.0;

fn places(raw: Raw<'_, f64>) -> Places {
    let (proximity, lock) = (raw.proximity(), raw.lock());
    let at = |p: ProximityParameter| proximity[p as usize];
    Places {
        switch: [at(ProximityParameter::Position0), at(ProximityParameter::Position25), at(ProximityParameter::Position75)],
        hysteresis: at(ProximityParameter::Hysteresis),
        stroke: raw.lever()[LeverParameter::Stroke as usize],
        engage: lock[LockParameter::EngageTravel as usize],
        release: lock[LockParameter::ReleaseTravel as usize],
        end: lock[LockParameter::Travel as usize] + lock[LockParameter::Overtravel as usize],
    }
}

impl Unit {
    pub fn start(raw: &[f64], nut: f64) -> Self {
        let raw = Raw(raw);
        let stroke = raw.lever()[LeverParameter::Stroke as usize];
        let locked = nut - stroke >= raw.lock()[LockParameter::EngageTravel as usize];
        let released = ReleaseOpen::read(raw.release()[ReleaseParameter::Open as usize]) == ReleaseOpen::Yes;
        let switches = Switches::start(raw.proximity(), Scene { ram: nut.min(stroke), locked, wheels: false });
        let coil = Coil::new(Powered::read(raw.brake()[BrakeParameter::Powered as usize]) == Powered::Always);
        Self {
            sequence: Sequence::start(released, places(raw), switches.reading),
            speed: PiRate::default(),
            switches,
            coil,
            demand: 0.0,
            driving: false,
            short: false,
            speed_meas: 0.0,
            current: 0.0,
            line: 0.0,
            hall_errors: 0.0,
            hanging: 0.0,
            reported: false,
            dead: 0.0,
            starting: 0.0,
        }
    }

    /// The first tick is power-up: what the switches read then, weight on wheels too.
    pub fn tick(&mut self, raw: &[f64], plant: &PlantSignals) {
        let raw = Raw(raw);
        let p = raw.sequence();
        let dt = raw.pi_rate()[PiRateParameter::Period as usize];
        let scene = Scene { ram: plant.ram, locked: plant.locked > 0.5, wheels: plant.on_wheels };
        if plant.time <= 0.0 {
            self.switches = Switches::start(raw.proximity(), scene);
            self.sequence = Sequence::start(self.sequence.released, places(raw), self.switches.reading);
        } else {
            self.switches.step(raw.proximity(), scene, dt);
        }
        let share = dt / (dt + p[SequenceParameter::CurrentFilter as usize]);
        self.current = settled(self.current + (plant.bus - self.current) * share);
        self.line = settled(self.line + (plant.line - self.line) * share);
        self.speed_meas = plant.speed;
        let seen = self.seen(raw, plant, dt);
        let orders = self.ordered(p, &seen);
        if orders.fresh || !orders.drive {
            self.speed = PiRate::default();
        }
        self.driving = orders.drive;
        self.demand =
            if orders.drive { self.speed.step(raw.pi_rate(), orders.extending, orders.target, plant.speed, plant.supply) } else { 0.0 };
        let software = BrakeReading::read(p[SequenceParameter::BrakeReading as usize]) == BrakeReading::SoftwareBrake;
        self.short = orders.short || (software && orders.drive && self.demand.abs() < p[SequenceParameter::BrakeVoltage as usize]);
        let brake = raw.brake();
        let always = Powered::read(brake[BrakeParameter::Powered as usize]) == Powered::Always;
        self.coil.step(brake, Feed { always, powered: orders.brake_powered, supply: plant.supply }, dt);
        self.judge(plant, dt);
    }

    /// The orders of the state machine while the unit has power: it bridges an interruption, then starts anew.
    fn ordered(&mut self, p: &[f64], seen: &Seen) -> Orders {
        let carries = seen.supply >= p[SequenceParameter::LogicVoltage as usize];
        self.dead = if carries { 0.0 } else { self.dead + seen.dt };
        if self.sequence.phase == Phase::Off {
            self.starting = if carries { self.starting + seen.dt } else { 0.0 };
            if self.starting > p[SequenceParameter::StartTime as usize] * (1.0 - 1e-9) {
                self.sequence.restart(seen);
            }
        } else if self.dead > p[SequenceParameter::HoldUp as usize] * (1.0 + 1e-9) {
            self.starting = 0.0;
        } else {
            return self.sequence.step(p, seen);
        }
        if self.sequence.phase == Phase::Off || !carries {
            self.sequence.lose_power(seen);
        }
        Orders::default()
    }

    fn seen(&mut self, raw: Raw<'_, f64>, plant: &PlantSignals, dt: f64) -> Seen {
        let wrong = plant.hall_errors - self.hall_errors;
        self.hall_errors = plant.hall_errors;
        // While no code comes the motor may run as fast as it is let.
        let blind = if plant.hall_valid { 0.0 } else { dt * plant.travel * raw.sequence()[SequenceParameter::Overspeed as usize] };
        Seen {
            dt,
            time: plant.time,
            command: plant.command.round().clamp(0.0, 2.0 * COMMANDS.len() as f64 - 1.0) as u8,
            supply: plant.supply,
            current: self.current,
            line: self.line,
            line_now: plant.line,
            speed: plant.speed,
            demand: self.demand,
            switches: self.switches.reading,
            counted: plant.counted,
            lost: wrong * HIDDEN * plant.pitch + blind,
            hall_errors: plant.hall_errors,
            hall_valid: plant.hall_valid,
            tripped: plant.tripped,
            rig: plant.rig,
            release_time: raw.release()[ReleaseParameter::Time as usize],
        }
    }

    /// A ram that should fall and rests unlocked did not arrive.
    fn judge(&mut self, plant: &PlantSignals, dt: f64) {
        let hangs = self.sequence.released && plant.locked < 0.5 && plant.nut_speed == 0.0 && !plant.rig;
        self.hanging = if hangs { self.hanging + dt } else { 0.0 };
        if self.hanging > HANGING && !self.reported {
            self.reported = true;
            self.sequence.notes.add(Note::Hanging { time: plant.time, place: plant.ram });
        }
    }

    /// What went otherwise than commanded, if anything.
    pub fn reason(&self) -> Option<String> {
        self.sequence.notes.text()
    }
}

/// A filter's rest that is too small to be a number of full precision is zero.
fn settled(x: f64) -> f64 {
    if x.abs() < 1e-30 {
        0.0
    } else {
        x
    }
}
