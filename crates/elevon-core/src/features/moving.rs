//! Values over a window that moves: the window is eight hops long and moves a hop at a time, so that it needs eight numbers
//! whatever its length, and no running sum that rounding could wear.

/// Hops in a window.
const HOPS: usize = 8;
/// Length of the window, s.
const WINDOW: f64 = 0.1;

/// Rows in a hop: at least one.
pub fn hop(rate: f64) -> usize {
    ((WINDOW * rate / HOPS as f64).round() as usize).max(1)
}

#[derive(Clone, Copy, Debug)]
pub struct Moving {
    hop: usize,
    rows: usize,
    square: f64,
    peak: f64,
    ring: [(f64, f64); HOPS],
    hops: usize,
    largest: f64,
    least: f64,
    peaks: f64,
}

impl Moving {
    pub fn new(rate: f64) -> Self {
        Self {
            hop: hop(rate),
            rows: 0,
            square: 0.0,
            peak: 0.0,
            ring: [(0.0, 0.0); HOPS],
            hops: 0,
            largest: f64::NEG_INFINITY,
            least: f64::INFINITY,
            peaks: 0.0,
        }
    }

    #[inline(always)]
    pub fn push(&mut self, x: f64) {
        self.square += x * x;
        self.peak = if x.abs() > self.peak { x.abs() } else { self.peak };
        self.rows += 1;
        if self.rows == self.hop {
            self.turn();
        }
    }

    /// A hop is full.
    fn turn(&mut self) {
        self.ring[self.hops % HOPS] = (self.square, self.peak);
        self.hops += 1;
        (self.rows, self.square, self.peak) = (0, 0.0, 0.0);
        if self.hops >= HOPS {
            let sum: f64 = self.ring.iter().map(|hop| hop.0).sum();
            let rms = (sum / (HOPS * self.hop) as f64).sqrt();
            self.largest = self.largest.max(rms);
            self.least = self.least.min(rms);
            self.peaks += self.ring.iter().map(|hop| hop.1).fold(0.0, f64::max);
        }
    }

    /// Largest and least RMS of a window, mean of the windows' peaks; NaN where the motion is shorter than one window.
    pub fn finish(&self) -> [f64; 3] {
        if self.hops < HOPS {
            return [f64::NAN; 3];
        }
        [self.largest, self.least, self.peaks / (self.hops + 1 - HOPS) as f64]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_seen_by_the_windows_on_either_side() {
        let mut moving = Moving::new(400.0);
        assert_eq!(moving.hop, 5);
        (0..200).for_each(|i| moving.push(if i < 100 { 1.0 } else { -3.0 }));
        let [largest, least, peaks] = moving.finish();
        assert_eq!((largest, least), (3.0, 1.0));
        // 33 windows end at hop 8, ..., 40; those from hop 21 on hold rows of the second half.
        assert!((peaks - (13.0 * 1.0 + 20.0 * 3.0) / 33.0).abs() < 1e-12);
    }

    #[test]
    fn shorter_than_a_window_is_not_a_number() {
        let mut moving = Moving::new(400.0);
        (0..39).for_each(|_| moving.push(1.0));
        assert!(moving.finish().iter().all(|x| x.is_nan()));
    }
}
