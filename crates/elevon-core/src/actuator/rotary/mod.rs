//! The rotary actuator (Torino): a geared servo whose output turns.

use super::servo::{faults, layout, signals, Form};
use super::{Finding, Machine, Port, Setup};
use crate::fault::FaultKind;
use crate::scalar::Scalar;
use crate::transmission::gear::GearParameter;
use crate::transmission::nut_heat::NutHeat;
use crate::transmission::screw::Screw;
use crate::transmission::vibration::Vibration;
use crate::variable::{Group, Signal};
use layout::At;

#[derive(Clone)]
pub struct Rotary;

impl Machine for Rotary {
    const GROUPS: &'static [Group] = layout::GROUPS;
    const PORTS: &'static [Port] = layout::PORTS;
    const LATE_PORTS: &'static [usize] = &[layout::OUTPUT];
    const HELD_PORTS: &'static [usize] = &[layout::AMBIENT];

    fn faults() -> Vec<FaultKind> {
        faults::catalogue(faults::ROTARY)
    }
}

impl Form for Rotary {
    const LINEAR: bool = false;
    const HIGH: &'static [Signal] = signals::HIGH;
    const LOW: &'static [Signal] = signals::LOW;

    fn ratio<S: Scalar>(raw: &[S]) -> S {
        raw[GearParameter::Ratio.at()]
    }
    fn screw_inertia<S: Scalar>(_raw: &[S]) -> S {
        S::zero()
    }
    fn screw<S: Scalar>(_raw: &[S]) -> Screw<S> {
        Screw::none()
    }
    fn nut<S: Scalar>(_raw: &[S], _period: f64) -> NutHeat<S> {
        NutHeat::none()
    }
    fn housing<S: Scalar>(_raw: &[S]) -> Vibration<S> {
        Vibration::none()
    }
    fn preloaded(_setup: &Setup) -> bool {
        false
    }
    fn vibrates(_setup: &Setup) -> bool {
        false
    }
    fn spalled(_setup: &Setup) -> bool {
        false
    }
    fn contaminated(_setup: &Setup) -> bool {
        false
    }
    fn check(_raw: &[f64]) -> Vec<Finding> {
        Vec::new()
    }
}

/// The switching model of the rotary actuator.
pub type High = super::servo::High<Rotary>;
/// The reduced-order model of the rotary actuator.
pub type Low = super::servo::Low<Rotary>;
