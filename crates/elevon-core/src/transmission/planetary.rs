//! Two planetary stages with the free-fall release between them, and the governor that limits the fall.

use crate::scalar::Scalar;
use crate::transmission::lubricant::Lubricant;
use crate::{choices, variables};

variables! {
    /// The gearbox; inertias stand at its output.
    PlanetaryParameter, PLANETARY {
        RatioFirst => "ratio_first", "tau_1", "1", AtLeast(1.0), Plant, None, "ratio of the first stage";
        RatioSecond => "ratio_second", "tau_2", "1", AtLeast(1.0), Plant, None, "ratio of the second stage";
        EfficiencyFirst => "efficiency_first", "eta_g1", "1", Fraction, Plant, None, "efficiency of the first stage";
        EfficiencySecond => "efficiency_second", "eta_g2", "1", Fraction, Plant, None, "efficiency of the second stage";
        InertiaFirst => "inertia_first", "J_g1", "kg m2", NonNegative, Plant, None, "inertia of the first stage, at the screw; stays with the motor at free fall";
        InertiaSecond => "inertia_second", "J_g2", "kg m2", NonNegative, Plant, None, "inertia of the second stage, at the screw; stays with the screw at free fall";
    }
}

choices! {
    /// The stages at the start.
    ReleaseOpen { No "no", Yes "yes" }
}

variables! {
    /// The manual release between the stages.
    ReleaseParameter, RELEASE {
        Time => "time", "-", "s", NonNegative, Plant, None, "from the command until the stages are apart";
        GovernorSpeed => "governor_speed", "v_0", "m/s", NonNegative, Plant, None, "ram speed above which the governor brakes a released extension";
        GovernorCoefficient => "governor_coefficient", "c", "N s2/m2", NonNegative, Plant, None, "governor force c (v^2 - v_0^2)";
        Open => "open", "-", "1", Choice(ReleaseOpen::NAMES), Plant, Some(0.0), "yes: released from the start";
        CableFailed => "cable_failed", "-", "1", Flag, Plant, Some(0.0), "1: the cable of the free-fall release does not pull";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Planetary<S> {
    /// Motor speed over screw speed.
    pub ratio: S,
    pub efficiency: S,
    pub efficiency_second: S,
}

impl<S: Scalar> Planetary<S> {
    pub fn derive(raw: &[S], lubricant: &Lubricant<S>) -> Self {
        use PlanetaryParameter as P;
        let g = |p: P| raw[p as usize];
        let second = lubricant.efficiency(g(P::EfficiencySecond));
        Self {
            ratio: g(P::RatioFirst) * g(P::RatioSecond),
            efficiency: lubricant.efficiency(g(P::EfficiencyFirst)) * second,
            efficiency_second: second,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Governor<S> {
    speed_square: S,
    coefficient: S,
}

impl<S: Scalar> Governor<S> {
    pub fn derive(raw: &[S]) -> Self {
        let speed = raw[ReleaseParameter::GovernorSpeed as usize];
        Self { speed_square: speed * speed, coefficient: raw[ReleaseParameter::GovernorCoefficient as usize] }
    }

    /// Force against extension at ram speed `speed`.
    #[inline(always)]
    pub fn force(&self, speed: S) -> S {
        let over = (speed * speed - self.speed_square).maximum(S::zero());
        S::select(S::zero().lt(speed), self.coefficient * over, S::zero())
    }
}
