//! The one scalar trait: components are written over it once and run as one
//! `f64`, as a vector of lanes (one run a lane) or as a dual number.
//!
//! Every operation of a lane type is the IEEE operation of its lanes, in the same order: that is
//! what makes batch and single runs equal to the last bit. A multiply-add is fused only where `fma` is written,
//! and then on every type and processor (without the instruction the library's exact one is called: slow, equal).

mod dual;
mod portable;
mod single;
mod trig;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use dual::Dual;
pub use portable::Portable;
pub(crate) use trig::reduced_sin_cos;
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2x4, Avx512x8};

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// A piece of work that a scalar type runs with its own instruction set enabled.
/// `run` must be `#[inline(always)]`, and so must everything hot below it.
pub trait Kernel {
    type Output;
    fn run(self) -> Self::Output;
}

/// Arithmetic, selection by mask and the few elementary functions that models need.
pub trait Scalar:
    Copy
    + Send
    + Sync
    + std::fmt::Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;
    /// Quarter turns as an integer, low bits valid.
    type Quarters: Copy;
    const LANES: usize;
    /// Has each kind of run a form of the step of its own, without what it does not need? Faster, and as many forms to
    /// compile; the form with every detail gives the same bits.
    const FORMS: bool = false;

    fn splat(x: f64) -> Self;
    fn from_fn(f: impl FnMut(usize) -> f64) -> Self;
    /// Value of lane `i` (the real part of a dual number).
    fn lane(self, i: usize) -> f64;
    /// The same, of a value in memory: read without the other lanes.
    #[inline(always)]
    fn lane_at(&self, i: usize) -> f64 {
        self.lane(i)
    }

    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    fn equals(self, other: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// `plain` where a detail is `neutral`, to the bit; slopes are those of `detailed` in any case.
    #[inline(always)]
    fn anchor(neutral: Self::Mask, plain: Self, detailed: Self) -> Self {
        Self::select(neutral, plain, detailed)
    }
    fn any(mask: Self::Mask) -> bool;
    fn mask(value: bool) -> Self::Mask;

    /// `self * factor + addend` with one rounding.
    fn fma(self, factor: Self, addend: Self) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    /// Nearest integer, ties to even.
    fn round(self) -> Self;
    fn floor(self) -> Self;
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self {
        Self::from_fn(|i| libm::log(self.lane(i)))
    }
    fn powf(self, exponent: f64) -> Self;
    /// Nearest integer (ties to even) as a number and as quarter turns; for magnitudes below 2^51.
    fn quarters(self) -> (Self, Self::Quarters);
    /// Two to the power of a whole number, as `quarters` gives it; above -1022.
    fn power_of_two(whole: Self::Quarters) -> Self;
    /// exp(-x) for x from zero on by our own polynomial: the same bits on every platform and lane width, zero beyond 700.
    #[inline(always)]
    fn decay(self) -> Self {
        trig::decay(self)
    }
    /// Sine and cosine of an angle turned by quarter turns.
    fn turn(sin: Self, cos: Self, quarters: Self::Quarters) -> (Self, Self);
    /// Sine and cosine by our own polynomials: the same bits on every platform and lane width.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        trig::sin_cos(self)
    }

    /// Runs `kernel` with the instruction set of this type enabled.
    fn vectorize<K: Kernel>(kernel: K) -> K::Output;

    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }
    #[inline(always)]
    fn minimum(self, other: Self) -> Self {
        Self::select(other.lt(self), other, self)
    }
    #[inline(always)]
    fn maximum(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
    /// `self` held inside `[low, high]`.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        self.minimum(high).maximum(low)
    }
    /// `self` held inside `[-limit, limit]`.
    #[inline(always)]
    fn clamp_abs(self, limit: Self) -> Self {
        self.clamp(-limit, limit)
    }
    /// `magnitude` with the sign of `self`; zero counts as positive.
    #[inline(always)]
    fn signed(self, magnitude: Self) -> Self {
        Self::select(self.lt(Self::zero()), -magnitude, magnitude)
    }
    /// -1, 0 or 1.
    #[inline(always)]
    fn sign(self) -> Self {
        let negative_or_zero = Self::select(self.lt(Self::zero()), -Self::one(), Self::zero());
        Self::select(Self::zero().lt(self), Self::one(), negative_or_zero)
    }
    #[inline(always)]
    fn square(self) -> Self {
        self * self
    }
    /// Is the condition true: 1 or 0.
    #[inline(always)]
    fn indicator(mask: Self::Mask) -> Self {
        Self::select(mask, Self::one(), Self::zero())
    }
    /// Angle of the vector `(x, y)` for `x > 0`, by the same polynomial everywhere.
    #[inline(always)]
    fn atan2_right(y: Self, x: Self) -> Self {
        trig::atan2_right(y, x)
    }
    fn finite(self) -> bool {
        (0..Self::LANES).all(|i| self.lane(i).is_finite())
    }
}

/// 1.5 * 2^52: adding it rounds to an integer, which then stands in the low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Runs a kernel as a function of its own, with the instructions that the build assumes. In its callers the forms of a step
/// would make one function, which takes far longer to compile than its parts.
#[inline(never)]
fn plainly<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// Runs a kernel as a function of its own, with its instruction set: for large code that is wanted in several places.
#[inline(never)]
pub(crate) fn apart<S: Scalar, K: Kernel>(kernel: K) -> K::Output {
    S::vectorize(kernel)
}

/// Has this processor a fused multiply-add for single numbers, in the instruction sets that are used here?
#[inline(always)]
pub fn fused() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    true
}

/// Runs small code without vector types with AVX2 and FMA where the processor has them: faster, the same results. What is
/// large compiles once, by `Scalar::vectorize`.
#[inline(always)]
pub(crate) fn best<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if fused() {
        // SAFETY: the features were just detected.
        return unsafe { x86::with_avx2(kernel) };
    }
    kernel.run()
}

/// `three!(|j| f(j))` is `[f(0), f(1), f(2)]`, written out: closures and the standard library's array adapters are
/// not always inlined, and a call in the inner loop costs more than the step.
#[macro_export]
macro_rules! three {
    (|$j:ident| $body:expr) => {
        [
            {
                let $j = 0_usize;
                $body
            },
            {
                let $j = 1_usize;
                $body
            },
            {
                let $j = 2_usize;
                $body
            },
        ]
    };
}

/// Sine and cosine of three angles 120 degrees apart: `[a, a - 2 pi/3, a + 2 pi/3]`.
#[inline(always)]
pub fn three_phase<S: Scalar>(sin: S, cos: S) -> ([S; 3], [S; 3]) {
    let half = S::splat(0.5);
    let root = S::splat(0.866_025_403_784_438_6);
    let (hs, hc) = (half * sin, half * cos);
    let (rs, rc) = (root * sin, root * cos);
    ([sin, -hs - rc, rc - hs], [cos, rs - hc, -hc - rs])
}
