//! Unbalanced magnetic pull: an eccentric rotor is drawn towards the narrow side of its gap.
//!
//! With a field of peak B over the gap, the pressure B^2 / (2 mu_0) summed round the rotor gives, to first order in the
//! eccentricity e (a fraction of the gap, magnets included), F = K e with K = pi R l B^2 / (2 mu_0). A static eccentricity
//! pulls in one direction, a dynamic one turns with the shaft; the bearings carry their sum.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;

variables! {
    /// Pull of an eccentric rotor.
    MagneticPullParameter, MAGNETIC_PULL {
        MagneticPull => "magnetic_pull", "K_u", "N", NonNegative, Plant, Some(0.0), "radial pull on the rotor per relative eccentricity, pi R l B^2/(2 mu_0); 0: not counted. ASSUMED example: 490 N for R = 16 mm, l = 50 mm, B = 0.7 T",
            when(&[Either(&[
                Away("motor.eccentricity_static", 0.0), Away("motor.eccentricity_dynamic", 0.0), Away("motor.unbalance_inertia", 0.0),
            ])]);
    }
}

/// Where the rotor stands in its bore, in fractions of the gap.
#[derive(Clone, Copy, Debug)]
pub struct Eccentricity<S> {
    fixed: S,
    /// The dynamic eccentricity at the rotor's zero, along the static one and across it.
    along: S,
    across: S,
}

impl<S: Scalar> Eccentricity<S> {
    /// `fixed` is the static eccentricity, `turning` the dynamic one times cosine and sine of its mechanical phase.
    pub fn new(fixed: S, [along, across]: [S; 2]) -> Self {
        Self { fixed, along, across }
    }

    /// Along the static eccentricity and across it, at a rotor angle.
    #[inline(always)]
    pub fn at(&self, angle: S) -> [S; 2] {
        let (sin, cos) = angle.sin_cos();
        [self.along.fma(cos, self.across.fma(sin, self.fixed)), self.along.fma(sin, -(self.across * cos))]
    }
}

#[derive(Clone, Copy, Debug)]
pub struct MagneticPull<S> {
    per_eccentricity: S,
}

impl<S: Scalar> MagneticPull<S> {
    /// Is there any?
    pub fn needed(view: &View<MagneticPullParameter>) -> bool {
        view.away(MagneticPullParameter::MagneticPull)
    }

    pub fn derive(raw: &[S]) -> Self {
        Self { per_eccentricity: raw[MagneticPullParameter::MagneticPull as usize] }
    }

    /// Radial force on the bearings at a rotor angle.
    #[inline(always)]
    pub fn force(&self, eccentricity: &Eccentricity<S>, angle: S) -> S {
        let [x, y] = eccentricity.at(angle);
        self.per_eccentricity * x.fma(x, y * y).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(fixed: f64, turning: f64, angle: f64) -> f64 {
        let eccentricity = Eccentricity::new(fixed, [turning * 0.2_f64.cos(), turning * 0.2_f64.sin()]);
        MagneticPull::derive(&[490.0]).force(&eccentricity, angle)
    }

    #[test]
    fn one_eccentricity_pulls_evenly() {
        for angle in [0.0, 0.7, 2.9] {
            assert!((force(0.1, 0.0, angle) - 49.0).abs() < 1e-12);
            assert!((force(0.0, 0.2, angle) - 98.0).abs() < 1e-12);
            assert_eq!(force(0.0, 0.0, angle), 0.0);
        }
    }

    #[test]
    fn both_add_as_vectors_once_a_turn() {
        assert!((force(0.1, 0.04, 0.2) - 490.0 * 0.14).abs() < 1e-10);
        assert!((force(0.1, 0.04, std::f64::consts::PI + 0.2) - 490.0 * 0.06).abs() < 1e-10);
    }
}
