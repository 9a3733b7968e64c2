//! RMS in bands of frequency: Welch's mean of windowed spectra, segment by segment
//! (P. D. Welch, IEEE Trans. Audio Electroacoustics 15(2), 1967).

use super::fft::Fft;
use super::rows::{Columns, Signal};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Edges of the bands, Hz.
pub const EDGES: [f64; 9] = [5.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0];
pub const COUNT: usize = EDGES.len() - 1;

pub const TEXT: &str = "RMS of {} between {} Hz (the upper edge excluded): Welch's spectrum of segments of at least 0.2 s \
                        (the next power of two of rows), half overlapping, each less its mean, in Hann's window";

/// Least length of a segment, s.
const SEGMENT: f64 = 0.2;

/// What all lanes share: the transform, the window and the band of each line.
#[derive(Debug)]
pub struct Spectrum {
    fft: Fft,
    window: Vec<f64>,
    /// From a line's squared magnitude to mean square.
    scale: f64,
    /// First line of each band and one past its last.
    lines: [(usize, usize); COUNT],
}

impl Spectrum {
    pub fn new(rate: f64) -> Self {
        let rows = ((SEGMENT * rate).ceil().max(8.0) as usize).next_power_of_two();
        let window: Vec<f64> = (0..rows).map(|i| 0.5 - 0.5 * libm::cos(TAU * i as f64 / rows as f64)).collect();
        let power: f64 = window.iter().map(|w| w * w).sum();
        let line = |edge: f64| ((edge * rows as f64 / rate).ceil() as usize).min(rows / 2);
        let lines = std::array::from_fn(|i| (line(EDGES[i]), line(EDGES[i + 1])));
        Self { fft: Fft::new(rows.trailing_zeros()), scale: 2.0 / (power * rows as f64), window, lines }
    }

    /// Mean square in each band of one segment.
    fn bands(&self, segment: &[f64], work: &mut Vec<(f64, f64)>) -> [f64; COUNT] {
        let mean = segment.iter().sum::<f64>() / segment.len() as f64;
        work.clear();
        work.extend(segment.iter().zip(&self.window).map(|(x, w)| ((x - mean) * w, 0.0)));
        self.fft.transform(work);
        let power = |&(re, im): &(f64, f64)| re * re + im * im;
        self.lines.map(|(from, to)| self.scale * work[from..to].iter().map(power).sum::<f64>())
    }
}

#[derive(Clone, Debug)]
pub struct Bands {
    signal: Signal,
    shared: Arc<Spectrum>,
    segment: Vec<f64>,
    work: Vec<(f64, f64)>,
    sums: [f64; COUNT],
    count: f64,
}

impl Bands {
    pub fn new(signal: Signal, shared: Arc<Spectrum>) -> Self {
        let segment = Vec::with_capacity(shared.window.len());
        Self { signal, shared, segment, work: Vec::new(), sums: [0.0; COUNT], count: 0.0 }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        let values = self.signal.of(rows);
        for i in 0..values.len() {
            self.segment.push(values.at(i));
            if self.segment.len() == self.shared.window.len() {
                self.turn();
            }
        }
    }

    /// A segment is full; its second half is the next one's first.
    fn turn(&mut self) {
        let bands = self.shared.bands(&self.segment, &mut self.work);
        for (sum, x) in self.sums.iter_mut().zip(bands) {
            *sum += x;
        }
        self.count += 1.0;
        let half = self.segment.len() / 2;
        self.segment.copy_within(half.., 0);
        self.segment.truncate(half);
    }

    /// NaN where the motion is shorter than a segment.
    pub fn finish(&self, out: &mut Vec<f64>) {
        out.extend(self.sums.iter().map(|sum| (sum / self.count).sqrt()));
    }
}

#[cfg(test)]
mod tests {
    use super::super::rows::Role;
    use super::*;

    #[test]
    fn a_tone_stands_in_its_band_with_its_rms() {
        let rate = 1000.0;
        let x: Vec<f64> = (0..4000).map(|i| 7.0 + 2.0 * libm::sin(TAU * 75.0 * f64::from(i) / rate)).collect();
        let mut rows = Columns::default();
        rows.set(Role::TorqueCurrent, &x);
        let mut bands = Bands::new(Signal::TorqueCurrent, Arc::new(Spectrum::new(rate)));
        let mut out = Vec::new();
        bands.push(&rows);
        bands.finish(&mut out);
        assert!((out[2] - 2.0_f64.sqrt()).abs() < 1e-3, "{out:?}");
        assert!(out.iter().enumerate().all(|(i, x)| i == 2 || *x < 0.02), "{out:?}");
    }
}
