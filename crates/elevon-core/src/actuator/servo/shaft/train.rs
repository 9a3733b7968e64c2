//! What acts on the motor shaft in addition to the plain friction: the law of the dry friction, cogging, a bearing with a defect or a
//! magnetic pull on it, worn teeth.

use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::motor::cogging::Cogging;
use crate::motor::iron_loss::IronLoss;
use crate::motor::magnetic_pull::{Eccentricity, MagneticPull};
use crate::motor::rub::Rub;
use crate::motor::star::MotorParameter;
use crate::motor::unbalance::Unbalance;
use crate::scalar::Scalar;
use crate::transmission::bearing::{Bearing, BearingTorque};
use crate::transmission::friction::FrictionParameter;
use crate::transmission::friction_law::{FrictionLaw, Law};
use crate::transmission::tooth::Teeth;
use crate::{details, signals};

details! {
    /// Which of it a run needs.
    TrainDetails, read<F>(parts: Parts)
    always {
        law: FrictionLaw = FrictionLaw::chosen(&parts.friction_law());
    }
    full {}
    extra {
        /// Another law than Borello's.
        lawful = law != FrictionLaw::Borello;
        cogging = Cogging::<f64>::needed(&parts.cogging());
        iron = IronLoss::<f64>::needed(&parts.iron_loss());
        /// An eccentric rotor is pulled.
        pull = MagneticPull::<f64>::needed(&parts.magnetic_pull())
            && (parts.motor().any_away([MotorParameter::EccentricityStatic, MotorParameter::EccentricityDynamic])
                || Unbalance::<f64>::needed(&parts.unbalance()));
        /// The gap can close.
        rub = Rub::<f64>::needed(&parts.rub(), &parts.motor(), Unbalance::<f64>::needed(&parts.unbalance()));
        bearing = pull || Bearing::<f64>::needed(&parts.bearing());
        teeth = Teeth::<f64>::needed(&parts.tooth());
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Train<S> {
    pub law: Law<S>,
    cogging: Cogging<S>,
    pub iron: IronLoss<S>,
    bearing: Bearing<S>,
    eccentricity: Eccentricity<S>,
    pull: MagneticPull<S>,
    rub: Rub<S>,
    teeth: Teeth<S>,
}

signals! {
    /// Signals of both fidelities, named as they are recorded.
    #[allow(clippy::enum_variant_names)]
    TrainSignal, TRAIN {
        CoggingTorque => "cogging_torque", "T_cog", "N m", "cogging torque of the motor, positive drives forwards";
        BearingTorque => "bearing_torque", "-", "N m", "torque of balls passing a defect of the bearing, positive drives forwards";
        RubForce => "rub_force", "N", "N", "force between a rotor and a stator that touch";
        ToothTorque => "tooth_torque", "-", "N m", "torque of worn or chipped flanks under load, positive drives forwards";
    }
}

/// What it adds on the motor shaft: torques positive where they drive forwards, and dry friction.
#[derive(Clone, Copy, Debug)]
pub(in crate::actuator::servo) struct Added<S> {
    pub cogging: S,
    pub bearing: BearingTorque<S>,
    /// Force and friction torque of a rotor that rubs.
    pub rub: [S; 2],
    pub teeth: S,
}

impl<S: Scalar> Added<S> {
    #[inline(always)]
    pub fn torque(&self) -> S {
        self.cogging + self.bearing.torque + self.teeth
    }

    /// Dry friction.
    #[inline(always)]
    pub fn friction(&self) -> S {
        self.bearing.friction + self.rub[1]
    }

    /// In the order of `TRAIN`.
    #[inline(always)]
    pub fn signals(&self) -> [S; TRAIN.len()] {
        [self.cogging, self.bearing.torque, self.rub[0], self.teeth]
    }
}

impl<S: Scalar> Train<S> {
    /// `(eccentricity, phase)` is what an excess mass of the rotor adds to the dynamic eccentricity.
    pub(super) fn derive(raw: &[S], (eccentricity, phase): (S, S)) -> Self {
        let view = Raw(raw);
        let at = |p: MotorParameter| raw[p.at()];
        let (sin, cos) = at(MotorParameter::EccentricityDynamicPhase).sin_cos();
        let (sin_x, cos_x) = phase.sin_cos();
        let dynamic = at(MotorParameter::EccentricityDynamic);
        let turning = [dynamic * cos + eccentricity * cos_x, dynamic * sin + eccentricity * sin_x];
        Self {
            law: Law::derive(view.friction_law(), raw[FrictionParameter::DryScale.at()]),
            cogging: Cogging::derive(view.cogging()),
            iron: IronLoss::derive(view.iron_loss(), view.motor()),
            bearing: Bearing::derive(view.bearing()),
            eccentricity: Eccentricity::new(at(MotorParameter::EccentricityStatic), turning),
            pull: MagneticPull::derive(view.magnetic_pull()),
            rub: Rub::derive(view.rub()),
            teeth: Teeth::derive(view.tooth()),
        }
    }

    /// At a motor angle; the torque through the gear as the motor's side and as the output feel it, `per_ratio` the gear's.
    #[inline(always)]
    pub(super) fn added(&self, d: &TrainDetails, angle: S, [through, delivered]: [S; 2], per_ratio: S) -> Added<S> {
        let zero = S::zero();
        let mut added = Added { cogging: zero, bearing: BearingTorque { torque: zero, friction: zero }, rub: [zero; 2], teeth: zero };
        if d.cogging {
            added.cogging = self.cogging.torque(angle);
        }
        if d.bearing {
            let pull = if d.pull { self.pull.force(&self.eccentricity, angle) } else { zero };
            added.bearing = self.bearing.torque(angle, through * per_ratio, pull);
        }
        if d.rub {
            added.rub = self.rub.contact(&self.eccentricity, angle);
        }
        if d.teeth {
            added.teeth = self.teeth.lag(angle).torque(delivered);
        }
        added
    }

    /// Force of a rub on the housing.
    #[inline(always)]
    pub(super) fn rub_force(&self, d: &TrainDetails, angle: S, speed: S) -> S {
        if d.rub {
            self.rub.force(&self.eccentricity, angle, speed)
        } else {
            S::zero()
        }
    }

    /// What worn teeth add to half the backlash at a motor angle.
    #[inline(always)]
    pub(super) fn lag(&self, angle: S) -> S {
        self.teeth.lag(angle).half
    }
}
