//! Lanes without intrinsics: the baseline that compiles everywhere (SSE2, NEON, anything). Two numbers as two fields: what
//! loops over an array of lanes takes the compiler several times as long.

use super::{Kernel, Scalar};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub struct Portable(f64, f64);

#[derive(Clone, Copy, Debug)]
pub struct PortableMask(bool, bool);

impl Portable {
    #[inline(always)]
    fn each(self, f: impl Fn(f64) -> f64) -> Self {
        Self(f(self.0), f(self.1))
    }
}

macro_rules! lanewise {
    ($($lanes:ident $trait:ident $method:ident $op:tt),*) => {$(
        impl $trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0 $op other.0, self.1 $op other.1)
            }
        }
    )*};
}
lanewise!(Portable Add add +, Portable Sub sub -, Portable Mul mul *, Portable Div div /);
lanewise!(PortableMask BitAnd bitand &, PortableMask BitOr bitor |);

impl Neg for Portable {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl Not for PortableMask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0, !self.1)
    }
}

impl Scalar for Portable {
    type Mask = PortableMask;
    type Quarters = (u64, u64);
    const LANES: usize = 2;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(x, x)
    }
    #[inline(always)]
    fn from_fn(mut f: impl FnMut(usize) -> f64) -> Self {
        let first = f(0);
        Self(first, f(1))
    }
    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        [self.0, self.1][i]
    }
    #[inline(always)]
    fn lt(self, other: Self) -> PortableMask {
        PortableMask(self.0 < other.0, self.1 < other.1)
    }
    #[inline(always)]
    fn le(self, other: Self) -> PortableMask {
        PortableMask(self.0 <= other.0, self.1 <= other.1)
    }
    #[inline(always)]
    fn equals(self, other: Self) -> PortableMask {
        PortableMask(self.0 == other.0, self.1 == other.1)
    }
    #[inline(always)]
    fn select(mask: PortableMask, yes: Self, no: Self) -> Self {
        Self(f64::select(mask.0, yes.0, no.0), f64::select(mask.1, yes.1, no.1))
    }
    #[inline(always)]
    fn any(mask: PortableMask) -> bool {
        mask.0 || mask.1
    }
    #[inline(always)]
    fn mask(value: bool) -> PortableMask {
        PortableMask(value, value)
    }
    #[inline(always)]
    fn fma(self, factor: Self, addend: Self) -> Self {
        Self(f64::mul_add(self.0, factor.0, addend.0), f64::mul_add(self.1, factor.1, addend.1))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.each(f64::abs)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.each(f64::sqrt)
    }
    #[inline(always)]
    fn round(self) -> Self {
        self.each(f64::round_ties_even)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        self.each(f64::floor)
    }
    fn exp(self) -> Self {
        self.each(libm::exp)
    }
    fn powf(self, exponent: f64) -> Self {
        self.each(|x| libm::pow(x, exponent))
    }
    #[inline(always)]
    fn quarters(self) -> (Self, (u64, u64)) {
        let ((a, first), (b, second)) = (self.0.quarters(), self.1.quarters());
        (Self(a, b), (first, second))
    }
    #[inline(always)]
    fn power_of_two(whole: (u64, u64)) -> Self {
        Self(f64::power_of_two(whole.0), f64::power_of_two(whole.1))
    }
    #[inline(always)]
    fn turn(sin: Self, cos: Self, quarters: (u64, u64)) -> (Self, Self) {
        let first = f64::turn(sin.0, cos.0, quarters.0);
        let second = f64::turn(sin.1, cos.1, quarters.1);
        (Self(first.0, second.0), Self(first.1, second.1))
    }
    #[inline(always)]
    fn vectorize<K: Kernel>(kernel: K) -> K::Output {
        super::plainly(kernel)
    }
}
