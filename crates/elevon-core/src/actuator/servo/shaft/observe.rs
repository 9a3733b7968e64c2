//! The shaft's signals for an observer. Nothing here feeds back.

use super::loads::Loads;
use super::train::Added;
use super::{Shaft, ShaftDetails, ShaftState};
use crate::actuator::servo::advance::Instant;
use crate::scalar::Scalar;
use crate::transmission::friction::Friction;
use crate::transmission::gear_train::MESHES;

/// The shaft's signals for an observer.
pub(in crate::actuator::servo) struct ShaftSignals<S> {
    pub output_speed: S,
    pub friction: S,
    pub brake: S,
    pub load: S,
    pub output_torque: S,
    pub through: S,
    pub unbalance: S,
    /// Loss of the motor's iron, W.
    pub iron: S,
    pub added: Added<S>,
    /// Torque on the motor shaft that an end stop cancels.
    pub stop: S,
    /// Torques of the meshes of a gear of several bodies.
    pub meshes: [S; MESHES],
}

impl<S: Scalar> Shaft<S> {
    /// The shaft's signals while the motor gives `torque`.
    #[inline(always)]
    pub(in crate::actuator::servo) fn observe(&self, d: &ShaftDetails, x: &Instant<S>, s: &ShaftState<S>, torque: S) -> ShaftSignals<S> {
        let loads = self.loads::<true, true>(d, x, s, torque);
        let dry = self.dry(d, s, &loads, torque);
        ShaftSignals {
            output_speed: self.output_speed(d, s),
            friction: dry + loads.viscous,
            brake: x.brake,
            load: loads.load,
            output_torque: loads.output_torque,
            through: loads.delivered,
            unbalance: if d.unbalance { self.unbalance.torque(s.motor_position) } else { S::zero() },
            iron: loads.iron * s.motor_speed.abs(),
            added: self.train.added(&d.train, s.motor_position, [loads.through, loads.delivered], self.gear.per_ratio),
            stop: self.stopped(d, x, s, &loads, torque - loads.load - dry),
            meshes: loads.meshes,
        }
    }

    /// Dry friction at the instant.
    #[inline(always)]
    fn dry(&self, d: &ShaftDetails, s: &ShaftState<S>, loads: &Loads<S>, torque: S) -> S {
        if d.train.law.bristles() {
            self.train.law.bristle.torque(s.bristle, s.motor_speed, loads.dynamic)
        } else {
            Friction::dry_torque(torque - loads.load, s.motor_speed, loads.static_limit, loads.dynamic)
        }
    }

    /// What a stop cancels, on the motor shaft: of the torque `net` there, or of what pushes the second mass.
    #[inline(always)]
    fn stopped(&self, d: &ShaftDetails, x: &Instant<S>, s: &ShaftState<S>, loads: &Loads<S>, net: S) -> S {
        let zero = S::zero();
        if d.buffered {
            let (stop, at) = if d.elastic {
                (&self.gear.output_stop, [s.output_position, s.output_speed])
            } else {
                (&self.gear.motor_stop, [s.motor_position, s.motor_speed])
            };
            let force = stop.force(at[0], at[1]);
            return if d.elastic { force * self.gear.per_ratio } else { force };
        }
        if d.elastic {
            let active = loads.delivered - loads.output_torque;
            let limit = if d.load_side { self.load_side_friction(d, x) } else { zero };
            let net = active - active.clamp_abs(limit);
            let pressed = s.output_speed.equals(zero) & self.gear.output_stop.outwards(s.output_position, net);
            return S::select(pressed, net * self.gear.per_ratio, zero);
        }
        let pressed = s.motor_speed.equals(zero) & self.gear.motor_stop.outwards(s.motor_position, net);
        S::select(pressed, net, zero)
    }

    /// Where nothing acts on it, the output moves with the motor while the backlash is taken up, else it rests.
    #[inline(always)]
    fn output_speed(&self, d: &ShaftDetails, s: &ShaftState<S>) -> S {
        if d.elastic {
            return s.output_speed;
        }
        let lag = s.motor_position * self.gear.per_ratio - s.output_position;
        let edge = self.backlash.half * S::splat(1.0 - 1e-9);
        let pushing = edge.le(lag.abs()) & S::zero().le(lag * s.motor_speed);
        let follows = S::select(pushing, s.motor_speed * self.gear.per_ratio, S::zero());
        if d.flanks {
            S::select(s.flank.idle(), follows, s.output_speed)
        } else {
            follows
        }
    }

    /// Ram position and speed, the screw's torque at the motor shaft, its efficiencies.
    #[inline(always)]
    pub(in crate::actuator::servo) fn observe_screw(&self, s: &ShaftState<S>, signals: &ShaftSignals<S>) -> [S; 5] {
        let per_ratio = self.gear.per_ratio;
        let efficiency = [self.screw.efficiency, self.screw.efficiency_aiding];
        [s.motor_position * per_ratio, s.motor_speed * per_ratio, signals.through * per_ratio, efficiency[0], efficiency[1]]
    }

    /// Friction and damping of the load side, and the torque of spalls.
    #[inline(always)]
    pub(in crate::actuator::servo) fn observe_load_side(
        &self,
        d: &ShaftDetails,
        x: &Instant<S>,
        s: &ShaftState<S>,
        signals: &ShaftSignals<S>,
    ) -> [S; 2] {
        let limit = self.load_side_friction(d, x);
        let dry = Friction::dry_torque(signals.through - signals.output_torque, signals.output_speed, limit, limit);
        let spall =
            if d.spall { self.screw.spall(s.motor_position, signals.through, s.motor_position * self.gear.per_ratio).0 } else { S::zero() };
        [dry + self.load_damping * signals.output_speed, spall]
    }

    #[inline(always)]
    pub(in crate::actuator::servo) fn kinetic(&self, d: &ShaftDetails, s: &ShaftState<S>) -> S {
        if d.flanks {
            let whole = S::splat(0.5) * self.inertia * s.motor_speed * s.motor_speed;
            return S::select(self.joined(s), whole, self.kinetic_of(s.motor_speed, s.output_speed));
        }
        let half = S::splat(0.5);
        let ends = half * self.inertia * s.motor_speed * s.motor_speed + half * self.output_inertia * s.output_speed * s.output_speed;
        if d.meshed {
            ends + self.kinetic_of_bodies(s)
        } else {
            ends
        }
    }
}
