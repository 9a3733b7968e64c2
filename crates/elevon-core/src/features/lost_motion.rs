//! Lost motion: how far the output lags behind the motor, more in one direction than in the other.
//!
//! Rows of motion follow `output = a + b angle -+ h`, the sign being that of the motion: least squares with one slope for both
//! directions (analysis of covariance) in five sums a direction. The lost motion is `2 h`: backlash, and what the elastic parts
//! deflect under a friction that changes its sign.
//!
//! A row weighs as the square of the angle travelled since the motion last turned back: rows within the backlash,
//! which contain part of it, hardly count (a backlash `p` in strokes `d` reads low by less than `(p/d)^2` of itself), and no backlash
//! need be known before.

use super::friction::LEAST_ROWS;
use super::rows::{Columns, Role};

pub const RECORDS: [(&str, &str, &str); 2] = [
    (
        "lost_motion",
        "{output_position}",
        "distance between the lines of output position over motor angle in backward and in forward motion, fitted with one slope, each row by the square of the motor angle travelled since the motion turned back; positive where the output lags (backlash, and friction over stiffness)",
    ),
    ("transmission_slope", "{output_position}/rad", "that slope: travel of the output per radian of the motor"),
];

/// Sums of one direction, about the first row's angle and position.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    rows: f64,
    w: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl Sums {
    fn spread(&self) -> f64 {
        self.xx - self.x * self.x / self.w
    }
    fn common(&self) -> f64 {
        self.xy - self.x * self.y / self.w
    }
}

#[derive(Clone, Debug)]
pub struct LostMotion {
    moving: f64,
    start: Option<(f64, f64)>,
    /// Direction of the stroke and angle at which it began.
    stroke: Option<(usize, f64)>,
    directions: [Sums; 2],
}

impl LostMotion {
    pub fn new(moving: f64) -> Self {
        Self { moving, start: None, stroke: None, directions: [Sums::default(); 2] }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        let (angle, output) = (rows.get(Role::MotorPosition), rows.get(Role::OutputPosition));
        let speed = rows.get(Role::MotorSpeed);
        for i in 0..angle.len() {
            let (a, o) = *self.start.get_or_insert((angle[i], output[i]));
            if speed[i].abs() > self.moving {
                let (x, y) = (angle[i] - a, output[i] - o);
                let direction = usize::from(speed[i] < 0.0);
                let begun = match self.stroke {
                    Some((same, begun)) if same == direction => begun,
                    _ => x,
                };
                self.stroke = Some((direction, begun));
                let w = (x - begun) * (x - begun);
                let sums = &mut self.directions[direction];
                sums.rows += 1.0;
                sums.w += w;
                sums.x += w * x;
                sums.y += w * y;
                sums.xx += w * x * x;
                sums.xy += w * x * y;
            }
        }
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        let [forward, backward] = &self.directions;
        if forward.rows < LEAST_ROWS || backward.rows < LEAST_ROWS {
            out.extend([f64::NAN; 2]);
            return;
        }
        let spread = forward.spread() + backward.spread();
        // Angles that do not move give no slope; rounding of their squares may.
        let slope = if spread > 1e-9 * (forward.xx + backward.xx) { (forward.common() + backward.common()) / spread } else { f64::NAN };
        let line = |s: &Sums| (s.y - slope * s.x) / s.w;
        out.extend([slope.signum() * (line(backward) - line(forward)), slope]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_backlash_of_a_ratio_is_recovered() {
        for (ratio, backlash) in [(124.0, 1.0e-4), (-124.0, 0.1)] {
            // The output rests while the motor crosses the backlash.
            let half = 0.5 * backlash * f64::abs(ratio);
            let angle: Vec<f64> = (0..2000).map(|i| 900.0 + 40.0 * libm::sin(0.01 * f64::from(i))).collect();
            let speed: Vec<f64> = (0..2000).map(|i| 50.0 * libm::cos(0.01 * f64::from(i))).collect();
            let mut rests = angle[0];
            let follow = |a: &f64| {
                rests = rests.clamp(a - half, a + half);
                rests / ratio
            };
            let output: Vec<f64> = angle.iter().map(follow).collect();
            let mut rows = Columns::default();
            rows.set(Role::OutputPosition, &output);
            rows.set(Role::MotorPosition, &angle);
            rows.set(Role::MotorSpeed, &speed);
            let (mut lost, mut out) = (LostMotion::new(1.0), Vec::new());
            lost.push(&rows);
            lost.finish(&mut out);
            let seen_low = (backlash * f64::abs(ratio) / 80.0_f64).powi(2);
            assert!((out[0] - backlash).abs() < backlash * (1e-6 + seen_low), "{} {backlash}", out[0]);
            assert!((out[1] * ratio - 1.0).abs() < 1e-6 + seen_low);
        }
    }
}
