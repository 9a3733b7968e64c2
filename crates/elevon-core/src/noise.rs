//! Counter-based random numbers: a value is a function of (seed, run, channel, tick) and of nothing else,
//! so it does not depend on threads, lanes or the order of evaluation.

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a bijection that avalanches every bit.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Names the stream of random numbers of one channel of one run.
#[derive(Clone, Copy, Debug)]
pub struct Key(u64);

impl Key {
    pub fn new(seed: u64, run: u64, channel: u64) -> Self {
        let golden = 0x9e37_79b9_7f4a_7c15_u64;
        let a = mix(seed.wrapping_add(golden));
        let b = mix(a ^ run.wrapping_mul(golden).wrapping_add(1));
        Self(mix(b ^ channel.wrapping_mul(0xd1b5_4a32_d192_ed03).wrapping_add(2)))
    }

    fn bits(self, counter: u64) -> u64 {
        mix(self.0 ^ mix(counter.wrapping_add(0x9e37_79b9_7f4a_7c15)))
    }

    /// Uniform in `(0, 1)`, 53 bits.
    pub fn uniform(self, counter: u64) -> f64 {
        ((self.bits(counter) >> 11) as f64 + 0.5) * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Standard normal (Box-Muller).
    pub fn gaussian(self, tick: u64) -> f64 {
        let radius = (-2.0 * libm::log(self.uniform(2 * tick))).sqrt();
        radius * cosine_of_turns(self.uniform(2 * tick + 1))
    }
}

/// cos(2 pi u) for `u` in (0, 1): quarter turns by rounding, then the polynomials of `scalar::trig` without
/// fused operations (this runs outside the vector code).
fn cosine_of_turns(u: f64) -> f64 {
    let quarter = (4.0 * u).round();
    let r = (u - 0.25 * quarter) * std::f64::consts::TAU;
    let (sin, cos) = crate::scalar::reduced_sin_cos(r);
    match quarter as u8 & 3 {
        0 => cos,
        1 => -sin,
        2 => -cos,
        _ => sin,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_a_normal() {
        let key = Key::new(7, 3, 1);
        let n = 200_000_u64;
        let (mut m1, mut m2, mut m4) = (0.0, 0.0, 0.0);
        for tick in 0..n {
            let x = key.gaussian(tick);
            m1 += x;
            m2 += x * x;
            m4 += x * x * x * x;
        }
        let n = n as f64;
        // Five standard errors of each moment.
        assert!((m1 / n).abs() < 5.0 / n.sqrt());
        assert!((m2 / n - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
        assert!((m4 / n - 3.0).abs() < 5.0 * (96.0 / n).sqrt());
    }

    #[test]
    fn cosine_of_turns_is_the_cosine() {
        for i in 1..2000 {
            let u = f64::from(i) / 2000.0;
            assert!((cosine_of_turns(u) - libm::cos(std::f64::consts::TAU * u)).abs() < 1e-15);
        }
    }

    #[test]
    fn channels_and_ticks_are_uncorrelated() {
        let n = 100_000_u64;
        for (a, b) in
            [(Key::new(1, 0, 0), Key::new(1, 0, 1)), (Key::new(1, 0, 0), Key::new(1, 1, 0)), (Key::new(1, 0, 0), Key::new(2, 0, 0))]
        {
            let cross: f64 = (0..n).map(|t| a.gaussian(t) * b.gaussian(t)).sum();
            let lag: f64 = (0..n).map(|t| a.gaussian(t) * a.gaussian(t + 1)).sum();
            assert!(cross.abs() < 5.0 * (n as f64).sqrt());
            assert!(lag.abs() < 5.0 * (n as f64).sqrt());
        }
    }
}
