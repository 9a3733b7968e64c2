//! What the control unit watches while nothing should move: rest, and the free fall.

use super::codes::*;
use super::readings::{P0, P100, P25, P75};
use super::{Phase, Seen, Sequence, SequenceParameter as P};

impl Sequence {
    /// At rest, in whatever state, the count stands still. It is zeroed at the ends.
    pub(super) fn watch_rest(&mut self, p: &[f64], see: &Seen) {
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
        let moved = |from: f64| (see.counted - from).abs() > p[P::RestTravel as usize];
        if moved(self.anchor) {
            return self.fail(see, UNCOMMANDED);
        }
        let left = match self.phase {
            Phase::Retracted => !self.readings.on[P0],
            Phase::Locked => !self.readings.on[P100],
            _ => false,
        };
        self.gone = if left { self.gone + see.dt } else { 0.0 };
        if self.gone > p[P::ProximityTime as usize] {
            if moved(self.arrived) {
                self.fail(see, UNCOMMANDED);
            } else {
                self.doubt_end(see);
            }
        }
    }

    /// The switch of the end has gone though nothing has moved: the end is not known any more, a command still runs.
    fn doubt_end(&mut self, see: &Seen) {
        let switch = if self.phase == Phase::Retracted { P0 } else { P100 };
        self.flag(switch);
        self.rest_unconfirmed(see, PROXIMITY);
    }

    /// Ends a move, or rest at an end, where the place is likely but not shown by two indications.
    pub(super) fn rest_unconfirmed(&mut self, see: &Seen, fault: u8) {
        self.note(see, fault);
        self.finish(Phase::Unconfirmed);
        (self.wanted, self.pressed) = (STOP, true);
    }

    fn zero(&mut self) {
        let places = self.places;
        match self.phase {
            Phase::Retracted => self.position.between(0.0, places.switch[P0] + places.hysteresis),
            Phase::Locked => self.position.between(places.stroke + places.release, places.stroke + places.end),
            _ => {}
        }
    }

    /// Apart, only time and order tell: the lock's switch cannot come before that at 75 %, nor at once after it.
    pub(super) fn watch_fall(&mut self, p: &[f64], see: &Seen) {
        let (on, stood, changed) = (&self.readings.on, &self.readings.stood, &self.readings.changed);
        let order = p[P::FallOrder as usize];
        let early = |later: usize, earlier: usize| changed[later] && on[later] && on[earlier] && stood[earlier] < order.min(self.releasing);
        let reversed = |later: usize, earlier: usize| changed[earlier] && on[earlier] && on[later];
        self.distrusted |= early(P100, P75) || early(P75, P25) || reversed(P100, P75);
        self.falling += see.dt;
        if self.phase == Phase::Released && self.falling > p[P::FallTime as usize] {
            self.note(see, NOT_ENGAGED);
            self.give_up_release();
        }
    }

    /// A release that has moved no switch in all that time has not opened: the motor may try.
    fn give_up_release(&mut self) {
        let still = (0..4).all(|j| self.readings.stood[j] >= self.falling);
        if still && !self.closed {
            (self.closed, self.released, self.releasing) = (true, false, 0.0);
            self.wanted = STOP;
            self.stop_now();
        }
    }
}
