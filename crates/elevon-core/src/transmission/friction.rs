//! Borello's dry friction with exact stick (T2; reference sheet 1.6) and viscous friction.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;

variables! {
    /// Friction, referred to the motor shaft.
    FrictionParameter, FRICTION {
        Static => "static", "FSJ", "N m", NonNegative, Plant, None, "static friction limit";
        Dynamic => "dynamic", "FDJ", "N m", NonNegative, Plant, None, "dynamic dry friction";
        DryScale => "dry_scale", "-", "1", NonNegative, Plant, Some(1.0), "healthy 1; growth of the dry friction",
            when(&[Either(&[Away("friction.static", 0.0), Away("friction.dynamic", 0.0)])]);
        ReverseScale => "reverse_scale", "-", "1", NonNegative, Plant, Some(1.0), "dry friction of negative motion over that of positive motion",
            when(&[Either(&[Away("friction.static", 0.0), Away("friction.dynamic", 0.0)])]);
        Viscous => "viscous", "C", "N m s/rad", NonNegative, Plant, None, "viscous coefficient at rest";
        ViscousSlope => "viscous_slope", "-", "s/rad", Any, Plant, Some(0.0), "relative change of the viscous coefficient per rad/s: C(w) = C (1 + slope |w|), not below zero",
            when(&[Away("friction.viscous", 0.0)]);
        ViscousScale => "viscous_scale", "-", "1", NonNegative, Plant, Some(1.0), "healthy 1; change of the lubricant",
            when(&[Away("friction.viscous", 0.0)]);
        JamTorque => "jam_torque", "T_jam", "N m", NonNegative, Plant, Some(0.0), "resistive torque once the mechanism has seized; 0: none";
        JamPosition => "jam_position", "-", "rad", Any, Plant, Some(0.0), "output position at which it seizes when first reached",
            when(&[Away("friction.jam_torque", 0.0), Away("friction.jam_anywhere", 1.0)]);
        JamAnywhere => "jam_anywhere", "-", "1", Flag, Plant, Some(1.0), "1: seized wherever it is, 0: only from jam_position on",
            when(&[Away("friction.jam_torque", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Friction<S> {
    pub static_limit: S,
    pub dynamic: S,
    pub viscous: S,
    viscous_slope: S,
    reverse_scale: S,
    pub jam_torque: S,
    pub jam_position: S,
    pub jam_anywhere: S,
}

impl<S: Scalar> Friction<S> {
    pub fn derive(raw: &[S]) -> Self {
        use FrictionParameter as P;
        let g = |p: P| raw[p as usize];
        Self {
            static_limit: g(P::Static) * g(P::DryScale),
            dynamic: g(P::Dynamic) * g(P::DryScale),
            viscous: g(P::Viscous) * g(P::ViscousScale),
            viscous_slope: g(P::ViscousSlope),
            reverse_scale: g(P::ReverseScale),
            jam_torque: g(P::JamTorque),
            jam_position: g(P::JamPosition),
            jam_anywhere: g(P::JamAnywhere),
        }
    }

    /// Does the viscous coefficient change with the speed?
    pub fn sloped(view: &View<FrictionParameter>) -> bool {
        view.away(FrictionParameter::ViscousSlope)
    }

    /// Does the dry friction differ between the directions?
    pub fn directed(view: &View<FrictionParameter>) -> bool {
        view.away(FrictionParameter::ReverseScale)
    }

    /// Dry friction, at rest and moving, in the direction of motion, or of the `active` torque that would start it.
    #[inline(always)]
    pub fn in_direction(&self, limits: [S; 2], speed: S, active: S) -> [S; 2] {
        let direction = S::select(speed.equals(S::zero()), active, speed);
        let scale = S::select(direction.lt(S::zero()), self.reverse_scale, S::one());
        [limits[0] * scale, limits[1] * scale]
    }

    /// Does the mechanism ever seize?
    pub fn jams(view: &View<FrictionParameter>) -> bool {
        view.away(FrictionParameter::JamTorque)
    }

    /// Static over dynamic dry friction, 1 where there is none: what else is dry sticks as much above its dynamic value.
    pub fn stick(raw: &[S]) -> S {
        let (fixed, moving) = (raw[FrictionParameter::Static as usize], raw[FrictionParameter::Dynamic as usize]);
        let dry = S::zero().lt(moving);
        S::select(dry, fixed / S::select(dry, moving, S::one()), S::one())
    }

    /// Scales the lubricant's drag.
    pub fn lubricated(&mut self, viscous: S) {
        self.viscous = self.viscous * viscous;
    }

    /// C(w) w.
    #[inline(always)]
    pub fn viscous_torque(&self, speed: S) -> S {
        let factor = (S::one() + self.viscous_slope * speed.abs()).maximum(S::zero());
        self.viscous * factor * speed
    }

    /// Dry friction at `speed` under the `active` torque: at rest it holds what it can.
    #[inline(always)]
    pub fn dry_torque(active: S, speed: S, static_limit: S, dynamic: S) -> S {
        let sticking = active.clamp_abs(static_limit);
        S::select(speed.equals(S::zero()), sticking, speed.signed(dynamic))
    }

    /// Torque left to accelerate. `active` is what would move the shaft from rest, `resist` what opposes it when it moves
    /// (loads, dynamic dry and viscous friction): two early sums, so that the motor torque enters last.
    #[inline(always)]
    pub fn net_torque(torque: S, load: S, resist: S, speed: S, static_limit: S) -> S {
        let at_rest = speed.equals(S::zero());
        if !S::any(at_rest) {
            return torque - resist;
        }
        let active = torque - load;
        let from_rest = active - active.clamp_abs(static_limit);
        S::select(at_rest, from_rest, torque - resist)
    }

    /// Seizes where the output first reaches the jam's position while the jam is there; one that is gone holds nothing.
    /// `side` is where the output stood when the jam came. One without a position holds from its first step on.
    #[inline(always)]
    pub fn seize(&self, output: S, side: &mut S, jammed: &mut S) {
        let present = S::zero().lt(self.jam_torque);
        let from = output - self.jam_position;
        let seized = S::select((from * *side).le(S::zero()), S::one(), *jammed);
        let here = S::select(present, seized, S::zero());
        *jammed = S::select(S::splat(0.5).le(self.jam_anywhere), S::one(), here);
        *side = S::select(present, *side, from.sign());
    }

    /// The new speed, stopped for one step where it would change sign.
    #[inline(always)]
    pub fn stop_at_reversal(old: S, new: S) -> S {
        let reversed = (old * new).lt(S::zero());
        if S::any(reversed) {
            S::select(reversed, S::zero(), new)
        } else {
            new
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jam(torque: f64, anywhere: f64) -> Friction<f64> {
        let mut raw = [0.0; FRICTION.len()];
        raw[FrictionParameter::JamTorque as usize] = torque;
        raw[FrictionParameter::JamPosition as usize] = 1.0;
        raw[FrictionParameter::JamAnywhere as usize] = anywhere;
        Friction::derive(&raw)
    }

    /// Seized or not after each (torque, output position).
    fn history(anywhere: f64, steps: &[(f64, f64)]) -> Vec<f64> {
        let (mut side, mut jammed) = (-1.0, 0.0);
        let mut seen = Vec::new();
        for &(torque, output) in steps {
            jam(torque, anywhere).seize(output, &mut side, &mut jammed);
            seen.push(jammed);
        }
        seen
    }

    #[test]
    fn a_passage_before_the_jam_does_not_seize() {
        let there_and_back = [(0.0, 0.5), (0.0, 1.5), (2.0, 1.5), (2.0, 1.2), (2.0, 0.9), (2.0, 0.2)];
        assert_eq!(history(0.0, &there_and_back), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn a_jam_that_is_gone_must_be_reached_again() {
        let gone = [(2.0, 1.5), (0.0, 1.5), (2.0, 1.4), (2.0, 0.9)];
        assert_eq!(history(0.0, &gone), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(history(1.0, &[(0.0, 0.2), (2.0, 0.2), (0.0, 0.2)]), [1.0, 1.0, 1.0]);
    }

    #[test]
    fn dry_friction_has_a_value_for_each_direction() {
        let mut raw = [0.0; FRICTION.len()];
        raw[FrictionParameter::ReverseScale as usize] = 1.5;
        let friction = Friction::<f64>::derive(&raw);
        assert_eq!(friction.in_direction([0.4, 0.2], 3.0, -9.0), [0.4, 0.2]);
        assert_eq!(friction.in_direction([0.4, 0.2], -3.0, 9.0), [0.4 * 1.5, 0.2 * 1.5]);
        // At rest what would start the motion decides.
        assert_eq!(friction.in_direction([0.4, 0.2], 0.0, 9.0), [0.4, 0.2]);
        assert_eq!(friction.in_direction([0.4, 0.2], 0.0, -9.0), [0.4 * 1.5, 0.2 * 1.5]);
    }
}
