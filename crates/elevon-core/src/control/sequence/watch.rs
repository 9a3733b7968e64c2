//! What the control unit watches in motion: the switches against each other and against the Hall count, motor, supply.

use super::codes::*;
use super::command::Note;
use super::readings::{P100, SWITCHES};
use super::{Move, Phase, Seen, Sequence, SequenceParameter as P};

impl Sequence {
    /// Into the fault state.
    pub(super) fn fail(&mut self, see: &Seen, fault: u8) {
        self.note(see, fault);
        self.phase = Phase::Fault;
        self.following = None;
        self.wanted = STOP;
        self.cleared = false;
        self.stop_now();
    }

    pub(super) fn note(&mut self, see: &Seen, fault: u8) {
        if self.fault != fault {
            self.fault = fault;
            self.warn();
            self.notes.add(Note::Failed { time: see.time, fault, command: self.wanted, warning: self.warning });
        }
    }

    /// Nothing follows from a switch any more.
    pub(super) fn flag(&mut self, switch: usize) {
        self.readings.failed[switch] = true;
    }

    /// Stops, rests, then goes on with `following`, unless all retries are spent. Without current no lock and no jam is
    /// the cause.
    fn retry(&mut self, p: &[f64], see: &Seen, following: Move, fault: u8) {
        if self.retries >= p[P::Retries as usize] {
            let dead = self.stalled(p) && see.line.abs() < p[P::OpenCurrent as usize];
            return self.fail(see, if dead { NO_CURRENT } else { fault });
        }
        self.retries += 1.0;
        self.pause = p[P::RetryPause as usize];
        self.following = Some(following);
        self.halt();
    }

    pub(super) fn watch(&mut self, p: &[f64], see: &Seen) {
        if self.apart() {
            return self.watch_fall(p, see);
        }
        let proven = self.judge_switches(p, see);
        self.warn();
        if self.phase == Phase::Fault {
            return self.watch_rest(p, see);
        }
        let upwards = matches!(self.action, Move::Retract | Move::BackOff) || (self.action == Move::Confirm && !self.extending);
        if see.tripped {
            self.fail(see, TRIPPED);
        } else if self.hall_fails(p, see) {
            self.fail(see, HALL);
        } else if upwards && self.on_wheels(p) {
            self.fail(see, WHEELS_DOWN);
        } else if proven && upwards && self.action != Move::Confirm {
            self.fail(see, PROXIMITY);
        } else if see.speed.abs() > p[P::Overspeed as usize] {
            self.fail(see, OVERSPEED);
        } else if see.current > p[P::Overcurrent as usize] {
            self.fail(see, OVERCURRENT);
        } else if self.action == Move::Idle {
            self.watch_rest(p, see);
        } else if self.starves(p, see) {
            self.fail(see, SUPPLY);
        } else if self.action == Move::Confirm {
            self.watch_press(p, see, proven);
        } else if self.action != Move::Halt {
            self.watch_move(p, see);
        }
    }

    /// Outside the limits of the supply for longer than its transients.
    fn starves(&mut self, p: &[f64], see: &Seen) -> bool {
        let outside = see.supply < p[P::Undervoltage as usize] || see.supply > p[P::Overvoltage as usize];
        self.starved = if outside { self.starved + see.dt } else { 0.0 };
        self.starved > p[P::SupplyTime as usize]
    }

    /// Against a stop the motor stands under a current that no free leg needs.
    fn watch_press(&mut self, p: &[f64], see: &Seen, proven: bool) {
        let (line, limit) =
            if self.extending { (see.line, p[P::DragExtension as usize]) } else { (-see.line, p[P::DragRetraction as usize]) };
        let stands = see.speed.abs() < p[P::StallSpeed as usize] && line > limit;
        self.pressing = if stands { self.pressing + see.dt } else { 0.0 };
        if proven {
            self.finish(Phase::Stopped);
        }
    }

    fn watch_move(&mut self, p: &[f64], see: &Seen) {
        let stands = see.speed.abs() < p[P::StallSpeed as usize] && see.demand.abs() > p[P::StallVoltage as usize];
        self.standing = if stands { self.standing + see.dt } else { 0.0 };
        let slow = self.action == Move::Extend && self.last_quarter();
        self.slow = if slow { self.slow + see.dt } else { 0.0 };
        self.watch_drag(p, see);
        let stalled = self.stalled(p) || self.driven_back(p, see);
        let near = self.position.high > self.places.stroke - 2e-3;
        let known = self.position.high - self.position.low <= p[P::ProximityTravel as usize];
        let late = known && self.slow > p[P::LockTimeout as usize];
        if self.action == Move::Retract && self.readings.believed(P100) && (stalled || self.since > p[P::UnlockTimeout as usize]) {
            self.retry(p, see, Move::Reseat, NOT_RELEASED);
        } else if self.locked_at_the_stop(p) || self.retracted_at_the_stop(p) {
            // The end of the stroke itself confirms the switch: `act` takes it.
        } else if self.action == Move::Extend && (stalled || late) && self.may_be_locked() {
            self.rest_perhaps_locked(see);
        } else if self.action == Move::Extend && (late || (stalled && near)) {
            self.retry(p, see, Move::BackOff, NOT_ENGAGED);
        } else if stalled && self.action != Move::Reseat {
            self.retry(p, see, self.action, STALLED);
        } else if self.since > p[P::MotionTimeout as usize] {
            self.retry(p, see, self.action, MOTION);
        }
    }

    /// By the count or by the lock's switch, though it be flagged: the unit lifts a leg of its own accord only where both
    /// say that the lock is open.
    pub(super) fn may_be_locked(&self) -> bool {
        self.readings.on[P100] || self.position.high >= self.places.stroke + self.places.engage
    }

    pub(super) fn rest_perhaps_locked(&mut self, see: &Seen) {
        self.rest_unconfirmed(see, if self.readings.failed[P100] { PROXIMITY } else { NOT_ENGAGED });
    }

    pub(super) fn stalled(&self, p: &[f64]) -> bool {
        self.standing >= p[P::StallTime as usize]
    }

    /// Further back than a switch may be wrong, against its command.
    fn driven_back(&mut self, p: &[f64], see: &Seen) -> bool {
        let direction = if self.extending { 1.0 } else { -1.0 };
        self.furthest = self.furthest.max(direction * see.counted);
        self.furthest - direction * see.counted > p[P::ProximityTravel as usize]
    }

    /// Current that no load of a healthy leg needs. In retraction a drag hides below what the heaviest load takes.
    fn watch_drag(&mut self, p: &[f64], see: &Seen) {
        let (motoring, limit) =
            if self.extending { (see.line, p[P::DragExtension as usize]) } else { (-see.line, p[P::DragRetraction as usize]) };
        let overload = motoring > limit && see.speed.abs() > p[P::StallSpeed as usize] && self.action != Move::Reseat;
        self.dragging = if overload { self.dragging + see.dt } else { 0.0 };
        if self.dragging > p[P::DragTime as usize] {
            self.warning = DRAG;
        }
        if see.hall_errors - self.hall_begun >= p[P::HallErrors as usize] && self.warning == 0 {
            self.warning = HALL_POWER;
        }
    }

    /// A switch at fault is displayed where nothing else is, and readings of which one must be.
    fn warn(&mut self) {
        if self.warning == 0 || self.warning == CONTRADICTION {
            if let Some(first) = (0..SWITCHES).find(|&j| self.readings.failed[j]) {
                self.warning = SWITCH + first as u8;
            } else if self.doubt {
                self.warning = CONTRADICTION;
            }
        }
    }

    fn hall_fails(&mut self, p: &[f64], see: &Seen) -> bool {
        let new = see.hall_errors - self.hall_seen;
        self.hall_seen = see.hall_errors;
        for _ in 0..(new.min(8.0) as usize) {
            self.hall_times.rotate_right(1);
            self.hall_times[0] = see.time;
        }
        self.hall_invalid = if see.hall_valid { 0.0 } else { self.hall_invalid + see.dt };
        let needed = p[P::HallErrors as usize] as usize;
        let window = p[P::HallWindow as usize];
        see.time - self.hall_times[needed.clamp(1, 8) - 1] < window || self.hall_invalid > window
    }

    /// Flags a switch that the count contradicts, or that has read the same over too much travel. True where readings
    /// cannot all be right. Where two switches stand against the count, the count is what is wrong.
    fn judge_switches(&mut self, p: &[f64], see: &Seen) -> bool {
        let limits = self.limits(p);
        let proven = self
            .position
            .contradicted(&self.places, &self.readings.on, &self.readings.failed, &Self::margins(p))
            .or_else(|| self.readings.overstayed(&self.places, &limits));
        let pair = self.readings.pair();
        self.impossible = if proven.is_some() || pair.is_some() { self.impossible + see.dt } else { 0.0 };
        let failed = self.impossible > p[P::ProximityTime as usize];
        self.doubt = failed && proven.is_none();
        if let (true, Some(switch)) = (failed, proven) {
            if (0..4).any(|j| self.readings.failed[j]) {
                self.position = super::Position::start(&self.places, self.readings.on, see.counted);
            }
            self.flag(switch);
            self.impossible = 0.0;
        }
        failed
    }
}
