//! What the temperature of the lubricant does to friction and efficiency. The papers leave temperature out; the curves are
//! ASSUMED: viscosity by Reynolds' exponential law, the load-independent friction of a rolling contact with its power 2/3
//! (Palmgren), dry friction and efficiency losses growing linearly with cold.

use crate::kept;
use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;

variables! {
    /// The grease of gearbox, screw and bearings.
    LubricantParameter, LUBRICANT {
        Reference => "reference", "-", "K", Positive, Plant, Some(293.15), "temperature of the lubricant at which friction and efficiencies were taken",
            when(&[Either(&[Away("lubricant.viscosity_rate", 0.0), Away("lubricant.loss_rate", 0.0), Away("lubricant.dry_rate", 0.0)])]);
        ViscosityRate => "viscosity_rate", "beta", "1/K", NonNegative, Plant, Some(0.0), "relative loss of viscosity per kelvin (Reynolds' law); 0: the viscous friction knows no temperature";
        ViscosityExponent => "viscosity_exponent", "-", "1", NonNegative, Plant, Some(2.0 / 3.0), "power of the viscosity in the viscous friction (Palmgren's of a rolling contact)",
            when(&[Away("lubricant.viscosity_rate", 0.0)]);
        LossRate => "loss_rate", "-", "1/K", NonNegative, Plant, Some(0.0), "relative growth of the losses 1/eta - 1 per kelvin below the reference";
        DryRate => "dry_rate", "-", "1/K", NonNegative, Plant, Some(0.0), "relative growth of the dry friction per kelvin below the reference";
    }
}

/// The laws of a lubricant.
#[derive(Clone, Copy, Debug)]
pub struct Grease<S> {
    reference: S,
    viscosity: S,
    loss: S,
    dry: S,
}

/// Factors at the lubricant's temperature; 1 at the reference.
#[derive(Clone, Copy, Debug)]
pub struct Lubricant<S> {
    /// On the part of the friction that grows with speed.
    pub viscous: S,
    /// On the part that does not.
    pub dry: S,
    /// On 1/eta - 1.
    pub loss: S,
}

kept!(Lubricant<f64> as Lubricant { viscous, dry, loss });

impl<S: Scalar> Grease<S> {
    pub fn derive(raw: &[S]) -> Self {
        use LubricantParameter as P;
        let g = |p: P| raw[p as usize];
        Self {
            reference: g(P::Reference),
            viscosity: g(P::ViscosityExponent) * g(P::ViscosityRate),
            loss: g(P::LossRate),
            dry: g(P::DryRate),
        }
    }

    /// Does the temperature change anything?
    pub fn needed(view: &View<LubricantParameter>) -> bool {
        view.any_away([LubricantParameter::ViscosityRate, LubricantParameter::LossRate, LubricantParameter::DryRate])
    }

    pub fn at(&self, temperature: S) -> Lubricant<S> {
        let colder = self.reference - temperature;
        let same = colder.equals(S::zero());
        // Far above the reference a loss stays a loss.
        let linear = |rate: S| S::anchor(same, S::one(), rate.fma(colder, S::one()).maximum(S::splat(0.1)));
        let viscous = S::anchor(same, S::one(), (self.viscosity * colder).exp());
        Lubricant { viscous, dry: linear(self.dry), loss: linear(self.loss) }
    }
}

impl<S: Scalar> Lubricant<S> {
    /// As at the reference.
    pub fn reference() -> Self {
        let one = S::one();
        Self { viscous: one, dry: one, loss: one }
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
            let scaled = self.viscous.fma(force - least, self.dry * least);
            S::anchor(self.viscous.equals(S::one()) & self.dry.equals(S::one()), force, scaled)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grease(dry: f64) -> Grease<f64> {
        Grease::derive(&[293.15, 0.05, 2.0 / 3.0, 0.001, dry])
    }

    fn at(kelvin: f64) -> Lubricant<f64> {
        grease(0.0).at(kelvin)
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

    #[test]
    fn cold_raises_the_dry_part_in_proportion_and_heat_leaves_a_tenth_of_it() {
        let factor = (2.0_f64 / 3.0 * 0.05 * 60.0).exp();
        let cold = grease(0.002).at(233.15);
        assert!((cold.dry - 1.12).abs() < 1e-12);
        let [mixed, least, viscous] = cold.friction([345.0, 290.0, 330.0]);
        assert!((mixed - 345.0 * 1.12).abs() < 1e-9 && (least - 290.0 * 1.12).abs() < 1e-9);
        assert!((viscous - (290.0 * 1.12 + 40.0 * factor)).abs() < 1e-9);
        assert_eq!(grease(0.02).at(373.15).dry, 0.1);
        assert_eq!(grease(0.02).at(293.15).dry, 1.0);
    }
}
