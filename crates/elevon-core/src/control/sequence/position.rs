//! Where the nut is: an interval that the Hall count moves and the switches narrow. A switch is believed where the count
//! agrees with it, whether it has changed or has failed to.

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

#[derive(Clone, Copy, Debug)]
pub struct Position {
    pub low: f64,
    pub high: f64,
    counted: f64,
}

/// How far the count and a switch may differ before the switch is at fault: at the ends, and at 25 and 75 %.
#[derive(Clone, Copy, Debug)]
pub struct Margins {
    pub end: f64,
    pub quarter: f64,
}

const P0: usize = 0;
const P100: usize = 3;

impl Places {
    /// Nowhere in particular.
    pub fn whole(&self) -> (f64, f64) {
        (0.0, self.stroke + self.end)
    }

    /// Where the nut may be while a switch (0, 25, 75 %, lock sleeve) reads as it does. An engaged lock that does not let
    /// go holds the nut at the end of the stroke.
    fn claim(&self, switch: usize, on: bool) -> (f64, f64) {
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
    /// What the switches alone state at power-up.
    pub fn start(places: &Places, switches: [bool; 4], counted: f64) -> Self {
        let (low, high) = places.whole();
        let mut position = Self { low, high, counted };
        for (switch, on) in switches.into_iter().enumerate() {
            let (from, to) = places.claim(switch, on);
            position.low = position.low.max(from);
            position.high = position.high.min(to);
        }
        if position.low > position.high {
            (position.low, position.high) = (low, high);
        }
        position
    }

    pub fn between(&mut self, low: f64, high: f64) {
        (self.low, self.high) = (low, high);
    }

    /// After a tick: the count has moved, and may have lost up to `lost`.
    pub fn advance(&mut self, counted: f64, lost: f64) {
        let moved = counted - self.counted;
        self.counted = counted;
        self.low += moved - lost;
        self.high += moved + lost;
    }

    /// By how much a switch's claim misses the interval.
    fn gap(&self, places: &Places, switch: usize, on: bool) -> f64 {
        let (from, to) = places.claim(switch, on);
        (from - self.high).max(self.low - to)
    }

    /// The first switch that the count contradicts.
    pub fn contradicted(&self, places: &Places, switches: [bool; 4], margins: &Margins) -> Option<usize> {
        let margin = |switch| if switch == P0 || switch == P100 { margins.end } else { margins.quarter };
        (0..4).find(|&switch| self.gap(places, switch, switches[switch]) > margin(switch))
    }

    /// The switches of the ram narrow the interval where they agree with it to `slack`, which covers their response. The
    /// lock's does not: it is what the count has to confirm.
    pub fn narrow(&mut self, places: &Places, switches: [bool; 4], slack: f64) {
        for (switch, on) in switches.into_iter().enumerate().take(P100) {
            if self.gap(places, switch, on) <= slack {
                let (from, to) = places.claim(switch, on);
                self.low = self.low.max(from - slack).min(self.high);
                self.high = self.high.min(to + slack).max(self.low);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: Places = Places { switch: [1.5, 66.0, 198.0], hysteresis: 0.5, stroke: 264.0, engage: 2.2, release: 0.8, end: 4.0 };
    const MARGINS: Margins = Margins { end: 0.5, quarter: 20.0 };

    fn seen(x: f64) -> [bool; 4] {
        [x <= 1.5, x >= 66.0, x >= 198.0, x >= 266.2]
    }

    /// Over a whole stroke the interval holds the truth, and is narrow where the lock must be confirmed.
    #[test]
    fn the_interval_holds_the_truth() {
        let mut position = Position::start(&PLACES, seen(0.75), 0.0);
        for tick in 1..=26_700 {
            let x = 0.75 + 0.01 * f64::from(tick);
            position.advance(x - 0.75, 0.0);
            position.narrow(&PLACES, seen(x), 0.5);
            assert!(position.low <= x && x <= position.high, "{x}: {position:?}");
            assert_eq!(position.contradicted(&PLACES, seen(x), &MARGINS), None, "{x}");
        }
        assert!(position.high - position.low < 1.6, "{position:?}");
    }

    /// Every switch stuck on or off is contradicted by the count somewhere on the stroke.
    #[test]
    fn stuck_switches_are_contradicted() {
        for switch in 0..4 {
            for stuck in [false, true] {
                let mut position = Position::start(&PLACES, seen(0.75), 0.0);
                let mut found = false;
                for tick in 1..=2_672 {
                    let x = 0.75 + 0.1 * f64::from(tick);
                    let mut readings = seen(x);
                    if x > 2.5 {
                        readings[switch] = stuck;
                    }
                    position.advance(x - 0.75, 0.0);
                    found |= position.contradicted(&PLACES, readings, &MARGINS) == Some(switch);
                    position.narrow(&PLACES, readings, 0.5);
                }
                // The switch at 0 % off and those at 25 % on are what the stroke upwards has in any case.
                let harmless = switch == 0 && !stuck;
                assert_eq!(found, !harmless, "switch {switch} stuck {stuck}");
            }
        }
    }
}
