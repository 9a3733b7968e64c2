//! What an eccentric rotor makes of the phases' coefficients k_j, by one of two laws.
//!
//! *Published* (T2): phase j is modulated with the electrical angle, 1 + zeta cos(theta_e - phi + 2 pi (j-1)/3), the dynamic
//! part with the shaft's. No flux of a turning magnet has that EMF: its mean over a turn is k zeta/2 sin(phi - 4 pi (j-1)/3),
//! 0.43 zeta k in b and c at phi = 0, so a shorted winding carries direct current.
//!
//! *Periodic*: each phase links a flux that is periodic over a turn of the shaft, its coils standing together at
//! 2 pi (j-1)/3 round the stator (ASSUMED),
//!
//!     lambda_j = -(k/p) F(theta_e - 2 pi (j-1)/3) (1 + zeta cos(phi - 2 pi (j-1)/3)) g_j
//!     g_j = 1 + zeta_d cos(theta_m - phi_d - 2 pi (j-1)/3),   F the integral of the EMF's shape f
//!
//! and k_j is its slope over the angle: unequal amplitudes that stand still, and of the dynamic part f g_j with -F g_j'/p.
//! Whatever the flux, torque sum k_j i_j is the EMFs' power over the speed.

use super::star::MotorParameter;
use crate::scalar::Scalar;
use crate::three;

/// The gap of an eccentric rotor.
#[derive(Clone, Copy, Debug)]
pub struct AirGap<S> {
    fixed: [S; 2],
    turning: [S; 2],
    pub per_pole_pairs: S,
}

/// a + x cos + y sin of three axes 2 pi/3 apart, `forward` or backward.
#[inline(always)]
fn three_axes<S: Scalar>(x: S, y: S, forward: bool) -> [S; 3] {
    let half = S::splat(-0.5) * x;
    let root = S::splat(0.866_025_403_784_438_6) * y;
    if forward {
        [x, half + root, half - root]
    } else {
        [x, half - root, half + root]
    }
}

impl<S: Scalar> AirGap<S> {
    pub fn derive(raw: &[S]) -> Self {
        use MotorParameter as P;
        let g = |p: P| raw[p as usize];
        let vector = |size: P, phase: P| {
            let (sin, cos) = g(phase).sin_cos();
            [g(size) * cos, g(size) * sin]
        };
        Self {
            fixed: vector(P::EccentricityStatic, P::EccentricityStaticPhase),
            turning: vector(P::EccentricityDynamic, P::EccentricityDynamicPhase),
            per_pole_pairs: S::one() / g(P::PolePairs),
        }
    }

    /// Adds a dynamic eccentricity.
    pub fn add(&mut self, (eccentricity, phase): (S, S)) {
        let (sin, cos) = phase.sin_cos();
        self.turning[0] = self.turning[0] + eccentricity * cos;
        self.turning[1] = self.turning[1] + eccentricity * sin;
    }

    /// 1 + zeta cos(phi - 2 pi (j-1)/3), the amplitudes of the phases by the periodic law.
    pub fn amplitudes(&self) -> [S; 3] {
        let around = three_axes(self.fixed[0], self.fixed[1], true);
        three!(|j| S::one() + around[j])
    }

    /// 1 + zeta cos(theta_e - phi + 2 pi (j-1)/3), the published modulation of phase j.
    #[inline(always)]
    pub fn published(&self, sin: S, cos: S) -> [S; 3] {
        let [c, s] = self.fixed;
        let (x, y) = (c.fma(cos, s * sin), c.fma(sin, -(s * cos)));
        let around = three_axes(x, y, false);
        three!(|j| S::one() + around[j])
    }

    /// Turning part along phase j, zeta_d cos(theta_m - phi_d - 2 pi (j-1)/3), and its slope over the shaft's angle.
    #[inline(always)]
    pub fn turning(&self, theta: S) -> ([S; 3], [S; 3]) {
        let (sin, cos) = theta.sin_cos();
        let [c, s] = self.turning;
        let (x, y) = (c * cos + s * sin, c * sin - s * cos);
        (three_axes(x, y, true), three_axes(-y, x, true))
    }
}

#[cfg(test)]
mod tests {
    use super::super::pole::WeakPole;
    use super::super::star::{MotorParameter as P, MotorStructure, Star, MOTOR};
    use std::f64::consts::TAU;

    const ZETA: f64 = 0.2;
    const PHI: f64 = 0.7;

    fn raw(set: &[(P, f64)]) -> Vec<f64> {
        let mut raw: Vec<f64> = MOTOR.iter().map(|v| v.default.unwrap_or(1.0)).collect();
        set.iter().for_each(|&(p, x)| raw[p as usize] = x);
        raw
    }

    fn structure(periodic: bool, trapezoidal: bool) -> MotorStructure {
        MotorStructure { static_eccentricity: true, dynamic_eccentricity: true, periodic, trapezoidal, ..MotorStructure::default() }
    }

    /// k_j of an eccentric motor at a shaft's angle.
    fn k(raw: &[f64], s: &MotorStructure, pole: Option<&WeakPole<f64>>, theta: f64) -> [f64; 3] {
        let star = Star::derive(raw, s, 1e-6);
        let (sin, cos) = star.electrical_angle(theta).sin_cos();
        star.coefficients::<true>(s, pole, theta, [sin, cos], None)
    }

    fn mean(of: impl Fn(f64) -> [f64; 3]) -> [f64; 3] {
        const STEPS: usize = 7200;
        let mut sum = [0.0; 3];
        for n in 0..STEPS {
            let values = of(TAU * n as f64 / STEPS as f64);
            (0..3).for_each(|j| sum[j] += values[j] / STEPS as f64);
        }
        sum
    }

    fn eccentric(pairs: f64) -> Vec<f64> {
        raw(&[
            (P::PolePairs, pairs),
            (P::EccentricityStatic, ZETA),
            (P::EccentricityStaticPhase, PHI),
            (P::EccentricityDynamic, 0.3),
            (P::EccentricityDynamicPhase, -0.4),
        ])
    }

    #[test]
    fn the_periodic_laws_emf_has_no_mean_over_a_turn() {
        for pairs in [1.0, 2.0, 3.0, 4.0, 5.0] {
            let pole = WeakPole::derive(&[0.4, 0.3, 1.0], pairs);
            for trapezoidal in [false, true] {
                for weak_pole in [false, true] {
                    let s = MotorStructure { weak_pole, ..structure(true, trapezoidal) };
                    let found = mean(|theta| k(&eccentric(pairs), &s, Some(&pole), theta));
                    assert!(found.iter().all(|x| x.abs() < 1e-6), "p {pairs} {trapezoidal} {weak_pole}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn the_published_laws_emf_has_the_stated_mean() {
        let raw = raw(&[(P::PolePairs, 4.0), (P::EccentricityStatic, ZETA), (P::EccentricityStaticPhase, PHI)]);
        let s = MotorStructure { dynamic_eccentricity: false, ..structure(false, false) };
        let found = mean(|theta| k(&raw, &s, None, theta));
        for j in 0..3 {
            let law = 0.5 * ZETA * (PHI - 2.0 * TAU * j as f64 / 3.0).sin();
            assert!((found[j] - law).abs() < 1e-12, "{found:?}");
        }
    }

    /// lambda_j as the module's head has it, by a sum of the shape over the angle.
    #[test]
    fn the_periodic_law_is_the_slope_of_a_flux() {
        let (raw, pairs) = (eccentric(2.0), 2.0);
        for trapezoidal in [false, true] {
            let s = structure(true, trapezoidal);
            let star = Star::<f64>::derive(&raw, &s, 1e-6);
            let linked = |theta: f64, j: usize| {
                let shift = TAU * j as f64 / 3.0;
                let f = if trapezoidal { star.trapezoid_flux(pairs * theta)[j] } else { -(pairs * theta - shift).cos() };
                f / pairs * (1.0 + ZETA * (PHI - shift).cos()) * (1.0 + 0.3 * (theta + 0.4 - shift).cos())
            };
            for n in 0..40 {
                let (theta, h) = (0.11 + TAU * f64::from(n) / 40.0, 1e-5);
                let found = k(&raw, &s, None, theta);
                for j in 0..3 {
                    let slope = (linked(theta + h, j) - linked(theta - h, j)) / (2.0 * h);
                    assert!((found[j] - slope).abs() < 1e-5, "{trapezoidal} {theta} {j}: {} {slope}", found[j]);
                }
            }
        }
    }

    #[test]
    fn without_eccentricity_both_laws_are_the_even_gap_to_the_bit() {
        let raw = raw(&[(P::PolePairs, 3.0), (P::EccentricityStaticPhase, PHI), (P::EccentricityDynamicPhase, 0.2)]);
        for trapezoidal in [false, true] {
            let even = MotorStructure { trapezoidal, ..MotorStructure::default() };
            for n in 0..50 {
                let theta = 0.37 * f64::from(n);
                let healthy = k(&raw, &even, None, theta);
                for periodic in [false, true] {
                    assert_eq!(k(&raw, &structure(periodic, trapezoidal), None, theta).map(f64::to_bits), healthy.map(f64::to_bits));
                }
            }
        }
    }
}
