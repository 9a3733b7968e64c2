//! Spring-applied electromagnetic brake on the motor shaft, with the delays of its coil.

use crate::scalar::Scalar;
use crate::{choices, variables};

choices! {
    /// What powers the coil.
    Powered { ByDrive "by_drive", Always "always" }
}

variables! {
    /// The brake.
    BrakeParameter, BRAKE {
        Torque => "torque", "T_br", "N m", NonNegative, Plant, None, "resistive torque of the set brake";
        ReleaseDelay => "release_delay", "-", "s", NonNegative, Plant, None, "from power on to free";
        EngageDelay => "engage_delay", "-", "s", NonNegative, Plant, None, "from power off to set";
        Drag => "drag", "-", "N m", NonNegative, Plant, Some(0.0), "torque left when released; healthy 0";
        Powered => "powered", "-", "1", Choice(Powered::NAMES), Plant, Some(0.0), "always: the bench holds the brake open whatever the drive does (modified free-fall test)";
        Stuck => "stuck", "-", "1", Flag, Plant, Some(0.0), "1: the brake stays set under power";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Brake<S> {
    torque: S,
    drag: S,
    works: S,
}

impl<S: Scalar> Brake<S> {
    pub fn derive(raw: &[S]) -> Self {
        Self {
            torque: raw[BrakeParameter::Torque as usize],
            drag: raw[BrakeParameter::Drag as usize],
            works: S::indicator(raw[BrakeParameter::Stuck as usize].lt(S::splat(0.5))),
        }
    }

    /// 1 while the brake is open.
    #[inline(always)]
    pub fn open(&self, free: S) -> S {
        free * self.works
    }

    /// Resistive torque; `free` is 1 while the coil holds the spring back. The residual torque acts behind the spring, too.
    #[inline(always)]
    pub fn torque(&self, free: S) -> S {
        S::select(S::splat(0.5).lt(self.open(free)), self.drag, self.drag.maximum(self.torque))
    }
}

/// The coil of one brake: it follows its power after a delay.
#[derive(Clone, Copy, Debug, Default)]
pub struct Coil {
    pub free: bool,
    waiting: f64,
}

impl Coil {
    pub fn new(free: bool) -> Self {
        Self { free, waiting: 0.0 }
    }

    /// After a tick of `dt` with the coil powered or not.
    pub fn step(&mut self, powered: bool, release_delay: f64, engage_delay: f64, dt: f64) {
        if powered == self.free {
            self.waiting = 0.0;
            return;
        }
        self.waiting += dt;
        let delay = if powered { release_delay } else { engage_delay };
        if self.waiting > delay * (1.0 - 1e-9) {
            *self = Self { free: powered, waiting: 0.0 };
        }
    }
}
