//! State machine of a landing gear's control unit: interlocks, moves in two speeds, time-outs, retries, fault states.
//! It runs at control ticks, one lane at a time.

mod codes;
mod command;
mod moves;
mod position;
mod readings;
mod rest;
mod watch;

pub use codes::{COMMANDS, FAULTS, REFUSALS, WARNINGS};
pub use command::Note;
pub use position::Places;
pub use readings::{SWITCHES, WHEELS};

use crate::kept::{keep_choice, Kept, Store};
use crate::{choices, kept, variables};
use codes::{FREE_FALL, POWER, STOP};
use command::Notes;
use position::{Margins, Position};
use readings::{Limits, Readings, P100, P25, P75};

choices! {
    /// What the small demand of P's Table 2.1 does.
    BrakeReading { SoftwareBrake "software_brake", Release "release" }
}

variables! {
    /// The state machine.
    SequenceParameter, SEQUENCE {
        SpeedHigh => "speed_high", "w_mH", "rad/s", Positive, Controller, None, "motor speed of the long part of a stroke";
        SpeedLow => "speed_low", "w_mL", "rad/s", Positive, Controller, None, "motor speed near the end: beyond 75 % extending, below 25 % retracting";
        BrakeVoltage => "brake_voltage", "V_demth", "V", NonNegative, Controller, None, "SW brake maximum voltage command: the demand below which the windings are shorted, or that first releases the brake (brake_reading)";
        BrakeReading => "brake_reading", "-", "1", Choice(BrakeReading::NAMES), Controller, Some(0.0), "software_brake: below brake_voltage all low switches short the windings, the brake opens with the move; release: brake_voltage first releases the brake, which stays open until the move ends";
        ProofCurrent => "proof_current", "-", "A", NonNegative, Controller, Some(0.0), "torque proof: mean line current that must flow before the brake opens; 0: none is required";
        MotionTimeout => "motion_timeout", "-", "s", Positive, Controller, None, "longest move";
        UnlockTimeout => "unlock_timeout", "-", "s", Positive, Controller, None, "longest time from retract until the lock sleeve lets go";
        LockTimeout => "lock_timeout", "-", "s", Positive, Controller, None, "longest low-speed part of an extension without the lock sleeve";
        Retries => "retries", "-", "1", Between(0.0, 10.0), Controller, None, "tries after the first one";
        RetryPause => "retry_pause", "-", "s", NonNegative, Controller, None, "rest before a retry";
        StallSpeed => "stall_speed", "-", "rad/s", Positive, Controller, None, "motor speed below which the motor counts as standing";
        StallTime => "stall_time", "-", "s", Positive, Controller, None, "time standing under demand that counts as a stall";
        StallVoltage => "stall_voltage", "-", "V", Positive, Controller, None, "demand that counts for a stall";
        Overspeed => "overspeed", "-", "rad/s", Positive, Controller, None, "motor speed that faults";
        Undervoltage => "undervoltage", "-", "V", NonNegative, Controller, None, "supply below which a move is refused";
        Overvoltage => "overvoltage", "-", "V", Positive, Controller, None, "supply above which a move is refused";
        Overcurrent => "overcurrent", "-", "A", Positive, Controller, None, "filtered link current that faults";
        CurrentFilter => "current_filter", "-", "s", Positive, Controller, Some(0.02), "time constant of the filter of the link current";
        HallErrors => "hall_errors", "-", "1", Between(1.0, 8.0), Controller, Some(5.0), "wrong Hall codes within hall_window that fault";
        HallWindow => "hall_window", "-", "s", Positive, Controller, Some(0.1), "window over which wrong Hall codes are counted";
        Debounce => "debounce", "-", "s", NonNegative, Controller, Some(0.01), "time for which a switch must read the same before it counts";
        ChatterTime => "chatter_time", "-", "s", Positive, Controller, Some(2.0), "time over which the changes of a switch are counted";
        ChatterChanges => "chatter_changes", "-", "1", Count(3.0, 100.0), Controller, Some(6.0), "changes within chatter_time beyond which a switch is at fault";
        ProximityTime => "proximity_time", "-", "s", Positive, Controller, Some(0.02), "time that an impossible set of switches is borne";
        ProximityTravel => "proximity_travel", "-", "m", Positive, Controller, Some(0.02), "by how much the Hall count may contradict the switch at 25 or 75 %";
        CountTolerance => "count_tolerance", "-", "m", Positive, Controller, Some(5e-4), "by how much the Hall count may contradict the switches at the ends";
        RestTime => "rest_time", "-", "s", NonNegative, Controller, Some(0.3), "from the end of a move until rest is watched";
        RestTravel => "rest_travel", "-", "m", Positive, Controller, Some(5e-4), "travel by the Hall count at rest that faults";
        ConfirmDelay => "confirm_delay", "-", "s", NonNegative, Controller, Some(1.0), "from power-up without a command until an end that a switch shows is confirmed by pressing against its stop";
        ConfirmTime => "confirm_time", "-", "s", Positive, Controller, Some(0.1), "time standing under a drag limit's current that counts as the stop of an end";
        AirborneTime => "airborne_time", "-", "s", NonNegative, Controller, Some(1.0), "once there was weight on wheels: time without it before a retraction";
        SupplyTime => "supply_time", "-", "s", NonNegative, Controller, Some(0.1), "time outside undervoltage and overvoltage that ends a motion";
        LogicVoltage => "logic_voltage", "-", "V", NonNegative, Controller, Some(6.0), "supply below which the unit itself has no power";
        HoldUp => "hold_up", "-", "s", NonNegative, Controller, Some(0.06), "time without power that the unit bridges";
        StartTime => "start_time", "-", "s", NonNegative, Controller, Some(0.2), "from the return of power to the first tick";
        OpenCurrent => "open_current", "-", "A", Positive, Controller, Some(1.0), "line current below which a motor that stands under demand has none";
        FallOrder => "fall_order", "-", "s", NonNegative, Controller, Some(0.2), "shortest time from the switch at 75 % to the lock in a free fall";
        FallConfirm => "fall_confirm", "-", "s", NonNegative, Controller, Some(3.0), "longest time of a healthy fall from 75 % to the lock: the lock's switch counts only after it";
        FallTime => "fall_time", "-", "s", Positive, Controller, Some(10.0), "longest free fall without the lock sleeve";
        DragTime => "drag_time", "-", "s", Positive, Controller, Some(0.5), "time of current above a drag limit that warns";
        DragExtension => "drag_extension", "-", "A", Positive, Controller, Some(12.0), "filtered motoring current that warns in extension, which the load aids";
        DragRetraction => "drag_retraction", "-", "A", Positive, Controller, Some(42.0), "filtered motoring current that warns in retraction";
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    Retracted,
    Extending,
    Locked,
    Retracting,
    Stopped,
    Released,
    Fault,
    /// At rest at an end that one switch alone shows.
    Unconfirmed,
    /// Without power, or starting.
    Off,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Move {
    #[default]
    Idle,
    Extend,
    Retract,
    Halt,
    /// Low speed back to 75 %, then extend again.
    BackOff,
    /// Extend against the stop for a moment, then retract again.
    Reseat,
    /// Press against the stop of the end that a switch shows, at power-up.
    Confirm,
}

impl Kept for Phase {
    fn keep(&mut self, store: &mut Store) {
        use Phase::*;
        keep_choice(self, &[Retracted, Extending, Locked, Retracting, Stopped, Released, Fault, Unconfirmed, Off], store);
    }
}

impl Kept for Move {
    fn keep(&mut self, store: &mut Store) {
        use Move::*;
        keep_choice(self, &[Idle, Extend, Retract, Halt, BackOff, Reseat, Confirm], store);
    }
}

/// What the control unit sees at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub dt: f64,
    pub time: f64,
    /// The command as it stands; a repeated one differs by the number of commands.
    pub command: u8,
    pub supply: f64,
    /// Filtered link current, and filtered line current (positive: torque towards extension).
    pub current: f64,
    pub line: f64,
    /// Line current of the last tick.
    pub line_now: f64,
    pub speed: f64,
    pub demand: f64,
    /// 0, 25, 75 %, lock sleeve, weight on wheels.
    pub switches: [bool; SWITCHES],
    /// Nut travel by the Hall count since power-up, and what the count may have lost since the last tick.
    pub counted: f64,
    pub lost: f64,
    pub hall_errors: f64,
    /// Neither all high nor all low.
    pub hall_valid: bool,
    /// The bridge has tripped.
    pub tripped: bool,
    /// A rig moves the ram: the unit is a bystander.
    pub rig: bool,
    pub release_time: f64,
}

/// What the control unit does until the next tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Orders {
    pub drive: bool,
    pub extending: bool,
    pub target: f64,
    pub brake_powered: bool,
    /// All low switches on, whatever the demand.
    pub short: bool,
    /// The speed control starts anew.
    pub fresh: bool,
}

#[derive(Clone, Copy, Debug)]
pub struct Sequence {
    pub phase: Phase,
    action: Move,
    following: Option<Move>,
    wanted: u8,
    last: u8,
    pub released: bool,
    releasing: f64,
    falling: f64,
    /// The release has not opened: the motor may try again.
    pub closed: bool,
    /// Since the begin of the move, since power-up.
    since: f64,
    powered: f64,
    pause: f64,
    retries: f64,
    standing: f64,
    /// Time standing under the current that only a stop takes.
    pressing: f64,
    slow: f64,
    /// Time at rest, the counts at its begin and once settled, and the time for which the switch of the end has been off.
    resting: f64,
    arrived: f64,
    anchor: f64,
    gone: f64,
    /// Furthest count of a move in its direction.
    furthest: f64,
    dragging: f64,
    impossible: f64,
    /// Time with the supply outside its limits.
    starved: f64,
    hall_seen: f64,
    hall_begun: f64,
    hall_invalid: f64,
    hall_times: [f64; 8],
    cleared: bool,
    extending: bool,
    brake_open: bool,
    fresh: bool,
    /// The lock's switch came out of order in a free fall: it proves nothing any more.
    distrusted: bool,
    /// Two switches contradict each other and nothing tells which is wrong.
    doubt: bool,
    /// There has been weight on wheels since power-up.
    grounded: bool,
    /// The end shown at power-up has been pressed against.
    pressed: bool,
    places: Places,
    position: Position,
    readings: Readings,
    pub fault: u8,
    pub refused: u8,
    pub warning: u8,
    pub notes: Notes,
}

kept!(Sequence as Sequence {
    phase, action, following, wanted, last, released, releasing, falling, closed, since, powered, pause, retries, standing, pressing,
    slow, resting, arrived, anchor, gone, furthest, dragging, impossible, starved, hall_seen, hall_begun, hall_invalid, hall_times,
    cleared, extending, brake_open, fresh, distrusted, doubt, grounded, pressed, places, position, readings, fault, refused, warning,
    notes
});

impl Sequence {
    /// At power-up. An end that one switch shows is not yet known.
    pub fn start(released: bool, places: Places, switches: [bool; SWITCHES]) -> Self {
        let ends = [switches[0], switches[P100]];
        let phase = match ends {
            _ if released => Phase::Released,
            [false, false] => Phase::Stopped,
            _ => Phase::Unconfirmed,
        };
        Self {
            phase,
            action: Move::Idle,
            following: None,
            wanted: STOP,
            last: STOP,
            released,
            releasing: 0.0,
            falling: 0.0,
            closed: false,
            since: 0.0,
            powered: 0.0,
            pause: 0.0,
            retries: 0.0,
            standing: 0.0,
            pressing: 0.0,
            slow: 0.0,
            resting: 0.0,
            arrived: 0.0,
            anchor: 0.0,
            gone: 0.0,
            furthest: 0.0,
            dragging: 0.0,
            impossible: 0.0,
            starved: 0.0,
            hall_seen: 0.0,
            hall_begun: 0.0,
            hall_invalid: 0.0,
            hall_times: [f64::NEG_INFINITY; 8],
            cleared: false,
            extending: true,
            brake_open: false,
            fresh: false,
            distrusted: false,
            doubt: false,
            grounded: switches[WHEELS],
            pressed: ends == [true, true],
            places,
            position: Position::start(&places, switches, 0.0),
            readings: Readings::start(switches, 0.0),
            fault: 0,
            refused: 0,
            warning: 0,
            notes: Notes::default(),
        }
    }

    pub fn step(&mut self, p: &[f64], see: &Seen) -> Orders {
        self.fresh = false;
        self.since += see.dt;
        self.powered += see.dt;
        self.read(p, see);
        self.take_command(p, see);
        if !see.rig {
            self.watch(p, see);
        }
        self.act(p, see);
        self.orders(p, see)
    }

    /// The unit has lost its power: nothing is driven, nothing known. The release is the crew's own lever and works on.
    pub fn lose_power(&mut self, see: &Seen) {
        if self.phase != Phase::Off {
            self.notes.add(Note::Failed { time: see.time, fault: POWER, command: self.wanted, warning: 0 });
            (self.phase, self.fault) = (Phase::Off, POWER);
            (self.action, self.following, self.wanted) = (Move::Idle, None, STOP);
        }
        if see.command % COMMANDS.len() as u8 == FREE_FALL || self.releasing > 0.0 {
            self.open_release(see);
        }
    }

    /// Power is back: as at power-up. A command that stands is not taken again.
    pub fn restart(&mut self, see: &Seen) {
        let (notes, releasing, fault) = (self.notes, self.releasing, self.fault);
        *self = Self {
            notes,
            releasing,
            fault,
            last: see.command,
            position: Position::start(&self.places, see.switches, see.counted),
            readings: Readings::start(see.switches, see.counted),
            hall_seen: see.hall_errors,
            ..Self::start(self.released, self.places, see.switches)
        };
    }

    /// The count moves the interval, a switch in mid-stroke that changes narrows it. Apart from the screw the motor's count
    /// bears no information.
    fn read(&mut self, p: &[f64], see: &Seen) {
        let limits = self.limits(p);
        self.readings.step(see.switches, &limits, see.counted, see.lost, see.dt);
        self.grounded |= self.readings.on[WHEELS];
        self.position.advance(see.counted, see.lost);
        if self.apart() {
            let (low, high) = self.places.whole();
            self.position.between(low, high);
            self.readings.forget_travel(see.counted);
        } else if self.action != Move::Idle {
            // At rest no edge is passed: a switch that changes then has failed.
            self.readings.place(&mut self.position, &self.places, see.counted, limits.travel[0] / 2.0);
        }
    }

    fn limits(&self, p: &[f64]) -> Limits {
        Limits {
            debounce: p[SequenceParameter::Debounce as usize],
            chatter_time: p[SequenceParameter::ChatterTime as usize],
            chatter_changes: p[SequenceParameter::ChatterChanges as usize],
            travel: [2.0 * p[SequenceParameter::CountTolerance as usize], p[SequenceParameter::ProximityTravel as usize]],
        }
    }

    fn margins(p: &[f64]) -> Margins {
        Margins { end: p[SequenceParameter::CountTolerance as usize], quarter: p[SequenceParameter::ProximityTravel as usize] }
    }

    /// The stages are apart, or about to be.
    fn apart(&self) -> bool {
        (self.released || self.releasing > 0.0) && !self.closed
    }

    /// Weight on wheels, or not long enough without it. A switch that chatters is taken to be on.
    fn on_wheels(&self, p: &[f64]) -> bool {
        let wheels = &self.readings;
        let settling = self.grounded && wheels.stood[WHEELS] < p[SequenceParameter::AirborneTime as usize];
        wheels.on[WHEELS] || wheels.failed[WHEELS] || settling
    }

    /// Beyond 75 %, where an extension is slow: by the switch, or by the count where the switch fails.
    fn last_quarter(&self) -> bool {
        if self.readings.failed[P75] {
            self.position.high >= self.places.switch[P75]
        } else {
            self.readings.on[P75]
        }
    }

    /// Below 25 %, where a retraction is slow.
    fn first_quarter(&self) -> bool {
        if self.readings.failed[P25] {
            self.position.low <= self.places.switch[P25]
        } else {
            !self.readings.on[P25]
        }
    }
}
