//! The bodies of a gear between motor and output, moved by its meshes (docs/explanation/theory/gear-train.md).

use super::loads::Loads;
use super::{Shaft, ShaftDetails, ShaftState};
use crate::kept;
use crate::scalar::{apart, Kernel, Scalar};
use crate::transmission::gear_train::{GearTrain, BODIES, MESHES};

/// Angle and speed of each body.
#[derive(Clone, Copy, Debug)]
pub struct Bodies<S> {
    pub position: [S; BODIES],
    speed: [S; BODIES],
}

kept!(Bodies<f64> as Bodies { position, speed });

impl<S: Scalar> Bodies<S> {
    /// As the motor turns them, amid every backlash.
    pub(super) fn with(position: S, speed: S, turns: [S; BODIES]) -> Self {
        Self { position: turns.map(|x| x * position), speed: turns.map(|x| x * speed) }
    }
}

/// The torques of the meshes. Apart from the step, which few runs with them share.
struct Carried<'a, S: Scalar> {
    train: &'a GearTrain<S>,
    state: &'a ShaftState<S>,
    lag: S,
}

impl<S: Scalar> Kernel for Carried<'_, S> {
    type Output = [S; MESHES];
    #[inline(always)]
    fn run(self) -> [S; MESHES] {
        let (s, b) = (self.state, &self.state.bodies);
        let at = [s.motor_position, b.position[0], b.position[1], s.output_position];
        let speed = [s.motor_speed, b.speed[0], b.speed[1], s.output_speed];
        self.train.torques(at, speed, self.lag)
    }
}

impl<S: Scalar> Shaft<S> {
    /// Torque of each mesh.
    #[inline(always)]
    pub(super) fn carried(&self, d: &ShaftDetails, s: &ShaftState<S>) -> [S; MESHES] {
        let lag = if d.train.teeth { self.train.lag(s.motor_position) } else { S::zero() };
        apart::<S, _>(Carried { train: &self.gear_train, state: s, lag })
    }

    /// What the meshes take from the motor and give to the output, both as torques at the output.
    #[inline(always)]
    pub(super) fn through_meshes(&self, torques: &[S; MESHES]) -> [S; 2] {
        let [taken, given] = self.gear_train.ends(torques);
        [taken * self.gear.ratio, given]
    }

    /// A step of the bodies; the work of motor and bodies into the meshes, with the mean `motor` speed of the step.
    #[inline(always)]
    pub(super) fn move_bodies(&self, d: &ShaftDetails, s: &mut ShaftState<S>, loads: &Loads<S>, motor: S) {
        let mut wound = loads.through * self.gear.per_ratio * motor;
        let moved = self.gear_train.accelerations(&loads.meshes);
        for (k, [torque, acceleration]) in moved.into_iter().enumerate() {
            let old = s.bodies.speed[k];
            let new = self.dt.fma(acceleration, old);
            s.bodies.speed[k] = new;
            s.bodies.position[k] = self.dt.fma(if d.semi_implicit { new } else { old }, s.bodies.position[k]);
            wound = wound - S::splat(0.5) * torque * (old + new);
        }
        if d.accounts {
            s.work.impact = s.work.impact + self.dt * wound;
        }
    }

    /// Kinetic energy of the bodies.
    #[inline(always)]
    pub(super) fn kinetic_of_bodies(&self, s: &ShaftState<S>) -> S {
        let square = |k: usize| self.gear_train.inertia[k] * s.bodies.speed[k] * s.bodies.speed[k];
        S::splat(0.5) * (square(0) + square(1))
    }
}
