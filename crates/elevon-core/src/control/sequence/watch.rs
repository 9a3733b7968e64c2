//! What the control unit watches: the switches against each other and against the Hall count, the motor, rest, the fall.

use super::codes::*;
use super::command::Note;
use super::position::Margins;
use super::{Move, Phase, Seen, Sequence, SequenceParameter as P};

impl Sequence {
    /// Into the fault state.
    pub(super) fn fail(&mut self, see: &Seen, fault: u8) {
        self.note(see, fault);
        self.phase = Phase::Fault;
        self.action = Move::Idle;
        self.following = None;
        self.wanted = STOP;
        self.cleared = false;
    }

    fn note(&mut self, see: &Seen, fault: u8) {
        if self.fault != fault {
            self.fault = fault;
            self.notes.add(Note::Failed { time: see.time, fault, command: self.wanted });
        }
    }

    /// Stops, rests, then goes on with `following`, unless all retries are spent.
    fn retry(&mut self, p: &[f64], see: &Seen, following: Move, fault: u8) {
        if self.retries >= p[P::Retries as usize] {
            return self.fail(see, fault);
        }
        self.retries += 1.0;
        self.pause = p[P::RetryPause as usize];
        self.following = Some(following);
        self.halt();
    }

    pub(super) fn watch(&mut self, p: &[f64], see: &Seen) {
        let switches_fail = self.switches_fail(p, see);
        self.narrow(p, see);
        if self.released || self.releasing > 0.0 {
            return self.watch_fall(p, see, switches_fail);
        }
        if self.phase == Phase::Fault {
            return;
        }
        if see.tripped {
            self.fail(see, TRIPPED);
        } else if self.hall_fails(p, see) {
            self.fail(see, HALL);
        } else if switches_fail {
            self.fail(see, PROXIMITY);
        } else if see.speed.abs() > p[P::Overspeed as usize] {
            self.fail(see, OVERSPEED);
        } else if see.current > p[P::Overcurrent as usize] {
            self.fail(see, OVERCURRENT);
        } else if self.action == Move::Idle {
            self.watch_idle(p, see);
        } else if self.action != Move::Halt {
            self.watch_move(p, see);
        }
    }

    /// The leg falls without the motor: nothing is left to stop, only the switches report.
    fn watch_fall(&mut self, p: &[f64], see: &Seen, switches_fail: bool) {
        let lost_lock = self.phase == Phase::Locked && !see.switches[3];
        if lost_lock {
            self.phase = Phase::Released;
        }
        if switches_fail || lost_lock {
            self.note(see, PROXIMITY);
        }
        self.falling += see.dt;
        if self.phase == Phase::Released && self.falling > p[P::FallTime as usize] {
            self.note(see, NOT_ENGAGED);
        }
    }

    /// At rest the count stands still, and the switch of the end stays on. The count is zeroed at the ends.
    fn watch_idle(&mut self, p: &[f64], see: &Seen) {
        let settled = self.resting >= p[P::RestTime as usize];
        if self.resting == 0.0 {
            self.arrived = see.counted;
        }
        self.resting += see.dt;
        if !settled {
            self.anchor = see.counted;
            if self.resting >= p[P::RestTime as usize] {
                self.zero();
            }
        }
        let left = match self.phase {
            Phase::Retracted => !see.switches[0],
            Phase::Locked => !see.switches[3],
            _ => false,
        };
        self.gone = if left { self.gone + see.dt } else { 0.0 };
        let moved = |from: f64| (see.counted - from).abs() > p[P::RestTravel as usize];
        if moved(self.anchor) {
            self.fail(see, UNCOMMANDED);
        } else if self.gone > p[P::ProximityTime as usize] {
            self.fail(see, if moved(self.arrived) { UNCOMMANDED } else { PROXIMITY });
        }
    }

    fn zero(&mut self) {
        let places = self.places;
        match self.phase {
            Phase::Retracted => self.position.between(0.0, places.switch[0] + places.hysteresis),
            Phase::Locked => self.position.between(places.stroke + places.release, places.stroke + places.end),
            _ => {}
        }
    }

    fn watch_move(&mut self, p: &[f64], see: &Seen) {
        let stands = see.speed.abs() < p[P::StallSpeed as usize] && see.demand.abs() > p[P::StallVoltage as usize];
        self.standing = if stands { self.standing + see.dt } else { 0.0 };
        let slow = self.action == Move::Extend && see.switches[2];
        self.slow = if slow { self.slow + see.dt } else { 0.0 };
        self.watch_drag(p, see);
        let stalled = self.stalled(p) || self.driven_back(p, see);
        let near = self.position.high > self.places.stroke - 2e-3;
        if self.action == Move::Retract && see.switches[3] && (stalled || self.since > p[P::UnlockTimeout as usize]) {
            self.retry(p, see, Move::Reseat, NOT_RELEASED);
        } else if self.locked_at_the_stop(p, see) {
            // The end of the stroke itself confirms the lock's switch: `act` takes it.
        } else if self.action == Move::Extend && (self.slow > p[P::LockTimeout as usize] || (stalled && near)) {
            self.retry(p, see, Move::BackOff, NOT_ENGAGED);
        } else if stalled && self.action != Move::Reseat {
            self.retry(p, see, self.action, STALLED);
        } else if self.since > p[P::MotionTimeout as usize] {
            self.retry(p, see, self.action, MOTION);
        }
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

    /// Pairs that no position of the ram has, and switches that the count contradicts.
    fn switches_fail(&mut self, p: &[f64], see: &Seen) -> bool {
        let [at_0, at_25, at_75, lock] = see.switches;
        let pair = (lock && !at_75) || (at_75 && !at_25) || (at_25 && at_0);
        let margins = Margins { end: p[P::CountTolerance as usize], quarter: p[P::ProximityTravel as usize] };
        let contradicted = self.position.contradicted(&self.places, see.switches, &margins);
        let fails = pair || contradicted.is_some();
        self.impossible = if fails { self.impossible + see.dt } else { 0.0 };
        let failed = self.impossible > p[P::ProximityTime as usize];
        if failed && lock && (!at_75 || at_0 || contradicted == Some(3)) {
            self.distrusted = true;
        }
        failed
    }
}
