//! A discrete Fourier transform of 2^n values: decimation in time, radix 2. A library's would be faster and would choose
//! its order of additions by the processor; here the bits are the same on every platform, and the transform is no bottleneck.

use std::f64::consts::TAU;

#[derive(Clone, Debug)]
pub struct Fft {
    bits: u32,
    /// Cosine and sine of the turns of half a period.
    turns: Vec<(f64, f64)>,
}

impl Fft {
    /// For `1 << bits` values.
    pub fn new(bits: u32) -> Self {
        let n = 1usize << bits;
        let turn = |k: usize| TAU * k as f64 / n as f64;
        Self { bits, turns: (0..n / 2).map(|k| (libm::cos(turn(k)), -libm::sin(turn(k)))).collect() }
    }

    /// In place.
    pub fn transform(&self, x: &mut [(f64, f64)]) {
        let n = x.len();
        for i in 0..n {
            let j = i.reverse_bits() >> (usize::BITS - self.bits);
            if i < j {
                x.swap(i, j);
            }
        }
        for stage in 0..self.bits {
            let half = 1usize << stage;
            let stride = n >> (stage + 1);
            for group in x.chunks_exact_mut(2 * half) {
                let (low, high) = group.split_at_mut(half);
                for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let (c, s) = self.turns[k * stride];
                    let turned = (b.0 * c - b.1 * s, b.0 * s + b.1 * c);
                    (*a, *b) = ((a.0 + turned.0, a.1 + turned.1), (a.0 - turned.0, a.1 - turned.1));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_sum_of_its_definition() {
        let fft = Fft::new(6);
        let x: Vec<(f64, f64)> = (0..64).map(|i| (libm::sin(0.3 * f64::from(i * i)), libm::cos(0.7 * f64::from(i)))).collect();
        let mut y = x.clone();
        fft.transform(&mut y);
        for (k, seen) in y.iter().enumerate() {
            let mut sum = (0.0, 0.0);
            for (i, v) in x.iter().enumerate() {
                let turn = -TAU * (i * k % 64) as f64 / 64.0;
                let (c, s) = (libm::cos(turn), libm::sin(turn));
                sum = (sum.0 + v.0 * c - v.1 * s, sum.1 + v.0 * s + v.1 * c);
            }
            assert!((seen.0 - sum.0).abs() < 1e-12 && (seen.1 - sum.1).abs() < 1e-12);
        }
    }
}
