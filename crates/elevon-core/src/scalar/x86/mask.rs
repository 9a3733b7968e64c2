//! Comparisons of the lanes of `x86`, and what of its types is not alike in both registers.
//!
//! What makes the intrinsics safe stands at the head of `x86`: a value of these types exists only where the processor has
//! its instruction set.

use super::{Avx2x4, Avx512x8};
use std::arch::x86_64::*;
use std::ops::{BitAnd, BitOr, Neg, Not};

#[derive(Clone, Copy, Debug)]
pub struct Avx2Mask(pub(super) __m256d);

impl Avx2Mask {
    #[inline(always)]
    pub(super) fn less(a: Avx2x4, b: Avx2x4) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(a.0, b.0) })
    }
    #[inline(always)]
    pub(super) fn less_equal(a: Avx2x4, b: Avx2x4) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_cmp_pd::<_CMP_LE_OQ>(a.0, b.0) })
    }
    #[inline(always)]
    pub(super) fn equal(a: Avx2x4, b: Avx2x4) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_cmp_pd::<_CMP_EQ_OQ>(a.0, b.0) })
    }
    #[inline(always)]
    pub(super) fn blend(self, yes: Avx2x4, no: Avx2x4) -> Avx2x4 {
        // SAFETY: this type exists only where the processor has its instructions.
        Avx2x4(unsafe { _mm256_blendv_pd(no.0, yes.0, self.0) })
    }
    #[inline(always)]
    pub(super) fn bits(self) -> i32 {
        // SAFETY: this type exists only where the processor has its instructions.
        unsafe { _mm256_movemask_pd(self.0) }
    }
    #[inline(always)]
    pub(super) fn uniform(value: bool) -> Self {
        let bits = if value { -1 } else { 0 };
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_castsi256_pd(_mm256_set1_epi64x(bits)) })
    }
}
impl BitAnd for Avx2Mask {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_and_pd(self.0, o.0) })
    }
}
impl BitOr for Avx2Mask {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_or_pd(self.0, o.0) })
    }
}
impl Not for Avx2Mask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_xor_pd(self.0, Self::uniform(true).0) })
    }
}
impl Neg for Avx2x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
}
impl Avx2x4 {
    #[inline(always)]
    pub(super) fn absolute(self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    pub(super) fn rounded<const MODE: i32>(self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm256_round_pd::<MODE>(self.0) })
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Avx512Mask(pub(super) __mmask8);

impl Avx512Mask {
    #[inline(always)]
    pub(super) fn less(a: Avx512x8, b: Avx512x8) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a.0, b.0) })
    }
    #[inline(always)]
    pub(super) fn less_equal(a: Avx512x8, b: Avx512x8) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm512_cmp_pd_mask::<_CMP_LE_OQ>(a.0, b.0) })
    }
    #[inline(always)]
    pub(super) fn equal(a: Avx512x8, b: Avx512x8) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(a.0, b.0) })
    }
    #[inline(always)]
    pub(super) fn blend(self, yes: Avx512x8, no: Avx512x8) -> Avx512x8 {
        // SAFETY: this type exists only where the processor has its instructions.
        Avx512x8(unsafe { _mm512_mask_blend_pd(self.0, no.0, yes.0) })
    }
    #[inline(always)]
    pub(super) fn bits(self) -> i32 {
        i32::from(self.0)
    }
    #[inline(always)]
    pub(super) fn uniform(value: bool) -> Self {
        Self(if value { 0xff } else { 0 })
    }
}
impl BitAnd for Avx512Mask {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        Self(self.0 & o.0)
    }
}
impl BitOr for Avx512Mask {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        Self(self.0 | o.0)
    }
}
impl Not for Avx512Mask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}
impl Neg for Avx512x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm512_xor_pd(self.0, _mm512_set1_pd(-0.0)) })
    }
}
impl Avx512x8 {
    #[inline(always)]
    pub(super) fn absolute(self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm512_abs_pd(self.0) })
    }
    #[inline(always)]
    pub(super) fn rounded<const MODE: i32>(self) -> Self {
        // SAFETY: this type exists only where the processor has its instructions.
        Self(unsafe { _mm512_roundscale_pd::<MODE>(self.0) })
    }
}
