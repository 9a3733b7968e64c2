//! Motor shaft, gearbox, screw, ram, leg and lock: one shaft while connected, two after the free-fall release.
//! `kick` changes the speeds, `drift` the positions; forces towards extension are positive.

mod apart;
mod rig;

use super::layout::*;
use crate::kept;
use crate::motor::star::MotorParameter;
use crate::piecewise::{Curve, Knots};
use crate::scalar::Scalar;
use crate::transmission::brake::Brake;
use crate::transmission::friction::Friction;
use crate::transmission::lever::{Arm, LegParameter, Lever};
use crate::transmission::lock::Lock;
use crate::transmission::lubricant::Grease;
use crate::transmission::planetary::{Governor, Planetary, PlanetaryParameter};
use crate::transmission::roller_screw::{RollerScrew, ScrewParameter};
use crate::transmission::train_friction::TrainFriction;
use crate::variable::Switch;

const GRAVITY: f64 = 9.80665;

#[derive(Clone, Copy, Debug)]
pub struct Mechanics<S> {
    dt: S,
    /// Ram travel per motor radian.
    pub travel: S,
    per_travel: S,
    /// At the motor: with the first stage, and with everything but the leg.
    inertia_motor: S,
    inertia_train: S,
    /// At the ram: screw side alone.
    mass_screw: S,
    mass: S,
    leg: S,
    rate_term: S,
    pub lever: Lever<S>,
    pub lock: Lock<S>,
    screw: RollerScrew<S>,
    gear: Planetary<S>,
    friction: TrainFriction<S>,
    governor: Governor<S>,
    brake: Brake<S>,
    load_knots: Knots<S, LOADS>,
    load_curve: Curve<S, LOADS>,
    factor: S,
    detent: S,
    periods: S,
    bearing: S,
}

/// What moves.
#[derive(Clone, Copy, Debug)]
pub struct Motion<S> {
    pub motor_position: S,
    pub motor_speed: S,
    pub nut_position: S,
    pub nut_speed: S,
    /// 1 while the ram belongs to the motion.
    pub carrying: S,
    pub locked: S,
    /// Force of the rig on the ram.
    pub rig_force: S,
    /// Largest motor speed so far, before stops: what a stop ends within a step is found, too.
    pub fastest: S,
    pub energy: [S; ACCOUNTS],
}

kept!(Motion<f64> as Motion { motor_position, motor_speed, nut_position, nut_speed, carrying, locked, rig_force, fastest, energy });

/// What acts during a step.
#[derive(Clone, Copy, Debug)]
pub struct Acting<S> {
    pub motor_torque: S,
    /// Output load, positive opposes extension.
    pub output: S,
    /// 1 while the brake's coil holds it open.
    pub brake_free: S,
    /// 1 once the stages are apart.
    pub released: S,
    pub rig_speed: S,
}

pub const ACCOUNTS: usize = 9;
pub const E_MOTOR: usize = 0;
pub const E_LOAD: usize = 1;
pub const E_LOCK: usize = 2;
pub const E_DETENT: usize = 3;
pub const E_FRICTION: usize = 4;
pub const E_EFFICIENCY: usize = 5;
pub const E_BRAKE: usize = 6;
pub const E_GOVERNOR: usize = 7;
pub const E_IMPACT: usize = 8;

/// Forces on the screw at the present position.
#[derive(Clone, Copy, Debug)]
pub struct Forces<S> {
    /// Of the leg and the output, while the ram moves.
    pub load: S,
    pub spring: S,
    pub efficiency: S,
    pub arm: Arm<S>,
}

/// One shaft (or the ram) for one step: generalised forces.
#[derive(Clone, Copy)]
struct Shaft<S: Scalar> {
    speed: S,
    active: S,
    fixed: S,
    kinetic: S,
    inertia: S,
    blocked_up: S::Mask,
    blocked_down: S::Mask,
}

/// Outcome of a step of one shaft.
#[derive(Clone, Copy)]
struct Moved<S> {
    speed: S,
    /// Speed before friction and stops end it.
    free: S,
    middle: S,
    /// Work of the dry resistances.
    rubbed: S,
    impact: S,
}

impl<S: Scalar> Mechanics<S> {
    pub fn derive(raw: &[S], dt: S) -> Self {
        let view = Raw(raw);
        let at = |i: usize| raw[i];
        let lubricant = Grease::derive(view.lubricant()).at(at(LubricantStateParameter::Temperature.at()));
        let screw = RollerScrew::derive(view.screw(), &lubricant);
        let gear = Planetary::derive(view.gear(), &lubricant);
        let lever = Lever::derive(view.lever());
        let per_travel = screw.turns * gear.ratio;
        let travel = S::one() / per_travel;
        let square = gear.ratio * gear.ratio;
        let (first, second) = (at(PlanetaryParameter::InertiaFirst.at()), at(PlanetaryParameter::InertiaSecond.at()));
        let (turning, mass) = (at(ScrewParameter::Inertia.at()), at(ScrewParameter::MovingMass.at()));
        let rotor = at(MotorParameter::Inertia.at());
        let load_knots = Knots::new(std::array::from_fn(|k| lever.stroke * S::splat(k as f64 / (LOADS - 1) as f64)));
        Self {
            dt,
            travel,
            per_travel,
            inertia_motor: rotor + first / square,
            inertia_train: rotor + (turning + first + second) / square + mass * travel * travel,
            mass_screw: mass + (turning + second) * screw.turns * screw.turns,
            mass,
            leg: at(LegParameter::Inertia.at()),
            rate_term: S::splat(0.5) * S::indicator(S::mask(Switch::read(at(LegParameter::InertiaRateTerm.at())) == Switch::On)),
            load_curve: Curve::new(&load_knots, &view.load()[LoadCurveParameter::Force0 as usize..]),
            load_knots,
            factor: at(LoadCurveParameter::Factor.at()),
            lever,
            lock: Lock::derive(view.lock()),
            screw,
            gear,
            friction: TrainFriction::derive(view.friction(), &lubricant),
            governor: Governor::derive(view.release()),
            brake: Brake::derive(view.brake()),
            detent: at(ShaftParameter::DetentTorque.at()),
            periods: at(ShaftParameter::DetentPeriods.at()),
            bearing: at(ShaftParameter::BearingTorque.at()),
        }
    }

    pub fn start(&self, nut: S, locked: S, speed: S) -> Motion<S> {
        Motion {
            motor_position: nut * self.per_travel,
            motor_speed: speed,
            nut_position: nut,
            nut_speed: speed * self.travel,
            carrying: S::indicator(nut.le(self.lever.stroke)),
            locked,
            rig_force: S::zero(),
            fastest: S::zero(),
            energy: [S::zero(); ACCOUNTS],
        }
    }

    /// Position of the ram: held by the housing while the nut works the lock, by the segments once locked.
    #[inline(always)]
    pub fn ram(&self, s: &Motion<S>, output: S) -> S {
        let inside = s.nut_position.clamp(S::zero(), self.lever.stroke);
        let seated = self.lever.stroke + self.end_load(output) * self.lock.per_stiffness;
        S::select(S::splat(0.5).lt(s.locked), seated, inside)
    }

    /// Load on the ram at the extended end.
    #[inline(always)]
    pub fn end_load(&self, output: S) -> S {
        let reach = self.load_knots.reach(self.lever.stroke);
        self.factor * self.load_curve.at(&reach) - output
    }

    #[inline(always)]
    pub fn forces(&self, s: &Motion<S>, output: S, rig: bool) -> Forces<S> {
        let ram = s.nut_position.clamp(S::zero(), self.lever.stroke);
        let outside = self.factor * self.load_curve.at(&self.load_knots.reach(ram)) - output;
        let load = if rig { S::zero() } else { S::select(S::splat(0.5).lt(s.carrying), outside, S::zero()) };
        let spring = self.lock.spring(s.nut_position - self.lever.stroke);
        Forces { load, spring, efficiency: self.screw.efficiency(load + spring), arm: self.lever.at(ram) }
    }

    /// Inertia at the motor of everything connected.
    #[inline(always)]
    pub fn inertia(&self, s: &Motion<S>, arm: &Arm<S>) -> S {
        self.inertia_train + s.carrying * self.leg * arm.per_square * (self.travel * self.travel)
    }

    fn mass_released(&self, s: &Motion<S>, arm: &Arm<S>) -> S {
        self.mass_screw + s.carrying * self.leg * arm.per_square
    }

    pub fn efficiency(&self, forces: &Forces<S>, released: S) -> S {
        forces.efficiency * S::select(S::splat(0.5).lt(released), self.gear.efficiency_second, self.gear.efficiency)
    }

    #[inline(always)]
    pub fn detent_torque(&self, motor_position: S) -> S {
        let (sin, _) = (self.periods * motor_position).sin_cos();
        -(self.detent * sin)
    }

    /// Kinetic friction of what moves with the nut.
    pub fn friction_force(&self, s: &Motion<S>, released: S) -> S {
        let rubs = self.friction.at(s.nut_speed, S::zero().le(s.nut_speed), s.nut_position, self.screw.turns);
        S::select(S::splat(0.5).lt(released), rubs.screw, rubs.train)
    }

    pub fn brake_open(&self, brake_free: S) -> S {
        self.brake.open(brake_free)
    }

    pub fn brake_torque(&self, brake_free: S) -> S {
        self.brake.torque(brake_free)
    }

    pub fn kinetic_energy(&self, s: &Motion<S>, released: S) -> S {
        let half = S::splat(0.5);
        let arm = self.lever.at(s.nut_position.clamp(S::zero(), self.lever.stroke));
        let together = half * self.inertia(s, &arm) * s.motor_speed * s.motor_speed;
        let apart =
            half * self.inertia_motor * s.motor_speed * s.motor_speed + half * self.mass_released(s, &arm) * s.nut_speed * s.nut_speed;
        S::select(half.lt(released), apart, together)
    }

    #[inline(always)]
    pub fn drift(&self, s: &mut Motion<S>, dt: S) {
        s.motor_position = dt.fma(s.motor_speed, s.motor_position);
        s.nut_position = dt.fma(s.nut_speed, s.nut_position);
    }

    /// New speeds under what acts; with a rig its speed is imposed and its force found.
    #[inline(always)]
    pub fn kick(&self, s: &mut Motion<S>, a: &Acting<S>, rig: bool) {
        let half = S::splat(0.5);
        let apart = half.lt(a.released);
        self.pick_up(s, a.released, rig);
        let forces = self.forces(s, a.output, rig);
        if rig {
            return self.imposed(s, a, &forces);
        }
        let before = *s;
        self.connected(s, a, &forces);
        if S::any(apart) {
            let mut other = before;
            self.apart(&mut other, a, &forces);
            s.motor_speed = S::select(apart, other.motor_speed, s.motor_speed);
            s.nut_speed = S::select(apart, other.nut_speed, s.nut_speed);
            s.fastest = S::select(apart, other.fastest, s.fastest);
            for (mine, theirs) in s.energy.iter_mut().zip(other.energy) {
                *mine = S::select(apart, theirs, *mine);
            }
        }
        s.locked = self.lock.engaged(s.locked, s.nut_position - self.lever.stroke);
    }

    /// The leg leaves the motion at the end of the stroke and is picked up again there: a plastic impact.
    #[inline(always)]
    fn pick_up(&self, s: &mut Motion<S>, released: S, rig: bool) {
        let carrying = S::indicator(s.nut_position.le(self.lever.stroke));
        let same = carrying.equals(s.carrying);
        if rig || !S::any(!same) {
            s.carrying = carrying;
            return;
        }
        let before = self.kinetic_energy(s, released);
        let arm = self.lever.at(s.nut_position.clamp(S::zero(), self.lever.stroke));
        let taken = S::select(
            S::splat(0.5).lt(released),
            self.mass_screw / (self.mass_screw + self.leg * arm.per_square),
            self.inertia_train / (self.inertia_train + self.leg * arm.per_square * (self.travel * self.travel)),
        );
        let slowed = S::select(s.carrying.lt(carrying), taken, S::one());
        s.carrying = carrying;
        s.nut_speed = slowed * s.nut_speed;
        s.motor_speed = S::select(S::splat(0.5).lt(released), s.motor_speed, slowed * s.motor_speed);
        let lost = S::select(same, S::zero(), before - self.kinetic_energy(s, released));
        s.energy[E_IMPACT] = s.energy[E_IMPACT] + lost;
    }

    #[inline(always)]
    fn ends(&self, s: &Motion<S>) -> (S::Mask, S::Mask) {
        let beyond = s.nut_position - self.lever.stroke;
        (self.lock.end.le(beyond), s.nut_position.le(S::zero()) | self.lock.holds_back(s.locked, beyond))
    }

    #[inline(always)]
    fn connected(&self, s: &mut Motion<S>, a: &Acting<S>, f: &Forces<S>) {
        let zero = S::zero();
        let r = self.travel;
        let w = s.motor_speed;
        let detent = self.detent_torque(s.motor_position);
        let axial = f.load + f.spring;
        let active = a.motor_torque + detent + axial * r;
        let heading = S::select(w.equals(zero), active, w);
        let resistance = self.friction.at(w * r, zero.le(heading), s.nut_position, self.screw.turns).train;
        let loss = r * RollerScrew::load_friction(axial, f.efficiency * self.gear.efficiency);
        let jam = r * self.screw.jam(s.nut_position);
        let brake = self.brake.torque(a.brake_free);
        let rubbing = r * resistance;
        let other = loss + jam + brake + self.bearing;
        let (up, down) = self.ends(s);
        let inertia = self.inertia(s, &f.arm);
        let rate = self.rate_term * s.carrying * self.leg * r * r * r * f.arm.rate * w * w;
        let shaft = Shaft {
            speed: w,
            active: active - rate,
            fixed: self.friction.breakaway * rubbing + other,
            kinetic: rubbing + other,
            inertia,
            blocked_up: up,
            blocked_down: down,
        };
        let moved = self.move_shaft(&shaft);
        s.motor_speed = moved.speed;
        s.nut_speed = r * moved.speed;
        s.fastest = s.fastest.maximum(moved.free.abs());
        let work = self.dt * moved.middle;
        let share = moved.rubbed / shaft.kinetic.maximum(S::splat(1e-300));
        let e = &mut s.energy;
        e[E_MOTOR] = e[E_MOTOR] + a.motor_torque * work;
        e[E_LOAD] = e[E_LOAD] - f.load * r * work;
        e[E_LOCK] = e[E_LOCK] - f.spring * r * work;
        e[E_DETENT] = e[E_DETENT] - detent * work;
        e[E_FRICTION] = e[E_FRICTION] + share * (rubbing + jam + self.bearing);
        e[E_EFFICIENCY] = e[E_EFFICIENCY] + share * loss;
        e[E_BRAKE] = e[E_BRAKE] + share * brake;
        e[E_IMPACT] = e[E_IMPACT] + moved.impact;
    }

    /// Borello's friction: at rest it holds what it can; a speed that would change sign stops first.
    #[inline(always)]
    fn move_shaft(&self, x: &Shaft<S>) -> Moved<S> {
        let zero = S::zero();
        let half = S::splat(0.5);
        let dry = Friction::dry_torque(x.active, x.speed, x.fixed, x.kinetic);
        let free = x.speed + self.dt / x.inertia * (x.active - dry);
        let kept = Friction::stop_at_reversal(x.speed, free);
        let hit = (x.blocked_up & zero.lt(kept)) | (x.blocked_down & kept.lt(zero));
        let speed = S::select(hit, zero, kept);
        let middle = half * (x.speed + speed);
        // What a stopped shaft did not do: friction where it reversed, the stop where it was held.
        let residue = half * x.inertia * (x.speed + speed) * (free - speed);
        let reversed = !kept.equals(free);
        let rubbed = self.dt * dry * middle + S::select(reversed, residue, zero);
        Moved { speed, free, middle, rubbed, impact: S::select(hit & !reversed, residue, zero) }
    }
}
