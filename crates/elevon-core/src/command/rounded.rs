//! Triangles and trapezoids whose corners are rounded to a largest acceleration (docs/explanation/theory/ballscrew.md, "Profiles").
//!
//! A corner at which the slope changes by D is replaced by a parabola over D/a about it: position and slope are continuous,
//! the curve cuts the corner by D^2/(8 a). The motion begins from rest at its start, where half a parabola lies outside the
//! figure: everything is later by half the first parabola.

use super::term::Line;

/// Corners that are counted at most.
const MANY: f64 = 1e9;

/// A point of the figure: time after the first corner and value.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    pub time: f64,
    pub value: f64,
}

/// A figure of straight lines between corners in order; the first one is where the motion begins.
pub trait Figure {
    /// The corner with the number `i`; none after the last one, whose value holds.
    fn corner(&self, i: u32) -> Option<Corner>;
    /// The number of a corner that is not after `time`.
    fn early(&self, time: f64) -> u32;
}

/// Slope behind the corner `i`.
fn slope(figure: &impl Figure, i: u32) -> f64 {
    match (figure.corner(i), figure.corner(i + 1)) {
        (Some(a), Some(b)) => (b.value - a.value) / (b.time - a.time),
        _ => 0.0,
    }
}

/// The part of the rounded figure at time `t`; `begin` is when its motion begins.
pub fn rounded(figure: &impl Figure, acceleration: f64, begin: f64, t: f64) -> Line {
    let before = |i: u32| if i == 0 { 0.0 } else { slope(figure, i - 1) };
    let half = |i: u32| 0.5 * (slope(figure, i) - before(i)).abs() / acceleration;
    let origin = begin + half(0);
    let time = t - origin;
    let Some(first) = figure.corner(0) else { return Line::constant(0.0, f64::INFINITY) };
    if t < begin {
        return Line::constant(first.value, begin);
    }
    let mut i = figure.early(time);
    while figure.corner(i + 1).is_some_and(|next| next.time <= time) {
        i += 1;
    }
    let Some(here) = figure.corner(i) else { return Line::constant(first.value, f64::INFINITY) };
    let bend = |i: u32, at: Corner| {
        let (h, change) = (half(i), slope(figure, i) - before(i));
        Line {
            at: origin + at.time - h,
            value: at.value - before(i) * h,
            slope: before(i),
            curve: 0.5 * acceleration * if change < 0.0 { -1.0 } else { 1.0 },
            until: origin + at.time + h,
        }
    };
    if time < here.time + half(i) {
        return bend(i, here);
    }
    match figure.corner(i + 1) {
        Some(next) if time >= next.time - half(i + 1) => bend(i + 1, next),
        Some(next) => {
            Line { at: origin + here.time, value: here.value, slope: slope(figure, i), curve: 0.0, until: origin + next.time - half(i + 1) }
        }
        None => Line::constant(here.value, f64::INFINITY),
    }
}

/// The parameters of a triangle in the order of the catalogue, from the time at which it begins.
pub struct TriangleFigure {
    amplitude: f64,
    bias: f64,
    frequency: f64,
    /// Quarter periods since the rising crossing of the bias.
    entered: f64,
    /// Number of the first turning point: 0 is the upper one of the first period.
    turning: f64,
}

impl TriangleFigure {
    pub fn new(amplitude: f64, frequency: f64, entered: f64, bias: f64) -> Self {
        let turning = (0.5 * (entered - 1.0)).floor() + 1.0;
        Self { amplitude, bias, frequency, entered, turning }
    }
    fn value(&self) -> f64 {
        let half = (0.5 * (self.entered + 1.0)).floor();
        let sign = if half.rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
        self.bias + sign * self.amplitude * (self.entered - 2.0 * half)
    }
}

impl Figure for TriangleFigure {
    fn corner(&self, i: u32) -> Option<Corner> {
        if i == 0 {
            return Some(Corner { time: 0.0, value: self.value() });
        }
        let turning = self.turning + f64::from(i - 1);
        let sign = if turning.rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
        let time = 0.25 * (2.0 * turning + 1.0 - self.entered) / self.frequency;
        Some(Corner { time, value: self.bias + sign * self.amplitude })
    }
    fn early(&self, time: f64) -> u32 {
        (2.0 * self.frequency * time - 2.0).clamp(0.0, MANY) as u32
    }
}

/// A trapezoid from the time at which it begins: rise, hold, fall, hold; holds of no length are no corners.
pub struct TrapezoidFigure {
    corners: [Corner; 5],
    count: u32,
    period: f64,
    repeat: bool,
    entered: f64,
    first: u32,
}

impl TrapezoidFigure {
    /// `spans` are rise, hold_high, fall and hold_low; `entered` is the time since its start at which the motion begins.
    pub fn new(levels: [f64; 2], spans: [f64; 4], repeat: bool, entered: f64) -> Self {
        let [low, high] = levels;
        let period: f64 = spans.iter().sum();
        let repeat = repeat && period > 0.0;
        let mut corners = [Corner { time: 0.0, value: low }; 5];
        let (mut count, mut time) = (1, 0.0);
        for (span, value) in spans.iter().zip([high, high, low, low]).take(if repeat { 3 } else { 4 }) {
            time += span;
            if *span > 0.0 && time < period {
                corners[count as usize] = Corner { time, value };
                count += 1;
            }
        }
        if !repeat {
            corners[count as usize] = Corner { time: period, value: low };
            count += u32::from(corners[count as usize - 1].time < period);
        }
        let mut figure = Self { corners, count, period, repeat, entered, first: 0 };
        while figure.whole(figure.first).is_some_and(|c| c.time <= entered) {
            figure.first += 1;
        }
        figure
    }
    /// Corners of the figure from its own start.
    fn whole(&self, i: u32) -> Option<Corner> {
        if !self.repeat && i >= self.count {
            return None;
        }
        let corner = self.corners[(i % self.count) as usize];
        Some(Corner { time: corner.time + self.period * f64::from(i / self.count), ..corner })
    }
}

impl Figure for TrapezoidFigure {
    fn corner(&self, i: u32) -> Option<Corner> {
        if i > 0 {
            return self.whole(self.first + i - 1).map(|c| Corner { time: c.time - self.entered, ..c });
        }
        let value = match (self.first.checked_sub(1).and_then(|k| self.whole(k)), self.whole(self.first)) {
            (Some(a), Some(b)) => a.value + (b.value - a.value) * (self.entered - a.time) / (b.time - a.time),
            (Some(a), None) => a.value,
            (None, Some(b)) => b.value,
            (None, None) => self.corners[0].value,
        };
        Some(Corner { time: 0.0, value })
    }
    fn early(&self, time: f64) -> u32 {
        if self.repeat {
            (f64::from(self.count) * (time / self.period - 1.0)).clamp(0.0, MANY) as u32
        } else {
            0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The parts of a figure from 0 to `end`, in order.
    fn parts(figure: &impl Figure, acceleration: f64, begin: f64, end: f64) -> Vec<Line> {
        let mut found = Vec::new();
        let mut t = 0.0;
        while t < end {
            let line = rounded(figure, acceleration, begin, t);
            t = line.until + 1e-12;
            found.push(line);
        }
        found
    }
    fn at(line: &Line, t: f64) -> [f64; 2] {
        let tau = t - line.at;
        [line.value + (line.slope + line.curve * tau) * tau, line.slope + 2.0 * line.curve * tau]
    }

    fn smooth(parts: &[Line]) {
        for pair in parts.windows(2) {
            let (a, b) = (at(&pair[0], pair[0].until), at(&pair[1], pair[0].until));
            assert!((a[0] - b[0]).abs() < 1e-12 && (a[1] - b[1]).abs() < 1e-9, "{pair:?}");
        }
    }

    #[test]
    fn position_and_rate_are_continuous_and_the_corner_is_cut_by_its_law() {
        for phase in [0.0, 0.5, 1.0, 2.7, 3.0] {
            let figure = TriangleFigure::new(0.05, 0.3, phase, 0.01);
            let found = parts(&figure, 0.5, 0.2, 12.0);
            smooth(&found);
            assert_eq!(at(&found[0], 0.0)[1], 0.0);
            let rate = 4.0 * 0.3 * 0.05;
            let peak = found.iter().skip(2).filter(|l| l.curve < 0.0).map(|l| at(l, 0.5 * (l.at + l.until))[0]).fold(f64::MIN, f64::max);
            assert!((peak - (0.06 - (2.0 * rate) * (2.0 * rate) / (8.0 * 0.5))).abs() < 1e-12);
            assert!(found.iter().all(|l| 2.0 * l.curve.abs() <= 0.5 + 1e-12 && l.slope.abs() <= rate + 1e-12));
        }
    }

    #[test]
    fn trapezoids_with_and_without_holds_and_entered_anywhere() {
        for (holds, repeat, entered) in
            [([1.0, 1.0], true, 0.0), ([0.0, 0.0], true, 0.0), ([0.5, 0.0], true, 0.8), ([1.0, 0.3], false, 0.5)]
        {
            let figure = TrapezoidFigure::new([-0.05, 0.05], [1.6, holds[0], 1.6, holds[1]], repeat, entered);
            let found = parts(&figure, 0.6, 0.0, 20.0);
            smooth(&found);
            assert!(found.iter().all(|l| l.slope.abs() <= 0.1 / 1.6 + 1e-12));
            assert!(repeat || found.last().is_some_and(|l| l.value == -0.05 && l.until == f64::INFINITY));
        }
    }
}
