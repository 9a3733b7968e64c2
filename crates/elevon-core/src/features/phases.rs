//! The three phase currents against each other.

use super::rows::{Columns, Role};
use crate::scalar::Scalar;

pub const RECORDS: [(&str, &str, &str); 5] = [
    (
        "phase_current_positive",
        "{current_a}",
        "amplitude of the phase currents' system that turns with the rotor (mean of alpha + j beta times exp(-j p theta) over the angle travelled in each direction; the directions' magnitudes by their travel)",
    ),
    (
        "phase_current_negative",
        "{current_a}",
        "the same of the system that turns against the rotor: an unequal phase",
    ),
    ("phase_current_unbalance", "1", "difference of the largest and least RMS of the three phase currents over their mean"),
    ("phase_current_offset", "{current_a}", "largest magnitude of the mean of a phase current"),
    ("phase_current_residual", "{current_a}", "RMS of the sum of the three phase currents: a current to ground, or a sensor's offset or gain"),
];

/// Weighted sums of the two systems in one direction.
#[derive(Clone, Copy, Debug, Default)]
struct Systems {
    w: f64,
    positive: [f64; 2],
    negative: [f64; 2],
}

#[derive(Clone, Debug)]
pub struct Phases {
    pole_pairs: f64,
    count: f64,
    sum: [f64; 3],
    square: [f64; 3],
    residual: f64,
    directions: [Systems; 2],
    last: Option<f64>,
}

impl Phases {
    pub fn new(pole_pairs: f64) -> Self {
        let directions = [Systems::default(); 2];
        Self { pole_pairs, count: 0.0, sum: [0.0; 3], square: [0.0; 3], residual: 0.0, directions, last: None }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        let phases = [rows.get(Role::CurrentA), rows.get(Role::CurrentB), rows.get(Role::CurrentC)];
        let angle = rows.get(Role::MotorPosition);
        for i in 0..angle.len() {
            let abc = [phases[0][i], phases[1][i], phases[2][i]];
            self.count += 1.0;
            for (phase, x) in abc.into_iter().enumerate() {
                self.sum[phase] += x;
                self.square[phase] += x * x;
            }
            let all = abc[0] + abc[1] + abc[2];
            self.residual += all * all;
            let travelled = angle[i] - self.last.replace(angle[i]).unwrap_or(angle[i]);
            self.turn(travelled, angle[i], abc);
        }
    }

    #[inline(always)]
    fn turn(&mut self, travelled: f64, angle: f64, [a, b, c]: [f64; 3]) {
        const ROOT: f64 = 0.577_350_269_189_625_8;
        let (alpha, beta) = ((2.0 * a - b - c) / 3.0, (b - c) * ROOT);
        let (sin, cos) = Scalar::sin_cos(self.pole_pairs * angle);
        let (direction, w) = (&mut self.directions[usize::from(travelled < 0.0)], travelled.abs());
        direction.w += w;
        direction.positive[0] += w * (alpha * cos + beta * sin);
        direction.positive[1] += w * (beta * cos - alpha * sin);
        direction.negative[0] += w * (alpha * cos - beta * sin);
        direction.negative[1] += w * (beta * cos + alpha * sin);
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        let travel = self.directions[0].w + self.directions[1].w;
        let length = |[x, y]: [f64; 2]| (x * x + y * y).sqrt();
        let turned = self.pole_pairs * travel >= std::f64::consts::TAU;
        let over = |sum: f64| if turned { sum / travel } else { f64::NAN };
        out.push(over(self.directions.iter().map(|direction| length(direction.positive)).sum()));
        out.push(over(self.directions.iter().map(|direction| length(direction.negative)).sum()));
        let rms = self.square.map(|x| (x / self.count).sqrt());
        let (largest, least) = (rms[0].max(rms[1]).max(rms[2]), rms[0].min(rms[1]).min(rms[2]));
        out.push((largest - least) * 3.0 / (rms[0] + rms[1] + rms[2]));
        out.push(self.sum.iter().fold(f64::NAN, |most, x| most.max((x / self.count).abs())));
        out.push((self.residual / self.count).sqrt());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_two_systems_are_parted() {
        let angle: Vec<f64> = (0..20_000).map(|i| 20.0 * TAU * libm::sin(TAU * f64::from(i) / 20_000.0)).collect();
        let phase = |j: f64| -> Vec<f64> {
            let current = |(i, a): (usize, &f64)| {
                let turn = 4.0 * a - j * TAU / 3.0;
                let back = -4.0 * a - j * TAU / 3.0;
                // The torque changes its sign with the motion, and so does the positive system.
                let direction = if (i + 5000) % 20_000 < 10_000 { 1.0 } else { -1.0 };
                5.0 * direction * libm::cos(turn + 0.2) + 0.3 * direction * libm::cos(back) + 0.1
            };
            angle.iter().enumerate().map(current).collect()
        };
        let (a, b, c) = (phase(0.0), phase(1.0), phase(2.0));
        let mut rows = Columns::default();
        rows.set(Role::CurrentA, &a);
        rows.set(Role::CurrentB, &b);
        rows.set(Role::CurrentC, &c);
        rows.set(Role::MotorPosition, &angle);
        let (mut phases, mut out) = (Phases::new(4.0), Vec::new());
        phases.push(&rows);
        phases.finish(&mut out);
        assert!((out[0] - 5.0).abs() < 0.01 && (out[1] - 0.3).abs() < 0.01, "{out:?}");
        assert!((out[4] - 0.3).abs() < 1e-9);
    }
}
