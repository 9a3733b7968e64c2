//! Dual numbers: exact derivatives of a run with respect to as many parameters at once as a scalar type has lanes.
//!
//! Selections follow the real part, so a derivative is that of the branch taken: at a stick-slip
//! switch the true function has a kink and the derivative is one-sided.

use super::{trig, Kernel, Scalar};
use std::ops::{Add, Div, Mul, Neg, Sub};

#[derive(Clone, Copy, Debug)]
pub struct Dual<V> {
    pub value: f64,
    pub slope: V,
}

impl<V: Scalar> Dual<V> {
    /// The independent variable number `index`.
    pub fn variable(value: f64, index: usize) -> Self {
        Self { value, slope: V::from_fn(|i| if i == index { 1.0 } else { 0.0 }) }
    }
    #[inline(always)]
    fn chain(self, value: f64, derivative: f64) -> Self {
        Self { value, slope: self.slope * V::splat(derivative) }
    }
}

impl<V: Scalar> Add for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { value: self.value + o.value, slope: self.slope + o.slope }
    }
}
impl<V: Scalar> Sub for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self { value: self.value - o.value, slope: self.slope - o.slope }
    }
}
// The product and quotient rules mix the operators.
#[allow(clippy::suspicious_arithmetic_impl)]
impl<V: Scalar> Mul for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        let slope = self.slope * V::splat(o.value) + V::splat(self.value) * o.slope;
        Self { value: self.value * o.value, slope }
    }
}
#[allow(clippy::suspicious_arithmetic_impl)]
impl<V: Scalar> Div for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        Self { value, slope: (self.slope - V::splat(value) * o.slope) / V::splat(o.value) }
    }
}
impl<V: Scalar> Neg for Dual<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

impl<V: Scalar> Scalar for Dual<V> {
    type Mask = bool;
    type Quarters = u64;
    const LANES: usize = 1;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self { value, slope: V::zero() }
    }
    #[inline(always)]
    fn from_fn(mut f: impl FnMut(usize) -> f64) -> Self {
        Self::splat(f(0))
    }
    #[inline(always)]
    fn lane(self, _i: usize) -> f64 {
        self.value
    }
    #[inline(always)]
    fn lt(self, o: Self) -> bool {
        self.value < o.value
    }
    #[inline(always)]
    fn le(self, o: Self) -> bool {
        self.value <= o.value
    }
    #[inline(always)]
    fn equals(self, o: Self) -> bool {
        self.value == o.value
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask {
            yes
        } else {
            no
        }
    }
    #[inline(always)]
    fn anchor(neutral: bool, plain: Self, detailed: Self) -> Self {
        Self { value: if neutral { plain.value } else { detailed.value }, slope: detailed.slope }
    }
    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn mask(value: bool) -> bool {
        value
    }
    #[inline(always)]
    fn fma(self, factor: Self, addend: Self) -> Self {
        let product = self * factor + addend;
        Self { value: f64::mul_add(self.value, factor.value, addend.value), slope: product.slope }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        if self.value < 0.0 {
            -self
        } else {
            self
        }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        // The slope at zero is infinite; a model never differentiates there, zero keeps it finite.
        self.chain(root, if root == 0.0 { 0.0 } else { 0.5 / root })
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self::splat(self.value.round_ties_even())
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self::splat(self.value.floor())
    }
    fn exp(self) -> Self {
        let value = libm::exp(self.value);
        self.chain(value, value)
    }
    fn ln(self) -> Self {
        self.chain(libm::log(self.value), 1.0 / self.value)
    }
    fn powf(self, exponent: f64) -> Self {
        let value = libm::pow(self.value, exponent);
        self.chain(value, exponent * libm::pow(self.value, exponent - 1.0))
    }
    #[inline(always)]
    fn quarters(self) -> (Self, u64) {
        let (nearest, quarters) = self.value.quarters();
        (Self::splat(nearest), quarters)
    }
    #[inline(always)]
    fn power_of_two(whole: u64) -> Self {
        Self::splat(f64::power_of_two(whole))
    }
    #[inline(always)]
    fn decay(self) -> Self {
        let value = trig::decay(self.value);
        self.chain(value, -value)
    }
    #[inline(always)]
    fn turn(sin: Self, cos: Self, quarters: u64) -> (Self, Self) {
        let (s, c) = if quarters & 1 != 0 { (cos, sin) } else { (sin, cos) };
        let s = if quarters & 2 != 0 { -s } else { s };
        (s, if quarters.wrapping_add(1) & 2 != 0 { -c } else { c })
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = trig::sin_cos(self.value);
        (self.chain(s, c), self.chain(c, -s))
    }
    #[inline(always)]
    fn vectorize<K: Kernel>(kernel: K) -> K::Output {
        V::vectorize(kernel)
    }
    fn finite(self) -> bool {
        self.value.is_finite() && self.slope.finite()
    }
}
