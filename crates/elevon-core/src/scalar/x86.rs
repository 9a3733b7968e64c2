//! Lanes on x86-64: four in an AVX2 register, eight in an AVX-512 one.
//!
//! The intrinsics need `unsafe` because they may only run on a processor that has them. Values of these types
//! are created only below `Scalar::vectorize`, and the solver chooses a type only after detecting its instruction
//! set (`solver::width`): that is the whole of the safety argument for this file.

mod mask;

use self::mask::{Avx2Mask, Avx512Mask};
use super::{Kernel, Scalar, ROUNDER};
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// # Safety
/// The processor must have AVX2 and FMA.
#[target_feature(enable = "avx2,fma")]
#[inline(never)]
pub unsafe fn with_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// # Safety
/// The processor must have AVX-512 F, DQ and VL.
#[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
#[inline(never)]
unsafe fn with_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// From quarter turns: is the turn odd, and the sign bits to flip in sine and cosine.
///
/// # Safety
/// The processor must have AVX2.
#[inline(always)]
unsafe fn signs_avx2(quarters: __m256i) -> (Avx2Mask, __m256d, __m256d) {
    let sign = _mm256_set1_epi64x(i64::MIN);
    let odd = _mm256_slli_epi64::<63>(quarters);
    let sin_sign = _mm256_and_si256(_mm256_slli_epi64::<62>(quarters), sign);
    // cos changes sign with quarters + 1: the second bit of the sum is the exclusive or of the two low bits.
    let cos_sign = _mm256_xor_si256(sin_sign, odd);
    (Avx2Mask(_mm256_castsi256_pd(odd)), _mm256_castsi256_pd(sin_sign), _mm256_castsi256_pd(cos_sign))
}

/// As `signs_avx2`.
///
/// # Safety
/// The processor must have AVX-512 F and DQ.
#[inline(always)]
unsafe fn signs_avx512(quarters: __m512i) -> (Avx512Mask, __m512d, __m512d) {
    let sign = _mm512_set1_epi64(i64::MIN);
    let odd = _mm512_slli_epi64::<63>(quarters);
    let sin_sign = _mm512_and_si512(_mm512_slli_epi64::<62>(quarters), sign);
    let cos_sign = _mm512_xor_si512(sin_sign, odd);
    (Avx512Mask(_mm512_movepi64_mask(odd)), _mm512_castsi512_pd(sin_sign), _mm512_castsi512_pd(cos_sign))
}

/// Two to the power of whole numbers in the low bits: their sum with the exponent's bias, in the exponent's place.
///
/// # Safety
/// The processor must have AVX2.
#[inline(always)]
unsafe fn power_avx2(whole: __m256i) -> __m256d {
    _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_add_epi64(whole, _mm256_set1_epi64x(1023))))
}

/// As `power_avx2`.
///
/// # Safety
/// The processor must have AVX-512 F.
#[inline(always)]
unsafe fn power_avx512(whole: __m512i) -> __m512d {
    _mm512_castsi512_pd(_mm512_slli_epi64::<52>(_mm512_add_epi64(whole, _mm512_set1_epi64(1023))))
}

macro_rules! vector_type {
    ($name:ident, $mask:ident, $lanes:literal, $align:literal, $register:ty,
     $add:ident, $sub:ident, $mul:ident, $div:ident, $splat:ident, $load:ident, $store:ident,
     $sqrt:ident, $minimum:ident, $maximum:ident, $fma:ident, $with:ident,
     $integers:ty, $to_bits:ident, $power:ident, $signs:ident, $xor:ident) => {
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $name($register);

        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $add(self.0, o.0) })
            }
        }
        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $sub(self.0, o.0) })
            }
        }
        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, o: Self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $mul(self.0, o.0) })
            }
        }
        impl Div for $name {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: Self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $div(self.0, o.0) })
            }
        }

        impl $name {
            #[inline(always)]
            fn array(self) -> [f64; $lanes] {
                let mut out = [0.0; $lanes];
                // SAFETY: the array holds every lane; the instructions as in the head of this file.
                unsafe { $store(out.as_mut_ptr(), self.0) };
                out
            }
            #[inline(always)]
            fn from_array(values: [f64; $lanes]) -> Self {
                // SAFETY: the array holds every lane; the instructions as in the head of this file.
                Self(unsafe { $load(values.as_ptr()) })
            }
        }

        impl Scalar for $name {
            type Mask = $mask;
            type Quarters = $integers;
            const LANES: usize = $lanes;
            const FORMS: bool = true;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn from_fn(f: impl FnMut(usize) -> f64) -> Self {
                Self::from_array(std::array::from_fn(f))
            }
            #[inline(always)]
            fn lane(self, i: usize) -> f64 {
                Self::lane_at(&self, i)
            }
            #[inline(always)]
            fn lane_at(&self, i: usize) -> f64 {
                assert!(i < $lanes);
                // SAFETY: a register in memory is its lanes one after another, and `i` is one of them.
                unsafe { *std::ptr::from_ref(self).cast::<f64>().add(i) }
            }
            #[inline(always)]
            fn lt(self, o: Self) -> $mask {
                $mask::less(self, o)
            }
            #[inline(always)]
            fn le(self, o: Self) -> $mask {
                $mask::less_equal(self, o)
            }
            #[inline(always)]
            fn equals(self, o: Self) -> $mask {
                $mask::equal(self, o)
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                mask.blend(yes, no)
            }
            #[inline(always)]
            fn any(mask: $mask) -> bool {
                mask.bits() != 0
            }
            #[inline(always)]
            fn mask(value: bool) -> $mask {
                $mask::uniform(value)
            }
            #[inline(always)]
            fn fma(self, factor: Self, addend: Self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $fma(self.0, factor.0, addend.0) })
            }
            /// The instruction gives its second operand where they are equal or not numbers: `self`, as a selection does.
            #[inline(always)]
            fn minimum(self, o: Self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $minimum(o.0, self.0) })
            }
            #[inline(always)]
            fn maximum(self, o: Self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $maximum(o.0, self.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.absolute()
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn round(self) -> Self {
                self.rounded::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>()
            }
            #[inline(always)]
            fn floor(self) -> Self {
                self.rounded::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>()
            }
            fn exp(self) -> Self {
                Self::from_array(self.array().map(libm::exp))
            }
            fn powf(self, exponent: f64) -> Self {
                Self::from_array(self.array().map(|x| libm::pow(x, exponent)))
            }
            #[inline(always)]
            fn quarters(self) -> (Self, $integers) {
                let shifted = self + Self::splat(ROUNDER);
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                (shifted - Self::splat(ROUNDER), unsafe { $to_bits(shifted.0) })
            }
            #[inline(always)]
            fn power_of_two(whole: $integers) -> Self {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                Self(unsafe { $power(whole) })
            }
            #[inline(always)]
            fn turn(sin: Self, cos: Self, quarters: $integers) -> (Self, Self) {
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                let (odd, sin_sign, cos_sign) = unsafe { $signs(quarters) };
                let (s, c) = (Self::select(odd, cos, sin), Self::select(odd, sin, cos));
                // SAFETY: this type exists only where the processor has its instructions (head of this file).
                unsafe { (Self($xor(s.0, sin_sign)), Self($xor(c.0, cos_sign))) }
            }
            #[inline(always)]
            fn vectorize<K: Kernel>(kernel: K) -> K::Output {
                // SAFETY: the solver chose this type because the processor has its instructions.
                unsafe { $with(kernel) }
            }
        }
    };
}

vector_type!(
    Avx2x4,
    Avx2Mask,
    4,
    32,
    __m256d,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_set1_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    _mm256_sqrt_pd,
    _mm256_min_pd,
    _mm256_max_pd,
    _mm256_fmadd_pd,
    with_avx2,
    __m256i,
    _mm256_castpd_si256,
    power_avx2,
    signs_avx2,
    _mm256_xor_pd
);
vector_type!(
    Avx512x8,
    Avx512Mask,
    8,
    64,
    __m512d,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_set1_pd,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    _mm512_sqrt_pd,
    _mm512_min_pd,
    _mm512_max_pd,
    _mm512_fmadd_pd,
    with_avx512,
    __m512i,
    _mm512_castpd_si512,
    power_avx512,
    signs_avx512,
    _mm512_xor_pd
);
