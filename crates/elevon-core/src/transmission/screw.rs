//! Ball screw: efficiencies, preload, blocked return channels, starved and contaminated lubrication, spalls
//! (docs/explanation/theory/ballscrew.md, "Screw" and "Faults").
//!
//! An actuator file gives the two efficiencies; they mean a friction coefficient on the inclined plane of the thread. Faults add
//! to that coefficient, and the efficiencies follow. With nothing added the file's numbers are used unchanged.

use crate::scalar::Scalar;
use crate::three;
use crate::variable::View;
use crate::variables;
use std::f64::consts::{PI, TAU};

variables! {
    /// The ball screw and its nut.
    ScrewParameter, SCREW {
        Lead => "lead", "-", "m/rad", Positive, Plant, None, "travel of the nut per radian of the screw";
        PitchDiameter => "pitch_diameter", "d_m", "m", Positive, Plant, Some(0.032), "diameter of the circle on which the balls run",
            when(&[Either(&[
                Away("screw.blocked_circuits", 0.0), Away("screw.lubricant_lost", 0.0), Away("screw.debris", 0.0),
                Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0),
            ])]);
        BallDiameter => "ball_diameter", "d_b", "m", Positive, Plant, Some(0.00635), "diameter of a ball",
            when(&[Either(&[Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0)])]);
        ContactAngle => "contact_angle", "alpha", "rad", Between(0.1, 1.5), Plant, Some(std::f64::consts::FRAC_PI_4), "contact angle of the balls",
            when(&[Either(&[Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0)])]);
        BallsPerTurn => "balls_per_turn", "Z", "1", Count(1.0, f64::INFINITY), Plant, Some(15.0), "balls in one turn",
            when(&[Either(&[Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0)])]);
        Circuits => "circuits", "n", "1", Count(1.0, f64::INFINITY), Plant, Some(4.0), "return channels, each with one turn of balls",
            when(&[Either(&[
                Away("screw.blocked_circuits", 0.0),
                Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0),
            ])]);
        NutLength => "nut_length", "-", "m", Positive, Plant, Some(0.05), "length of the nut: a defect of the screw's groove is felt while it is covered",
            when(&[Away("screw.spall_groove", 0.0)]);
        Efficiency => "efficiency", "eta", "1", Fraction, Plant, None, "efficiency under a load that opposes motion";
        EfficiencyAiding => "efficiency_aiding", "eta_prime", "1", Between(-1e3, 1.0), Plant, None, "efficiency under a load that aids motion; 0 or less: the load cannot back-drive";
        Preload => "preload", "F_pr", "N", NonNegative, Plant, Some(0.0), "force between the two nut halves";
        Inertia => "inertia", "J_s", "kg m2", NonNegative, Plant, Some(0.0), "inertia of the screw";
        FrictionSliding => "friction_sliding", "mu_s", "1", Unit, Plant, Some(0.10), "friction coefficient of balls that slide (blocked return, spalled track)",
            when(&[Either(&[
                Away("screw.blocked_circuits", 0.0),
                Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0),
            ])]);
        FrictionDry => "friction_dry", "mu_dry", "1", Unit, Plant, Some(0.05), "friction coefficient without lubricant",
            when(&[Away("screw.lubricant_lost", 0.0)]);
        BlockedCircuits => "blocked_circuits", "b", "1", Count(0.0, f64::INFINITY), Plant, Some(0.0), "healthy 0; return channels that are jammed";
        LubricantLost => "lubricant_lost", "s", "1", Unit, Plant, Some(0.0), "healthy 0; fraction of the lubricant lost";
        Debris => "debris", "c", "1", Between(0.0, 0.05), Plant, Some(0.0), "healthy 0; mass of debris over mass of grease";
        SpallGroove => "spall_groove", "w", "m", Between(0.0, 5e-3), Plant, Some(0.0), "healthy 0; length of a spall in the screw's groove";
        SpallNut => "spall_nut", "w", "m", Between(0.0, 5e-3), Plant, Some(0.0), "healthy 0; length of a spall in the nut's groove";
        SpallBall => "spall_ball", "w", "m", Between(0.0, 5e-3), Plant, Some(0.0), "healthy 0; length of a spall on a ball";
        SpallDepth => "spall_depth", "d", "m", Between(0.0, 1e-3), Plant, Some(2e-4), "depth of the spalls, unless their chord is shallower",
            when(&[Either(&[Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0)])]);
        NutCapacity => "nut_capacity", "C_n", "J/K", Positive, Plant, Some(700.0), "heat capacity of the nut",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        NutToAir => "nut_to_air", "R_n", "K/W", Positive, Plant, Some(1.2), "thermal resistance from the nut to the air",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        NutHeatShare => "nut_heat_share", "-", "1", Unit, Plant, Some(0.5), "part of the screw's friction heat that stays in the nut; the rest leaves with the screw",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        SpallPosition => "spall_position", "-", "m", Any, Plant, Some(0.0), "ram position at which the nut's middle stands over the groove's spall",
            when(&[Away("screw.spall_groove", 0.0)]);
    }
}

variables! {
    /// What the maker allows; feeds flags and scaling only.
    RatingParameter, RATING {
        Current => "current", "-", "A", Positive, Load, Some(1e9), "continuous phase current, peak",
            nowhere("a maker's rating scales and flags, it moves nothing");
        Load => "load", "-", "N", Positive, Load, Some(1e9), "largest continuous load",
            nowhere("a maker's rating scales and flags, it moves nothing");
    }
}

/// Film parameter with all of its lubricant, from which the asperities' share of the load follows as exp(-Lambda).
const FULL_FILM: f64 = 3.0;
/// Friction coefficient added per mass fraction of debris.
const DEBRIS_FRICTION: f64 = 0.5;

/// A load of 2^(3/2) times the preload relieves one half of a double nut altogether: with Hertz' deflection Q^(2/3) of both
/// halves held together, Q_A^(2/3) + Q_B^(2/3) = 2 F_pr^(2/3), Q_A - Q_B = F.
const RELIEF: f64 = 2.0 * std::f64::consts::SQRT_2;
/// Q_B / F_pr = y^(3/2) q(y^(1/2)), y = 1 - F / (2^(3/2) F_pr): coefficients of q, ascending; within 4e-5.
const RELIEVED: [f64; 5] = [1.53960, -1.19476, 1.13376, -0.67106, 0.19246];

/// One defect that balls pass.
#[derive(Clone, Copy, Debug)]
struct Defect<S> {
    /// Passes per motor-shaft radian.
    passes: S,
    /// One over the half width of a pass, in radians of the ball spacing.
    per_width: S,
    drop: S,
}

/// The screw as the motor shaft feels it.
#[derive(Clone, Copy, Debug)]
pub struct Screw<S> {
    pub efficiency: S,
    pub efficiency_aiding: S,
    /// Friction torque of the preload on the motor shaft without load; under load the relieved half's share of it is left.
    pub preload_torque: S,
    /// Factor on the viscous friction: starved grease resists less.
    pub viscous: S,
    /// Spread of the dry friction under debris.
    pub scatter: S,
    preload: S,
    per_relief: S,
    /// 1/eta - 1 and 1 - eta'.
    opposing: S,
    aiding: S,
    per_balls: S,
    defects: [Defect<S>; 3],
    position: S,
    reach: S,
}

/// Friction coefficients of driving and back-driving.
fn coefficients<S: Scalar>(t: S, eta: S, aiding: S) -> [S; 2] {
    let one = S::one();
    [(one - eta) * t / (eta + t * t), (one - aiding) * t / (one + aiding * t * t)]
}

/// Spalls of groove, nut and ball: passes a turn of the motor shaft by the bearing's kinematics, width against the ball
/// spacing, depth of the chord that a ball sinks into them.
fn defects<S: Scalar>(raw: &[S], cos: S, spacing: S, gear: S) -> [Defect<S>; 3] {
    use ScrewParameter as P;
    let g = |p: P| raw[p as usize];
    let (zero, one) = (S::zero(), S::one());
    let spalls = [P::SpallGroove, P::SpallNut, P::SpallBall].map(g);
    let gamma = g(P::BallDiameter) * cos / g(P::PitchDiameter);
    let half = S::splat(0.5) * g(P::BallsPerTurn);
    let passes = [half * (one + gamma), half * (one - gamma), g(P::PitchDiameter) / g(P::BallDiameter) * (one - gamma * gamma)];
    three!(|i| {
        let (length, present) = (spalls[i], zero.lt(spalls[i]));
        let chord = length * length / (S::splat(4.0) * g(P::BallDiameter));
        let per_width = spacing / (S::splat(PI) * S::select(present, length, spacing));
        Defect { passes: passes[i] / gear, per_width, drop: chord.minimum(g(P::SpallDepth)) }
    })
}

impl<S: Scalar> Screw<S> {
    /// No screw: nothing is lost in it.
    pub fn none() -> Self {
        let (zero, one) = (S::zero(), S::one());
        let defect = Defect { passes: zero, per_width: zero, drop: zero };
        Self {
            efficiency: one,
            efficiency_aiding: one,
            preload_torque: zero,
            viscous: one,
            scatter: zero,
            preload: zero,
            per_relief: zero,
            opposing: zero,
            aiding: zero,
            per_balls: zero,
            defects: [defect; 3],
            position: zero,
            reach: zero,
        }
    }

    /// Do balls pass a spall?
    pub fn preloaded(view: &View<ScrewParameter>) -> bool {
        view.away(ScrewParameter::Preload)
    }
    pub fn spalled(view: &View<ScrewParameter>) -> bool {
        view.any_away([ScrewParameter::SpallGroove, ScrewParameter::SpallNut, ScrewParameter::SpallBall])
    }

    /// Does debris scatter the friction?
    pub fn contaminated(view: &View<ScrewParameter>) -> bool {
        view.away(ScrewParameter::Debris)
    }

    /// `gear` is the ratio of a gearbox between motor and screw.
    pub fn derive(raw: &[S], gear: S) -> Self {
        use ScrewParameter as P;
        let g = |p: P| raw[p as usize];
        let (zero, one) = (S::zero(), S::one());
        let slope = S::splat(2.0) * g(P::Lead) / g(P::PitchDiameter);
        let level = one / (one + slope * slope).sqrt();
        let (sin, cos) = g(P::ContactAngle).sin_cos();
        let spacing = S::splat(PI) * g(P::PitchDiameter) / (g(P::BallsPerTurn) * level);
        let (balls, mu) = (g(P::BallsPerTurn) * g(P::Circuits), coefficients(slope, g(P::Efficiency), g(P::EfficiencyAiding)));
        let spalls = [P::SpallGroove, P::SpallNut, P::SpallBall].map(g);
        let sliding = g(P::BlockedCircuits).floor() / g(P::Circuits) + (spalls[0] + spalls[1] + spalls[2]) / (balls * spacing);
        let full = S::splat(-FULL_FILM).exp();
        let asperities = ((S::splat(-FULL_FILM) * (one - g(P::LubricantLost))).exp() - full) / (one - full);
        let debris = S::splat(DEBRIS_FRICTION) * g(P::Debris);
        let worn = mu.map(|mu| sliding * (g(P::FrictionSliding) - mu) + asperities * (g(P::FrictionDry) - mu) + debris);
        let healthy = sliding.equals(zero) & asperities.equals(zero) & debris.equals(zero);
        let (drive, back) = (mu[0] + worn[0], mu[1] + worn[1]);
        let efficiency = S::anchor(healthy, g(P::Efficiency), (one - drive * slope) / (one + drive / slope));
        let aiding = S::anchor(healthy, g(P::EfficiencyAiding), (one - back / slope) / (one + back * slope));
        Self {
            efficiency,
            efficiency_aiding: aiding,
            preload_torque: g(P::Preload) * g(P::Lead) / gear * (one / efficiency - aiding),
            viscous: one - g(P::LubricantLost),
            scatter: g(P::Debris).sqrt(),
            preload: g(P::Preload),
            opposing: one / efficiency - one,
            aiding: one - aiding,
            per_relief: S::select(zero.lt(g(P::Preload)), one / (S::splat(RELIEF) * g(P::Preload)), zero),
            per_balls: one / (balls * sin * level),
            defects: defects(raw, cos, spacing, gear),
            position: g(P::SpallPosition),
            reach: S::splat(0.5) * g(P::NutLength),
        }
    }

    /// Friction that a force through the nut makes in it, at the nut, in the direction of motion.
    #[inline(always)]
    pub fn drag(&self, force: S, direction: S) -> S {
        let opposes = S::zero().lt(force * direction);
        force.abs() * S::select(opposes, self.opposing, self.aiding)
    }

    /// Load of the nut half that `force` relieves, over the preload: 1 without load, 0 from 2^(3/2) preloads on. The half
    /// that bears the load carries that much more than the force.
    #[inline(always)]
    pub fn relieved(&self, force: S) -> S {
        // A tiny floor instead of zero: the derivative of the root stays finite.
        let y = (S::one() - force.abs() * self.per_relief).maximum(S::splat(1e-300));
        let t = y.sqrt();
        let [a, b, c, d, e] = RELIEVED.map(S::splat);
        y * t * e.fma(t, d).fma(t, c).fma(t, b).fma(t, a)
    }

    /// Load that the nut misses while balls stand over spalls: deeper than `1 / per_approach`, a spall unloads them whole.
    #[inline(always)]
    pub fn missing(&self, angle: S, force: S, ram: S, per_approach: S) -> S {
        let one = S::one();
        let ball = (force.abs() + S::splat(2.0) * self.preload * self.relieved(force)) * self.per_balls;
        let covered = (ram - self.position).abs().le(self.reach);
        let mut sum = S::zero();
        for (i, d) in self.defects.iter().enumerate() {
            let turned = d.passes * angle;
            let psi = turned - S::splat(TAU) * (turned * S::splat(1.0 / TAU)).round();
            let u = psi * d.per_width;
            let part = (d.drop * per_approach).minimum(one);
            let felt = if i == 0 { S::select(covered, part, S::zero()) } else { part };
            let gone = (one - u * u) * (one - u * u) * felt * ball;
            sum = sum + S::select(u.abs().lt(one), gone, S::zero());
        }
        sum
    }

    /// Torque of the balls that fall into the spalls and climb out of them, and the mean friction they leave; both on
    /// the motor shaft. `force` goes through the nut, `ram` is its position.
    #[inline(always)]
    pub fn spall(&self, angle: S, force: S, ram: S) -> (S, S) {
        let zero = S::zero();
        // Both halves together bear the force and twice what the relieved one keeps.
        let ball = (force.abs() + S::splat(2.0) * self.preload * self.relieved(force)) * self.per_balls;
        let covered = (ram - self.position).abs().le(self.reach);
        let (mut torque, mut friction) = (zero, zero);
        for (i, d) in self.defects.iter().enumerate() {
            let turned = d.passes * angle;
            let psi = turned - S::splat(TAU) * (turned * S::splat(1.0 / TAU)).round();
            let u = psi * d.per_width;
            let felt = if i == 0 { S::select(covered, ball * d.drop, zero) } else { ball * d.drop };
            // E = -Q delta (1 - u^2)^2 inside the spall.
            let inside = u.abs().lt(S::one());
            let pull = S::splat(-4.0) * felt * u * (S::one() - u * u) * d.per_width * d.passes;
            torque = torque + S::select(inside, pull, zero);
            friction = friction + S::splat(0.5 / TAU) * felt * d.passes;
        }
        (torque, friction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn screw(preload: f64) -> Screw<f64> {
        let mut raw: Vec<f64> = SCREW.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        raw[ScrewParameter::Lead as usize] = 0.01 / TAU;
        raw[ScrewParameter::Efficiency as usize] = 0.9;
        raw[ScrewParameter::EfficiencyAiding as usize] = 0.889;
        raw[ScrewParameter::Preload as usize] = preload;
        Screw::derive(&raw, 1.0)
    }

    #[test]
    fn the_relieved_half_follows_hertz() {
        let screw = screw(437.5);
        for i in 0..=1000 {
            // A parameter of the exact law: Q_A and Q_B are (1 +- u)^(3/2) preloads.
            let u = f64::from(i) / 1000.0;
            let (bearing, relieved) = ((1.0 + u).powf(1.5), (1.0 - u).powf(1.5));
            let found = screw.relieved(437.5 * (bearing - relieved));
            assert!((found - relieved).abs() < 4e-5, "{u}: {found} {relieved}");
        }
        assert_eq!(screw.relieved(-437.5), screw.relieved(437.5));
        assert!(screw.relieved(437.5 * 2.9) < 1e-300);
    }

    #[test]
    fn below_the_relief_the_load_hardly_raises_the_friction() {
        let (screw, force) = (screw(437.5), 500.0);
        let travel = 0.01 / TAU;
        let added = (1.0 / 0.9 - 1.0) * force * travel;
        let preloaded = added + screw.preload_torque * screw.relieved(force);
        // 0.155 N m without load; the sum of both would be 0.243.
        assert!((screw.preload_torque - 0.1547).abs() < 1e-4);
        assert!((preloaded - 0.1633).abs() < 1e-4, "{preloaded}");
        // Once relieved the load alone makes the friction.
        assert!((screw.relieved(8500.0) * screw.preload_torque).abs() < 1e-12);
    }
}
