//! Rub of the rotor on the stator: the gap closes on one side where the eccentricity is large, or where something fills it.
//!
//! Rotor and stator touch where |e| + filled > c; all are fractions of the gap. The rotor is then pushed back against its
//! own bending and its bearings, N = K (|e| + filled - c), and the contact rubs with T = mu N R against the motion (Coulomb).
//! A static eccentricity presses in one direction, a dynamic one turns with the shaft: it shakes the stator once a turn. Both
//! together touch once a turn. The heat of the rub warms no node, and the touching parts do not wear.

use super::magnetic_pull::Eccentricity;
use super::star::MotorParameter;
use crate::scalar::Scalar;
use crate::variable::{acts::When, View};
use crate::variables;

variables! {
    /// Where and how the rotor rubs on the stator.
    RubParameter, RUB {
        RubFilled => "rub_filled", "f", "1", Unit, Plant, Some(0.0), "healthy 0; share of the air gap that something fills: a lifted sleeve or magnet, a burr, debris";
        RubClearance => "rub_clearance", "c", "1", Between(0.05, 1.0), Plant, Some(0.95), "eccentricity, fraction of the air gap, at which rotor and stator touch; ASSUMED: runout and tilt of the rotor's ends use up a twentieth",
            when(CLOSING);
        RubStiffness => "rub_stiffness", "K", "N", NonNegative, Plant, Some(1e4), "force of the contact per relative eccentricity; ASSUMED: rotor in its bearings 2e7 N/m, gap 0.5 mm",
            when(CLOSING);
        RubFriction => "rub_friction", "mu", "1", Between(0.0, 1.0), Plant, Some(0.2), "Coulomb friction of the contact; ASSUMED: steel on steel or resin, dry, 0.15 to 0.3",
            when(CLOSING);
        RubRadius => "rub_radius", "R", "m", Positive, Plant, Some(0.016), "radius of the rotor; ASSUMED as for motor.magnetic_pull",
            when(CLOSING);
    }
}

/// What may close the gap.
const CLOSING: &[When] = &[When::Either(&[
    When::Away("motor.rub_filled", 0.0),
    When::Away("motor.eccentricity_static", 0.0),
    When::Away("motor.eccentricity_dynamic", 0.0),
    When::Away("motor.unbalance_inertia", 0.0),
])];

#[derive(Clone, Copy, Debug)]
pub struct Rub<S> {
    /// Eccentricity at which the gap is closed.
    free: S,
    stiffness: S,
    friction: S,
    radius: S,
}

impl<S: Scalar> Rub<S> {
    /// Can the gap close? An eccentricity that a fault moves may become any; `unbalanced` adds one that depends on inertias.
    pub fn needed(view: &View<RubParameter>, motor: &View<MotorParameter>, unbalanced: bool) -> bool {
        let eccentricity = motor.most(MotorParameter::EccentricityStatic) + motor.most(MotorParameter::EccentricityDynamic);
        unbalanced || eccentricity + view.most(RubParameter::RubFilled) > view.value(RubParameter::RubClearance)
    }

    pub fn derive(raw: &[S]) -> Self {
        use RubParameter as P;
        let g = |p: P| raw[p as usize];
        Self {
            free: g(P::RubClearance) - g(P::RubFilled),
            stiffness: g(P::RubStiffness),
            friction: g(P::RubFriction),
            radius: g(P::RubRadius),
        }
    }

    /// Normal force where the rotor stands so far out of centre.
    #[inline(always)]
    fn normal(&self, [x, y]: [S; 2]) -> S {
        self.stiffness * (x.fma(x, y * y).sqrt() - self.free).maximum(S::zero())
    }

    /// Normal force and friction torque on the shaft at a rotor angle.
    #[inline(always)]
    pub fn contact(&self, eccentricity: &Eccentricity<S>, angle: S) -> [S; 2] {
        let normal = self.normal(eccentricity.at(angle));
        [normal, self.friction * normal * self.radius]
    }

    /// Force on the stator along the static eccentricity: the contact presses outwards and rubs against the rotor's motion. A
    /// gap that is filled all round a centred rotor pushes nowhere.
    #[inline(always)]
    pub fn force(&self, eccentricity: &Eccentricity<S>, angle: S, speed: S) -> S {
        let [x, y] = eccentricity.at(angle);
        let size = x.fma(x, y * y).sqrt();
        let along = x - self.friction * speed.sign() * y;
        self.normal([x, y]) * along / size.maximum(S::splat(1e-12))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;
    use RubParameter as P;

    fn rub(changes: &[(P, f64)]) -> Rub<f64> {
        let mut raw: Vec<f64> = RUB.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        for &(p, x) in changes {
            raw[p as usize] = x;
        }
        Rub::derive(&raw)
    }

    fn eccentric(fixed: f64, turning: f64) -> Eccentricity<f64> {
        Eccentricity::new(fixed, [turning, 0.0])
    }

    #[test]
    fn nothing_rubs_while_the_gap_is_open() {
        for e in [eccentric(0.0, 0.0), eccentric(0.9, 0.0), eccentric(0.5, 0.45)] {
            for angle in [0.0, 1.0, 4.0] {
                assert_eq!(rub(&[]).contact(&e, angle), [0.0, 0.0]);
                assert_eq!(rub(&[]).force(&e, angle, 3.0), 0.0);
            }
        }
    }

    /// K (|e| + f - c), and mu R times that.
    #[test]
    fn a_closed_gap_presses_and_rubs() {
        for (e, filled, depth) in [(eccentric(0.97, 0.0), 0.0, 0.02), (eccentric(0.0, 0.4), 0.6, 0.05), (eccentric(0.0, 0.0), 1.0, 0.05)] {
            for angle in [0.0, 0.7, 2.9] {
                let [normal, torque] = rub(&[(P::RubFilled, filled)]).contact(&e, angle);
                assert!((normal - 1e4 * depth).abs() < 1e-9, "{normal}");
                assert!((torque - 0.2 * 1e4 * depth * 0.016).abs() < 1e-12, "{torque}");
            }
        }
    }

    /// Where the two point in the same direction: the contact lasts while cos theta > (c^2 - a^2 - b^2)/(2 a b).
    #[test]
    fn static_and_dynamic_together_touch_once_a_turn() {
        let (a, b, c) = (0.5_f64, 0.48, 0.95);
        let (e, r) = (eccentric(a, b), rub(&[]));
        let edge = ((c * c - a * a - b * b) / (2.0 * a * b)).acos();
        assert!((r.contact(&e, 0.0)[0] - 1e4 * 0.03).abs() < 1e-9);
        for side in [-1.0, 1.0] {
            assert!(r.contact(&e, side * (edge - 1e-6))[0] > 0.0);
            assert_eq!(r.contact(&e, side * (edge + 1e-6))[0], 0.0);
        }
        assert_eq!(r.contact(&e, PI)[0], 0.0);
    }

    /// A dynamic eccentricity alone: constant friction, and sqrt(1 + mu^2) N once a turn on the stator.
    #[test]
    fn a_turning_contact_shakes_the_stator_once_a_turn() {
        let (e, r) = (eccentric(0.0, 0.97), rub(&[]));
        for speed in [-2.0_f64, 2.0] {
            for i in 0..20 {
                let angle = 0.4 * f64::from(i);
                let exact = 200.0 * (angle.cos() - 0.2 * speed.signum() * angle.sin());
                assert!((r.force(&e, angle, speed) - exact).abs() < 1e-9);
            }
        }
        assert_eq!(rub(&[(P::RubFilled, 1.0)]).force(&eccentric(0.0, 0.0), 0.3, 1.0), 0.0);
    }
}
