//! What the unit makes of its switches: debounced, watched for chatter, and with the travel over which each has stood.

use super::position::{Places, Position};
use crate::kept;

/// At 0, 25, 75 %, on the lock sleeve, and the weight on wheels.
pub const SWITCHES: usize = 5;
pub const P0: usize = 0;
pub const P25: usize = 1;
pub const P75: usize = 2;
pub const P100: usize = 3;
pub const WHEELS: usize = 4;

/// The times and limits of the watch (s, changes, m).
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub debounce: f64,
    pub chatter_time: f64,
    pub chatter_changes: f64,
    /// Travel that response and count may add to the length over which a switch reads the same: at the ends, elsewhere.
    pub travel: [f64; 2],
}

#[derive(Clone, Copy, Debug)]
pub struct Readings {
    /// Debounced.
    pub on: [bool; SWITCHES],
    /// Time for which the debounced reading has stood.
    pub stood: [f64; SWITCHES],
    /// The switch has been proven false, or chatters: nothing follows from it.
    pub failed: [bool; SWITCHES],
    /// A change of it was no edge, or it has failed: it places the nut no more.
    misplaced: [bool; SWITCHES],
    /// By how much the count, when the last change began, lay behind the furthest since the one before: an edge is passed
    /// onwards, at the furthest.
    back: [f64; 4],
    /// The debounced reading changed at this tick.
    pub changed: [bool; SWITCHES],
    raw: [bool; SWITCHES],
    waiting: [f64; SWITCHES],
    changes: [f64; SWITCHES],
    /// Count when the present change began.
    begun: [f64; SWITCHES],
    /// Counts between which the reading has stood, and what the count may have lost meanwhile.
    least: [f64; 4],
    most: [f64; 4],
    lost: f64,
}

kept!(Readings as Readings { on, stood, failed, misplaced, back, changed, raw, waiting, changes, begun, least, most, lost });

impl Readings {
    pub fn start(on: [bool; SWITCHES], counted: f64) -> Self {
        Self {
            on,
            stood: [0.0; SWITCHES],
            failed: [false; SWITCHES],
            misplaced: [false; SWITCHES],
            back: [0.0; 4],
            changed: [false; SWITCHES],
            raw: on,
            waiting: [0.0; SWITCHES],
            changes: [0.0; SWITCHES],
            begun: [counted; SWITCHES],
            least: [counted; 4],
            most: [counted; 4],
            lost: 0.0,
        }
    }

    /// A tick of `dt` later.
    pub fn step(&mut self, raw: [bool; SWITCHES], limits: &Limits, counted: f64, lost: f64, dt: f64) {
        self.lost += lost;
        for (j, now) in raw.into_iter().enumerate() {
            self.changes[j] -= self.changes[j] * (dt / limits.chatter_time).min(1.0);
            if now != self.raw[j] {
                self.changes[j] += 1.0;
                self.failed[j] |= self.changes[j] > limits.chatter_changes;
            }
            self.raw[j] = now;
            if self.waiting[j] == 0.0 {
                self.begun[j] = counted;
            }
            self.waiting[j] = if now == self.on[j] { 0.0 } else { self.waiting[j] + dt };
            self.changed[j] = self.waiting[j] > limits.debounce * (1.0 - 1e-9) && now != self.on[j];
            self.stood[j] += dt;
            if self.changed[j] {
                self.on[j] = now;
                (self.waiting[j], self.stood[j]) = (0.0, 0.0);
            }
        }
        for j in 0..4 {
            if self.changed[j] {
                self.back[j] = if self.on[j] { self.most[j] - self.begun[j] } else { self.begun[j] - self.least[j] };
                (self.least[j], self.most[j]) = (counted, counted);
            } else {
                (self.least[j], self.most[j]) = (self.least[j].min(counted), self.most[j].max(counted));
            }
        }
    }

    /// The travel by the count no longer bears on the ram.
    pub fn forget_travel(&mut self, counted: f64) {
        (self.least, self.most, self.lost) = ([counted; 4], [counted; 4], 0.0);
    }

    /// On, as far as it is believed.
    pub fn believed(&self, switch: usize) -> bool {
        self.on[switch] && !self.failed[switch]
    }

    /// The first switch that has read the same over more travel than its place allows, wherever the nut is.
    pub fn overstayed(&self, places: &Places, limits: &Limits) -> Option<usize> {
        (0..4).find(|&j| {
            let (from, to) = places.claim(j, self.on[j]);
            let slack = limits.travel[usize::from(j == P25 || j == P75)];
            !self.failed[j] && self.most[j] - self.least[j] - self.lost > to - from + slack
        })
    }

    /// The first pair of believed readings that no position has, told at the one nearer to the retracted end.
    pub fn pair(&self) -> Option<[usize; 2]> {
        let says = |j: usize, on: bool| !self.failed[j] && self.on[j] == on;
        [(P0, true, P25, true), (P25, false, P75, true), (P75, false, P100, true), (P0, true, P100, true)]
            .into_iter()
            .find(|&(low, a, high, b)| says(low, a) && says(high, b))
            .map(|(low, _, high, _)| [low, high])
    }

    /// A change of a switch in mid-stroke places the nut: it was at the edge when the change began. A change that the count
    /// contradicts is no edge; then, or once the switch has failed, it places the nut no more, and where it has is forgotten.
    pub fn place(&mut self, position: &mut Position, places: &Places, counted: f64, slack: f64) {
        for j in [P25, P75] {
            if self.misplaced[j] {
                continue;
            }
            let edge = places.switch[j] + counted - self.begun[j];
            let onwards = self.back[j] <= slack + self.lost;
            let agrees = !self.changed[j] || (onwards && position.at_edge(edge - places.hysteresis, edge, slack));
            if self.failed[j] || !agrees {
                self.misplaced[j] = true;
                position.forget_edges();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { debounce: 0.010, chatter_time: 2.0, chatter_changes: 6.0, travel: [1e-3, 20e-3] };
    const PLACES: Places =
        Places { switch: [1.5e-3, 66e-3, 198e-3], hysteresis: 5e-4, stroke: 264e-3, engage: 2.2e-3, release: 8e-4, end: 4e-3 };

    /// A pulse up to the time of debouncing changes nothing, a longer one does, once.
    #[test]
    fn pulses_are_debounced() {
        for (length, seen) in [(5, false), (9, false), (11, true)] {
            let mut readings = Readings::start([false; 5], 0.0);
            let mut ever = false;
            for tick in 0..100 {
                let raw = (20..20 + length).contains(&tick);
                readings.step([raw; 5], &LIMITS, 0.0, 0.0, 1e-3);
                ever |= readings.on[P100];
            }
            assert_eq!(ever, seen, "{length} ms");
            assert!(!readings.on[P100]);
        }
    }

    /// Changes more often than any motion makes them are a fault of the switch; two in a stroke are not.
    #[test]
    fn chatter_is_a_fault() {
        let run = |period: usize| {
            let mut readings = Readings::start([false; 5], 0.0);
            for tick in 0..5_000 {
                readings.step([tick % period < period / 2; 5], &LIMITS, 0.0, 0.0, 1e-3);
            }
            readings.failed[P75]
        };
        assert!(run(20));
        assert!(run(400));
        assert!(!run(4_000));
    }

    /// A switch in mid-stroke that flickers in an extension from an unknown place: once it has gone off, which no extension
    /// does, the interval holds the nut again; and it is healthy edges that leave it narrow.
    #[test]
    fn a_flickering_switch_does_not_place_the_nut() {
        for (start, switch, flickers) in [(200e-3, P75, true), (80e-3, P75, true), (80e-3, P25, true), (80e-3, P75, false)] {
            let seen = |x: f64| [x <= 1.5e-3, x >= 66e-3, x >= 198e-3, false, false];
            let mut position = Position::start(&PLACES, seen(start), 0.0);
            let mut readings = Readings::start(seen(start), 0.0);
            let mut off = false;
            for tick in 0..3_600 {
                let counted = 5e-5 * f64::from(tick);
                let mut on = seen(start + counted);
                if flickers && tick / 500 % 2 == 1 {
                    on[switch] = !on[switch];
                }
                readings.step(on, &LIMITS, counted, 0.0, 1e-3);
                position.advance(counted, 0.0);
                readings.place(&mut position, &PLACES, counted, 5e-4);
                off |= readings.changed[switch] && !readings.on[switch];
                let holds = position.low <= start + counted && start + counted <= position.high;
                assert!(holds || !off && flickers, "{start}, {switch}, {tick}: {position:?}");
            }
            assert_eq!(position.high - position.low < 2e-3, !flickers || switch == P25, "{position:?}");
        }
    }

    /// An end switch that stays on over more travel than its place has is false, wherever the nut began.
    #[test]
    fn an_end_switch_on_in_mid_stroke_is_proven_false() {
        for (switch, width) in [(P0, 2e-3), (P100, 4e-3)] {
            let mut on = [false, true, true, false, false];
            on[switch] = true;
            let mut readings = Readings::start(on, 0.0);
            let mut proven = None;
            for tick in 0..1_000 {
                let counted = 1e-5 * f64::from(tick);
                readings.step(on, &LIMITS, counted, 0.0, 1e-3);
                if proven.is_none() && readings.overstayed(&PLACES, &LIMITS) == Some(switch) {
                    proven = Some(counted);
                }
            }
            let at = proven.unwrap_or(f64::NAN);
            assert!((at - (width + 1e-3)).abs() < 2e-5, "{switch}: {at}");
        }
    }
}
