//! Backlash: the play operator (T1 eq. 3) and the elastic, damped dead zone between two masses.

use crate::scalar::Scalar;
use crate::{choices, variables};

choices! {
    PlayModel { Operator "operator", Elastic "elastic" }
}

variables! {
    /// Play between motor and user, measured at the user.
    PlayParameter, PLAY {
        Total => "total", "2 BLK", "rad", NonNegative, Plant, None, "total play, twice the half amplitude BLK of the papers";
        Extra => "extra", "-", "rad", NonNegative, Plant, Some(0.0), "healthy 0; play added by wear";
        Model => "model", "-", "1", Choice(PlayModel::NAMES), Plant, Some(0.0), "the play operator, or two masses with an elastic, damped dead zone",
            high_only("it keeps the play operator: two masses on a contact need the steps of the high one");
        Stiffness => "stiffness", "K", "N m/rad", Positive, Plant, Some(1e4), "contact stiffness at the user (elastic model)",
            high_only("it keeps the play operator: two masses on a contact need the steps of the high one").when(&[Chosen("play.model", &["elastic"])]);
        Damping => "damping", "C", "N m s/rad", NonNegative, Plant, Some(0.0), "contact damping at the user (elastic model)",
            high_only("it keeps the play operator: two masses on a contact need the steps of the high one").when(&[Chosen("play.model", &["elastic"])]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Play<S> {
    pub half: S,
    stiffness: S,
    damping: S,
}

impl<S: Scalar> Play<S> {
    pub fn derive(raw: &[S]) -> Self {
        use PlayParameter as P;
        let g = |p: P| raw[p as usize];
        Self { half: S::splat(0.5) * (g(P::Total) + g(P::Extra)), stiffness: g(P::Stiffness), damping: g(P::Damping) }
    }

    /// User position dragged by `driver` through the play (T1 eq. 3).
    #[inline(always)]
    pub fn drag(&self, driver: S, user: S) -> S {
        user.clamp(driver - self.half, driver + self.half)
    }

    /// The same where worn teeth add `lag` to half the play.
    #[inline(always)]
    pub fn drag_worn(&self, driver: S, user: S, lag: S) -> S {
        let half = self.half + lag;
        user.clamp(driver - half, driver + half)
    }

    /// Torque on the user of the elastic dead zone; it only pushes, never pulls. `lag` is what worn teeth add.
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
