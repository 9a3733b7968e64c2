//! Gear ratio, inertia and load-dependent friction, end stops, output inertia and spring.

use crate::scalar::Scalar;
use crate::transmission::stop::Stop;
use crate::variable::View;
use crate::variables;

variables! {
    /// The gearbox.
    GearParameter, GEAR {
        Ratio => "ratio", "i", "1", Positive, Plant, None, "motor-shaft speed over output speed";
        Inertia => "inertia", "J_g", "kg m2", NonNegative, Plant, Some(0.0), "inertia of the gearbox on the motor shaft";
        Efficiency => "efficiency", "eta", "1", Fraction, Plant, Some(1.0), "efficiency under a load that opposes motion";
        EfficiencyAiding => "efficiency_aiding", "eta_prime", "1", Between(-1e3, 1.0), Plant, Some(1.0), "efficiency under a load that aids motion; 0 or less: the load cannot back-drive";
    }
}

variables! {
    /// End stops, at the output.
    StopParameter, STOP {
        Upper => "upper", "-", "rad", Any, Plant, None, "upper end stop";
        Lower => "lower", "-", "rad", Any, Plant, None, "lower end stop";
        Stiffness => "stiffness", "K_stop", "N m/rad", NonNegative, Plant, Some(0.0), "stiffness of an end stop, at the output; 0: rigid, what reaches it stands at once";
        Damping => "damping", "C_stop", "N m s/rad", NonNegative, Plant, Some(0.0), "damping of an end stop while it is pressed, at the output; it pushes, never pulls",
            when(&[Away("stop.stiffness", 0.0)]);
    }
}

variables! {
    /// What hangs on the output side.
    LoadParameter, LOAD {
        Inertia => "inertia", "J_u", "kg m2", NonNegative, Load, Some(0.0), "inertia on the output side";
        Stiffness => "stiffness", "K_s", "N m/rad", NonNegative, Load, Some(0.0), "spring on the output side, torque proportional to the output position";
        SpringZero => "spring_zero", "-", "rad", Any, Load, Some(0.0), "output position at which the spring is relaxed",
            when(&[Away("load.stiffness", 0.0)]);
        Damping => "damping", "c_L", "N m s/rad", NonNegative, Load, Some(0.0), "viscous damping on the output side";
        Friction => "friction", "F_L", "N m", NonNegative, Load, Some(0.0), "dry friction on the output side";
        Constant => "constant", "T_0", "N m", Any, Load, Some(0.0), "constant load on the output side, such as a weight; positive opposes positive motion";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Gear<S> {
    pub ratio: S,
    pub per_ratio: S,
    /// 1/eta - 1 and 1 - eta'.
    opposing: S,
    aiding: S,
    /// The end stops, felt by the motor through the gear, and where they stand.
    pub motor_stop: Stop<S>,
    pub output_stop: Stop<S>,
    pub stiffness: S,
    pub spring_zero: S,
    pub constant: S,
}

impl<S: Scalar> Gear<S> {
    /// `ratio` is the motor's angle over the output's coordinate, `screw` the efficiencies of what follows the gear.
    pub fn derive(ratio: S, gear: &[S], stop: &[S], load: &[S], screw: [S; 2]) -> Self {
        let at = |p: StopParameter| stop[p as usize];
        let output_stop = Stop {
            upper: at(StopParameter::Upper),
            lower: at(StopParameter::Lower),
            stiffness: at(StopParameter::Stiffness),
            damping: at(StopParameter::Damping),
        };
        Self {
            ratio,
            per_ratio: S::one() / ratio,
            opposing: S::one() / (gear[GearParameter::Efficiency as usize] * screw[0]) - S::one(),
            aiding: S::one() - gear[GearParameter::EfficiencyAiding as usize] * screw[1],
            motor_stop: output_stop.behind(ratio),
            output_stop,
            stiffness: load[LoadParameter::Stiffness as usize],
            spring_zero: load[LoadParameter::SpringZero as usize],
            constant: load[LoadParameter::Constant as usize],
        }
    }

    /// Are the end stops elastic?
    pub fn buffered(view: &View<StopParameter>) -> bool {
        view.away(StopParameter::Stiffness)
    }

    /// Does a load add to the friction?
    pub fn loaded(view: &View<GearParameter>) -> bool {
        view.any_away([GearParameter::Efficiency, GearParameter::EfficiencyAiding])
    }

    /// Friction that an output torque adds on the motor shaft (Borello and Dalla Vedova 2006). `direction` is the
    /// sign of the motion, or of the torque that would start it.
    #[inline(always)]
    pub fn load_friction(&self, output_torque: S, direction: S) -> S {
        let magnitude = output_torque.abs() * self.per_ratio;
        let opposes = S::zero().lt(output_torque * direction);
        magnitude * S::select(opposes, self.opposing, self.aiding)
    }
}
