//! Flux linkages of a salient, saturating motor: what the currents add to the magnets' flux, in the rotor's frame.
//!
//! A coenergy in closed form gives both linkages, so that cross-saturation is reciprocal and no energy is lost or made:
//!
//!     s = 1 / sqrt(1 + (i_q^2 + xi (i_d + i_0)^2) / I_s^2)
//!     psi_q = L s i_q,   psi_d = k / p + xi L (s (i_d + i_0) - s_0 i_0),   s_0 = s at no current
//!
//! Torque 3/2 p (psi_d i_q - psi_q i_d), stored energy 3/2 int i dpsi. With xi = 1 and I_s = 0 the linkages are L i and none of this code runs.

use crate::motor::star::MotorParameter;
use crate::scalar::{three_phase, Scalar};
use crate::variable::View;
use crate::{three, variables};

variables! {
    /// Saliency and saturation of the motor.
    FluxMapParameter, FLUX_MAP {
        Saliency => "saliency", "xi", "1", Positive, Plant, Some(1.0), "direct over quadrature inductance, L_d / L_q, with nothing saturated; motor.winding_inductance is L_q. 1: magnets on the surface; below 1: buried";
        SaturationCurrent => "saturation_current", "I_s", "A", NonNegative, Plant, Some(0.0), "quadrature current, peak, at which the iron leaves 1/sqrt 2 of its flux; 0: the flux does not saturate";
        SaturationBias => "saturation_bias", "i_0", "A", NonNegative, Plant, Some(0.0), "direct current, peak, that would saturate the iron as the magnets do; with it a quadrature current weakens the magnets' flux",
            when(&[Away("motor.saturation_current", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct FluxMap<S> {
    pub pole_pairs: S,
    /// L_q and L_d, nothing saturated.
    quadrature: S,
    direct: S,
    saliency: S,
    /// 1 / I_s^2; none: no saturation.
    per_square: S,
    bias: S,
    at_rest: S,
}

/// Linkages without the magnets' and their slopes at a current (d, q).
#[derive(Clone, Copy, Debug)]
pub struct Linked<S> {
    pub flux: [S; 2],
    /// dpsi_d/di_d, dpsi_d/di_q = dpsi_q/di_d, dpsi_q/di_q.
    pub slope: [S; 3],
}

/// What the map makes of the three phases at a rotor angle and their currents.
#[derive(Clone, Copy, Debug)]
pub struct MappedPhases<S> {
    /// EMF of the phases in addition to the magnets', over the mechanical speed.
    pub emf: [S; 3],
    /// Slopes of the currents per flux (d, dq, q), and the phases' directions.
    inverse: [S; 3],
    sines: [S; 3],
    cosines: [S; 3],
}

impl<S: Scalar> FluxMap<S> {
    /// Are the linkages other than L i?
    pub fn needed(view: &View<FluxMapParameter>) -> bool {
        view.away(FluxMapParameter::Saliency) || view.away(FluxMapParameter::SaturationCurrent)
    }

    pub fn derive(raw: &[S], motor: &[S]) -> Self {
        use FluxMapParameter as P;
        let (zero, one) = (S::zero(), S::one());
        let (quadrature, saliency, limit) =
            (motor[MotorParameter::WindingInductance as usize], raw[P::Saliency as usize], raw[P::SaturationCurrent as usize]);
        let saturates = zero.lt(limit);
        let mut map = Self {
            pole_pairs: motor[MotorParameter::PolePairs as usize],
            quadrature,
            direct: saliency * quadrature,
            saliency,
            per_square: S::select(saturates, one / S::select(saturates, limit * limit, one), zero),
            bias: S::select(saturates, raw[P::SaturationBias as usize], zero),
            at_rest: one,
        };
        map.at_rest = map.saturation(zero, zero);
        map
    }

    /// s at a current.
    #[inline(always)]
    fn saturation(&self, i_d: S, i_q: S) -> S {
        let along = i_d + self.bias;
        let square = self.saliency.fma(along * along, i_q * i_q);
        S::one() / self.per_square.fma(square, S::one()).sqrt()
    }

    #[inline(always)]
    pub fn at(&self, [i_d, i_q]: [S; 2]) -> Linked<S> {
        let along = i_d + self.bias;
        let s = self.saturation(i_d, i_q);
        let bend = s * s * s * self.per_square;
        Linked {
            flux: [self.direct * (s * along - self.at_rest * self.bias), self.quadrature * s * i_q],
            slope: [
                self.direct * (s - bend * self.saliency * along * along),
                -(self.direct * bend * along * i_q),
                self.quadrature * (s - bend * i_q * i_q),
            ],
        }
    }

    /// Torque of the linkages without the magnets'.
    #[inline(always)]
    pub fn torque(&self, [i_d, i_q]: [S; 2]) -> S {
        let [psi_d, psi_q] = self.at([i_d, i_q]).flux;
        S::splat(1.5) * self.pole_pairs * (psi_d * i_q - psi_q * i_d)
    }

    /// Energy of the field that the currents have added, 3/2 (i psi - coenergy).
    #[inline(always)]
    pub fn energy(&self, [i_d, i_q]: [S; 2]) -> S {
        let (zero, half) = (S::zero(), S::splat(0.5));
        let [psi_d, psi_q] = self.at([i_d, i_q]).flux;
        let s = self.saturation(i_d, i_q);
        let saturates = zero.lt(self.per_square);
        let square = S::one() / S::select(saturates, self.per_square, S::one());
        let level = self.direct * self.at_rest * self.bias * i_d;
        let saturated = (self.quadrature * square).fma(S::one() / s - S::one() / self.at_rest, -level);
        let straight = half * (self.direct * i_d * i_d + self.quadrature * i_q * i_q);
        S::splat(1.5) * (psi_d * i_d + psi_q * i_q - S::select(saturates, saturated, straight))
    }

    /// The phases at the electrical angle of this sine and cosine, their currents `i`.
    #[inline(always)]
    pub fn phases(&self, [sin, cos]: [S; 2], i: [S; 3]) -> MappedPhases<S> {
        let (sines, cosines) = three_phase(sin, cos);
        let [i_d, i_q] = along(i, sines, cosines);
        let Linked { flux: [psi_d, psi_q], slope: [dd, dq, qq] } = self.at([i_d, i_q]);
        // Currents that stand in the phases turn in the rotor's frame.
        let turning = [dd * i_q - dq * i_d - psi_q, dq * i_q - qq * i_d + psi_d];
        let per_determinant = S::one() / (dd * qq - dq * dq);
        let emf = across([self.pole_pairs * turning[0], self.pole_pairs * turning[1]], sines, cosines);
        MappedPhases { emf, inverse: [qq * per_determinant, -(dq * per_determinant), dd * per_determinant], sines, cosines }
    }

    /// Currents (d, q) of the phases.
    #[inline(always)]
    pub fn currents(&self, [sin, cos]: [S; 2], i: [S; 3]) -> [S; 2] {
        let (sines, cosines) = three_phase(sin, cos);
        along(i, sines, cosines)
    }
}

impl<S: Scalar> MappedPhases<S> {
    /// Change of the phase currents per second under voltages less all EMFs and drops of the resistance.
    #[inline(always)]
    pub fn rise(&self, drop: [S; 3]) -> [S; 3] {
        let [d, q] = along(drop, self.sines, self.cosines);
        let [dd, dq, qq] = self.inverse;
        across([dd * d + dq * q, dq * d + qq * q], self.sines, self.cosines)
    }

    /// Change of the current of phase `j` per second and volt on phase `k`.
    #[inline(always)]
    pub fn reach(&self, j: usize, k: usize) -> S {
        let [dd, dq, qq] = self.inverse;
        let (s, c) = (&self.sines, &self.cosines);
        S::splat(2.0 / 3.0) * (qq * s[j] * s[k] + dd * c[j] * c[k] - dq * (s[j] * c[k] + c[j] * s[k]))
    }
}

/// Components (d, q) of three phase quantities.
#[inline(always)]
fn along<S: Scalar>(x: [S; 3], sines: [S; 3], cosines: [S; 3]) -> [S; 2] {
    let two_thirds = S::splat(2.0 / 3.0);
    let dot = |y: [S; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    [-(two_thirds * dot(cosines)), two_thirds * dot(sines)]
}

/// Three phase quantities of components (d, q).
#[inline(always)]
fn across<S: Scalar>([d, q]: [S; 2], sines: [S; 3], cosines: [S; 3]) -> [S; 3] {
    three!(|j| q * sines[j] - d * cosines[j])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::star::MOTOR;

    fn map(saliency: f64, limit: f64, bias: f64) -> FluxMap<f64> {
        let mut motor = vec![0.0; MOTOR.len()];
        motor[MotorParameter::PolePairs as usize] = 4.0;
        motor[MotorParameter::WindingInductance as usize] = 0.03;
        FluxMap::derive(&[saliency, limit, bias], &motor)
    }

    #[test]
    fn without_saturation_the_linkages_are_inductances() {
        let m = map(0.6, 0.0, 5.0);
        let x = m.at([-3.0, 4.0]);
        assert_eq!(x.slope, [0.018, 0.0, 0.03]);
        assert!((x.flux[0] + 0.054).abs() < 1e-15 && (x.flux[1] - 0.12).abs() < 1e-15);
        // 3/2 p (L_d - L_q) i_d i_q, 3/4 (L_d i_d^2 + L_q i_q^2).
        assert!((m.torque([-3.0, 4.0]) - 1.5 * 4.0 * (-0.012) * (-12.0)).abs() < 1e-12);
        assert!((m.energy([-3.0, 4.0]) - 0.75 * (0.018 * 9.0 + 0.03 * 16.0)).abs() < 1e-12);
    }

    #[test]
    fn at_the_saturation_current_the_flux_is_that_share() {
        let m = map(1.0, 10.0, 0.0);
        assert!((m.at([0.0, 10.0]).flux[1] - 0.3 / 2.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(map(1.0, 10.0, 4.0).at([0.0; 2]).flux, [0.0; 2]);
        // A quadrature current weakens the magnets.
        assert!(map(1.0, 10.0, 4.0).at([0.0, 8.0]).flux[0] < -1e-3);
    }

    #[test]
    fn slopes_are_those_of_the_linkages_and_energy_is_their_integral() {
        let (m, h) = (map(0.7, 8.0, 5.0), 1e-5);
        for [d, q] in [[-3.0, 4.0], [2.0, -7.0], [0.0, 12.0]] {
            let x = m.at([d, q]);
            let by = |dd: f64, dq: f64| (m.at([d + dd, q + dq]), m.at([d - dd, q - dq]));
            for (step, expected) in [([h, 0.0], [x.slope[0], x.slope[1]]), ([0.0, h], [x.slope[1], x.slope[2]])] {
                let (up, down) = by(step[0], step[1]);
                for k in 0..2 {
                    let slope = (up.flux[k] - down.flux[k]) / (2.0 * h);
                    assert!((slope - expected[k]).abs() < 1e-9, "{slope} {}", expected[k]);
                }
                let work = 1.5 * (d * (up.flux[0] - down.flux[0]) + q * (up.flux[1] - down.flux[1]));
                let kept = m.energy([d + step[0], q + step[1]]) - m.energy([d - step[0], q - step[1]]);
                assert!((work - kept).abs() < 1e-11, "{work} {kept}");
            }
        }
        assert!(m.energy([0.0; 2]).abs() < 1e-15);
    }

    /// With equal inductances the phases see what a plain winding does.
    #[test]
    fn a_plain_winding_is_a_special_case() {
        let m = map(1.0, 0.0, 0.0);
        let i = [2.0, -3.0, 1.0];
        let x = m.phases([0.3_f64.sin(), 0.3_f64.cos()], i);
        assert!(x.emf.iter().all(|e| e.abs() < 1e-15), "{:?}", x.emf);
        let rise = x.rise([5.0, -1.0, -4.0]);
        for (got, volts) in rise.iter().zip([5.0, -1.0, -4.0]) {
            assert!((got - volts / 0.03).abs() < 1e-10);
        }
        assert!((x.reach(0, 1) + 1.0 / 0.09).abs() < 1e-10 && (x.reach(1, 1) - 2.0 / 0.09).abs() < 1e-10);
    }
}
