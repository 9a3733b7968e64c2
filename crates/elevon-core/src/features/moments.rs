//! Mean, spread and kurtosis in one pass: the updates of central moments by one value, which lose no digits to a large mean
//! (P. Pébay, "Formulas for robust, one-pass parallel computation of covariances and arbitrary-order statistical moments",
//! Sandia report SAND2008-6212, 2008, eq. 2.1 with one added value).

#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    count: f64,
    mean: f64,
    second: f64,
    third: f64,
    fourth: f64,
}

impl Moments {
    #[inline(always)]
    pub fn push(&mut self, x: f64) {
        let before = self.count;
        self.count += 1.0;
        let (n, delta) = (self.count, x - self.mean);
        let share = delta / n;
        let square = share * share;
        let term = delta * share * before;
        self.mean += share;
        self.fourth += term * square * (n * n - 3.0 * n + 3.0) + 6.0 * square * self.second - 4.0 * share * self.third;
        self.third += term * share * (n - 2.0) - 3.0 * share * self.second;
        self.second += term;
    }

    /// NaN of nothing.
    pub fn mean(&self) -> f64 {
        if self.count > 0.0 {
            self.mean
        } else {
            f64::NAN
        }
    }

    pub fn rms(&self) -> f64 {
        (self.mean() * self.mean + self.second / self.count).sqrt()
    }

    /// Fourth central moment over the square of the second: 3 of normal noise; NaN of a constant.
    pub fn kurtosis(&self) -> f64 {
        self.count * self.fourth / (self.second * self.second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_two_passes_on_a_large_mean() {
        let x: Vec<f64> = (0..500).map(|i| 1.0e6 + libm::sin(0.7 * f64::from(i)) + 0.1 * f64::from(i % 7)).collect();
        let mut m = Moments::default();
        x.iter().for_each(|&x| m.push(x));
        let n = x.len() as f64;
        let mean = x.iter().sum::<f64>() / n;
        let central = |p: i32| x.iter().map(|x| (x - mean).powi(p)).sum::<f64>() / n;
        assert!((m.mean() - mean).abs() < 1e-9 * mean);
        assert!((m.kurtosis() - central(4) / (central(2) * central(2))).abs() < 1e-6);
        assert!((m.rms() - (x.iter().map(|x| x * x).sum::<f64>() / n).sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_square_wave_has_kurtosis_one() {
        let mut m = Moments::default();
        (0..100).for_each(|i| m.push(if i % 2 == 0 { 3.0 } else { -1.0 }));
        assert!((m.kurtosis() - 1.0).abs() < 1e-12);
    }
}
