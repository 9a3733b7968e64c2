//! Stribeck's fall of the friction from its static to its dynamic value (Bo and Pavelescu 1982; Armstrong-Helouvry 1994).

use crate::scalar::Scalar;

#[derive(Clone, Copy, Debug)]
pub(super) struct Stribeck<S> {
    pub per_speed: S,
    pub exponent: S,
}

impl<S: Scalar> Stribeck<S> {
    /// exp(-(|w| / v_s)^delta): what is left at `speed` of the excess of the static over the dynamic friction. The usual
    /// exponents, 1 and 2, need no logarithm.
    #[inline(always)]
    pub fn share(&self, speed: S) -> S {
        let ratio = speed.abs() * self.per_speed;
        let (one, two) = (self.exponent.equals(S::one()), self.exponent.equals(S::splat(2.0)));
        let usual = S::select(one, ratio, ratio * ratio);
        if S::FORMS && !S::any(!(one | two)) {
            return usual.decay();
        }
        let power = (self.exponent * ratio.maximum(S::splat(f64::MIN_POSITIVE)).ln()).exp();
        S::anchor(one | two, usual, power).decay()
    }
}
