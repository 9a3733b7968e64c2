//! What the temperature of the lubricant does to friction and efficiency. P leaves temperature out; the curves are ASSUMED:
//! viscosity by Reynolds' exponential law, the load-independent friction of a rolling contact with its power 2/3 (Palmgren),
//! the efficiency losses growing linearly with cold.

use crate::scalar::Scalar;
use crate::variables;

variables! {
    /// The grease of gearbox, screw and bearings.
    LubricantParameter, LUBRICANT {
        Temperature => "temperature", "T_l", "K", Positive, Plant, Some(293.15), "temperature of the lubricant";
        Reference => "reference", "-", "K", Positive, Plant, Some(293.15), "temperature at which friction tables and efficiencies were taken";
        ViscosityRate => "viscosity_rate", "beta", "1/K", NonNegative, Plant, Some(0.0), "relative loss of viscosity per kelvin (Reynolds' law)";
        ViscosityExponent => "viscosity_exponent", "-", "1", NonNegative, Plant, Some(2.0 / 3.0), "power of the viscosity in the viscous part of the friction tables";
        LossRate => "loss_rate", "-", "1/K", NonNegative, Plant, Some(0.0), "relative growth of the losses 1/eta - 1 per kelvin below the reference";
    }
}

/// Factors at the lubricant's temperature; 1 at the reference.
#[derive(Clone, Copy, Debug)]
pub struct Lubricant<S> {
    /// On the part of the friction that grows with speed.
    pub viscous: S,
    /// On 1/eta - 1.
    pub loss: S,
}

impl<S: Scalar> Lubricant<S> {
    pub fn derive(raw: &[S]) -> Self {
        use LubricantParameter as P;
        let g = |p: P| raw[p as usize];
        let colder = g(P::Reference) - g(P::Temperature);
        let same = colder.equals(S::zero());
        let viscous = (g(P::ViscosityExponent) * g(P::ViscosityRate) * colder).exp();
        // Far above the reference a loss stays a loss.
        let loss = g(P::LossRate).fma(colder, S::one()).maximum(S::splat(0.1));
        Self { viscous: S::anchor(same, S::one(), viscous), loss: S::anchor(same, S::one(), loss) }
    }

    /// An efficiency with its loss scaled.
    pub fn efficiency(&self, eta: S) -> S {
        let scaled = S::one() / (S::one() + self.loss * (S::one() / eta - S::one()));
        S::anchor(self.loss.equals(S::one()), eta, scaled)
    }

    /// A table of friction over rising speeds: what it has grown above its least value so far is viscous.
    pub fn friction<const N: usize>(&self, table: [S; N]) -> [S; N] {
        let mut least = table[0];
        table.map(|force| {
            least = least.minimum(force);
            let scaled = self.viscous.fma(force - least, least);
            S::anchor(self.viscous.equals(S::one()), force, scaled)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(kelvin: f64) -> Lubricant<f64> {
        Lubricant::derive(&[kelvin, 293.15, 0.05, 2.0 / 3.0, 0.001])
    }

    #[test]
    fn at_the_reference_no_bit_changes() {
        let table = [345.0, 290.0, 330.1];
        assert_eq!(at(293.15).friction(table), table);
        assert_eq!(at(293.15).efficiency(0.56), 0.56);
    }

    #[test]
    fn cold_thickens_what_grows_with_speed_and_leaves_mixed_friction() {
        let cold = at(233.15);
        let factor = (2.0_f64 / 3.0 * 0.05 * 60.0).exp();
        let [mixed, least, viscous] = cold.friction([345.0, 290.0, 330.0]);
        assert_eq!((mixed, least), (345.0, 290.0));
        assert!((viscous - (290.0 + 40.0 * factor)).abs() < 1e-9);
        assert!((1.0 / cold.efficiency(0.8) - 1.0 - 0.25 * 1.06).abs() < 1e-12);
        assert!(at(343.15).efficiency(0.8) > 0.8);
    }
}
