//! The motor's bearing with a local defect, a worn cage, or more radial load than it was measured with
//! (docs/explanation/theory/friction.md, "Bearings").
//!
//! Balls pass a defect as often as the geometry states (gamma = d/D cos alpha, Z balls, per turn of the shaft): outer ring
//! Z/2 (1 - gamma), inner ring Z/2 (1 + gamma), a ball's defect on both rings D/d (1 - gamma^2), the cage turns
//! (1 - gamma)/2. At each pass a loaded ball falls into the defect and is driven out again: a well of energy Q delta, of
//! which half is lost on the far edge. The bearing's friction when healthy is part of the measured friction of the shaft.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

variables! {
    /// The motor's bearing.
    BearingParameter, BEARING {
        Balls => "balls", "Z", "1", Count(3.0, 100.0), Plant, Some(8.0), "balls of the motor's bearing; ASSUMED: a deep-groove bearing of 15 mm bore",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0)])]);
        BallDiameter => "ball_diameter", "d", "m", Between(1e-4, 0.1), Plant, Some(5.95e-3), "diameter of a ball; ASSUMED as bearing.balls",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0), Away("bearing.cage_drag", 0.0)])]);
        PitchDiameter => "pitch_diameter", "D", "m", Between(1e-3, 1.0), Plant, Some(0.025), "diameter of the circle of the balls' centres; ASSUMED as bearing.balls",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0), Away("bearing.cage_drag", 0.0)])]);
        ContactAngle => "contact_angle", "alpha", "rad", Between(0.0, 1.2), Plant, Some(0.0), "contact angle of the balls",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0), Away("bearing.cage_drag", 0.0)])]);
        Bore => "bore", "d_i", "m", Positive, Plant, Some(0.015), "diameter of the shaft in the bearing; ASSUMED as bearing.balls",
            when(&[Away("motor.magnetic_pull", 0.0), Either(&[
                Away("motor.eccentricity_static", 0.0), Away("motor.eccentricity_dynamic", 0.0), Away("motor.unbalance_inertia", 0.0),
            ])]);
        FrictionCoefficient => "friction_coefficient", "mu", "1", Between(0.0, 0.5), Plant, Some(1.5e-3), "friction at the bore over the radial load, the makers' value for deep-groove ball bearings",
            when(&[Away("motor.magnetic_pull", 0.0), Either(&[
                Away("motor.eccentricity_static", 0.0), Away("motor.eccentricity_dynamic", 0.0), Away("motor.unbalance_inertia", 0.0),
            ])]);
        BallForce => "ball_force", "Q_0", "N", NonNegative, Plant, Some(5.0), "force on every ball from the preload; ASSUMED: a spring of some 40 N",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0)])]);
        RadialLoad => "radial_load", "F_r", "N", NonNegative, Plant, Some(30.0), "radial load at rest; ASSUMED: rotor's weight and the tension of a belt or mesh",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0)])]);
        RadialPerTorque => "radial_per_torque", "-", "1/m", NonNegative, Plant, Some(100.0), "radial load per torque through the gear on the motor shaft; ASSUMED: 1/(r cos 20 deg) of a pinion of 10 mm",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0)])]);
        DefectDepth => "defect_depth", "delta", "m", Between(0.0, 1e-3), Plant, Some(2e-4), "depth of the defects, unless the sag of a ball over their length is less",
            when(&[Either(&[Away("bearing.outer_defect", 0.0), Away("bearing.inner_defect", 0.0), Away("bearing.ball_defect", 0.0)])]);
        OuterDefect => "outer_defect", "w_o", "m", Between(0.0, 5e-3), Plant, Some(0.0), "healthy 0; length of a defect of the outer ring, in the loaded zone";
        InnerDefect => "inner_defect", "w_i", "m", Between(0.0, 5e-3), Plant, Some(0.0), "healthy 0; length of a defect of the inner ring";
        BallDefect => "ball_defect", "w_b", "m", Between(0.0, 5e-3), Plant, Some(0.0), "healthy 0; length of a defect of a ball";
        CageDrag => "cage_drag", "-", "N m", NonNegative, Plant, Some(0.0), "healthy 0; dry friction of a worn cage where it rubs most, once a turn of the cage";
    }
}

/// The most loaded ball carries this share of a radial load, times 1/Z (Stribeck's number).
const MOST_LOADED: f64 = 5.0;

/// A defect that balls pass.
#[derive(Clone, Copy, Debug)]
struct Defect<S> {
    /// Passes per turn of the shaft.
    order: S,
    /// One over half its width, in radians of a pass.
    per_width: S,
    /// How deep a ball falls.
    drop: S,
}

impl<S: Scalar> Defect<S> {
    fn new(length: S, spacing: S, order: S, ball: S, depth: S) -> Self {
        let present = S::zero().lt(length);
        let sag = length * length / (S::splat(4.0) * ball);
        // A ball cannot meet two ends at once: the half width stays below a quarter turn of a pass.
        let width = (S::splat(PI) * length / spacing).minimum(S::splat(FRAC_PI_2));
        Self { order, per_width: S::one() / S::select(present, width, S::one()), drop: sag.minimum(depth) }
    }

    /// Torque under the ball force `force`, from E = -Q delta (1 - u^2)^2 inside the defect.
    #[inline(always)]
    fn torque(&self, turns: S, force: S) -> S {
        let passes = self.order * turns;
        let u = S::splat(TAU) * (passes - passes.round()) * self.per_width;
        let pull = S::splat(-4.0) * force * self.drop * u * (S::one() - u * u) * self.per_width * self.order;
        S::select(u.abs().lt(S::one()), pull, S::zero())
    }

    /// Half the depth of the well is lost at each pass: its mean over a turn.
    #[inline(always)]
    fn friction(&self, force: S) -> S {
        S::splat(0.5 / TAU) * force * self.drop * self.order
    }
}

/// The bearing as the motor shaft feels it.
#[derive(Clone, Copy, Debug)]
pub struct Bearing<S> {
    outer: Defect<S>,
    inner: Defect<S>,
    ball: Defect<S>,
    /// Turns of the cage per turn of the shaft.
    cage: S,
    cage_drag: S,
    ball_force: S,
    radial_load: S,
    radial_per_torque: S,
    per_balls: S,
    /// Friction torque per newton of added radial load.
    per_pull: S,
}

/// What a bearing adds on the motor shaft.
#[derive(Clone, Copy, Debug)]
pub struct BearingTorque<S> {
    /// Positive where it drives forwards.
    pub torque: S,
    /// Dry friction.
    pub friction: S,
}

impl<S: Scalar> Bearing<S> {
    /// Is there any?
    pub fn needed(view: &View<BearingParameter>) -> bool {
        view.any_away([
            BearingParameter::OuterDefect,
            BearingParameter::InnerDefect,
            BearingParameter::BallDefect,
            BearingParameter::CageDrag,
        ])
    }

    pub fn derive(raw: &[S]) -> Self {
        use BearingParameter as P;
        let g = |p: P| raw[p as usize];
        let (one, half) = (S::one(), S::splat(0.5));
        let [outer, inner, ball, cage] = orders(raw);
        let (d, pitch, depth) = (g(P::BallDiameter), g(P::PitchDiameter), g(P::DefectDepth));
        let spacing = S::splat(PI) * pitch / g(P::Balls);
        let around = half * S::splat(PI) * d;
        Self {
            outer: Defect::new(g(P::OuterDefect), spacing, outer, d, depth),
            inner: Defect::new(g(P::InnerDefect), spacing, inner, d, depth),
            ball: Defect::new(g(P::BallDefect), around, ball, d, depth),
            cage,
            cage_drag: g(P::CageDrag),
            ball_force: g(P::BallForce),
            radial_load: g(P::RadialLoad),
            radial_per_torque: g(P::RadialPerTorque),
            per_balls: S::splat(MOST_LOADED) / g(P::Balls),
            per_pull: half * g(P::FrictionCoefficient) * g(P::Bore) * one,
        }
    }

    /// Torque and friction at a rotor angle; `through` is the torque through the gear on the motor shaft, `pull` the magnetic
    /// pull. A defect of the inner ring passes the loaded zone once a turn of the shaft, one of a ball once a turn of the
    /// cage; one of the outer ring stays in it.
    #[inline(always)]
    pub fn torque(&self, angle: S, through: S, pull: S) -> BearingTorque<S> {
        let half = S::splat(0.5);
        let turns = angle * S::splat(1.0 / TAU);
        let zone = |order: S| {
            let (_, cos) = (order * angle).sin_cos();
            half * (S::one() + cos)
        };
        let radial = self.per_balls * (self.radial_load + self.radial_per_torque * through.abs() + pull);
        let (once, with_cage) = (zone(S::one()), zone(self.cage));
        let forces = [self.ball_force + radial, radial.fma(once, self.ball_force), radial.fma(with_cage, self.ball_force)];
        let parts = [self.outer, self.inner, self.ball];
        let (mut torque, mut friction) = (S::zero(), self.cage_drag * with_cage + self.per_pull * pull);
        for (defect, force) in parts.iter().zip(forces) {
            torque = torque + defect.torque(turns, force);
            friction = friction + defect.friction(force);
        }
        BearingTorque { torque, friction }
    }
}

/// Passes per turn of the shaft: of the outer ring, of the inner ring, of a ball's defect over both rings, and the turns of
/// the cage.
pub fn orders<S: Scalar>(raw: &[S]) -> [S; 4] {
    use BearingParameter as P;
    let g = |p: P| raw[p as usize];
    let (one, half) = (S::one(), S::splat(0.5));
    let (_, cos) = g(P::ContactAngle).sin_cos();
    let ratio = g(P::BallDiameter) / g(P::PitchDiameter);
    let gamma = ratio * cos;
    let balls = half * g(P::Balls);
    [balls * (one - gamma), balls * (one + gamma), (one - gamma * gamma) / ratio, half * (one - gamma)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use BearingParameter as P;

    fn raw(changes: &[(P, f64)]) -> Vec<f64> {
        let mut raw: Vec<f64> = BEARING.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        for &(p, x) in changes {
            raw[p as usize] = x;
        }
        raw
    }
    fn bearing(changes: &[(P, f64)]) -> Bearing<f64> {
        Bearing::derive(&raw(changes))
    }

    #[test]
    fn every_default_is_in_its_range() {
        for v in BEARING {
            assert!(v.default.is_some_and(|x| v.range.contains(x)), "{}", v.path);
        }
    }

    /// The maker's table of the 6205: 9 balls of 7.94 mm on 39.04 mm: 3.5848, 5.4152, 4.7135 (twice 2.3567), 0.3983.
    #[test]
    fn orders_are_those_of_the_geometry() {
        let found = orders(&raw(&[(P::Balls, 9.0), (P::BallDiameter, 7.94e-3), (P::PitchDiameter, 39.04e-3)]));
        for (x, printed) in found.into_iter().zip([3.5848, 5.4152, 4.7135, 0.3983]) {
            assert!((x / printed - 1.0_f64).abs() < 1e-3, "{x} against {printed}");
        }
        // Whatever the geometry, both rings together see every ball once a turn.
        assert!((found[0] + found[1] - 9.0).abs() < 1e-12);
    }

    #[test]
    fn a_healthy_bearing_adds_nothing() {
        let b = bearing(&[]);
        for angle in [0.0, 0.3, 7.9] {
            let x = b.torque(angle, 2.0, 0.0);
            assert_eq!((x.torque, x.friction), (0.0, 0.0));
        }
    }

    /// The torque is that of a well: over a pass it does no work, and its peak is 8 / (3 sqrt 3) Q delta order / half width.
    #[test]
    fn a_pass_is_a_well_of_energy() {
        let w = 1e-3;
        let b = bearing(&[(P::OuterDefect, w)]);
        let [order, ..] = orders(&raw(&[]));
        let n = 400_000;
        let (mut work, mut peak) = (0.0, 0.0_f64);
        let pass = TAU / order;
        for i in 0..n {
            let torque = b.torque(pass * f64::from(i) / f64::from(n), 0.0, 0.0).torque;
            work += torque * pass / f64::from(n);
            peak = peak.max(torque);
        }
        let force = 5.0 + 5.0 / 8.0 * 30.0;
        let drop = w * w / (4.0 * 5.95e-3);
        let half_width = PI * w / (PI * 0.025 / 8.0);
        let expected = 8.0 / (3.0 * 3.0_f64.sqrt()) * force * drop * order / half_width;
        assert!(work.abs() < 1e-9, "{work}");
        assert!((peak / expected - 1.0).abs() < 1e-4, "{peak} against {expected}");
        let friction = b.torque(0.1, 0.0, 0.0).friction;
        assert!((friction - 0.5 * force * drop * order / TAU).abs() < 1e-15);
    }

    /// As many pulses in many turns as the order states, and stronger under load.
    #[test]
    fn passes_are_counted_by_the_order_and_grow_with_the_load() {
        for (p, i) in [(P::OuterDefect, 0), (P::InnerDefect, 1), (P::BallDefect, 2)] {
            let b = bearing(&[(p, 5e-4)]);
            let order = orders(&raw(&[]))[i];
            let (mut count, mut last, turns, n) = (0, 0.0, 100.0, 2_000_000);
            for k in 0..n {
                let torque = b.torque(TAU * turns * f64::from(k) / f64::from(n), 0.0, 0.0).torque;
                if last <= 0.0 && torque > 0.0 {
                    count += 1;
                }
                last = torque;
            }
            assert!((f64::from(count) - turns * order).abs() <= 1.0, "{p:?}: {count} against {}", turns * order);
            let angle = 1e-3;
            let (idle, loaded) = (b.torque(angle, 0.0, 0.0), b.torque(angle, -1.0, 0.0));
            assert!(loaded.torque.abs() > 2.0 * idle.torque.abs() && loaded.friction > 2.0 * idle.friction);
        }
    }

    #[test]
    fn a_worn_cage_rubs_once_a_turn_of_the_cage() {
        let b = bearing(&[(P::CageDrag, 0.02)]);
        let [.., cage] = orders(&raw(&[]));
        assert!((b.torque(0.0, 0.0, 0.0).friction - 0.02).abs() < 1e-15);
        assert!(b.torque(PI / cage, 0.0, 0.0).friction < 1e-12);
        assert!((b.torque(TAU / cage, 0.0, 0.0).friction - 0.02).abs() < 1e-12);
    }

    /// Half the friction coefficient times pull times bore.
    #[test]
    fn the_magnetic_pull_rubs_at_the_bore() {
        let x = bearing(&[]).torque(0.4, 0.0, 49.0);
        assert!((x.friction - 0.5 * 1.5e-3 * 49.0 * 0.015).abs() < 1e-15 && x.torque == 0.0);
    }
}
