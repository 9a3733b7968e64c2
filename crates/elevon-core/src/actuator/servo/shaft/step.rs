//! A step of the shaft and of the load side, and the accounts of their work.

use super::loads::Loads;
use super::{Shaft, ShaftDetails, ShaftState};
use crate::actuator::servo::advance::Instant;
use crate::scalar::Scalar;
use crate::transmission::friction::Friction;

impl<S: Scalar> Shaft<S> {
    /// Torque left to accelerate under the motor's `torque`.
    #[inline(always)]
    pub(in crate::actuator::servo) fn net(loads: &Loads<S>, speed: S, torque: S) -> S {
        Friction::net_torque(torque, loads.load, loads.resist, speed, loads.static_limit)
    }

    /// One step under the motor's `torque`.
    #[inline(always)]
    pub(in crate::actuator::servo) fn step<const FULL: bool, const EXTRA: bool>(
        &self,
        d: &ShaftDetails,
        x: &Instant<S>,
        s: &mut ShaftState<S>,
        loads: &Loads<S>,
        torque: S,
    ) {
        let speed = s.motor_speed;
        let free = self.dt_per_inertia.fma(Self::net(loads, speed, torque), speed);
        let new_speed = Friction::stop_at_reversal(speed, free);
        let moved = self.dt.fma(if d.semi_implicit { new_speed } else { speed }, s.motor_position);
        let (position, held_speed) = self.gear.stop(moved, new_speed);
        if FULL && d.accounts {
            let dry = Friction::dry_torque(torque - loads.load, speed, loads.static_limit, loads.dynamic);
            self.account(s, loads, [speed, new_speed, held_speed], dry);
        }
        if FULL && d.elastic {
            self.user_step::<EXTRA>(d, x, s, loads);
        } else {
            s.user_position = self.play.drag(position * self.gear.per_ratio, s.user_position);
        }
        if FULL && d.jams {
            let passed = ((s.user_position - self.friction.jam_position) * s.jam_side).le(S::zero());
            let seized = passed | S::splat(0.5).lt(self.friction.jam_anywhere);
            s.jammed = S::select(seized, S::one(), s.jammed);
        }
        s.motor_position = position;
        s.motor_speed = held_speed;
    }

    /// The second mass of the elastic play.
    #[inline(always)]
    fn user_step<const EXTRA: bool>(&self, d: &ShaftDetails, x: &Instant<S>, s: &mut ShaftState<S>, loads: &Loads<S>) {
        let speed = s.user_speed;
        let active = loads.through - loads.user_torque;
        let new_speed = if EXTRA && d.load_side {
            let dry = self.load_side_friction(d, x);
            let net = Friction::net_torque(active, S::zero(), (self.load_damping).fma(speed, speed.signed(dry)), speed, dry);
            Friction::stop_at_reversal(speed, speed + self.dt * (self.per_user_inertia * net))
        } else {
            speed + self.dt * (self.per_user_inertia * active)
        };
        if d.accounts {
            let middle = S::splat(0.5) * (speed + new_speed);
            s.work.load = s.work.load + self.dt * loads.user_torque * middle;
            if EXTRA && d.load_side {
                self.account_load_side(d, x, s, active, middle);
            }
            let motor = s.motor_speed * self.gear.per_ratio;
            s.work.impact = s.work.impact + self.dt * loads.through * (motor - middle);
        }
        s.user_position = s.user_position + self.dt * if d.semi_implicit { new_speed } else { speed };
        s.user_speed = new_speed;
    }

    /// Work of a step at its middle; `speeds` before, after and as the stops leave it.
    #[inline(always)]
    fn account(&self, s: &mut ShaftState<S>, loads: &Loads<S>, [old, new, held]: [S; 3], dry: S) {
        let half = S::splat(0.5);
        let middle = half * (old + new);
        // The brake takes its share of the dry friction.
        let share = loads.brake / loads.dynamic.maximum(S::splat(1e-300));
        s.work.brake = s.work.brake + self.dt * (dry * share) * middle;
        s.work.friction = s.work.friction + self.dt * (dry * (S::one() - share) + loads.viscous) * middle;
        s.work.load = s.work.load + self.dt * loads.own * middle;
        s.work.impact = s.work.impact + half * self.inertia * (new * new - held * held);
    }

    #[inline(always)]
    fn account_load_side(&self, d: &ShaftDetails, x: &Instant<S>, s: &mut ShaftState<S>, active: S, middle: S) {
        let limit = self.load_side_friction(d, x);
        let dry = Friction::dry_torque(active, s.user_speed, limit, limit);
        let braked = if d.linear { dry * (x.brake / limit.maximum(S::splat(1e-300))) } else { S::zero() };
        s.work.brake = s.work.brake + self.dt * braked * middle;
        s.work.friction = s.work.friction + self.dt * (dry - braked + self.load_damping * s.user_speed) * middle;
    }
}
