//! One waveform of one run: its straight line or oscillator at a given time, and the time of its next breakpoint.

use super::rounded::{rounded, TrapezoidFigure, TriangleFigure};
use super::Wave;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A waveform with its parameters (SI) in the order of the catalogue.
#[derive(Clone, Debug)]
pub struct Term {
    pub wave: Wave,
    pub enabled: bool,
    pub parameters: Vec<f64>,
    /// Points of a table, shared between the runs of a batch.
    pub times: Arc<[f64]>,
    pub values: Arc<[f64]>,
}

/// `value + (slope + curve (t - at)) (t - at)` until `until`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    pub at: f64,
    pub value: f64,
    pub slope: f64,
    pub curve: f64,
    pub until: f64,
}

/// `amplitude sin(phase + (rate + sweep tau) tau)`, `tau = t - at`, until `until`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation {
    pub at: f64,
    pub amplitude: f64,
    pub phase: f64,
    pub rate: f64,
    pub sweep: f64,
    pub until: f64,
}

/// One cycle of a period sweep: a linear chirp from 1/T_k to 1/T_(k+1). Requiring the period at a cycle's start to be
/// T_k = T_0 + q t_k gives T_k = T_0 rho^k in closed form (docs/explanation/theory/ballscrew.md, "Profiles").
struct Cycle {
    begin: f64,
    period: f64,
    length: f64,
    sweep: f64,
}

impl Cycle {
    /// The cycle at time `t` of a sweep with the parameters `p`.
    fn find(p: &[f64], t: f64) -> Self {
        let (first, slope) = (p[1], (p[2] - p[1]) / p[3]);
        if slope == 0.0 {
            let k = (t / first).floor();
            return Self { begin: k * first, period: first, length: first, sweep: 0.0 };
        }
        let rho = slope + (1.0 + slope * slope).sqrt();
        let k = (libm::log(1.0 + slope * t / first) / libm::log(rho)).floor();
        let power = libm::pow(rho, k);
        let (period, length) = (first * power, (rho - 1.0) / slope * first * power);
        let begin = first * (power - 1.0) / slope;
        let sweep = std::f64::consts::PI * (1.0 / (rho * period) - 1.0 / period) / length;
        Self { begin, period, length, sweep }
    }
}

const NEVER: f64 = f64::INFINITY;

impl Line {
    pub fn constant(value: f64, until: f64) -> Self {
        Self { at: 0.0, value, slope: 0.0, curve: 0.0, until }
    }
    /// Through two points, exact at the first.
    fn through(t0: f64, v0: f64, t1: f64, v1: f64) -> Self {
        Self { at: t0, value: v0, slope: (v1 - v0) / (t1 - t0), curve: 0.0, until: t1 }
    }
    fn shifted(self, offset: f64) -> Self {
        Self { at: self.at + offset, until: self.until + offset, ..self }
    }
}

impl Term {
    pub fn oscillates(&self) -> bool {
        self.enabled && matches!(self.wave, Wave::Sine | Wave::Chirp | Wave::PeriodSweep)
    }

    /// The value at time `t`.
    pub fn at(&self, t: f64) -> f64 {
        let line = self.line(t);
        // A held value counts as it is: its slope is zero and its line may begin anywhere.
        let value = if line.slope == 0.0 { line.value } else { line.value + line.slope * (t - line.at) };
        if !self.oscillates() {
            return value;
        }
        let o = self.oscillation(t);
        let tau = t - o.at;
        value + o.amplitude * libm::sin(o.phase + (o.rate + o.sweep * tau) * tau)
    }

    /// The straight-line part at time `t` (for oscillating terms: the bias and the held values).
    pub fn line(&self, t: f64) -> Line {
        let p = &self.parameters;
        match self.wave {
            _ if !self.enabled => Line::constant(0.0, NEVER),
            Wave::Constant => Line::constant(p[0], NEVER),
            Wave::Step if t < p[2] => Line::constant(p[0], p[2]),
            Wave::Step => Line::constant(p[1], NEVER),
            Wave::Ramp if t < p[2] => Line::constant(p[0], p[2]),
            Wave::Ramp if t < p[3] => Line { at: p[2], value: p[0], slope: p[1], curve: 0.0, until: p[3] },
            Wave::Ramp => Line::constant(p[0] + p[1] * (p[3] - p[2]), NEVER),
            Wave::Sine => self.sine_line(t),
            Wave::Chirp => self.chirp_line(t),
            Wave::PeriodSweep => self.period_sweep_line(t),
            Wave::Triangle => self.triangle(t),
            Wave::Trapezoid => self.trapezoid(t),
            Wave::Rectangle => self.rectangle(t),
            Wave::Table => self.table(t),
        }
    }

    /// The oscillating part at time `t`; zero amplitude while the term is held.
    pub fn oscillation(&self, t: f64) -> Oscillation {
        let p = &self.parameters;
        let silent = |until| Oscillation { at: 0.0, amplitude: 0.0, phase: 0.0, rate: 0.0, sweep: 0.0, until };
        match self.wave {
            Wave::Sine if t < p[4] => silent(p[4]),
            Wave::Sine if t < p[5] => Oscillation { at: p[4], amplitude: p[0], phase: p[2], rate: TAU * p[1], sweep: 0.0, until: p[5] },
            Wave::Chirp if t < p[6] => silent(p[6]),
            Wave::Chirp => {
                let (cycle, repeat) = (((t - p[6]) / p[3]).floor(), p[7] != 0.0);
                if cycle >= 1.0 && !repeat {
                    return silent(NEVER);
                }
                let at = p[6] + cycle * p[3];
                let sweep = std::f64::consts::PI * (p[2] - p[1]) / p[3];
                Oscillation { at, amplitude: p[0], phase: p[4], rate: TAU * p[1], sweep, until: at + p[3] }
            }
            Wave::PeriodSweep if t < p[5] => silent(p[5]),
            Wave::PeriodSweep => {
                let sweep = ((t - p[5]) / p[3]).floor();
                if sweep >= 1.0 && p[6] == 0.0 {
                    return silent(NEVER);
                }
                let origin = p[5] + sweep * p[3];
                let cycle = Cycle::find(p, t - origin);
                let until = (origin + cycle.begin + cycle.length).min(origin + p[3]);
                Oscillation { at: origin + cycle.begin, amplitude: p[0], phase: 0.0, rate: TAU / cycle.period, sweep: cycle.sweep, until }
            }
            _ => silent(NEVER),
        }
    }

    fn period_sweep_line(&self, t: f64) -> Line {
        let p = &self.parameters;
        if t < p[5] {
            Line::constant(p[4], p[5])
        } else if p[6] == 0.0 && t >= p[5] + p[3] {
            let cycle = Cycle::find(p, p[3]);
            let tau = p[3] - cycle.begin;
            Line::constant(p[4] + p[0] * libm::sin((cycle.sweep * tau + TAU / cycle.period) * tau), NEVER)
        } else {
            Line::constant(p[4], self.oscillation(t).until)
        }
    }

    fn sine_line(&self, t: f64) -> Line {
        let p = &self.parameters;
        let sine = |time: f64| p[3] + p[0] * libm::sin(p[2] + TAU * p[1] * (time - p[4]));
        if t < p[4] {
            Line::constant(sine(p[4]), p[4])
        } else if t < p[5] {
            Line::constant(p[3], p[5])
        } else {
            Line::constant(sine(p[5]), NEVER)
        }
    }

    fn chirp_line(&self, t: f64) -> Line {
        let p = &self.parameters;
        let end_phase = p[4] + std::f64::consts::PI * (p[1] + p[2]) * p[3];
        if t < p[6] {
            Line::constant(p[5] + p[0] * libm::sin(p[4]), p[6])
        } else if p[7] == 0.0 && t >= p[6] + p[3] {
            Line::constant(p[5] + p[0] * libm::sin(end_phase), NEVER)
        } else {
            Line::constant(p[5], self.oscillation(t).until)
        }
    }

    fn triangle(&self, t: f64) -> Line {
        let p = &self.parameters;
        let (amplitude, frequency, bias, start, end) = (p[0], p[1], p[3], p[4], p[5]);
        if p[6] > 0.0 {
            // Entered where it stands when the run begins, at the latest.
            let begin = start.max(0.0);
            let entered = 4.0 * (p[2] / TAU + frequency * (begin - start));
            return rounded(&TriangleFigure::new(amplitude, frequency, entered, bias), p[6], begin, t);
        }
        let time = t.max(start).min(end);
        // Quarter periods since the rising crossing of the bias.
        let quarters = 4.0 * (p[2] / TAU + frequency * (time - start));
        let half = ((quarters + 1.0) / 2.0).floor();
        let rising = half.rem_euclid(2.0) == 0.0;
        let sign = if rising { 1.0 } else { -1.0 };
        let at = start + ((2.0 * half - p[2] / TAU * 4.0) / 4.0) / frequency;
        let slope = sign * 4.0 * frequency * amplitude;
        if t < start || t >= end {
            let until = if t < start { start } else { NEVER };
            return Line::constant(bias + slope * (time - at), until);
        }
        Line { at, value: bias, slope, curve: 0.0, until: (at + 0.25 / frequency).min(end) }
    }

    fn trapezoid(&self, t: f64) -> Line {
        let p = &self.parameters;
        let (low, high, start, repeat) = (p[0], p[1], p[6], p[7] != 0.0);
        if p[8] > 0.0 {
            let begin = start.max(0.0);
            let figure = TrapezoidFigure::new([low, high], [p[2], p[3], p[4], p[5]], repeat, begin - start);
            return rounded(&figure, p[8], begin, t);
        }
        if t < start {
            return Line::constant(low, start);
        }
        let period = p[2] + p[3] + p[4] + p[5];
        let cycle = if repeat { ((t - start) / period).floor() } else { 0.0 };
        let origin = start + cycle * period;
        let (t1, t2) = (p[2], p[2] + p[3]);
        let (t3, t4) = (t2 + p[4], period);
        let line = match t - origin {
            tau if tau < t1 => Line::through(0.0, low, t1, high),
            tau if tau < t2 => Line::constant(high, t2),
            tau if tau < t3 => Line::through(t2, high, t3, low),
            _ => Line::constant(low, if repeat { t4 } else { NEVER }),
        };
        line.shifted(origin)
    }

    fn rectangle(&self, t: f64) -> Line {
        let p = &self.parameters;
        if t < p[4] {
            return Line::constant(p[0], p[4]);
        }
        let origin = p[4] + ((t - p[4]) / p[2]).floor() * p[2];
        let switch = origin + p[3] * p[2];
        if t < switch {
            Line::constant(p[1], switch)
        } else {
            Line::constant(p[0], origin + p[2])
        }
    }

    fn table(&self, t: f64) -> Line {
        let (start, repeat, gain) = (self.parameters[0], self.parameters[1] != 0.0, self.parameters[2]);
        let (times, values) = (&self.times, &self.values);
        let last = times.len() - 1;
        let period = times[last] - times[0];
        let cycle = if repeat && period > 0.0 { ((t - start - times[0]) / period).floor().max(0.0) } else { 0.0 };
        let origin = start + cycle * period;
        let tau = t - origin;
        let scaled = |line: Line| Line { value: gain * line.value, slope: gain * line.slope, ..line }.shifted(origin);
        if tau < times[0] {
            return scaled(Line::constant(values[0], times[0]));
        }
        let next = times.partition_point(|&x| x <= tau);
        if next > last {
            return scaled(Line::constant(values[last], NEVER));
        }
        if self.parameters[3] != 0.0 {
            return scaled(Line::constant(values[next - 1], times[next]));
        }
        scaled(Line::through(times[next - 1], values[next - 1], times[next], values[next]))
    }
}
