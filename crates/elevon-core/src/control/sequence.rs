//! State machine of a landing gear's control unit: interlocks, moves in two speeds, time-outs, retries, fault states.
//! It runs at control ticks, one lane at a time.

use crate::variables;

variables! {
    /// The state machine.
    SequenceParameter, SEQUENCE {
        SpeedHigh => "speed_high", "w_mH", "rad/s", Positive, Controller, None, "motor speed of the long part of a stroke";
        SpeedLow => "speed_low", "w_mL", "rad/s", Positive, Controller, None, "motor speed near the end: beyond 75 % extending, below 25 % retracting";
        BrakeVoltage => "brake_voltage", "V_demth", "V", NonNegative, Controller, None, "demand that first releases the brake; it stays released until the move ends";
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
        ProximityTravel => "proximity_travel", "-", "m", Positive, Controller, Some(0.02), "travel by the Hall count past a switch that should have changed";
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

/// Why the control unit is in its fault state.
pub const FAULTS: &[&str] =
    &["none", "motion time-out", "lock not released", "lock not engaged", "stalled", "overspeed", "overcurrent", "hall", "proximity"];
const MOTION: u8 = 1;
const NOT_RELEASED: u8 = 2;
const NOT_ENGAGED: u8 = 3;
const STALLED: u8 = 4;
const OVERSPEED: u8 = 5;
const OVERCURRENT: u8 = 6;
const HALL: u8 = 7;
const PROXIMITY: u8 = 8;

pub const COMMANDS: &[&str] = &["stop", "extend", "retract", "free_fall"];
const STOP: u8 = 0;
const EXTEND: u8 = 1;
const RETRACT: u8 = 2;
const FREE_FALL: u8 = 3;

/// Why a command was refused.
pub const REFUSALS: &[&str] = &[
    "none",
    "the free-fall release is open",
    "the control unit is in its fault state",
    "the supply is below control.undervoltage",
    "the supply is above control.overvoltage",
    "weight on wheels",
    "the down-lock is engaged",
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Move {
    Rest,
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
    pub command: u8,
    pub on_wheels: bool,
    pub supply: f64,
    pub current: f64,
    pub speed: f64,
    pub demand: f64,
    /// 0, 25, 75 %, lock sleeve.
    pub switches: [bool; 4],
    /// Nut travel by the Hall count, and what is left of it to the end of the stroke.
    pub travel: f64,
    pub left: f64,
    /// Travel at which the switches at 25 and 75 % stand.
    pub quarters: [f64; 2],
    pub hall_errors: f64,
    pub release_time: f64,
}

/// What the control unit does until the next tick.
#[derive(Clone, Copy, Debug)]
pub struct Orders {
    pub drive: bool,
    pub extending: bool,
    pub target: f64,
    pub brake_powered: bool,
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
    since: f64,
    pause: f64,
    retries: f64,
    standing: f64,
    slow: f64,
    impossible: f64,
    hall_seen: f64,
    hall_times: [f64; 8],
    cleared: bool,
    extending: bool,
    brake_open: bool,
    fresh: bool,
    pub fault: u8,
    pub refused: u8,
    /// The first command was refused: the command and the value that spoke against it.
    pub turned_down: Option<(u8, f64)>,
    accepted: bool,
}

impl Sequence {
    pub fn start(phase: Phase, released: bool) -> Self {
        Self {
            phase,
            action: Move::Rest,
            following: None,
            wanted: STOP,
            last: STOP,
            released,
            releasing: 0.0,
            since: 0.0,
            pause: 0.0,
            retries: 0.0,
            standing: 0.0,
            slow: 0.0,
            impossible: 0.0,
            hall_seen: 0.0,
            hall_times: [f64::NEG_INFINITY; 8],
            cleared: false,
            extending: true,
            brake_open: false,
            fresh: false,
            fault: 0,
            refused: 0,
            turned_down: None,
            accepted: false,
        }
    }

    pub fn step(&mut self, p: &[f64], see: &Seen) -> Orders {
        self.fresh = false;
        self.since += see.dt;
        self.take_command(p, see);
        if self.phase != Phase::Fault && self.phase != Phase::Released {
            self.watch(p, see);
        }
        self.act(p, see);
        self.orders(p, see)
    }

    fn take_command(&mut self, p: &[f64], see: &Seen) {
        if see.command == self.last {
            return;
        }
        self.last = see.command;
        if see.command == STOP {
            self.wanted = STOP;
            self.cleared = self.phase == Phase::Fault;
            return;
        }
        match self.refusal(p, see) {
            Some((reason, value)) => {
                self.refused = reason;
                if !self.accepted && self.turned_down.is_none() {
                    self.turned_down = Some((see.command, value));
                }
            }
            None => {
                self.refused = 0;
                self.accepted = true;
                self.wanted = see.command;
                self.retries = 0.0;
            }
        }
    }

    fn refusal(&self, p: &[f64], see: &Seen) -> Option<(u8, f64)> {
        use SequenceParameter as P;
        if see.command == FREE_FALL {
            return if self.phase == Phase::Locked { Some((6, 1.0)) } else { see.on_wheels.then_some((5, 1.0)) };
        }
        if self.released || self.releasing > 0.0 {
            return Some((1, 1.0));
        }
        if self.phase == Phase::Fault && !self.cleared {
            return Some((2, f64::from(self.fault)));
        }
        if see.supply < p[P::Undervoltage as usize] {
            return Some((3, see.supply));
        }
        if see.supply > p[P::Overvoltage as usize] {
            return Some((4, see.supply));
        }
        (see.command == RETRACT && see.on_wheels).then_some((5, 1.0))
    }

    fn fail(&mut self, fault: u8) {
        self.phase = Phase::Fault;
        self.action = Move::Rest;
        self.following = None;
        self.fault = fault;
        self.wanted = STOP;
        self.cleared = false;
    }

    /// Stops, rests, then goes on with `following`, unless all retries are spent.
    fn retry(&mut self, p: &[f64], following: Move, fault: u8) {
        if self.retries >= p[SequenceParameter::Retries as usize] {
            return self.fail(fault);
        }
        self.retries += 1.0;
        self.pause = p[SequenceParameter::RetryPause as usize];
        self.following = Some(following);
        self.halt();
    }

    fn halt(&mut self) {
        self.action = Move::Halt;
        self.since = 0.0;
        self.standing = 0.0;
    }

    fn begin(&mut self, action: Move) {
        self.action = action;
        self.extending = matches!(action, Move::Extend | Move::Reseat);
        self.phase = if self.extending { Phase::Extending } else { Phase::Retracting };
        (self.since, self.standing, self.slow) = (0.0, 0.0, 0.0);
        self.following = None;
        self.fresh = true;
    }

    fn finish(&mut self, phase: Phase) {
        self.phase = phase;
        self.action = Move::Rest;
        self.following = None;
    }

    fn watch(&mut self, p: &[f64], see: &Seen) {
        use SequenceParameter as P;
        if self.hall_fails(p, see) {
            return self.fail(HALL);
        }
        if self.switches_fail(p, see) {
            return self.fail(PROXIMITY);
        }
        if see.speed.abs() > p[P::Overspeed as usize] {
            return self.fail(OVERSPEED);
        }
        if see.current > p[P::Overcurrent as usize] {
            return self.fail(OVERCURRENT);
        }
        if !matches!(self.action, Move::Rest | Move::Halt) {
            self.watch_move(p, see);
        }
    }

    fn watch_move(&mut self, p: &[f64], see: &Seen) {
        use SequenceParameter as P;
        let stands = see.speed.abs() < p[P::StallSpeed as usize] && see.demand.abs() > p[P::StallVoltage as usize];
        self.standing = if stands { self.standing + see.dt } else { 0.0 };
        let slow = self.action == Move::Extend && see.switches[2] && !see.switches[3];
        self.slow = if slow { self.slow + see.dt } else { 0.0 };
        let stalled = self.standing >= p[P::StallTime as usize];
        let locked = see.switches[3];
        if self.action == Move::Retract && locked && (stalled || self.since > p[P::UnlockTimeout as usize]) {
            self.retry(p, Move::Reseat, NOT_RELEASED);
        } else if self.action == Move::Extend && (self.slow > p[P::LockTimeout as usize] || (stalled && see.left.abs() < 2e-3)) {
            self.retry(p, Move::BackOff, NOT_ENGAGED);
        } else if stalled && self.action != Move::Reseat {
            self.retry(p, self.action, STALLED);
        } else if self.since > p[P::MotionTimeout as usize] {
            self.retry(p, self.action, MOTION);
        }
    }

    fn hall_fails(&mut self, p: &[f64], see: &Seen) -> bool {
        let new = see.hall_errors - self.hall_seen;
        self.hall_seen = see.hall_errors;
        for _ in 0..(new.min(8.0) as usize) {
            self.hall_times.rotate_right(1);
            self.hall_times[0] = see.time;
        }
        let needed = p[SequenceParameter::HallErrors as usize] as usize;
        see.time - self.hall_times[needed - 1] < p[SequenceParameter::HallWindow as usize]
    }

    fn switches_fail(&mut self, p: &[f64], see: &Seen) -> bool {
        let [at_0, at_25, at_75, lock] = see.switches;
        let out_of_order = (lock && !at_75) || (at_75 && !at_25);
        let impossible = out_of_order || (at_0 && at_75);
        self.impossible = if impossible { self.impossible + see.dt } else { 0.0 };
        if self.impossible > p[SequenceParameter::ProximityTime as usize] {
            return true;
        }
        let margin = p[SequenceParameter::ProximityTravel as usize];
        let missed =
            |on: bool, place: f64| if self.extending { !on && see.travel > place + margin } else { on && see.travel < place - margin };
        self.action != Move::Rest && (missed(at_25, see.quarters[0]) || missed(at_75, see.quarters[1]))
    }

    fn act(&mut self, p: &[f64], see: &Seen) {
        use SequenceParameter as P;
        if self.wanted == FREE_FALL {
            self.release(see);
        }
        match self.action {
            Move::Rest => self.rest(see),
            Move::Extend if see.switches[3] => self.finish(Phase::Locked),
            Move::Retract if see.switches[0] => self.finish(Phase::Retracted),
            Move::Extend if self.wanted != EXTEND => self.halt(),
            Move::Retract | Move::Reseat if self.wanted != RETRACT => self.halt(),
            Move::BackOff if self.wanted != EXTEND => self.halt(),
            Move::BackOff if !see.switches[2] => self.begin(Move::Extend),
            Move::Reseat if self.since > p[P::RetryPause as usize] => {
                self.pause = p[P::RetryPause as usize];
                self.following = Some(Move::Retract);
                self.halt();
            }
            Move::Halt if see.speed.abs() < p[P::StallSpeed as usize] || self.since > p[P::LockTimeout as usize] => {
                self.action = Move::Rest;
                self.phase = Phase::Stopped;
            }
            _ => {}
        }
    }

    fn release(&mut self, see: &Seen) {
        if self.phase != Phase::Released && !self.released {
            self.finish(Phase::Released);
        }
        self.releasing += see.dt;
        if self.releasing >= see.release_time {
            self.released = true;
        }
        if self.phase == Phase::Released && see.switches[3] {
            self.phase = Phase::Locked;
        }
    }

    fn rest(&mut self, see: &Seen) {
        if self.pause > 0.0 {
            self.pause -= see.dt;
            return;
        }
        if self.phase == Phase::Fault && self.cleared && self.wanted != STOP && self.wanted != FREE_FALL {
            self.phase = Phase::Stopped;
            (self.cleared, self.fault) = (false, 0);
        }
        let next = match (self.phase, self.wanted) {
            (Phase::Stopped, EXTEND) | (Phase::Stopped, RETRACT) if self.following.is_some() => self.following,
            (Phase::Retracted | Phase::Stopped, EXTEND) => Some(Move::Extend),
            (Phase::Locked | Phase::Stopped, RETRACT) => Some(Move::Retract),
            _ => None,
        };
        if let Some(action) = next {
            self.begin(action);
        }
    }

    fn orders(&mut self, p: &[f64], see: &Seen) -> Orders {
        use SequenceParameter as P;
        let (high, low) = (p[P::SpeedHigh as usize], p[P::SpeedLow as usize]);
        let target = match self.action {
            Move::Rest | Move::Halt => 0.0,
            Move::Extend if !see.switches[2] => high,
            Move::Extend | Move::Reseat => low,
            Move::Retract if see.switches[1] => -high,
            Move::Retract | Move::BackOff => -low,
        };
        let drive = self.action != Move::Rest;
        self.brake_open = drive && (self.brake_open || see.demand.abs() >= p[P::BrakeVoltage as usize]);
        Orders { drive, extending: self.extending, target, brake_powered: self.brake_open, fresh: self.fresh }
    }
}
