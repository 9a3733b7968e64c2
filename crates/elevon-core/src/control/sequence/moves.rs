//! Moves: how one begins, what ends it, and what the bridge and the brake do meanwhile.

use super::codes::*;
use super::{BrakeReading, Move, Orders, Phase, Seen, Sequence, SequenceParameter as P};

impl Sequence {
    pub(super) fn halt(&mut self) {
        self.action = Move::Halt;
        self.since = 0.0;
        self.standing = 0.0;
    }

    fn begin(&mut self, see: &Seen, action: Move) {
        self.action = action;
        self.extending = matches!(action, Move::Extend | Move::Reseat);
        self.phase = if self.extending { Phase::Extending } else { Phase::Retracting };
        (self.since, self.standing, self.slow, self.dragging) = (0.0, 0.0, 0.0, 0.0);
        self.furthest = if self.extending { see.counted } else { -see.counted };
        self.following = None;
        self.fresh = true;
    }

    fn finish(&mut self, phase: Phase) {
        self.phase = phase;
        self.following = None;
        self.stop_now();
    }

    fn stop_now(&mut self) {
        self.action = Move::Idle;
        (self.resting, self.gone) = (0.0, 0.0);
    }

    pub(super) fn act(&mut self, p: &[f64], see: &Seen) {
        if self.wanted == FREE_FALL || self.released || self.releasing > 0.0 {
            self.release(see);
        }
        match self.action {
            Move::Idle => self.idle(see),
            Move::Extend if self.locked_by_count(see) || self.locked_at_the_stop(p, see) => self.finish(Phase::Locked),
            Move::Retract if self.retracted_by_count(p, see) => self.finish(Phase::Retracted),
            Move::Extend if self.wanted != EXTEND => self.halt(),
            Move::Retract | Move::Reseat if self.wanted != RETRACT => self.halt(),
            Move::BackOff if self.wanted != EXTEND => self.halt(),
            Move::BackOff if !see.switches[2] => self.begin(see, Move::Extend),
            Move::Reseat if self.since > p[P::RetryPause as usize] => {
                self.pause = p[P::RetryPause as usize];
                self.following = Some(Move::Retract);
                self.halt();
            }
            Move::Halt if see.speed.abs() < p[P::StallSpeed as usize] || self.since > p[P::LockTimeout as usize] => {
                self.phase = Phase::Stopped;
                self.stop_now();
            }
            _ => {}
        }
    }

    /// The lock's switch, and the nut by the count at least where the lock engages.
    fn locked_by_count(&self, see: &Seen) -> bool {
        see.switches[2] && see.switches[3] && self.position.low >= self.places.stroke + self.places.engage
    }

    /// The lock's switch, and the nut at its stop: for a count that has lost some edges.
    pub(super) fn locked_at_the_stop(&self, p: &[f64], see: &Seen) -> bool {
        let there = self.position.high >= self.places.stroke + self.places.engage;
        self.action == Move::Extend && see.switches[2] && see.switches[3] && there && self.stalled(p)
    }

    fn retracted_by_count(&self, p: &[f64], see: &Seen) -> bool {
        let edge = self.places.switch[0] + self.places.hysteresis;
        see.switches[0] && !see.switches[1] && self.position.low <= edge + p[P::CountTolerance as usize]
    }

    fn release(&mut self, see: &Seen) {
        if !self.released && self.releasing == 0.0 {
            self.finish(Phase::Released);
        }
        self.releasing += see.dt;
        if self.releasing >= see.release_time {
            self.released = true;
        }
        if self.phase == Phase::Released && see.switches[3] && see.switches[2] && !self.distrusted {
            self.phase = Phase::Locked;
        }
    }

    fn idle(&mut self, see: &Seen) {
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
            (Phase::Retracted | Phase::Stopped, EXTEND) => Some(Move::Extend),
            (Phase::Locked | Phase::Stopped, RETRACT) => Some(Move::Retract),
            _ => None,
        };
        if let Some(action) = next {
            self.begin(see, action);
        }
    }

    pub(super) fn orders(&mut self, p: &[f64], see: &Seen) -> Orders {
        let (high, low) = (p[P::SpeedHigh as usize], p[P::SpeedLow as usize]);
        let target = match self.action {
            Move::Idle | Move::Halt => 0.0,
            Move::Extend if !see.switches[2] => high,
            Move::Extend | Move::Reseat => low,
            Move::Retract if see.switches[1] => -high,
            Move::Retract | Move::BackOff => -low,
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
