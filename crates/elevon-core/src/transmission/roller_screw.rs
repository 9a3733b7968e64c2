//! Planetary roller screw with load-dependent efficiency (P 2.1.3, 4.1.2 and Fig. 4.9).

use crate::scalar::Scalar;
use crate::transmission::lubricant::Lubricant;
use crate::variables;

variables! {
    /// The screw, its nut and the ram.
    ScrewParameter, SCREW {
        Lead => "lead", "p_s", "m/rad", Positive, Plant, None, "travel of the nut per radian of the screw";
        Inertia => "inertia", "J_s", "kg m2", NonNegative, Plant, None, "inertia of the screw, at the screw";
        MovingMass => "moving_mass", "m_n", "kg", NonNegative, Plant, None, "mass of ram and nut";
        EfficiencyUnloaded => "efficiency_unloaded", "eta_0", "1", Fraction, Plant, None, "efficiency at no load";
        EfficiencyLoaded => "efficiency_loaded", "eta_inf", "1", Fraction, Plant, None, "efficiency at very high load";
        EfficiencyForce => "efficiency_force", "F_c", "N", Positive, Plant, None, "load over which the efficiency falls e-fold";
        EfficiencyScale => "efficiency_scale", "-", "1", Fraction, Plant, Some(1.0), "healthy 1; less: the efficiency is lost";
        Preload => "preload", "F_pr", "N", Positive, Plant, None, "preload of the nut; its friction 2 F_pr (1/eta_0 - 1) is part of the friction tables and is not added again",
            nowhere("the friction tables contain its friction; it is there for reference");
        JamForce => "jam_force", "F_jam", "N", NonNegative, Plant, Some(0.0), "resistive force where the screw is jammed; 0: none";
        JamPosition => "jam_position", "-", "m", Any, Plant, Some(0.0), "middle of the jammed travel of the nut",
            when(&[Away("screw.jam_force", 0.0), Away("screw.jam_width", 0.0)]);
        JamWidth => "jam_width", "-", "m", NonNegative, Plant, Some(0.0), "length of the jammed travel; 0: jammed wherever it is",
            when(&[Away("screw.jam_force", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct RollerScrew<S> {
    /// Screw angle per travel.
    pub turns: S,
    loaded: S,
    excess: S,
    per_force: S,
    scale: S,
    jam_force: S,
    jam_position: S,
    jam_half: S,
}

impl<S: Scalar> RollerScrew<S> {
    pub fn derive(raw: &[S], lubricant: &Lubricant<S>) -> Self {
        use ScrewParameter as P;
        let g = |p: P| raw[p as usize];
        let loaded = lubricant.efficiency(g(P::EfficiencyLoaded));
        Self {
            turns: S::one() / g(P::Lead),
            loaded,
            excess: lubricant.efficiency(g(P::EfficiencyUnloaded)) - loaded,
            per_force: S::one() / g(P::EfficiencyForce),
            scale: g(P::EfficiencyScale),
            jam_force: g(P::JamForce),
            jam_position: g(P::JamPosition),
            jam_half: S::splat(0.5) * g(P::JamWidth),
        }
    }

    /// eta_s(F) = eta_inf + (eta_0 - eta_inf) exp(-|F| / F_c).
    #[inline(always)]
    pub fn efficiency(&self, force: S) -> S {
        let falling = (-(force.abs() * self.per_force)).exp();
        self.excess.fma(falling, self.loaded) * self.scale
    }

    /// Friction force of a load through a train of efficiency `eta`, for either sign of the load: an aiding load sees
    /// eta' = 2 - 1/eta and cannot drive back at eta <= 1/2.
    #[inline(always)]
    pub fn load_friction(force: S, eta: S) -> S {
        (S::one() / eta - S::one()) * force.abs()
    }

    /// Resistive force of a jam at this nut position.
    #[inline(always)]
    pub fn jam(&self, nut: S) -> S {
        let there = (nut - self.jam_position).abs().le(self.jam_half) | self.jam_half.le(S::zero());
        S::select(there, self.jam_force, S::zero())
    }
}
