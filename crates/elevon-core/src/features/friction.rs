//! The loop that friction opens between torque current and motor angle.

use super::rows::{Columns, Role};

/// Rows that a direction must have for its mean to count.
pub const LEAST_ROWS: f64 = 8.0;

pub const RECORDS: [(&str, &str, &str); 3] = [
    (
        "friction_current",
        "{torque_current}",
        "half the difference of the mean torque currents of forward and backward motion (motor faster than the speed that counts as motion; at least 8 rows in each direction)",
    ),
    ("load_current", "{torque_current}", "mean of the mean torque currents of forward and backward motion"),
    (
        "friction_loop_area",
        "{torque_current} rad",
        "area that torque current encloses over motor angle: integral of current less load_current over the angle (trapezoids)",
    ),
];

#[derive(Clone, Debug)]
pub struct Friction {
    moving: f64,
    /// By direction, forward first.
    count: [f64; 2],
    sum: [f64; 2],
    area: f64,
    first: f64,
    last: Option<(f64, f64)>,
}

impl Friction {
    pub fn new(moving: f64) -> Self {
        Self { moving, count: [0.0; 2], sum: [0.0; 2], area: 0.0, first: 0.0, last: None }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        let (current, angle) = (rows.get(Role::TorqueCurrent), rows.get(Role::MotorPosition));
        let speed = rows.get(Role::MotorSpeed);
        for i in 0..current.len() {
            if speed[i].abs() > self.moving {
                let direction = usize::from(speed[i] < 0.0);
                self.count[direction] += 1.0;
                self.sum[direction] += current[i];
            }
            match self.last {
                Some((c, a)) => self.area += 0.5 * (c + current[i]) * (angle[i] - a),
                None => self.first = angle[i],
            }
            self.last = Some((current[i], angle[i]));
        }
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        let mean =
            |direction: usize| if self.count[direction] >= LEAST_ROWS { self.sum[direction] / self.count[direction] } else { f64::NAN };
        let (forward, backward) = (mean(0), mean(1));
        let load = 0.5 * (forward + backward);
        let travel = self.last.map_or(f64::NAN, |(_, angle)| angle - self.first);
        out.extend([0.5 * (forward - backward), load, self.area - load * travel]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Friction of 2 A and a load of 0.5 A over one sine of 3 rad: an area of 2 A times four times the amplitude.
    #[test]
    fn a_known_loop() {
        let n = 4000;
        let phase = |i: i32| std::f64::consts::TAU * f64::from(i) / f64::from(n);
        let angle: Vec<f64> = (0..=n).map(|i| 3.0 * libm::sin(phase(i))).collect();
        let speed: Vec<f64> = (0..=n).map(|i| 30.0 * libm::cos(phase(i))).collect();
        let current: Vec<f64> = speed.iter().map(|v| 0.5 + 2.0 * v.signum()).collect();
        let mut rows = Columns::default();
        rows.set(Role::TorqueCurrent, &current);
        rows.set(Role::MotorPosition, &angle);
        rows.set(Role::MotorSpeed, &speed);
        let (mut friction, mut out) = (Friction::new(1.0), Vec::new());
        friction.push(&rows.part(0, 1234));
        friction.push(&rows.part(1234, 4001));
        friction.finish(&mut out);
        assert!((out[0] - 2.0).abs() < 1e-12 && (out[1] - 0.5).abs() < 1e-12);
        assert!((out[2] - 24.0).abs() < 0.01);
    }
}
