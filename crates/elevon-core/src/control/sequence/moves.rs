//! Moves: how one begins, what ends it, and what the bridge and the brake do meanwhile.

use super::codes::*;
use super::readings::{P0, P100, P25, P75};
use super::{BrakeReading, Move, Orders, Phase, Seen, Sequence, SequenceParameter as P};

impl Sequence {
    pub(super) fn halt(&mut self) {
        self.action = Move::Halt;
        self.since = 0.0;
        self.standing = 0.0;
    }

    fn begin(&mut self, see: &Seen, action: Move) {
        self.action = action;
        if action != Move::Confirm {
            self.extending = matches!(action, Move::Extend | Move::Reseat);
            self.phase = if self.extending { Phase::Extending } else { Phase::Retracting };
        }
        (self.since, self.standing, self.pressing, self.slow, self.dragging, self.starved) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        self.furthest = if self.extending { see.counted } else { -see.counted };
        self.hall_begun = see.hall_errors;
        self.following = None;
        self.fresh = true;
    }

    pub(super) fn finish(&mut self, phase: Phase) {
        self.phase = phase;
        self.following = None;
        self.stop_now();
    }

    pub(super) fn stop_now(&mut self) {
        self.action = Move::Idle;
        (self.resting, self.gone) = (0.0, 0.0);
    }

    pub(super) fn act(&mut self, p: &[f64], see: &Seen) {
        if self.wanted == FREE_FALL || self.apart() {
            self.open_release(see);
            self.confirm_fall(p);
        }
        match self.action {
            Move::Idle => self.idle(p, see),
            Move::Extend if self.locked_by_count() || self.locked_at_the_stop(p) => self.finish(Phase::Locked),
            Move::Retract if self.retracted_by_count(p) || self.retracted_at_the_stop(p) => self.finish(Phase::Retracted),
            Move::Confirm if self.pressing >= p[P::ConfirmTime as usize] => {
                self.finish(if self.extending { Phase::Locked } else { Phase::Retracted });
            }
            Move::Confirm if self.wanted != STOP || self.since > p[P::UnlockTimeout as usize] => self.halt(),
            Move::Extend if self.wanted != EXTEND => self.halt(),
            Move::Retract | Move::Reseat if self.wanted != RETRACT => self.halt(),
            Move::BackOff if self.wanted != EXTEND => self.halt(),
            Move::BackOff if !self.last_quarter() => self.begin(see, Move::Extend),
            Move::Reseat if self.since > p[P::RetryPause as usize] => {
                self.pause = p[P::RetryPause as usize];
                self.following = Some(Move::Retract);
                self.halt();
            }
            Move::Halt if see.speed.abs() < p[P::StallSpeed as usize] || self.since > p[P::LockTimeout as usize] => {
                let ends = self.readings.believed(P0) || self.readings.believed(P100);
                self.phase = if self.phase == Phase::Unconfirmed && ends { Phase::Unconfirmed } else { Phase::Stopped };
                self.stop_now();
            }
            _ => {}
        }
    }

    /// The lock's switch and the one at 75 %, or the count where that one fails.
    fn lock_shown(&self) -> bool {
        self.readings.believed(P100) && (self.readings.on[P75] || self.readings.failed[P75])
    }

    /// The lock's switch, and the nut by the count at least where the lock engages.
    fn locked_by_count(&self) -> bool {
        self.lock_shown() && self.position.low >= self.places.stroke + self.places.engage
    }

    /// The lock's switch, and the nut at its stop: for a count that has lost some edges, and where the switch at 75 % may
    /// be the one that fails.
    pub(super) fn locked_at_the_stop(&self, p: &[f64]) -> bool {
        let there = self.position.high >= self.places.stroke + self.places.engage;
        let shown = self.lock_shown() || (self.doubt && self.readings.believed(P100));
        self.action == Move::Extend && shown && there && self.stalled(p)
    }

    fn retraction_shown(&self) -> bool {
        self.readings.believed(P0) && !self.readings.believed(P25)
    }

    fn home(&self, p: &[f64]) -> f64 {
        self.places.switch[P0] + self.places.hysteresis + p[P::CountTolerance as usize]
    }

    fn retracted_by_count(&self, p: &[f64]) -> bool {
        self.retraction_shown() && self.position.high <= self.home(p)
    }

    pub(super) fn retracted_at_the_stop(&self, p: &[f64]) -> bool {
        self.action == Move::Retract && self.retraction_shown() && self.position.low <= self.home(p) && self.stalled(p)
    }

    /// The crew's lever: the release opens after its time, whatever the unit does.
    pub(super) fn open_release(&mut self, see: &Seen) {
        if !self.released && self.releasing == 0.0 {
            self.closed = false;
            self.falling = 0.0;
            if self.phase != Phase::Off {
                self.finish(Phase::Released);
            }
        }
        self.releasing += see.dt;
        if self.releasing >= see.release_time {
            self.released = true;
        }
    }

    /// Once the longest healthy fall must be over, the lock's switch counts; without the switch at 75 % that at 25 %, later.
    fn confirm_fall(&mut self, p: &[f64]) {
        if self.phase != Phase::Released {
            return;
        }
        let since = |switch: usize| if self.readings.on[switch] { self.readings.stood[switch].min(self.releasing) } else { 0.0 };
        let time = p[P::FallConfirm as usize];
        if since(P100) > 0.0 && !self.distrusted && !self.readings.failed[P100] && (since(P75) >= time || since(P25) >= 2.0 * time) {
            self.phase = Phase::Locked;
        }
    }

    fn idle(&mut self, p: &[f64], see: &Seen) {
        if self.pause > 0.0 {
            self.pause -= see.dt;
            return;
        }
        if self.phase == Phase::Fault && self.cleared && self.wanted != STOP && self.wanted != FREE_FALL {
            self.phase = Phase::Stopped;
            (self.cleared, self.fault) = (false, 0);
            self.stop_now();
        }
        let next = match (self.phase, self.wanted) {
            (Phase::Stopped, EXTEND) | (Phase::Stopped, RETRACT) if self.following.is_some() => self.following,
            (Phase::Retracted | Phase::Stopped | Phase::Unconfirmed, EXTEND) => Some(Move::Extend),
            (Phase::Locked | Phase::Stopped | Phase::Unconfirmed, RETRACT) => Some(Move::Retract),
            (Phase::Released, EXTEND | RETRACT) if self.closed => Some(if self.wanted == EXTEND { Move::Extend } else { Move::Retract }),
            (Phase::Unconfirmed, STOP) => self.press(p, see),
            _ => None,
        };
        match next {
            Some(Move::BackOff) if self.may_be_locked() => self.rest_perhaps_locked(see),
            Some(action) => self.begin(see, action),
            None => {}
        }
    }

    /// Once after power-up: towards the end that a switch shows, never up while there is weight on wheels.
    fn press(&mut self, p: &[f64], see: &Seen) -> Option<Move> {
        let supply = see.supply >= p[P::Undervoltage as usize] && see.supply <= p[P::Overvoltage as usize];
        if self.pressed || see.rig || !supply || self.powered < p[P::ConfirmDelay as usize] {
            return None;
        }
        self.extending = self.readings.believed(P100);
        if !self.extending && (!self.readings.believed(P0) || self.on_wheels(p) || self.may_be_locked()) {
            return None;
        }
        self.pressed = true;
        Some(Move::Confirm)
    }

    pub(super) fn orders(&mut self, p: &[f64], see: &Seen) -> Orders {
        let (high, low) = (p[P::SpeedHigh as usize], p[P::SpeedLow as usize]);
        let target = match self.action {
            Move::Idle | Move::Halt => 0.0,
            Move::Extend if !self.last_quarter() && !self.doubt => high,
            Move::Extend | Move::Reseat => low,
            Move::Retract if !self.first_quarter() => -high,
            Move::Retract | Move::BackOff => -low,
            Move::Confirm => {
                if self.extending {
                    low
                } else {
                    -low
                }
            }
        };
        let drive = self.action != Move::Idle;
        let software = BrakeReading::read(p[P::BrakeReading as usize]) == BrakeReading::SoftwareBrake;
        let request = software || see.demand.abs() >= p[P::BrakeVoltage as usize];
        let proven = see.line_now.abs() >= p[P::ProofCurrent as usize];
        self.brake_open = drive && (self.brake_open || (request && proven));
        // A leg that moves at rest has lost its brake: the windings are what is left to hold it.
        let short = software && self.phase == Phase::Fault && self.fault == UNCOMMANDED;
        Orders { drive, extending: self.extending, target, brake_powered: self.brake_open, short, fresh: self.fresh }
    }
}
