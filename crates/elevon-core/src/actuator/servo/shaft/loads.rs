//! What acts on the motor shaft.

use super::{Shaft, ShaftDetails, ShaftState};
use crate::actuator::servo::advance::Instant;
use crate::scalar::Scalar;
use crate::transmission::gear_train::MESHES;

/// What acts on the motor shaft.
#[derive(Clone, Copy)]
pub(in crate::actuator::servo) struct Loads<S> {
    pub(super) brake: S,
    pub output_torque: S,
    /// Signed torque on the motor shaft, and the part of it that is not the contact of the elastic backlash.
    pub load: S,
    pub(super) motor_side: S,
    /// Torque between gear and output, at the output: as the motor's side feels it, and as the output does. Only bodies
    /// between take part of it.
    pub(super) through: S,
    pub(super) delivered: S,
    /// Torques of the meshes of a gear of several bodies.
    pub(super) meshes: [S; MESHES],
    pub static_limit: S,
    pub dynamic: S,
    pub(super) viscous: S,
    /// Friction in the nut of a screw.
    pub(super) nut: S,
    /// Drag of the motor's iron, in the dry friction.
    pub(super) iron: S,
    /// All that opposes the motion at the present speed.
    pub(super) resist: S,
}

impl<S: Scalar> Loads<S> {
    /// With a further torque that drives the shaft forwards.
    #[inline(always)]
    pub(in crate::actuator::servo) fn aided(&self, torque: S) -> Self {
        Self { load: self.load - torque, resist: self.resist - torque, ..*self }
    }
}

impl<S: Scalar> Shaft<S> {
    /// Everything on the shaft under the motor's `torque`, which decides the direction of what is about to start.
    #[inline(always)]
    pub(in crate::actuator::servo) fn loads<const FULL: bool, const EXTRA: bool>(
        &self,
        d: &ShaftDetails,
        x: &Instant<S>,
        s: &ShaftState<S>,
        torque: S,
    ) -> Loads<S> {
        let output_torque = self.output_torque(d, x, s);
        let elastic = FULL && d.elastic;
        let meshed = EXTRA && d.meshed;
        let mut through = if elastic && !meshed { self.contact(d, s) } else { output_torque };
        if FULL && d.flanks {
            through = S::select(self.joined(s), through, S::zero());
        }
        let (mut delivered, mut meshes) = (through, [S::zero(); MESHES]);
        if meshed {
            meshes = self.carried(d, s);
            [through, delivered] = self.through_meshes(&meshes);
        }
        let mut load = through.fma(self.gear.per_ratio, x.shaft);
        let mut motor_side = if elastic { x.shaft } else { load };
        let mut added = x.brake;
        let mut nut = S::zero();
        if EXTRA {
            if d.linear {
                added = S::zero();
            }
            if d.load_side && !elastic {
                // Rigid: the load side's friction is felt on the motor shaft.
                added = added + self.felt_friction(d, x, s) * self.gear.per_ratio;
            }
            let (torque, friction, spalled) = self.disturbance(d, s, [through, delivered]);
            load = load - torque;
            motor_side = motor_side - torque;
            added = added + friction;
            nut = spalled;
        }
        let mut carried = through;
        if FULL {
            if d.loaded {
                let direction = self.direction(s, torque - load);
                carried = self.through_gear::<EXTRA>(d, x, s, through, direction);
                let mut lost = self.gear.load_friction(carried, direction);
                if EXTRA && d.lubricated {
                    lost = lost * s.lubricant.loss;
                }
                added = added + lost;
                if EXTRA && d.nut {
                    nut = nut + self.screw_drag(d, s, carried, direction);
                }
            }
            if d.jams {
                added = added + s.jammed * self.friction.jam_torque;
            }
        }
        let mut brake = x.brake;
        let mut limits = [self.friction.static_limit, self.friction.dynamic];
        if EXTRA && d.train.lawful {
            limits = self.train.law.limits(d.train.law, limits, s.motor_speed, torque, load);
        }
        if EXTRA && d.directed {
            limits = self.friction.in_direction(limits, s.motor_speed, torque - load);
        }
        if EXTRA && d.lubricated {
            limits = [limits[0] * s.lubricant.dry, limits[1] * s.lubricant.dry];
        }
        let (mut static_limit, mut dynamic) = (limits[0] + added, limits[1] + added);
        let mut iron = S::zero();
        if EXTRA {
            if d.preloaded {
                let mut preload = self.screw.preload_torque * self.screw.relieved(carried);
                if d.lubricated {
                    preload = preload * s.lubricant.dry;
                }
                static_limit = static_limit + self.stick * preload;
                dynamic = dynamic + preload;
                nut = nut + preload;
            }
            if d.linear {
                brake = if elastic { S::zero() } else { self.felt(d, s, x.brake) * self.gear.per_ratio };
            }
            if d.debris {
                static_limit = static_limit * s.scatter;
                dynamic = dynamic * s.scatter;
                nut = nut * s.scatter;
            }
            if d.train.iron {
                iron = self.train.iron.drag(s.motor_speed);
                (static_limit, dynamic) = (static_limit + iron, dynamic + iron);
            }
        }
        let speed = s.motor_speed;
        let viscous = self.viscous::<FULL, EXTRA>(d, s);
        let resist = load + speed.signed(dynamic) + viscous;
        Loads { brake, output_torque, load, motor_side, through, delivered, meshes, static_limit, dynamic, viscous, nut, iron, resist }
    }

    #[inline(always)]
    pub(super) fn viscous<const FULL: bool, const EXTRA: bool>(&self, d: &ShaftDetails, s: &ShaftState<S>) -> S {
        let speed = s.motor_speed;
        let mut viscous = if FULL && d.sloped { self.friction.viscous_torque(speed) } else { self.friction.viscous * speed };
        if EXTRA && d.lubricated {
            viscous = viscous * s.lubricant.viscous;
        }
        if EXTRA && d.load_side && !d.elastic {
            viscous = viscous + self.felt(d, s, self.load_damping) * self.gear.per_ratio * self.gear.per_ratio * speed;
        }
        viscous
    }

    /// Friction of the loaded screw on the motor shaft: what warms its nut.
    #[inline(always)]
    fn screw_drag(&self, d: &ShaftDetails, s: &ShaftState<S>, carried: S, direction: S) -> S {
        let drag = self.screw.drag(carried, direction) * self.gear.per_ratio;
        if d.lubricated {
            drag * s.lubricant.loss
        } else {
            drag
        }
    }

    /// Direction of the motion, or of the `active` torque that would start it: 1, -1 or 0.
    #[inline(always)]
    fn direction(&self, s: &ShaftState<S>, active: S) -> S {
        let at_rest = s.motor_speed.equals(S::zero());
        let moving = s.motor_speed.sign();
        if !S::any(at_rest) {
            // Where it moves the processor does not wait for the torque.
            return moving;
        }
        S::select(at_rest, active.sign(), moving)
    }

    /// What gear and screw carry in the `direction` of motion, at the output: the signed load and, behind a rigid joint, the
    /// load side's friction and damping. All of it passes their efficiency.
    #[inline(always)]
    fn through_gear<const EXTRA: bool>(&self, d: &ShaftDetails, x: &Instant<S>, s: &ShaftState<S>, through: S, direction: S) -> S {
        if !EXTRA || !d.load_side || d.elastic {
            return through;
        }
        let damping = self.felt(d, s, self.load_damping) * self.gear.per_ratio * s.motor_speed;
        direction.fma(self.felt_friction(d, x, s), through + damping)
    }

    /// What of a quantity of the output reaches the motor: nothing while they are apart.
    #[inline(always)]
    fn felt(&self, d: &ShaftDetails, s: &ShaftState<S>, value: S) -> S {
        if d.flanks {
            S::select(self.joined(s), value, S::zero())
        } else {
            value
        }
    }

    #[inline(always)]
    fn felt_friction(&self, d: &ShaftDetails, x: &Instant<S>, s: &ShaftState<S>) -> S {
        self.felt(d, s, self.load_side_friction(d, x))
    }

    #[inline(always)]
    pub(super) fn output_torque(&self, d: &ShaftDetails, x: &Instant<S>, s: &ShaftState<S>) -> S {
        let load = if d.weight { x.output + self.gear.constant } else { x.output };
        self.gear.stiffness.fma(s.output_position - self.gear.spring_zero, load)
    }

    /// Dry friction of the load side, at the output.
    #[inline(always)]
    pub(super) fn load_side_friction(&self, d: &ShaftDetails, x: &Instant<S>) -> S {
        if d.linear {
            self.load_friction + x.brake
        } else {
            self.load_friction
        }
    }

    /// Torque of unbalance, spalls and drive train on the motor shaft, positive where it drives forwards, their
    /// friction, and that of the spalls alone.
    #[inline(always)]
    pub(super) fn disturbance(&self, d: &ShaftDetails, s: &ShaftState<S>, carried: [S; 2]) -> (S, S, S) {
        let (mut torque, mut friction) = (S::zero(), S::zero());
        if d.spall {
            let through = carried[0];
            (torque, friction) = self.screw.spall(s.motor_position, through, s.motor_position * self.gear.per_ratio);
        }
        let spalled = friction;
        if d.unbalance {
            torque = torque + self.unbalance.torque(s.motor_position);
        }
        if d.train.extra {
            let added = self.train.added(&d.train, s.motor_position, carried, self.gear.per_ratio);
            torque = torque + added.torque();
            friction = friction + added.friction();
        }
        (torque, friction, spalled)
    }

    /// Torque on the output through the elastic backlash.
    #[inline(always)]
    pub(super) fn contact(&self, d: &ShaftDetails, s: &ShaftState<S>) -> S {
        let displacement = s.motor_position * self.gear.per_ratio - s.output_position;
        let rate = s.motor_speed * self.gear.per_ratio - s.output_speed;
        let lag = if d.train.teeth { self.train.lag(s.motor_position) } else { S::zero() };
        self.backlash.contact(displacement, rate, lag)
    }
}
