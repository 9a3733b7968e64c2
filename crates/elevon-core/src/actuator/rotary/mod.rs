//! The rotary actuator (Torino): a geared servo whose output turns.

mod records;

use super::servo::{faults, layout, signals, Form};
use super::{Finding, Machine, Port, Setup};
use crate::fault::FaultKind;
use crate::scalar::Scalar;
use crate::transmission::backlash::BacklashParameter;
use crate::transmission::gear::GearParameter;
use crate::transmission::gear_train::{GearLayout, GearTrain};
use crate::transmission::nut_heat::NutHeat;
use crate::transmission::screw::Screw;
use crate::transmission::vibration::Vibration;
use crate::variable::{Group, Signal};
use layout::At;

#[derive(Clone)]
pub struct Rotary;

impl Machine for Rotary {
    const GROUPS: &'static [Group] = records::GROUPS;
    const PORTS: &'static [Port] = layout::PORTS;
    const LATE_PORTS: &'static [usize] = &[layout::OUTPUT];
    const HELD_PORTS: &'static [usize] = &[layout::AMBIENT];

    fn faults() -> Vec<FaultKind> {
        faults::catalogue(faults::ROTARY)
    }
}

impl Form for Rotary {
    const LINEAR: bool = false;
    const HIGH: &'static [Signal] = records::HIGH;
    const LOW: &'static [Signal] = signals::LOW;

    fn ratio<S: Scalar>(raw: &[S]) -> S {
        raw[GearParameter::Ratio.at()]
    }
    fn layout(raw: &[f64]) -> GearLayout {
        GearLayout::read(records::train(raw))
    }
    fn train<S: Scalar>(raw: &[S], layout: GearLayout) -> GearTrain<S> {
        GearTrain::derive(records::train(raw), layout, Self::ratio(raw), raw[BacklashParameter::Extra.at()])
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
    fn check(raw: &[f64]) -> Vec<Finding> {
        records::check(raw)
    }
}

/// The switching model of the rotary actuator.
pub type High = super::servo::High<Rotary>;
/// The reduced-order model of the rotary actuator.
pub type Low = super::servo::Low<Rotary>;
