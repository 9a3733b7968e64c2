//! A step of the shaft and of the load side, and the accounts of their work.

use super::loads::Loads;
use super::{Shaft, ShaftDetails, ShaftState};
use crate::actuator::servo::advance::Instant;
use crate::scalar::Scalar;
use crate::transmission::friction::Friction;
use crate::transmission::friction_law::{Moved, Push};

impl<S: Scalar> Shaft<S> {
    /// Acceleration of a shaft of the inertia 1/`per_inertia` under the motor's `torque`.
    #[inline(always)]
    pub(in crate::actuator::servo) fn acceleration<const FULL: bool, const EXTRA: bool>(
        &self,
        d: &ShaftDetails,
        s: &ShaftState<S>,
        loads: &Loads<S>,
        torque: S,
        per_inertia: S,
    ) -> S {
        if EXTRA && d.train.law.bristles() {
            return (self.on_bristles(d, s, loads, torque, self.dt * per_inertia).speed - s.motor_speed) / self.dt;
        }
        self.net::<FULL>(d, s, loads, torque) * per_inertia
    }

    /// Torque left to accelerate under the motor's `torque`, by friction and a stop that it stands at.
    #[inline(always)]
    fn net<const FULL: bool>(&self, d: &ShaftDetails, s: &ShaftState<S>, loads: &Loads<S>, torque: S) -> S {
        let speed = s.motor_speed;
        let net = Friction::net_torque(torque, loads.load, loads.resist, speed, loads.static_limit);
        if FULL && d.elastic {
            return net;
        }
        if FULL && d.buffered {
            let stop = self.gear.motor_stop.force(s.motor_position, speed);
            return Friction::net_torque(torque, loads.load + stop, loads.resist + stop, speed, loads.static_limit);
        }
        self.gear.motor_stop.react(s.motor_position, speed, net)
    }

    /// Position and speed after a step at the motor's end stops.
    #[inline(always)]
    fn at_stop<const FULL: bool>(&self, d: &ShaftDetails, s: &ShaftState<S>, new_speed: S, moved: S) -> (S, S) {
        if FULL && d.elastic {
            return (moved, new_speed);
        }
        if FULL && d.buffered {
            let inertia = self.moving_inertia(d, s);
            return self.gear.motor_stop.give_way([s.motor_position, moved], [s.motor_speed, new_speed], inertia, self.dt);
        }
        self.gear.motor_stop.hold(moved, new_speed)
    }

    /// A step on bristles.
    #[inline(always)]
    fn on_bristles(&self, d: &ShaftDetails, s: &ShaftState<S>, loads: &Loads<S>, torque: S, dt_per_inertia: S) -> Moved<S> {
        let push = Push {
            free: dt_per_inertia.fma(torque - loads.load - loads.viscous, s.motor_speed),
            limits: [loads.static_limit, loads.dynamic],
            dt: self.dt,
            dt_per_inertia,
        };
        let bristle = &self.train.law.bristle;
        if d.elastic || d.buffered {
            bristle.advance(&push, s.bristle)
        } else {
            bristle.advance_at_stop(&push, s.bristle, s.motor_speed, &self.gear.motor_stop, s.motor_position)
        }
    }

    /// New speed, and the dry friction where bristles decide it.
    #[inline(always)]
    fn new_speed<const FULL: bool, const EXTRA: bool>(
        &self,
        d: &ShaftDetails,
        s: &mut ShaftState<S>,
        loads: &Loads<S>,
        torque: S,
    ) -> (S, Option<S>) {
        let mut dt_per_inertia = self.dt_per_inertia;
        if FULL && d.flanks {
            dt_per_inertia = S::select(self.joined(s), dt_per_inertia, self.dt_per_rotor);
        }
        if EXTRA && d.train.law.bristles() {
            let moved = self.on_bristles(d, s, loads, torque, dt_per_inertia);
            s.bristle = moved.bristle;
            return (moved.speed, Some(moved.dry));
        }
        let mut net = self.net::<FULL>(d, s, loads, torque);
        if FULL && d.buffered && !d.elastic {
            // The stop has a step of its own.
            net = net + self.gear.motor_stop.force(s.motor_position, s.motor_speed);
        }
        let free = dt_per_inertia.fma(net, s.motor_speed);
        (Friction::stop_at_reversal(s.motor_speed, free), None)
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
        let (new_speed, on_bristles) = self.new_speed::<FULL, EXTRA>(d, s, loads, torque);
        let moved = self.dt.fma(self.advancing(d, speed, new_speed), s.motor_position);
        let (position, end_speed) = self.at_stop::<FULL>(d, s, new_speed, moved);
        if FULL && (d.accounts || EXTRA && d.train.iron) {
            let dry = on_bristles.unwrap_or_else(|| Friction::dry_torque(torque - loads.load, speed, loads.static_limit, loads.dynamic));
            self.account::<EXTRA>(d, s, loads, [speed, new_speed, end_speed], dry);
        }
        if EXTRA && d.nut {
            s.nut.collected = s.nut.collected + self.dt * self.nut.share * loads.nut * speed.abs();
        }
        if EXTRA && d.vibrates {
            let force = self.shaking(d, s, loads.through, torque);
            self.vibration.step(&mut s.vibration, force, self.dt);
        }
        if FULL && d.elastic {
            if EXTRA && d.meshed {
                self.move_bodies(d, s, loads, S::splat(0.5) * (speed + new_speed));
            }
            self.output_step::<EXTRA>(d, x, s, loads);
        } else if !(FULL && d.flanks) {
            s.output_position = self.drag::<EXTRA>(d, position, s.output_position);
        }
        s.motor_position = position;
        s.motor_speed = end_speed;
        s.fastest = s.fastest.maximum(new_speed.abs());
        if FULL && d.flanks {
            self.output_at_flank::<EXTRA>(d, x, s, loads, speed);
        }
        if FULL && d.jams {
            self.friction.seize(s.output_position, &mut s.jam_side, &mut s.jammed);
        }
    }

    /// Speed that moves the position in a step.
    #[inline(always)]
    fn advancing(&self, d: &ShaftDetails, speed: S, new_speed: S) -> S {
        if d.middle {
            S::splat(0.5) * (speed + new_speed)
        } else if d.semi_implicit {
            new_speed
        } else {
            speed
        }
    }

    /// Force on the housing at the orders of its parts.
    #[inline(always)]
    fn shaking(&self, d: &ShaftDetails, s: &ShaftState<S>, through: S, torque: S) -> S {
        let angle = s.motor_position;
        let missing = self.screw.missing(angle, through, angle * self.gear.per_ratio, self.vibration.per_approach);
        let turning = self.unbalance.force(angle, s.motor_speed) + self.train.rub_force(&d.train, angle, s.motor_speed);
        missing + turning + self.vibration.mesh(angle, torque)
    }

    /// The output as the backlash operator leaves it.
    #[inline(always)]
    fn drag<const EXTRA: bool>(&self, d: &ShaftDetails, position: S, output: S) -> S {
        let driver = position * self.gear.per_ratio;
        if EXTRA && d.train.teeth {
            self.backlash.follow_worn(driver, output, self.train.lag(position))
        } else {
            self.backlash.follow(driver, output)
        }
    }

    /// The second mass of the elastic backlash; its end stop is where the output stands.
    #[inline(always)]
    fn output_step<const EXTRA: bool>(&self, d: &ShaftDetails, x: &Instant<S>, s: &mut ShaftState<S>, loads: &Loads<S>) {
        let speed = s.output_speed;
        let active = loads.delivered - loads.output_torque;
        let new_speed = if EXTRA && d.load_side {
            let dry = self.load_side_friction(d, x);
            let net = Friction::net_torque(active, S::zero(), (self.load_damping).fma(speed, speed.signed(dry)), speed, dry);
            let net = if d.buffered { net } else { self.gear.output_stop.react(s.output_position, speed, net) };
            Friction::stop_at_reversal(speed, speed + self.dt * (self.per_output_inertia * net))
        } else {
            let net = if d.buffered { active } else { self.gear.output_stop.react(s.output_position, speed, active) };
            speed + self.dt * (self.per_output_inertia * net)
        };
        let moved = s.output_position + self.dt * if d.semi_implicit { new_speed } else { speed };
        let stop = &self.gear.output_stop;
        let (position, end_speed) = if d.buffered {
            stop.give_way([s.output_position, moved], [speed, new_speed], self.output_inertia, self.dt)
        } else {
            stop.hold(moved, new_speed)
        };
        if d.accounts {
            let middle = S::splat(0.5) * (speed + new_speed);
            s.work.load = s.work.load + self.dt * loads.output_torque * middle;
            if EXTRA && d.load_side {
                self.account_load_side(d, x, s, active, middle);
            }
            let motor = s.motor_speed * self.gear.per_ratio;
            let stopped = S::splat(0.5) * self.output_inertia * (new_speed * new_speed - end_speed * end_speed);
            // Motor and bodies have given their part to the meshes.
            let wound = if EXTRA && d.meshed { -(self.dt * loads.delivered * middle) } else { self.dt * loads.through * (motor - middle) };
            s.work.impact = s.work.impact + wound + stopped;
        }
        s.output_position = position;
        s.output_speed = end_speed;
        s.fastest = s.fastest.maximum((new_speed * self.gear.ratio).abs());
    }

    /// Work of a step at its middle; `speeds` before, after and as the stops leave it.
    #[inline(always)]
    fn account<const EXTRA: bool>(&self, d: &ShaftDetails, s: &mut ShaftState<S>, loads: &Loads<S>, [old, new, end_speed]: [S; 3], dry: S) {
        let half = S::splat(0.5);
        let middle = half * (old + new);
        // The brake takes its share of the dry friction.
        let whole = loads.dynamic.maximum(S::splat(1e-300));
        let share = loads.brake / whole;
        if EXTRA && d.train.iron {
            let iron = dry * (loads.iron / whole);
            s.work.iron = s.work.iron + self.dt * iron * middle;
            s.work.friction = s.work.friction - self.dt * iron * middle;
        }
        s.work.brake = s.work.brake + self.dt * (dry * share) * middle;
        s.work.friction = s.work.friction + self.dt * (dry * (S::one() - share) + loads.viscous) * middle;
        s.work.load = s.work.load + self.dt * loads.motor_side * middle;
        s.work.impact = s.work.impact + half * self.moving_inertia(d, s) * (new * new - end_speed * end_speed);
    }

    #[inline(always)]
    fn account_load_side(&self, d: &ShaftDetails, x: &Instant<S>, s: &mut ShaftState<S>, active: S, middle: S) {
        let limit = self.load_side_friction(d, x);
        let dry = Friction::dry_torque(active, s.output_speed, limit, limit);
        let braked = if d.linear { dry * (x.brake / limit.maximum(S::splat(1e-300))) } else { S::zero() };
        s.work.brake = s.work.brake + self.dt * braked * middle;
        s.work.friction = s.work.friction + self.dt * (dry - braked + self.load_damping * s.output_speed) * middle;
    }
}
