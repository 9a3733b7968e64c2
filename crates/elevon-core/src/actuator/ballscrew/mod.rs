//! The ballscrew actuator (NASA / Impact Technologies): the motor turns a screw, the nut and the ram travel along it, and
//! a fixture with backlash couples the ram to a load side with mass, damping and friction of its own
//! (docs/explanation/theory/ballscrew.md).

mod faults;
mod records;

use super::servo::{layout, Form};
use super::{Finding, Machine, Port, Setup};
use crate::fault::FaultKind;
use crate::motor::thermal::ThermalParameter;
use crate::scalar::Scalar;
use crate::transmission::gear::GearParameter;
use crate::transmission::nut_heat::NutHeat;
use crate::transmission::screw::{Screw, ScrewParameter};
use crate::transmission::vibration::Vibration;
use crate::variable::{Group, Signal};
use layout::At;

#[derive(Clone)]
pub struct Ballscrew;

impl Machine for Ballscrew {
    const GROUPS: &'static [Group] = records::GROUPS;
    const PORTS: &'static [Port] = records::PORTS;
    const LATE_PORTS: &'static [usize] = &[layout::BRAKE, layout::OUTPUT];
    const HELD_PORTS: &'static [usize] = &[layout::AMBIENT];

    fn faults() -> Vec<FaultKind> {
        faults::catalogue()
    }
}

impl Form for Ballscrew {
    const LINEAR: bool = true;
    const HIGH: &'static [Signal] = records::HIGH;
    const LOW: &'static [Signal] = records::LOW;

    fn ratio<S: Scalar>(raw: &[S]) -> S {
        raw[GearParameter::Ratio.at()] / raw[ScrewParameter::Lead.at()]
    }
    fn screw_inertia<S: Scalar>(raw: &[S]) -> S {
        let ratio = raw[GearParameter::Ratio.at()];
        raw[ScrewParameter::Inertia.at()] / (ratio * ratio)
    }
    fn screw<S: Scalar>(raw: &[S]) -> Screw<S> {
        Screw::derive(records::screw(raw), raw[GearParameter::Ratio.at()])
    }
    fn nut<S: Scalar>(raw: &[S], period: f64) -> NutHeat<S> {
        let screw = |p: ScrewParameter| raw[p.at()];
        let ambient = raw[ThermalParameter::Ambient.at()];
        NutHeat::derive(
            screw(ScrewParameter::NutCapacity),
            screw(ScrewParameter::NutToAir),
            screw(ScrewParameter::NutHeatShare),
            ambient,
            period,
        )
    }
    fn housing<S: Scalar>(raw: &[S]) -> Vibration<S> {
        Vibration::derive(records::vibration(raw))
    }
    fn preloaded(setup: &Setup) -> bool {
        Screw::<f64>::preloaded(&records::Parts(setup).screw())
    }
    fn vibrates(setup: &Setup) -> bool {
        Vibration::<f64>::needed(&records::Parts(setup).vibration())
    }
    fn spalled(setup: &Setup) -> bool {
        Screw::<f64>::spalled(&records::Parts(setup).screw())
    }
    fn contaminated(setup: &Setup) -> bool {
        Screw::<f64>::contaminated(&records::Parts(setup).screw())
    }
    fn check(raw: &[f64]) -> Vec<Finding> {
        records::check(raw)
    }
}

/// The switching model of the ballscrew actuator.
pub type High = super::servo::High<Ballscrew>;
/// The reduced-order model of the ballscrew actuator: the printed L-R circuit.
pub type Low = super::servo::Low<Ballscrew>;
