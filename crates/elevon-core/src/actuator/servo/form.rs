//! What distinguishes one servo from another.

use crate::actuator::{Finding, Machine, Setup};
use crate::scalar::Scalar;
use crate::transmission::gear_train::{GearLayout, GearTrain};
use crate::transmission::nut_heat::NutHeat;
use crate::transmission::screw::Screw;
use crate::transmission::vibration::Vibration;
use crate::variable::Signal;

/// A kind of servo: its records, and how its transmission follows from them.
///
/// The groups begin with those of `layout::GROUPS`, in their order and of their lengths (units and names may differ), so
/// that a parameter of a shared component stands at one place in every form.
pub trait Form: Machine {
    /// The output's side travels: its coordinate is in metres, and the brake acts there.
    const LINEAR: bool;
    /// Signals begin with those of `signals::HIGH` and `signals::LOW`, in their order.
    const HIGH: &'static [Signal];
    const LOW: &'static [Signal];

    /// Motor angle over output coordinate.
    fn ratio<S: Scalar>(raw: &[S]) -> S;
    /// Which bodies stand between motor and output.
    fn layout(_raw: &[f64]) -> GearLayout {
        GearLayout::Lumped
    }
    fn train<S: Scalar>(_raw: &[S], _layout: GearLayout) -> GearTrain<S> {
        GearTrain::none()
    }
    /// Inertia on the motor shaft besides the motor's and the gear's.
    fn screw_inertia<S: Scalar>(raw: &[S]) -> S;
    fn screw<S: Scalar>(raw: &[S]) -> Screw<S>;
    /// The nut of a screw as a node of heat on a tick of `period` seconds.
    fn nut<S: Scalar>(raw: &[S], period: f64) -> NutHeat<S>;
    /// The housing under an accelerometer.
    fn housing<S: Scalar>(raw: &[S]) -> Vibration<S>;
    /// Are the halves of a screw's nut preloaded?
    fn preloaded(setup: &Setup) -> bool;
    /// Is there an accelerometer?
    fn vibrates(setup: &Setup) -> bool;
    /// Do balls of a screw pass spalls?
    fn spalled(setup: &Setup) -> bool;
    /// Does debris scatter the friction of a screw?
    fn contaminated(setup: &Setup) -> bool;
    /// Findings of its own.
    fn check(raw: &[f64]) -> Vec<Finding>;
}
