//! Lanes as a plain array: the baseline that compiles everywhere (SSE2, NEON, anything).

use super::{Kernel, Scalar};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub struct Portable<const N: usize>([f64; N]);

#[derive(Clone, Copy, Debug)]
pub struct PortableMask<const N: usize>([bool; N]);

macro_rules! lanewise {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl<const N: usize> $trait for Portable<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(std::array::from_fn(|i| self.0[i] $op other.0[i]))
            }
        }
    )*};
}
lanewise!(Add add +, Sub sub -, Mul mul *, Div div /);

impl<const N: usize> Neg for Portable<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}

macro_rules! maskwise {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl<const N: usize> $trait for PortableMask<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(std::array::from_fn(|i| self.0[i] $op other.0[i]))
            }
        }
    )*};
}
maskwise!(BitAnd bitand &, BitOr bitor |);

impl<const N: usize> Not for PortableMask<N> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0.map(|x| !x))
    }
}

impl<const N: usize> Scalar for Portable<N> {
    type Mask = PortableMask<N>;
    type Quarters = [u64; N];
    const LANES: usize = N;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    fn from_fn(f: impl FnMut(usize) -> f64) -> Self {
        Self(std::array::from_fn(f))
    }
    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.0[i]
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        PortableMask(std::array::from_fn(|i| self.0[i] < other.0[i]))
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        PortableMask(std::array::from_fn(|i| self.0[i] <= other.0[i]))
    }
    #[inline(always)]
    fn equals(self, other: Self) -> Self::Mask {
        PortableMask(std::array::from_fn(|i| self.0[i] == other.0[i]))
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| if mask.0[i] { yes.0[i] } else { no.0[i] }))
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        mask.0.iter().any(|&x| x)
    }
    #[inline(always)]
    fn mask(value: bool) -> Self::Mask {
        PortableMask([value; N])
    }
    #[inline(always)]
    fn fma(self, factor: Self, addend: Self) -> Self {
        Self(std::array::from_fn(|i| f64::mul_add(self.0[i], factor.0[i], addend.0[i])))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self(self.0.map(f64::round_ties_even))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(self.0.map(f64::floor))
    }
    fn exp(self) -> Self {
        Self(self.0.map(libm::exp))
    }
    fn powf(self, exponent: f64) -> Self {
        Self(self.0.map(|x| libm::pow(x, exponent)))
    }
    #[inline(always)]
    fn quarters(self) -> (Self, [u64; N]) {
        let both = self.0.map(|x| x.quarters());
        (Self(both.map(|b| b.0)), both.map(|b| b.1))
    }
    #[inline(always)]
    fn power_of_two(whole: [u64; N]) -> Self {
        Self(whole.map(f64::power_of_two))
    }
    #[inline(always)]
    fn turn(sin: Self, cos: Self, quarters: [u64; N]) -> (Self, Self) {
        let both: [(f64, f64); N] = std::array::from_fn(|i| f64::turn(sin.0[i], cos.0[i], quarters[i]));
        (Self(both.map(|b| b.0)), Self(both.map(|b| b.1)))
    }
    #[inline(always)]
    fn vectorize<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}
