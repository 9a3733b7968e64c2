//! Down-lock: beyond the stroke the nut works a spring-loaded sleeve that spreads the locking segments.
//! `s` is the nut's travel beyond the stroke.

use crate::scalar::Scalar;
use crate::variables;

variables! {
    /// The down-lock.
    LockParameter, LOCK {
        Travel => "travel", "s_max", "m", Positive, Plant, None, "nut travel beyond the stroke";
        EngageTravel => "engage_travel", "s_on", "m", Positive, Plant, None, "travel at which the segments are supported: locked";
        ReleaseTravel => "release_travel", "s_off", "m", Positive, Plant, None, "travel, moving back, at which they let go";
        SpringForce => "spring_force", "F_0", "N", NonNegative, Plant, None, "sleeve spring at the end of the stroke, pushing the nut on";
        SpringRate => "spring_rate", "k", "N/m", NonNegative, Plant, None, "loss of spring force over the travel";
        SpringScale => "spring_scale", "-", "1", Unit, Plant, Some(1.0), "healthy 1; less: the sleeve spring is weak";
        Stiffness => "stiffness", "k_lock", "N/m", Positive, Plant, None, "ram against the locked segments";
        Strength => "strength", "-", "N", Positive, Plant, None, "load that breaks the segments: the run ends";
        Overtravel => "overtravel", "-", "m", NonNegative, Plant, Some(1e-3), "travel left behind s_max before the nut meets its stop";
        Blocked => "blocked", "-", "1", Flag, Plant, Some(0.0), "1: the sleeve blocks, the lock does not engage";
        BlockTravel => "block_travel", "-", "m", NonNegative, Plant, Some(5e-4), "travel at which a blocked sleeve stops the nut";
        Stuck => "stuck", "-", "1", Flag, Plant, Some(0.0), "1: the segments of an engaged lock stay";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Lock<S> {
    engage: S,
    release: S,
    force: S,
    rate: S,
    pub per_stiffness: S,
    pub per_strength: S,
    /// Travel at which the nut is stopped.
    pub end: S,
    stuck: S,
}

impl<S: Scalar> Lock<S> {
    pub fn derive(raw: &[S]) -> Self {
        use LockParameter as P;
        let g = |p: P| raw[p as usize];
        let blocked = S::splat(0.5).le(g(P::Blocked));
        Self {
            engage: g(P::EngageTravel),
            release: g(P::ReleaseTravel),
            force: g(P::SpringForce) * g(P::SpringScale),
            rate: g(P::SpringRate) * g(P::SpringScale),
            per_stiffness: S::one() / g(P::Stiffness),
            per_strength: S::one() / g(P::Strength),
            end: S::select(blocked, g(P::BlockTravel), g(P::Travel) + g(P::Overtravel)),
            stuck: g(P::Stuck),
        }
    }

    /// Spring force on the nut, towards extension.
    #[inline(always)]
    pub fn spring(&self, travel: S) -> S {
        let force = (self.force - self.rate * travel).maximum(S::zero());
        S::select(S::zero().lt(travel), force, S::zero())
    }

    /// Locked (1) or not after a step at `travel`.
    #[inline(always)]
    pub fn engaged(&self, before: S, travel: S) -> S {
        let before_end = S::select(travel.le(self.release) & self.stuck.lt(S::splat(0.5)), S::zero(), before);
        S::select(self.engage.le(travel), S::one(), before_end)
    }

    /// Does a stuck lock hold the nut back at this travel?
    #[inline(always)]
    pub fn holds_back(&self, engaged: S, travel: S) -> S::Mask {
        S::splat(0.5).le(self.stuck) & S::splat(0.5).lt(engaged) & travel.le(S::zero())
    }
}
