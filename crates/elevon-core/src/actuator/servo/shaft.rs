//! Shaft, transmission and load side of a step.

use super::advance::Instant;
use super::details::Structure;
use super::high::model::*;
use crate::scalar::Scalar;
use crate::transmission::friction::Friction;

/// What acts on the fast shaft.
#[derive(Clone, Copy)]
pub(super) struct ShaftLoads<S> {
    pub brake: S,
    pub user_torque: S,
    /// Signed torque on the fast shaft, and the part of it that is not the contact of the elastic play.
    pub load: S,
    own: S,
    /// Torque between gear and user, at the user.
    pub through: S,
    pub static_limit: S,
    pub dynamic: S,
}

#[inline(always)]
pub(super) fn shaft_loads<S: Scalar, const FULL: bool, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    x: &Instant<S>,
    s: &State<S>,
    torque: S,
) -> ShaftLoads<S> {
    let user_torque = m.gear.stiffness.fma(s.user_position - m.gear.spring_zero, x.user);
    let elastic = FULL && structure.elastic;
    let through = if elastic { contact_torque(m, s) } else { user_torque };
    let mut load = through.fma(m.gear.per_ratio, x.shaft);
    let mut own = if elastic { x.shaft } else { load };
    let mut added = x.brake;
    if EXTRA {
        if structure.linear {
            added = S::zero();
        }
        if structure.load_side && !elastic {
            // Rigid: the load side's friction is felt on the fast shaft.
            added = added + load_side_friction(m, structure, x) * m.gear.per_ratio;
        }
        let (torque, friction) = disturbance(m, structure, s, through);
        load = load - torque;
        own = own - torque;
        added = added + friction;
    }
    if FULL {
        if structure.loaded {
            let moving = s.motor_speed.sign();
            let direction = S::select(s.motor_speed.equals(S::zero()), (torque - load).sign(), moving);
            added = added + m.gear.load_friction(through, direction);
        }
        if structure.jams {
            added = added + s.jammed * m.friction.jam_torque;
        }
    }
    let mut loads = ShaftLoads {
        brake: x.brake,
        user_torque,
        load,
        own,
        through,
        static_limit: m.friction.static_limit + added,
        dynamic: m.friction.dynamic + added,
    };
    if EXTRA {
        if structure.linear {
            loads.brake = if elastic { S::zero() } else { x.brake * m.gear.per_ratio };
        }
        if structure.debris {
            loads.static_limit = loads.static_limit * s.extra.scatter;
            loads.dynamic = loads.dynamic * s.extra.scatter;
        }
    }
    loads
}

/// Dry friction of the load side, at the user.
#[inline(always)]
pub(super) fn load_side_friction<S: Scalar>(m: &Model<S>, structure: &Structure, x: &Instant<S>) -> S {
    if structure.linear {
        m.extra.load_friction + x.brake
    } else {
        m.extra.load_friction
    }
}

/// Torque of unbalance and spalls on the fast shaft, positive where it drives forwards, and the friction of the spalls.
#[inline(always)]
pub(super) fn disturbance<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, through: S) -> (S, S) {
    let (mut torque, mut friction) = (S::zero(), S::zero());
    if structure.spall {
        (torque, friction) = m.extra.screw.spall(s.motor_position, through, s.motor_position * m.gear.per_ratio);
    }
    if structure.unbalance {
        torque = torque + m.extra.unbalance.torque(s.motor_position);
    }
    (torque, friction)
}

/// Torque on the user through the elastic play.
#[inline(always)]
pub(super) fn contact_torque<S: Scalar>(m: &Model<S>, s: &State<S>) -> S {
    let displacement = s.motor_position * m.gear.per_ratio - s.user_position;
    let rate = s.motor_speed * m.gear.per_ratio - s.user_speed;
    m.play.contact(displacement, rate)
}

#[inline(always)]
pub(super) fn mechanical_step<S: Scalar, const FULL: bool, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    x: &Instant<S>,
    s: &mut State<S>,
    torque: S,
) {
    let loads = shaft_loads::<S, FULL, EXTRA>(m, structure, x, s, torque);
    let speed = s.motor_speed;
    let mut viscous = if FULL && structure.sloped { m.friction.viscous_torque(speed) } else { m.friction.viscous * speed };
    if EXTRA && structure.load_side && !structure.elastic {
        viscous = viscous + m.extra.load_damping * m.gear.per_ratio * m.gear.per_ratio * speed;
    }
    let resist = loads.load + speed.signed(loads.dynamic) + viscous;
    let net = Friction::net_torque(torque, loads.load, resist, speed, loads.static_limit);
    let free = m.dt_per_inertia.fma(net, speed);
    let new_speed = Friction::stop_at_reversal(speed, free);
    let moved = m.dt.fma(if structure.semi_implicit { new_speed } else { speed }, s.motor_position);
    let (position, held_speed) = m.gear.stop(moved, new_speed);
    if FULL && structure.accounts {
        let dry = Friction::dry_torque(torque - loads.load, speed, loads.static_limit, loads.dynamic);
        account_mechanical(m, s, &loads, speed, new_speed, held_speed, dry, viscous);
    }
    if FULL && structure.elastic {
        user_step::<S, EXTRA>(m, structure, x, s, &loads);
    } else {
        s.user_position = m.play.drag(position * m.gear.per_ratio, s.user_position);
    }
    if FULL && structure.jams {
        let passed = ((s.user_position - m.friction.jam_position) * s.jam_side).le(S::zero());
        let seized = passed | S::splat(0.5).lt(m.friction.jam_anywhere);
        s.jammed = S::select(seized, S::one(), s.jammed);
    }
    s.motor_position = position;
    s.motor_speed = held_speed;
}

/// The second mass of the elastic play.
#[inline(always)]
fn user_step<S: Scalar, const EXTRA: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>, loads: &ShaftLoads<S>) {
    let through = loads.through;
    let speed = s.user_speed;
    let active = through - loads.user_torque;
    let new_speed = if EXTRA && structure.load_side {
        let dry = load_side_friction(m, structure, x);
        let net = Friction::net_torque(active, S::zero(), (m.extra.load_damping).fma(speed, speed.signed(dry)), speed, dry);
        Friction::stop_at_reversal(speed, speed + m.dt * (m.per_user_inertia * net))
    } else {
        speed + m.dt * (m.per_user_inertia * active)
    };
    if structure.accounts {
        let middle = S::splat(0.5) * (speed + new_speed);
        s.energy[E_LOAD] = s.energy[E_LOAD] + m.dt * loads.user_torque * middle;
        if EXTRA && structure.load_side {
            account_load_side(m, structure, x, s, active, middle);
        }
        let motor = s.motor_speed * m.gear.per_ratio;
        s.energy[E_IMPACT] = s.energy[E_IMPACT] + m.dt * through * (motor - middle);
    }
    s.user_position = s.user_position + m.dt * if structure.semi_implicit { new_speed } else { speed };
    s.user_speed = new_speed;
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn account_mechanical<S: Scalar>(m: &Model<S>, s: &mut State<S>, loads: &ShaftLoads<S>, old: S, new: S, held: S, dry: S, viscous: S) {
    let half = S::splat(0.5);
    let middle = half * (old + new);
    // The brake takes its share of the dry friction.
    let share = loads.brake / loads.dynamic.maximum(S::splat(1e-300));
    s.energy[E_BRAKE] = s.energy[E_BRAKE] + m.dt * (dry * share) * middle;
    s.energy[E_FRICTION] = s.energy[E_FRICTION] + m.dt * (dry * (S::one() - share) + viscous) * middle;
    s.energy[E_LOAD] = s.energy[E_LOAD] + m.dt * loads.own * middle;
    s.energy[E_IMPACT] = s.energy[E_IMPACT] + half * m.inertia * (new * new - held * held);
}

#[inline(always)]
fn account_load_side<S: Scalar>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>, active: S, middle: S) {
    let limit = load_side_friction(m, structure, x);
    let dry = Friction::dry_torque(active, s.user_speed, limit, limit);
    let braked = if structure.linear { dry * (x.brake / limit.maximum(S::splat(1e-300))) } else { S::zero() };
    s.energy[E_BRAKE] = s.energy[E_BRAKE] + m.dt * braked * middle;
    s.energy[E_FRICTION] = s.energy[E_FRICTION] + m.dt * (dry - braked + m.extra.load_damping * s.user_speed) * middle;
}
