//! Temperature, and what the bridge does.

use super::moving::hop;
use super::rows::{Columns, Role};

pub const TEMPERATURE: [(&str, &str, &str); 2] =
    [("temperature_max", "{temperature}", "highest temperature"), ("temperature_rise", "{temperature}", "last temperature less the first")];

pub const SWITCHING: [(&str, &str, &str); 3] = [
    ("switching_rate", "1/s", "leg transitions per second"),
    ("switching_rate_max", "1/s", "largest rate of leg transitions over an eighth of 0.1 s"),
    ("switching_rate_min", "1/s", "least rate of leg transitions over an eighth of 0.1 s"),
];

#[derive(Clone, Debug)]
pub struct Temperature {
    first: f64,
    last: f64,
    most: f64,
}

impl Temperature {
    pub fn new() -> Self {
        Self { first: f64::NAN, last: f64::NAN, most: f64::NAN }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        for &x in rows.get(Role::Temperature) {
            self.first = if self.first.is_nan() { x } else { self.first };
            self.last = x;
            self.most = self.most.max(x);
        }
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        out.extend([self.most, self.last - self.first]);
    }
}

#[derive(Clone, Debug)]
pub struct Switching {
    rate: f64,
    hop: usize,
    rows: usize,
    first: f64,
    last: f64,
    mark: f64,
    most: f64,
    least: f64,
}

impl Switching {
    pub fn new(rate: f64) -> Self {
        let nan = f64::NAN;
        Self { rate, hop: hop(rate), rows: 0, first: nan, last: nan, mark: nan, most: nan, least: nan }
    }

    #[inline(always)]
    pub fn push(&mut self, rows: &Columns<'_>) {
        for &count in rows.get(Role::Transitions) {
            if self.rows == 0 {
                (self.first, self.mark) = (count, count);
            } else if self.rows.is_multiple_of(self.hop) {
                let rate = (count - self.mark) * self.rate / self.hop as f64;
                self.most = self.most.max(rate);
                self.least = self.least.min(rate);
                self.mark = count;
            }
            self.rows += 1;
            self.last = count;
        }
    }

    pub fn finish(&self, out: &mut Vec<f64>) {
        let intervals = self.rows.saturating_sub(1) as f64;
        out.extend([(self.last - self.first) * self.rate / intervals, self.most, self.least]);
    }
}
