//! Severity over time: the factor on a fault's severity.

use crate::command::Term;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub enum Profile {
    Constant,
    Step {
        time: f64,
    },
    Ramp {
        start: f64,
        end: f64,
    },
    /// Grows as exp(t / tau) from nothing at `start` to the whole severity at `end`.
    Exponential {
        start: f64,
        end: f64,
        time_constant: f64,
    },
    Intermittent {
        start: f64,
        period: f64,
        duty: f64,
    },
    Table {
        times: Arc<[f64]>,
        values: Arc<[f64]>,
    },
}

/// A kind of profile and its parameters (name, unit, default, text).
#[derive(Clone, Copy, Debug)]
pub struct ProfileRecord {
    pub kind: &'static str,
    pub text: &'static str,
    pub parameters: &'static [(&'static str, &'static str, Option<f64>, &'static str)],
}

/// Every profile.
pub fn profiles() -> &'static [ProfileRecord] {
    &[
        ProfileRecord { kind: "constant", text: "the severity, always", parameters: &[] },
        ProfileRecord {
            kind: "step",
            text: "nothing, then the severity from a time on",
            parameters: &[("time", "s", None, "time of the step")],
        },
        ProfileRecord {
            kind: "ramp",
            text: "grows linearly from nothing to the severity",
            parameters: &[("start", "s", Some(0.0), "begin of the growth"), ("end", "s", None, "end of the growth")],
        },
        ProfileRecord {
            kind: "exponential",
            text: "grows exponentially from nothing to the severity",
            parameters: &[
                ("start", "s", Some(0.0), "begin of the growth"),
                ("end", "s", None, "time at which the severity is reached"),
                ("time_constant", "s", None, "time in which the growth rate becomes e-fold"),
            ],
        },
        ProfileRecord {
            kind: "intermittent",
            text: "the severity during the duty part of each period",
            parameters: &[
                ("start", "s", Some(0.0), "begin of the first period"),
                ("period", "s", None, "period"),
                ("duty", "1", Some(0.5), "part of the period with the fault present"),
            ],
        },
        ProfileRecord {
            kind: "table",
            text: "fractions of the severity at times, linear between; needs times and values",
            parameters: &[],
        },
    ]
}

impl Profile {
    /// From the kind's name and its parameters in the order of the record.
    pub fn new(kind: &str, p: &[f64], times: Arc<[f64]>, values: Arc<[f64]>) -> Option<Self> {
        Some(match (kind, p) {
            ("constant", []) => Self::Constant,
            ("step", &[time]) => Self::Step { time },
            ("ramp", &[start, end]) => Self::Ramp { start, end },
            ("exponential", &[start, end, time_constant]) => Self::Exponential { start, end, time_constant },
            ("intermittent", &[start, period, duty]) => Self::Intermittent { start, period, duty },
            ("table", []) if times.len() == values.len() && !times.is_empty() => Self::Table { times, values },
            _ => return None,
        })
    }

    /// Factor at time `t` and the time of the next change (`t` itself or earlier: changes all the time).
    pub fn factor(&self, t: f64) -> (f64, f64) {
        let never = f64::INFINITY;
        match self {
            Self::Constant => (1.0, never),
            &Self::Step { time } if t < time => (0.0, time),
            Self::Step { .. } => (1.0, never),
            &Self::Ramp { start, .. } | &Self::Exponential { start, .. } if t < start => (0.0, start),
            &Self::Ramp { end, .. } | &Self::Exponential { end, .. } if t >= end => (1.0, never),
            &Self::Ramp { start, end } => ((t - start) / (end - start), t),
            &Self::Exponential { start, end, time_constant } => (grown(t - start, end - start, time_constant), t),
            &Self::Intermittent { start, .. } if t < start => (0.0, start),
            &Self::Intermittent { start, period, duty } => {
                let origin = start + ((t - start) / period).floor() * period;
                let off = origin + duty * period;
                if t < off {
                    (1.0, off)
                } else {
                    (0.0, origin + period)
                }
            }
            Self::Table { times, values } => {
                let term = Term {
                    wave: crate::command::Wave::Table,
                    enabled: true,
                    parameters: vec![0.0, 0.0, 1.0, 0.0],
                    times: times.clone(),
                    values: values.clone(),
                };
                let line = term.line(t);
                (line.value + line.slope * (t - line.at), if line.slope == 0.0 { line.until } else { t })
            }
        }
    }
}

/// (exp(t/tau) - 1) / (exp(length/tau) - 1), written with falling exponentials: finite whatever the time constant.
fn grown(t: f64, length: f64, time_constant: f64) -> f64 {
    let whole = -libm::expm1(-length / time_constant);
    if whole < f64::MIN_POSITIVE {
        return t / length;
    }
    libm::exp((t - length) / time_constant) * (-libm::expm1(-t / time_constant) / whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exponential(time_constant: f64, t: f64) -> f64 {
        Profile::Exponential { start: 1.0, end: 3.0, time_constant }.factor(t).0
    }

    #[test]
    fn exponential_growth_is_the_printed_one() {
        for t in [1.0, 1.2, 2.0, 2.999] {
            let printed = libm::expm1((t - 1.0) / 0.4) / libm::expm1(2.0 / 0.4);
            assert!((exponential(0.4, t) - printed).abs() <= 4.0 * f64::EPSILON * printed.abs());
        }
    }

    #[test]
    fn exponential_growth_stays_a_fraction_at_any_time_constant() {
        for time_constant in [f64::MIN_POSITIVE, 1e-300, 2.0 / 709.9, 1.0, 1e17, 1e300, f64::MAX] {
            for t in [1.0, 1.0 + 1e-9, 2.0, 3.0 - 1e-9] {
                let factor = exponential(time_constant, t);
                assert!((0.0..=1.0).contains(&factor), "{time_constant} at {t}: {factor}");
            }
        }
        assert_eq!(exponential(1e300, 2.0), 0.5);
        assert_eq!(exponential(1e-300, 2.0), 0.0);
    }
}
