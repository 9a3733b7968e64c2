//! Laws of the dry friction of the motor shaft, chosen by `friction.law` (docs/explanation/theory/friction.md).
//!
//! A law states how much dry friction there is: the limit at rest and the value when moving (`limits`). Laws without a state
//! stick as Borello's does; a law with bristles moves shaft and bristles together (`lugre`).

mod load_dependent;
mod lugre;
mod stribeck;

pub use lugre::{Bristle, Moved, Push};

use crate::scalar::Scalar;
use crate::variable::View;
use crate::{choices, variables};
use load_dependent::LoadTerms;
use stribeck::Stribeck;

choices! {
    /// What the dry friction depends on.
    FrictionLaw { Borello "borello", Stribeck "stribeck", LuGre "lugre", LoadDependent "load_dependent" }
}

variables! {
    /// The law of the dry friction and its coefficients, referred to the motor shaft.
    FrictionLawParameter, FRICTION_LAW {
        Law => "law", "-", "1", Choice(FrictionLaw::NAMES), Plant, Some(0.0), "dry friction: Borello's two values, Stribeck's fall from static to dynamic, LuGre's bristles with the same fall, or the load-dependent form (extended servo friction models m1 to m6)";
        StribeckSpeed => "stribeck_speed", "v_s", "rad/s", Positive, Plant, Some(1.0), "speed over which the friction falls from static to dynamic (all laws but borello); ASSUMED: about 0.5 % of a 200 rad/s motor",
            when(&[Either(&[Chosen("friction.law", &["load_dependent"]), Differ("friction.static", "friction.dynamic")]), Chosen("friction.law", &["stribeck", "lugre", "load_dependent"])]);
        StribeckExponent => "stribeck_exponent", "delta", "1", Between(0.5, 10.0), Plant, Some(2.0), "exponent of the fall exp(-(|w|/v_s)^delta); 2: Canudas de Wit et al. 1995, 1: Tustin",
            when(&[Either(&[Chosen("friction.law", &["load_dependent"]), Differ("friction.static", "friction.dynamic")]), Chosen("friction.law", &["stribeck", "lugre", "load_dependent"])]);
        BristleStiffness => "bristle_stiffness", "sigma_0", "N m/rad", Positive, Plant, Some(100.0), "stiffness of the shaft before it slides (lugre); ASSUMED: a breakaway of 0.4 N m after 4 mrad",
            when(&[Chosen("friction.law", &["lugre"])]);
        BristleDamping => "bristle_damping", "sigma_1", "N m s/rad", NonNegative, Plant, Some(0.5), "damping of the bristles (lugre); ASSUMED: the order of 2 sqrt(sigma_0 J) with J = 2.7e-3 kg m2",
            when(&[Chosen("friction.law", &["lugre"])]);
        LoadMotor => "load_motor", "K_m", "1", Between(0.0, 0.99), Plant, Some(0.05), "friction per motor torque (load_dependent); ASSUMED: start value of the published identifications",
            when(&[Chosen("friction.law", &["load_dependent"])]);
        LoadExternal => "load_external", "K_e", "1", Between(0.0, 10.0), Plant, Some(0.05), "friction per load torque (load_dependent); ASSUMED as load_motor",
            when(&[Chosen("friction.law", &["load_dependent"])]);
        LoadMotorStribeck => "load_motor_stribeck", "K_ms", "1", Between(0.0, 0.99), Plant, Some(0.05), "friction per motor torque that vanishes with speed (load_dependent); ASSUMED as load_motor",
            when(&[Chosen("friction.law", &["load_dependent"])]);
        LoadExternalStribeck => "load_external_stribeck", "K_es", "1", Between(0.0, 10.0), Plant, Some(0.05), "friction per load torque that vanishes with speed (load_dependent); ASSUMED as load_motor",
            when(&[Chosen("friction.law", &["load_dependent"])]);
        LoadMotorQuadratic => "load_motor_quadratic", "Q_m", "1/(N m)", Between(0.0, 1e3), Plant, Some(0.0), "friction per square of the motor torque where the load drives (load_dependent); fades with speed",
            when(&[Chosen("friction.law", &["load_dependent"])]);
        LoadExternalQuadratic => "load_external_quadratic", "Q_e", "1/(N m)", Between(0.0, 1e3), Plant, Some(0.0), "friction per square of the load where the motor drives against it (load_dependent); fades with speed",
            when(&[Chosen("friction.law", &["load_dependent"])]);
    }
}

impl FrictionLaw {
    /// Does the friction have a state, which moves together with the shaft?
    pub fn bristles(self) -> bool {
        self == Self::LuGre
    }

    /// Does it depend on the motor's torque?
    pub fn knows_torque(self) -> bool {
        self == Self::LoadDependent
    }

    /// The law of a run.
    pub fn chosen(view: &View<FrictionLawParameter>) -> Self {
        Self::read(view.value(FrictionLawParameter::Law))
    }
}

/// Constants of all laws; the structure of a run chooses one.
#[derive(Clone, Copy, Debug)]
pub struct Law<S> {
    stribeck: Stribeck<S>,
    load: LoadTerms<S>,
    pub bristle: Bristle<S>,
}

impl<S: Scalar> Law<S> {
    /// `scale` is the growth of the dry friction by faults: the terms under load grow with it.
    pub fn derive(raw: &[S], scale: S) -> Self {
        use FrictionLawParameter as P;
        let g = |p: P| raw[p as usize];
        Self {
            stribeck: Stribeck { per_speed: S::one() / g(P::StribeckSpeed), exponent: g(P::StribeckExponent) },
            load: LoadTerms {
                sliding: [g(P::LoadMotor) * scale, g(P::LoadExternal) * scale],
                sticking: [g(P::LoadMotorStribeck) * scale, g(P::LoadExternalStribeck) * scale],
                quadratic: [g(P::LoadMotorQuadratic) * scale, g(P::LoadExternalQuadratic) * scale],
            },
            bristle: Bristle { stiffness: g(P::BristleStiffness), damping: g(P::BristleDamping) },
        }
    }

    /// Limit at rest and friction when moving at `speed`, from Borello's two values. `torque` is the motor's, `load` the
    /// signed load that opposes it, both on the motor shaft.
    #[inline(always)]
    pub fn limits(&self, law: FrictionLaw, [fixed, moving]: [S; 2], speed: S, torque: S, load: S) -> [S; 2] {
        match law {
            FrictionLaw::Borello => [fixed, moving],
            FrictionLaw::Stribeck | FrictionLaw::LuGre => [fixed, (fixed - moving).fma(self.stribeck.share(speed), moving)],
            FrictionLaw::LoadDependent => {
                let share = self.stribeck.share(speed);
                let [sliding, sticking] = self.load.terms(torque, load);
                let excess = fixed - moving + sticking;
                [fixed + sliding + sticking, excess.fma(share, moving + sliding)]
            }
        }
    }
}

#[cfg(test)]
mod tests;
