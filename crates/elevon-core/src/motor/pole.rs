//! One pole pair that has lost flux: local demagnetisation.
//!
//! The weak pole pair passes a phase's coils once a turn, so k_j is modulated with the mechanical angle:
//! k_j (1 - d (1/p + chi (W(theta_m - phi - 2 pi (j-1)/3) - 1/p))). W is the share of the weak pole pair in what a coil of one
//! pole pitch sees, a raised cosine over two pole pairs: (1 + cos(p x/2))/2 for |x| < 2 pi/p, else 0. Its mean is 1/p, and the
//! windows of all p pole pairs add to one, so that equal losses of all are the uniform demagnetisation. chi = 0: coils stand
//! under every pole pair and in series, their EMFs add to a constant amplitude and only the mean loss d/p is left.
//! ASSUMED: the window's form; a magnet's measured profile would take its place.

use crate::scalar::Scalar;
use crate::three;
use crate::variable::View;
use crate::variables;

variables! {
    /// Local demagnetisation.
    PoleParameter, POLE {
        PoleLoss => "pole_loss", "d", "1", Unit, Plant, Some(0.0), "healthy 0; fraction of its flux that one pole pair of the rotor has lost";
        PoleLossPhase => "pole_loss_phase", "phi_p", "rad", Any, Plant, Some(0.0), "mechanical angle of the weak pole pair",
            when(&[Away("motor.pole_loss", 0.0)]);
        PoleConcentration => "pole_concentration", "chi", "1", Unit, Plant, Some(1.0), "how far a phase's coils stand together: 1 under one pole pair at a time, 0 evenly under all",
            when(&[Away("motor.pole_loss", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct WeakPole<S> {
    /// 1 less the mean loss.
    mean: S,
    depth: S,
    phase: S,
    /// p / 2.
    half_pairs: S,
    share: S,
}

impl<S: Scalar> WeakPole<S> {
    pub fn derive(raw: &[S], pole_pairs: S) -> Self {
        let [loss, phase, concentration] =
            [PoleParameter::PoleLoss, PoleParameter::PoleLossPhase, PoleParameter::PoleConcentration].map(|p| raw[p as usize]);
        let one = S::one();
        let share = one / pole_pairs;
        // A single pole pair is all there is: its loss is uniform.
        let depth = S::select(one.lt(pole_pairs), loss * concentration, S::zero());
        Self { mean: one - loss * share, depth, phase, half_pairs: S::splat(0.5) * pole_pairs, share }
    }

    pub fn needed(view: &View<PoleParameter>) -> bool {
        view.away(PoleParameter::PoleLoss)
    }

    /// Factors on the coefficients of the three phases.
    #[inline(always)]
    pub fn gap(&self, theta: S) -> [S; 3] {
        three!(|j| {
            let x = theta - self.phase - S::splat(std::f64::consts::TAU * j as f64 / 3.0);
            self.mean - self.depth * (self.window(x) - self.share)
        })
    }

    #[inline(always)]
    fn window(&self, x: S) -> S {
        let turns = x * S::splat(1.0 / std::f64::consts::TAU);
        let near = (turns - turns.round()).abs() * S::splat(std::f64::consts::TAU) * self.half_pairs;
        let (_, cos) = near.minimum(S::splat(std::f64::consts::PI)).sin_cos();
        S::splat(0.5).fma(cos, S::splat(0.5))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn poles(loss: f64, concentration: f64, pairs: f64) -> WeakPole<f64> {
        WeakPole::derive(&[loss, 0.4, concentration], pairs)
    }

    #[test]
    fn all_pole_pairs_together_are_the_uniform_loss() {
        for pairs in [2.0, 3.0, 4.0, 7.0] {
            let weak = poles(1.0, 1.0, pairs);
            for k in 0..50 {
                let sum: f64 = (0..pairs as usize).map(|n| weak.window(0.13 * f64::from(k) + TAU * n as f64 / pairs)).sum();
                assert!((sum - 1.0).abs() < 1e-12, "{pairs}: {sum}");
            }
        }
    }

    /// a_n of the window, n > 0: sin(2 pi n/p) / (pi n (1 - (2 n/p)^2)), 1/p where n = p/2; a_0 = 1/p.
    fn harmonic(n: f64, pairs: f64) -> f64 {
        if 2.0 * n == pairs {
            1.0 / pairs
        } else {
            (TAU * n / pairs).sin() / (std::f64::consts::PI * n * (1.0 - (2.0 * n / pairs).powi(2)))
        }
    }

    #[test]
    fn its_harmonics_are_those_of_a_raised_cosine() {
        const STEPS: usize = 3600;
        for pairs in [2.0, 4.0, 5.0] {
            let weak = poles(0.3, 0.7, pairs);
            for phase in 0..3 {
                let shift = 0.4 + TAU * phase as f64 / 3.0;
                let angle = |k: usize| TAU * k as f64 / STEPS as f64;
                let values: Vec<f64> = (0..STEPS).map(|k| weak.gap(angle(k))[phase]).collect();
                let mean = values.iter().sum::<f64>() / STEPS as f64;
                assert!((mean - (1.0 - 0.3 / pairs)).abs() < 1e-6, "{mean}");
                for n in 1..7 {
                    let wave = |k: usize| (n as f64 * (angle(k) - shift)).cos();
                    let found = 2.0 / STEPS as f64 * values.iter().enumerate().map(|(k, x)| x * wave(k)).sum::<f64>();
                    assert!((found + 0.3 * 0.7 * harmonic(n as f64, pairs)).abs() < 1e-5, "p {pairs} n {n}: {found}");
                }
            }
        }
    }

    #[test]
    fn a_single_pole_pair_and_even_coils_lose_evenly() {
        for weak in [poles(0.2, 1.0, 1.0), poles(0.8, 0.0, 4.0)] {
            for k in 0..20 {
                for gap in weak.gap(0.4 * f64::from(k)) {
                    assert!((gap - 0.8).abs() < 1e-15);
                }
            }
        }
    }
}
