//! Piecewise linear curves over common knots, held outside them. The knots may differ from lane to lane: no
//! index is looked up, every segment adds its part.

use crate::scalar::Scalar;

/// The knots, with the lengths of the segments behind them.
#[derive(Clone, Copy, Debug)]
pub struct Knots<S, const N: usize> {
    at: [S; N],
    length: [S; N],
}

/// How far an argument reaches into each segment; shared by all curves over the same knots.
pub type Reach<S, const N: usize> = [S; N];

/// Values over knots.
#[derive(Clone, Copy, Debug)]
pub struct Curve<S, const N: usize> {
    first: S,
    slope: [S; N],
}

impl<S: Scalar, const N: usize> Knots<S, N> {
    /// `at` must rise.
    pub fn new(at: [S; N]) -> Self {
        let length = std::array::from_fn(|k| if k + 1 < N { at[k + 1] - at[k] } else { S::zero() });
        Self { at, length }
    }

    #[inline(always)]
    pub fn reach(&self, x: S) -> Reach<S, N> {
        let mut reach = [S::zero(); N];
        for (k, part) in reach.iter_mut().enumerate().take(N - 1) {
            *part = (x - self.at[k]).clamp(S::zero(), self.length[k]);
        }
        reach
    }
}

impl<S: Scalar, const N: usize> Curve<S, N> {
    pub fn new(knots: &Knots<S, N>, values: &[S]) -> Self {
        let slope = std::array::from_fn(|k| if k + 1 < N { (values[k + 1] - values[k]) / knots.length[k] } else { S::zero() });
        Self { first: values[0], slope }
    }

    #[inline(always)]
    pub fn at(&self, reach: &Reach<S, N>) -> S {
        let mut sum = self.first;
        for (slope, part) in self.slope.iter().zip(reach).take(N - 1) {
            sum = slope.fma(*part, sum);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_between_and_held_outside() {
        let knots = Knots::new([1.0, 2.0, 4.0]);
        let curve = Curve::new(&knots, &[10.0, 20.0, 0.0]);
        for (x, y) in [(-5.0, 10.0), (1.0, 10.0), (1.5, 15.0), (2.0, 20.0), (3.0, 10.0), (4.0, 0.0), (9.0, 0.0)] {
            assert_eq!(curve.at(&knots.reach(x)), y);
        }
    }
}
