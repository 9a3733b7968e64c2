//! Where the nut is: an interval that the Hall count moves, and the switches in mid-stroke and the stops narrow.

use super::readings::{P0, P100, SWITCHES};
use crate::kept;

/// Where the switches stand and what the lock needs, as the unit knows them (nut travel, m).
#[derive(Clone, Copy, Debug)]
pub struct Places {
    /// Upper edge of the switch at 0 %, lower edges of those at 25 and 75 %.
    pub switch: [f64; 3],
    pub hysteresis: f64,
    pub stroke: f64,
    /// Travel beyond the stroke at which the lock engages, lets go, and the nut meets its stop.
    pub engage: f64,
    pub release: f64,
    pub end: f64,
}

kept!(Places as Places { switch, hysteresis, stroke, engage, release, end });

#[derive(Clone, Copy, Debug)]
pub struct Position {
    pub low: f64,
    pub high: f64,
    /// What it would be if no switch in mid-stroke had placed the nut since an end was confirmed.
    edgeless: (f64, f64),
    counted: f64,
}

kept!(Position as Position { low, high, edgeless, counted });

/// How far the count and a switch may differ before the switch is at fault: at the ends, and at 25 and 75 %.
#[derive(Clone, Copy, Debug)]
pub struct Margins {
    pub end: f64,
    pub quarter: f64,
}

impl Places {
    /// Nowhere in particular.
    pub fn whole(&self) -> (f64, f64) {
        (0.0, self.stroke + self.end)
    }

    /// Where the nut may be while a switch (0, 25, 75 %, lock sleeve) reads as it does. An engaged lock that does not let
    /// go holds the nut at the end of the stroke.
    pub fn claim(&self, switch: usize, on: bool) -> (f64, f64) {
        let (first, last) = self.whole();
        match (switch, on) {
            (P0, true) => (first, self.switch[0] + self.hysteresis),
            (P0, false) => (self.switch[0], last),
            (P100, true) => (self.stroke, last),
            (P100, false) => (first, self.stroke + self.engage),
            (_, true) => (self.switch[switch] - self.hysteresis, last),
            (_, false) => (first, self.switch[switch]),
        }
    }
}

impl Position {
    /// What the switches state at power-up when any one of them may be wrong: all that is left when one is not asked.
    pub fn start(places: &Places, on: [bool; SWITCHES], counted: f64) -> Self {
        let whole = places.whole();
        let without = |doubted: usize| {
            let claims = (0..4).filter(|&switch| switch != doubted).map(|switch| places.claim(switch, on[switch]));
            claims.fold(whole, |(low, high), (from, to)| (low.max(from), high.min(to)))
        };
        let possible = (0..4).map(without).filter(|(low, high)| low <= high);
        let hull = possible.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or(whole);
        Self { low: hull.0, high: hull.1, edgeless: hull, counted }
    }

    pub fn between(&mut self, low: f64, high: f64) {
        (self.low, self.high, self.edgeless) = (low, high, (low, high));
    }

    /// A switch in mid-stroke proves false: where it has placed the nut bears nothing any more.
    pub fn forget_edges(&mut self) {
        (self.low, self.high) = self.edgeless;
    }

    /// After a tick: the count has moved, and may have lost up to `lost`.
    pub fn advance(&mut self, counted: f64, lost: f64) {
        let moved = counted - self.counted;
        self.counted = counted;
        self.low += moved - lost;
        self.high += moved + lost;
        self.edgeless = (self.edgeless.0 + moved - lost, self.edgeless.1 + moved + lost);
    }

    /// By how much a switch's claim misses the interval.
    fn gap(&self, places: &Places, switch: usize, on: bool) -> f64 {
        let (from, to) = places.claim(switch, on);
        (from - self.high).max(self.low - to)
    }

    /// The first believed switch that the count contradicts.
    pub fn contradicted(&self, places: &Places, on: &[bool; SWITCHES], failed: &[bool; SWITCHES], margins: &Margins) -> Option<usize> {
        let margin = |switch| if switch == P0 || switch == P100 { margins.end } else { margins.quarter };
        (0..4).find(|&switch| !failed[switch] && self.gap(places, switch, on[switch]) > margin(switch))
    }

    /// The nut is at an edge, between `from` and `to`, where that agrees with the count to `slack`, which covers the
    /// switches' response. False where it does not.
    pub fn at_edge(&mut self, from: f64, to: f64, slack: f64) -> bool {
        let agrees = from - self.high <= slack && self.low - to <= slack;
        if agrees {
            self.low = self.low.max(from - slack).min(to + slack);
            self.high = self.high.min(to + slack).max(self.low);
        }
        agrees
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: Places = Places { switch: [1.5, 66.0, 198.0], hysteresis: 0.5, stroke: 264.0, engage: 2.2, release: 0.8, end: 4.0 };
    const MARGINS: Margins = Margins { end: 0.5, quarter: 20.0 };
    const NONE: [bool; SWITCHES] = [false; SWITCHES];

    fn seen(x: f64) -> [bool; SWITCHES] {
        [x <= 1.5, x >= 66.0, x >= 198.0, x >= 266.2, false]
    }

    /// Whatever one switch says, the interval of power-up holds the nut.
    #[test]
    fn power_up_survives_any_one_switch() {
        for tick in 0..=2_680 {
            let x = 0.1 * f64::from(tick);
            for switch in 0..4 {
                for stuck in [false, true] {
                    let mut on = seen(x);
                    on[switch] = stuck;
                    let position = Position::start(&PLACES, on, 0.0);
                    assert!(position.low <= x && x <= position.high, "{x}, switch {switch} {stuck}: {position:?}");
                }
            }
        }
    }

    /// Over a whole stroke the interval holds the truth, and is narrow where the lock must be confirmed.
    #[test]
    fn the_interval_holds_the_truth() {
        let mut position = Position::start(&PLACES, seen(0.75), 0.0);
        let mut before = seen(0.75);
        for tick in 1..=26_700 {
            let x = 0.75 + 0.01 * f64::from(tick);
            position.advance(x - 0.75, 0.0);
            for switch in [1, 2] {
                if before[switch] != seen(x)[switch] {
                    position.at_edge(PLACES.switch[switch] - 0.5, PLACES.switch[switch], 0.5);
                }
            }
            before = seen(x);
            assert!(position.low <= x && x <= position.high, "{x}: {position:?}");
            assert_eq!(position.contradicted(&PLACES, &seen(x), &NONE, &MARGINS), None, "{x}");
        }
        assert!(position.high - position.low < 1.6, "{position:?}");
    }

    /// Every switch stuck on or off in a confirmed position is contradicted by the count somewhere on the stroke.
    #[test]
    fn stuck_switches_are_contradicted() {
        for switch in 0..4 {
            for stuck in [false, true] {
                let mut position = Position::start(&PLACES, seen(0.75), 0.0);
                position.between(0.0, 2.0);
                let mut proven = false;
                for tick in 1..=2_672 {
                    let x = 0.75 + 0.1 * f64::from(tick);
                    let mut readings = seen(x);
                    if x > 2.5 {
                        readings[switch] = stuck;
                    }
                    position.advance(0.1 * f64::from(tick), 0.0);
                    proven |= position.contradicted(&PLACES, &readings, &NONE, &MARGINS) == Some(switch);
                }
                // The switch at 0 % off and those at 25 % on are what the stroke upwards has in any case.
                let harmless = switch == 0 && !stuck;
                assert_eq!(proven, !harmless, "switch {switch} stuck {stuck}");
            }
        }
    }
}
