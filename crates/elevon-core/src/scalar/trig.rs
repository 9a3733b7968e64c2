//! Sine, cosine and arctangent over any scalar: Cody-Waite reduction by pi/2 in two parts, then
//! minimax polynomials on [-pi/4, pi/4] (coefficients as published with fdlibm's kernel functions). The falling
//! exponential by reduction with ln 2 and Taylor's series.

use super::Scalar;

const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
// pi/2 as a sum of two doubles: with a fused multiply-add the reduction is exact to 1e-32 |q|.
const HALF_PI_HIGH: f64 = std::f64::consts::FRAC_PI_2;
const HALF_PI_LOW: f64 = 6.123_233_995_736_766e-17;

const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Polynomial in Estrin's order: short dependency chains are what the inner loop needs.
#[inline(always)]
fn six<S: Scalar>(c: &[f64; 6], z: S) -> S {
    let z2 = z * z;
    let low = z.fma(S::splat(c[1]), S::splat(c[0]));
    let mid = z.fma(S::splat(c[3]), S::splat(c[2]));
    let high = z.fma(S::splat(c[5]), S::splat(c[4]));
    z2.fma(z2.fma(high, mid), low)
}

/// Sine and cosine of an angle within a quarter turn of zero, by the same polynomials without fused operations.
pub fn reduced_sin_cos(r: f64) -> (f64, f64) {
    let z = r * r;
    let horner = |c: &[f64; 6]| c.iter().rev().fold(0.0, |sum, &x| x + z * sum);
    (r + r * (z * horner(&SIN)), 1.0 - 0.5 * z + z * (z * horner(&COS)))
}

#[inline(always)]
pub fn sin_cos<S: Scalar>(x: S) -> (S, S) {
    let (q, quarters) = (x * S::splat(TWO_OVER_PI)).quarters();
    let r = q.fma(S::splat(-HALF_PI_LOW), q.fma(S::splat(-HALF_PI_HIGH), x));
    let z = r * r;
    let s = (r * z).fma(six(&SIN, z), r);
    let c = (z * z).fma(six(&COS, z), z.fma(S::splat(-0.5), S::one()));
    S::turn(s, c, quarters)
}

const LN_2_HIGH: f64 = std::f64::consts::LN_2;
const LN_2_LOW: f64 = 2.319_046_813_846_299_6e-17;
/// Beyond, exp(-x) is taken for zero.
const GONE: f64 = 700.0;

/// exp(-x), x from zero on.
#[inline(always)]
pub fn decay<S: Scalar>(x: S) -> S {
    /// 1/k! from k = 2 to 13: on [-ln 2 / 2, ln 2 / 2] the next term is 4e-18.
    const C: [f64; 12] = [
        1.0 / 2.0,
        1.0 / 6.0,
        1.0 / 24.0,
        1.0 / 120.0,
        1.0 / 720.0,
        1.0 / 5040.0,
        1.0 / 40_320.0,
        1.0 / 362_880.0,
        1.0 / 3_628_800.0,
        1.0 / 39_916_800.0,
        1.0 / 479_001_600.0,
        1.0 / 6_227_020_800.0,
    ];
    let (n, whole) = (x.minimum(S::splat(GONE)) * S::splat(-std::f64::consts::LOG2_E)).quarters();
    let r = n.fma(S::splat(-LN_2_LOW), n.fma(S::splat(-LN_2_HIGH), -x.minimum(S::splat(GONE))));
    let z = r * r;
    let z2 = z * z;
    let low = z.fma(r.fma(S::splat(C[3]), S::splat(C[2])), r.fma(S::splat(C[1]), S::splat(C[0])));
    let mid = z.fma(r.fma(S::splat(C[7]), S::splat(C[6])), r.fma(S::splat(C[5]), S::splat(C[4])));
    let high = z.fma(r.fma(S::splat(C[11]), S::splat(C[10])), r.fma(S::splat(C[9]), S::splat(C[8])));
    let tail = z2.fma(z2.fma(high, mid), low);
    let value = S::power_of_two(whole) * (S::one() + z.fma(tail, r));
    S::select(x.lt(S::splat(GONE)), value, S::zero())
}

/// Arctangent of `y / x`, `x > 0`: one reduction by 1/x when |y| > x, one by tan(pi/8), then the
/// odd Taylor-like minimax form of fdlibm on the remaining interval, in Estrin's order and with a single division.
#[inline(always)]
pub fn atan2_right<S: Scalar>(y: S, x: S) -> S {
    const C: [f64; 11] = [
        3.333_333_333_333_293e-1,
        -1.999_999_999_987_648_3e-1,
        1.428_571_427_250_346_6e-1,
        -1.111_111_040_546_235_6e-1,
        9.090_887_133_436_507e-2,
        -7.691_876_205_044_83e-2,
        6.661_073_137_387_531e-2,
        -5.833_570_133_790_573_5e-2,
        4.976_877_994_615_932e-2,
        -3.653_157_274_421_691_6e-2,
        1.628_582_011_536_578_2e-2,
    ];
    let (ay, half_pi) = (y.abs(), S::splat(std::f64::consts::FRAC_PI_2));
    let steep = x.lt(ay);
    let (over, under) = (S::select(steep, x, ay), S::select(steep, ay, x));
    let fold = (S::splat(0.414_213_562_373_095_03) * under).lt(over);
    let v = S::select(fold, over - under, over) / S::select(fold, over + under, under);
    let z = v * v;
    let (z2, pair) = (z * z, |i: usize| z.fma(S::splat(C[i + 1]), S::splat(C[i])));
    let low = z2.fma(pair(2), pair(0));
    let mid = z2.fma(pair(6), pair(4));
    let high = z2.fma(S::splat(C[10]), pair(8));
    let z4 = z2 * z2;
    let core = (-(v * z)).fma(z4.fma(z4.fma(high, mid), low), v);
    let unfolded = S::select(fold, S::splat(std::f64::consts::FRAC_PI_4) + core, core);
    let angle = S::select(steep, half_pi - unfolded, unfolded);
    S::select(y.lt(S::zero()), -angle, angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_falling_exponential_is_the_librarys_to_the_last_digits() {
        for k in 0..200_000 {
            let x = 699.9 * (f64::from(k) / 200_000.0).powi(3);
            let (ours, theirs) = (decay(x), libm::exp(-x));
            assert!((ours - theirs).abs() <= 3e-16 * theirs, "{x}: {ours} {theirs}");
        }
        assert_eq!((decay(0.0), decay(700.0), decay(f64::INFINITY)), (1.0, 0.0, 0.0));
    }
}
