//! Backlash: the backlash operator (T1 eq. 3) and the elastic, damped dead zone between two masses. Rigid flanks under a load
//! are those of the shaft (`actuator/servo/shaft/flank.rs`).

use crate::scalar::Scalar;
use crate::{choices, variables};

choices! {
    BacklashModel { Operator "operator", Elastic "elastic" }
}

variables! {
    /// Backlash between motor and output, measured at the output.
    BacklashParameter, BACKLASH {
        Total => "total", "2 BLK", "rad", NonNegative, Plant, None, "total backlash, twice the half amplitude BLK of the papers";
        Extra => "extra", "-", "rad", NonNegative, Plant, Some(0.0), "healthy 0; backlash added by wear, at the output";
        Model => "model", "-", "1", Choice(BacklashModel::NAMES), Plant, Some(0.0), "the backlash operator, rigid flanks where a force or friction acts on the output; or two masses with an elastic, damped dead zone. The reduced-order model keeps rigid flanks, and what acts on the output winds up the stiffness behind them in proportion";
        Stiffness => "stiffness", "K", "N m/rad", Positive, Plant, Some(1e4), "contact stiffness at the output (elastic model)",
            when(&[Chosen("backlash.model", &["elastic"])]);
        Damping => "damping", "C", "N m s/rad", NonNegative, Plant, Some(0.0), "contact damping at the output (elastic model)",
            high_only("it has rigid flanks on a stiffness: two masses on a contact need the steps of the switching model").when(&[Chosen("backlash.model", &["elastic"])]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Backlash<S> {
    pub half: S,
    pub stiffness: S,
    pub damping: S,
}

impl<S: Scalar> Backlash<S> {
    pub fn derive(raw: &[S]) -> Self {
        use BacklashParameter as P;
        let g = |p: P| raw[p as usize];
        Self { half: S::splat(0.5) * (g(P::Total) + g(P::Extra)), stiffness: g(P::Stiffness), damping: g(P::Damping) }
    }

    pub fn of(half: S, stiffness: S, damping: S) -> Self {
        Self { half, stiffness, damping }
    }

    /// Output position, carried along by `driver` through the backlash (T1 eq. 3).
    #[inline(always)]
    pub fn follow(&self, driver: S, output: S) -> S {
        output.clamp(driver - self.half, driver + self.half)
    }

    /// The same where worn teeth add `lag` to half the backlash.
    #[inline(always)]
    pub fn follow_worn(&self, driver: S, output: S, lag: S) -> S {
        let half = self.half + lag;
        output.clamp(driver - half, driver + half)
    }

    /// Torque on the output of the elastic dead zone; it only pushes, never pulls. `lag` is what worn teeth add.
    #[inline(always)]
    pub fn contact(&self, displacement: S, rate: S, lag: S) -> S {
        let zero = S::zero();
        let beyond = displacement - displacement.clamp_abs(self.half + lag);
        let torque = self.stiffness * beyond + self.damping * rate;
        let above = zero.lt(beyond);
        let below = beyond.lt(zero);
        S::select(above, torque.maximum(zero), S::select(below, torque.minimum(zero), zero))
    }
}
