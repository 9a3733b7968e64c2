//! Excess mass on one side of the rotor: inertia, gravity torque, and the gap it narrows (N 4.4).

use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;

const GRAVITY: f64 = 9.806_65;

variables! {
    /// Excess mass of the rotor.
    UnbalanceParameter, UNBALANCE {
        UnbalanceInertia => "unbalance_inertia", "J_x", "kg m2", NonNegative, Plant, Some(0.0), "healthy 0; inertia of the excess mass";
        UnbalanceRadius => "unbalance_radius", "-", "1/m", NonNegative, Plant, Some(22.94), "mass times eccentricity of the excess mass per its inertia (half ring of 16 to 35 mm)",
            when(&[Away("motor.unbalance_inertia", 0.0)]);
        UnbalancePhase => "unbalance_phase", "phi_x", "rad", Any, Plant, Some(0.0), "mechanical angle of the excess mass",
            when(&[Away("motor.unbalance_inertia", 0.0)]);
        UnbalanceGapShare => "unbalance_gap_share", "-", "1", NonNegative, Plant, Some(1.0), "dynamic eccentricity per share of excess inertia",
            when(&[Away("motor.unbalance_inertia", 0.0)]);
        ShaftTilt => "shaft_tilt", "-", "rad", Between(0.0, 1.570_796_326_794_896_7), Plant, Some(0.0), "angle of the shaft above the horizontal: a vertical shaft feels no gravity",
            when(&[Away("motor.unbalance_inertia", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Unbalance<S> {
    pub inertia: S,
    weight: S,
    /// Mass times eccentricity.
    mass_eccentricity: S,
    phase: S,
    gap_share: S,
}

impl<S: Scalar> Unbalance<S> {
    pub fn derive(raw: &[S]) -> Self {
        use UnbalanceParameter as P;
        let g = |p: P| raw[p as usize];
        let (_, level) = g(P::ShaftTilt).sin_cos();
        Self {
            inertia: g(P::UnbalanceInertia),
            mass_eccentricity: g(P::UnbalanceInertia) * g(P::UnbalanceRadius),
            weight: g(P::UnbalanceInertia) * g(P::UnbalanceRadius) * S::splat(GRAVITY) * level,
            phase: g(P::UnbalancePhase),
            gap_share: g(P::UnbalanceGapShare),
        }
    }

    pub fn needed(view: &View<UnbalanceParameter>) -> bool {
        view.away(UnbalanceParameter::UnbalanceInertia)
    }

    /// Gravity torque on the shaft.
    #[inline(always)]
    pub fn torque(&self, angle: S) -> S {
        let (_, cos) = (angle + self.phase).sin_cos();
        -(self.weight * cos)
    }

    /// Centrifugal force across the shaft, in one direction that stands still.
    #[inline(always)]
    pub fn force(&self, angle: S, speed: S) -> S {
        let (_, cos) = (angle + self.phase).sin_cos();
        self.mass_eccentricity * speed * speed * cos
    }

    /// Dynamic eccentricity and its phase, for a shaft whose whole inertia, the excess included, is `total`.
    pub fn eccentricity(&self, total: S) -> (S, S) {
        (self.gap_share * self.inertia / total, self.phase)
    }
}
