//! One run: `f64`.

use super::{Kernel, Scalar, ROUNDER};

impl Scalar for f64 {
    type Mask = bool;
    type Quarters = u64;
    const LANES: usize = 1;
    const FORMS: bool = cfg!(not(feature = "physics"));

    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn from_fn(mut f: impl FnMut(usize) -> f64) -> Self {
        f(0)
    }
    #[inline(always)]
    fn lane(self, _i: usize) -> f64 {
        self
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }
    #[inline(always)]
    fn equals(self, other: Self) -> bool {
        self == other
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
    fn any(mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn mask(value: bool) -> bool {
        value
    }
    #[inline(always)]
    fn fma(self, factor: Self, addend: Self) -> Self {
        f64::mul_add(self, factor, addend)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn round(self) -> Self {
        f64::round_ties_even(self)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        f64::floor(self)
    }
    fn exp(self) -> Self {
        libm::exp(self)
    }
    fn powf(self, exponent: f64) -> Self {
        libm::pow(self, exponent)
    }
    #[inline(always)]
    fn quarters(self) -> (Self, u64) {
        let shifted = self + ROUNDER;
        (shifted - ROUNDER, shifted.to_bits())
    }
    #[inline(always)]
    fn power_of_two(whole: u64) -> Self {
        f64::from_bits(whole.wrapping_add(1023) << 52)
    }
    #[inline(always)]
    fn turn(sin: Self, cos: Self, quarters: u64) -> (Self, Self) {
        let (s, c) = if quarters & 1 != 0 { (cos, sin) } else { (sin, cos) };
        let sin_sign = (quarters & 2) << 62;
        let cos_sign = (quarters.wrapping_add(1) & 2) << 62;
        (f64::from_bits(s.to_bits() ^ sin_sign), f64::from_bits(c.to_bits() ^ cos_sign))
    }
    /// Compiled once, with fused multiply-adds: `solver::width` runs nothing in `f64` where the processor has none.
    #[inline(always)]
    fn vectorize<K: Kernel>(kernel: K) -> K::Output {
        assert!(super::fused(), "single runs need a processor with AVX2 and FMA in this build");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the features were just detected.
        return unsafe { super::x86::with_avx2(kernel) };
        #[cfg(not(target_arch = "x86_64"))]
        super::plainly(kernel)
    }
}
