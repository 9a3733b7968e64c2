//! Spring-applied electromagnetic brake on the motor shaft, with the delays of its coil.

use crate::scalar::Scalar;
use crate::{choices, kept, variables};

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
        PickupVoltage => "pickup_voltage", "-", "V", NonNegative, Plant, Some(10.0), "supply that the coil needs to draw the armature";
        DropoutVoltage => "dropout_voltage", "-", "V", NonNegative, Plant, Some(5.0), "supply below which the coil lets the armature go";
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

kept!(Coil as Coil { free, waiting });

/// What the coil is fed with at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Feed {
    /// The bench's own supply holds the brake open.
    pub always: bool,
    /// The unit's order, and the supply that carries it out (V).
    pub powered: bool,
    pub supply: f64,
}

impl Coil {
    pub fn new(free: bool) -> Self {
        Self { free, waiting: 0.0 }
    }

    /// After a tick of `dt`: the armature needs more to be drawn than to be held.
    pub fn step(&mut self, raw: &[f64], feed: Feed, dt: f64) {
        use BrakeParameter as P;
        let least = raw[if self.free { P::DropoutVoltage } else { P::PickupVoltage } as usize];
        let powered = feed.always || (feed.powered && feed.supply >= least);
        if powered == self.free {
            self.waiting = 0.0;
            return;
        }
        self.waiting += dt;
        let delay = raw[if powered { P::ReleaseDelay } else { P::EngageDelay } as usize];
        if self.waiting > delay * (1.0 - 1e-9) {
            *self = Self { free: powered, waiting: 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drawn from the pick-up voltage on, held down to the drop-out voltage, each after its delay.
    #[test]
    fn the_coil_has_two_thresholds() {
        let mut raw = [0.0; 8];
        raw[BrakeParameter::PickupVoltage as usize] = 10.0;
        raw[BrakeParameter::DropoutVoltage as usize] = 5.0;
        raw[BrakeParameter::ReleaseDelay as usize] = 0.003;
        raw[BrakeParameter::EngageDelay as usize] = 0.002;
        let mut coil = Coil::new(false);
        let mut ticks = |supply: f64, number: usize| {
            (0..number).for_each(|_| coil.step(&raw, Feed { always: false, powered: true, supply }, 1e-3));
            coil.free
        };
        assert!(!ticks(9.9, 100));
        assert!(!ticks(10.0, 2));
        assert!(ticks(10.0, 1));
        assert!(ticks(5.0, 100));
        assert!(ticks(4.9, 1));
        assert!(!ticks(4.9, 1));
        assert!(!ticks(9.9, 100));
        coil.step(&raw, Feed { always: true, powered: false, supply: 0.0 }, 1.0);
        assert!(coil.free);
    }
}
