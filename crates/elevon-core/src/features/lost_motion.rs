//! Lost motion: how far the output lags behind the motor, more in one direction than in the other.
//!
//! Rows of motion follow `output = a + b angle -+ h`, the sign being that of the motion: least squares with one slope for both
//! directions (analysis of covariance) in five sums a direction. The lost motion is `2 h`: play, and what the elastic parts
//! give way to a friction that changes its sign.

use super::friction::LEAST_ROWS;
use super::rows::{Columns, Role};

pub const RECORDS: [(&str, &str, &str); 2] = [
    (
        "lost_motion",
        "{output_position}",
        "distance between the lines of output position over motor angle in backward and in forward motion, fitted with one slope; positive where the output lags (play, and friction over stiffness)",
    ),
    ("transmission_slope", "{output_position}/rad", "that slope: travel of the output per radian of the motor"),
];

/// Sums of one direction, about the first row's angle and position.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl Sums {
    fn spread(&self) -> f64 {
        self.xx - self.x * self.x / self.n
    }
    fn common(&self) -> f64 {
        self.xy - self.x * self.y / self.n
    }
}

#[derive(Clone, Debug)]
pub struct LostMotion {
    moving: f64,
    start: Option<(f64, f64)>,
    ways: [Sums; 2],
}

impl LostMotion {
    pub fn new(moving: f64) -> Self {
        Self { moving, start: None, ways: [Sums::default(); 2] }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        let (angle, output) = (rows.get(Role::MotorPosition), rows.get(Role::OutputPosition));
        let speed = rows.get(Role::MotorSpeed);
        for i in 0..angle.len() {
            let (a, o) = *self.start.get_or_insert((angle[i], output[i]));
            if speed[i].abs() > self.moving {
                let (x, y) = (angle[i] - a, output[i] - o);
                let sums = &mut self.ways[usize::from(speed[i] < 0.0)];
                sums.n += 1.0;
                sums.x += x;
                sums.y += y;
                sums.xx += x * x;
                sums.xy += x * y;
            }
        }
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        let [forward, backward] = &self.ways;
        if forward.n < LEAST_ROWS || backward.n < LEAST_ROWS {
            out.extend([f64::NAN; 2]);
            return;
        }
        let spread = forward.spread() + backward.spread();
        // Angles that do not move give no slope; rounding of their squares may.
        let slope = if spread > 1e-9 * (forward.xx + backward.xx) { (forward.common() + backward.common()) / spread } else { f64::NAN };
        let line = |s: &Sums| (s.y - slope * s.x) / s.n;
        out.extend([slope.signum() * (line(backward) - line(forward)), slope]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_play_of_a_ratio_is_recovered() {
        let phase = |i: i32| 0.01 * f64::from(i);
        let angle: Vec<f64> = (0..2000).map(|i| 900.0 + 40.0 * libm::sin(phase(i))).collect();
        let speed: Vec<f64> = (0..2000).map(|i| 50.0 * libm::cos(phase(i))).collect();
        for ratio in [124.0, -124.0] {
            let play = 1.0e-4;
            let output: Vec<f64> =
                angle.iter().zip(&speed).map(|(a, v)| a / ratio - 0.5 * play * v.signum() * f64::signum(ratio)).collect();
            let mut rows = Columns::default();
            rows.set(Role::OutputPosition, &output);
            rows.set(Role::MotorPosition, &angle);
            rows.set(Role::MotorSpeed, &speed);
            let (mut lost, mut out) = (LostMotion::new(1.0), Vec::new());
            lost.push(&rows);
            lost.finish(&mut out);
            assert!((out[0] - play).abs() < 1e-9 * play.max(1e-3), "{}", out[0]);
            assert!((out[1] - 1.0 / ratio).abs() < 1e-12);
        }
    }
}
