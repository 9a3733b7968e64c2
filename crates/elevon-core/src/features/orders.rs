//! Ripple that is locked to the motor's angle: order tracking without a spectrum.
//!
//! Each row weighs as much as the angle travelled since the last one, so that the sums with `cos k theta` and `sin k theta`
//! are Fourier integrals over angle, whatever the speed. The mean of each direction of motion is removed first: a friction
//! that changes its sign with the motion is no ripple.

use super::rows::{Columns, Role, Signal};
use crate::scalar::Scalar;
use std::f64::consts::{PI, TAU};

/// Orders per turn of the shaft, then per electrical turn.
const SHAFT: [f64; 2] = [1.0, 2.0];
const ELECTRICAL: [f64; 3] = [1.0, 2.0, 6.0];
const COUNT: usize = SHAFT.len() + ELECTRICAL.len();

pub const SUFFIXES: [(&str, &str); COUNT] = [
    ("ripple_shaft_1", "once per turn of the shaft"),
    ("ripple_shaft_2", "twice per turn of the shaft"),
    ("ripple_electrical_1", "once per electrical turn"),
    ("ripple_electrical_2", "twice per electrical turn"),
    ("ripple_electrical_6", "six times per electrical turn"),
];

pub const TEXT: &str = "amplitude of the part of {} that repeats {}, over the angle travelled, the mean of each direction removed; \
                        rows between which the order turns more than half a period are left out; needs two periods";

/// Weighted sums of one order in one direction.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    w: f64,
    wx: f64,
    wc: f64,
    ws: f64,
    wxc: f64,
    wxs: f64,
}

impl Sums {
    #[inline(always)]
    fn push(&mut self, w: f64, x: f64, (s, c): (f64, f64)) {
        let (wc, ws) = (w * c, w * s);
        self.w += w;
        self.wx += w * x;
        self.wc += wc;
        self.ws += ws;
        self.wxc += x * wc;
        self.wxs += x * ws;
    }

    /// Sums with cosine and sine, less those of the mean.
    fn locked(&self) -> (f64, f64) {
        let mean = if self.w > 0.0 { self.wx / self.w } else { 0.0 };
        (self.wxc - mean * self.wc, self.wxs - mean * self.ws)
    }
}

#[derive(Clone, Debug)]
pub struct Orders {
    signal: Signal,
    pole_pairs: f64,
    /// By order and direction.
    sums: [[Sums; 2]; COUNT],
    last: Option<f64>,
}

/// Sine and cosine of twice an angle.
#[inline(always)]
fn doubled((s, c): (f64, f64)) -> (f64, f64) {
    (2.0 * s * c, c * c - s * s)
}

/// Sine and cosine of a sum of angles.
#[inline(always)]
fn added((s, c): (f64, f64), (t, d): (f64, f64)) -> (f64, f64) {
    (s * d + c * t, c * d - s * t)
}

impl Orders {
    pub fn new(signal: Signal, pole_pairs: f64) -> Self {
        Self { signal, pole_pairs, sums: Default::default(), last: None }
    }

    fn order(&self, i: usize) -> f64 {
        if i < SHAFT.len() {
            SHAFT[i]
        } else {
            self.pole_pairs * ELECTRICAL[i - SHAFT.len()]
        }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        let (values, angle) = (self.signal.of(rows), rows.get(Role::MotorPosition));
        let orders: [f64; COUNT] = std::array::from_fn(|i| self.order(i));
        for i in 0..angle.len() {
            let travelled = angle[i] - self.last.replace(angle[i]).unwrap_or(angle[i]);
            let (direction, w, x) = (usize::from(travelled < 0.0), travelled.abs(), values.at(i));
            let shaft = Scalar::sin_cos(angle[i]);
            let electrical = Scalar::sin_cos(self.pole_pairs * angle[i]);
            let second = doubled(electrical);
            let sixth = added(doubled(second), second);
            let turned = [shaft, doubled(shaft), electrical, second, sixth];
            for k in 0..COUNT {
                // Beyond half a period from row to row an order looks like another.
                let seen = if w * orders[k] <= PI { w } else { 0.0 };
                self.sums[k][direction].push(seen, x, turned[k]);
            }
        }
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        out.extend(self.sums.iter().enumerate().map(|(i, directions)| {
            let (forward, backward) = (directions[0].locked(), directions[1].locked());
            let (c, s) = (forward.0 + backward.0, forward.1 + backward.1);
            let travel = directions[0].w + directions[1].w;
            if self.order(i) * travel >= 2.0 * TAU {
                2.0 * (c * c + s * s).sqrt() / travel
            } else {
                f64::NAN
            }
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(angle: &[f64], current: &[f64]) -> Vec<f64> {
        let mut rows = Columns::default();
        rows.set(Role::TorqueCurrent, current);
        rows.set(Role::MotorPosition, angle);
        let (mut orders, mut out) = (Orders::new(Signal::TorqueCurrent, 4.0), Vec::new());
        orders.push(&rows.part(0, 777));
        orders.push(&rows.part(777, angle.len()));
        orders.finish(&mut out);
        out
    }

    #[test]
    fn amplitudes_are_recovered_in_a_motion_that_turns_back() {
        let angle: Vec<f64> = (0..40_000).map(|i| 60.0 * libm::sin(TAU * f64::from(i) / 20_000.0)).collect();
        let current: Vec<f64> = angle
            .iter()
            .enumerate()
            .map(|(i, a)| {
                let friction = if (i + 5000) % 20_000 < 10_000 { 3.0 } else { -3.0 };
                friction + 0.5 * libm::cos(a + 0.3) + 0.2 * libm::sin(8.0 * a) + 0.1 * libm::cos(24.0 * a)
            })
            .collect();
        let out = of(&angle, &current);
        for (seen, known) in out.iter().zip([0.5, 0.0, 0.0, 0.2, 0.1]) {
            assert!((seen - known).abs() < 0.01, "{out:?}");
        }
    }

    #[test]
    fn an_order_faster_than_the_rows_is_not_a_number() {
        let angle: Vec<f64> = (0..1000).map(|i| 0.4 * f64::from(i)).collect();
        let out = of(&angle, &angle);
        assert!(out[4].is_nan() && out[3].is_nan() && out[2].is_finite());
    }
}
