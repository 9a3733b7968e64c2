//! State machine of a landing gear's control unit: interlocks, moves in two speeds, time-outs, retries, fault states.
//! It runs at control ticks, one lane at a time.

mod codes;
mod command;
mod moves;
mod position;
mod watch;

pub use codes::{COMMANDS, FAULTS, REFUSALS, WARNINGS};
pub use command::Note;
pub use position::Places;

use crate::{choices, variables};
use codes::STOP;
use command::Notes;
use position::Position;

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
        ProximityTime => "proximity_time", "-", "s", Positive, Controller, Some(0.02), "time that an impossible set of switches is borne";
        ProximityTravel => "proximity_travel", "-", "m", Positive, Controller, Some(0.02), "by how much the Hall count may contradict the switch at 25 or 75 %";
        CountTolerance => "count_tolerance", "-", "m", Positive, Controller, Some(5e-4), "by how much the Hall count may contradict the switches at the ends";
        RestTime => "rest_time", "-", "s", NonNegative, Controller, Some(0.3), "from the end of a move until rest is watched";
        RestTravel => "rest_travel", "-", "m", Positive, Controller, Some(5e-4), "travel by the Hall count at rest that faults";
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
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Move {
    Idle,
    Extend,
    Retract,
    Halt,
    /// Low speed back to 75 %, then extend again.
    BackOff,
    /// Extend against the stop for a moment, then retract again.
    Reseat,
}

/// What the control unit sees at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub dt: f64,
    pub time: f64,
    /// The command as it stands; a repeated one differs by the number of commands.
    pub command: u8,
    pub on_wheels: bool,
    pub supply: f64,
    /// Filtered link current, and filtered line current (positive: torque towards extension).
    pub current: f64,
    pub line: f64,
    /// Line current of the last tick.
    pub line_now: f64,
    pub speed: f64,
    pub demand: f64,
    /// 0, 25, 75 %, lock sleeve.
    pub switches: [bool; 4],
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
#[derive(Clone, Copy, Debug)]
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
    since: f64,
    pause: f64,
    retries: f64,
    standing: f64,
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
    hall_seen: f64,
    hall_invalid: f64,
    hall_times: [f64; 8],
    cleared: bool,
    extending: bool,
    brake_open: bool,
    fresh: bool,
    /// The lock's switch has contradicted the others: it proves nothing any more.
    distrusted: bool,
    places: Places,
    position: Position,
    pub fault: u8,
    pub refused: u8,
    pub warning: u8,
    pub notes: Notes,
}

impl Sequence {
    pub fn start(phase: Phase, released: bool, places: Places, switches: [bool; 4]) -> Self {
        Self {
            phase,
            action: Move::Idle,
            following: None,
            wanted: STOP,
            last: STOP,
            released,
            releasing: 0.0,
            falling: 0.0,
            since: 0.0,
            pause: 0.0,
            retries: 0.0,
            standing: 0.0,
            slow: 0.0,
            resting: 0.0,
            arrived: 0.0,
            anchor: 0.0,
            gone: 0.0,
            furthest: 0.0,
            dragging: 0.0,
            impossible: 0.0,
            hall_seen: 0.0,
            hall_invalid: 0.0,
            hall_times: [f64::NEG_INFINITY; 8],
            cleared: false,
            extending: true,
            brake_open: false,
            fresh: false,
            distrusted: false,
            places,
            position: Position::start(&places, switches, 0.0),
            fault: 0,
            refused: 0,
            warning: 0,
            notes: Notes::default(),
        }
    }

    pub fn step(&mut self, p: &[f64], see: &Seen) -> Orders {
        self.fresh = false;
        self.since += see.dt;
        self.take_command(p, see);
        if !see.rig {
            self.locate(see);
            self.watch(p, see);
        }
        self.act(p, see);
        self.orders(p, see)
    }

    /// The count moves the interval; agreeing switches narrow it. Apart from the screw the motor's count bears no information.
    fn locate(&mut self, see: &Seen) {
        self.position.advance(see.counted, see.lost);
        if self.released || self.releasing > 0.0 {
            let (low, high) = self.places.whole();
            self.position.between(low, high);
        }
    }

    fn narrow(&mut self, p: &[f64], see: &Seen) {
        self.position.narrow(&self.places, see.switches, p[SequenceParameter::CountTolerance as usize]);
    }
}
