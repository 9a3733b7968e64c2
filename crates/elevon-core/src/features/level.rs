//! How large a signal is: mean, RMS, peak, kurtosis, and RMS and peak over a moving window.

use super::moments::Moments;
use super::moving::Moving;
use super::rows::{Columns, Signal};

pub const SUFFIXES: [(&str, &str); 7] = [
    ("mean", "mean of {}"),
    ("rms", "root mean square of {}"),
    ("peak", "largest magnitude of {}"),
    ("kurtosis", "fourth central moment of {} over the square of its second (normal noise: 3)"),
    ("moving_rms_max", "largest RMS of {} over a window of 0.1 s that moves in eighths of itself"),
    ("moving_rms_min", "least RMS of {} over a window of 0.1 s that moves in eighths of itself"),
    ("moving_peak_mean", "mean, over windows of 0.1 s that move in eighths of themselves, of the largest magnitude of {}"),
];

#[derive(Clone, Debug)]
pub struct Level {
    signal: Signal,
    moments: Moments,
    moving: Moving,
    peak: f64,
}

impl Level {
    pub fn new(signal: Signal, rate: f64) -> Self {
        Self { signal, moments: Moments::default(), moving: Moving::new(rate), peak: f64::NAN }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        let values = self.signal.of(rows);
        for i in 0..values.len() {
            let x = values.at(i);
            self.moments.push(x);
            self.moving.push(x);
            self.peak = self.peak.max(x.abs());
        }
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        let m = &self.moments;
        out.extend([m.mean(), m.rms(), self.peak, m.kurtosis()]);
        out.extend(self.moving.finish());
    }
}
