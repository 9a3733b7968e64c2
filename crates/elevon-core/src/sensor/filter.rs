//! First-order low-pass, discretised exactly for inputs held over a step.

use crate::scalar::Scalar;

/// 1 - exp(-2 pi f dt): the share of the gap that one step closes.
pub fn closing<S: Scalar>(cutoff_hz: S, dt: f64) -> S {
    S::one() - (-(cutoff_hz * S::splat(std::f64::consts::TAU * dt))).exp()
}

#[inline(always)]
pub fn low_pass<S: Scalar>(closing: S, filtered: S, input: S) -> S {
    closing.fma(input - filtered, filtered)
}
