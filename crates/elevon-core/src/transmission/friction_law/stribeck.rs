//! Stribeck's fall of the friction from its static to its dynamic value (Bo and Pavelescu 1982; Armstrong-Helouvry 1994).

use crate::scalar::Scalar;

/// Exponent of e beyond which exp(-e^x) is zero in double precision.
const GONE: f64 = 6.7;

#[derive(Clone, Copy, Debug)]
pub(super) struct Stribeck<S> {
    pub per_speed: S,
    pub exponent: S,
}

impl<S: Scalar> Stribeck<S> {
    /// exp(-(|w| / v_s)^delta): what is left at `speed` of the excess of the static over the dynamic friction.
    #[inline(always)]
    pub fn share(&self, speed: S) -> S {
        let ratio = (speed.abs() * self.per_speed).maximum(S::splat(f64::MIN_POSITIVE));
        let power = (self.exponent * ratio.ln()).minimum(S::splat(GONE)).exp();
        (-power).exp()
    }
}
