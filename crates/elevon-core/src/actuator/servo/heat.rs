//! The thermal network of a servo: whether there is one, and at which tick.

use super::layout::*;
use crate::motor::star::MotorParameter;
use crate::motor::thermal::{Network, ThermalModel, ThermalParameter};
use crate::scalar::Scalar;

/// The thermal network at the whole number of solver steps next to its sample time.
pub(super) fn network<S: Scalar>(raw: &[S], dt: f64) -> Network<S> {
    let at = |p: MotorParameter| raw[p.at()];
    let temperature = [
        at(MotorParameter::ReferenceTemperature),
        at(MotorParameter::TemperatureCoefficient),
        at(MotorParameter::FluxTemperatureCoefficient),
    ];
    Network::derive(Raw(raw).thermal(), temperature, network_period(raw, dt))
}

/// Is there a thermal network?
pub(super) fn heated<S: Scalar>(raw: &[S]) -> bool {
    ThermalModel::read(raw[ThermalParameter::Model.at()]) != ThermalModel::Off
}

/// Tick of the thermal network, s.
pub(super) fn network_period<S: Scalar>(raw: &[S], dt: f64) -> f64 {
    (raw[ThermalParameter::SampleTime.at()].lane(0) / dt).round().max(1.0) * dt
}
