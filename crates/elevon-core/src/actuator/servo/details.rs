//! What of a servo a run needs: equal over a lane block.

use super::form::Form;
use super::layout::*;
use super::signals::HighSignal;
use crate::actuator::Setup;
use crate::control::current_dq::PwmParameter;
use crate::control::position_speed::{ControlParameter, ControlStructure, Feedback};
use crate::inverter::bridge::{BridgeStructure, InverterParameter};
use crate::motor::star::{EmfShape, MotorParameter, MotorStructure, ShortModel};
use crate::motor::tap::TapParameter;
use crate::motor::thermal::{ThermalModel, ThermalParameter};
use crate::motor::unbalance::UnbalanceParameter;
use crate::sensor::current::{CurrentSensor, CurrentSensorParameter};
use crate::sensor::resolver::{Resolver, ResolverParameter};
use crate::time::Steps;
use crate::transmission::friction::FrictionParameter;
use crate::transmission::gear::{GearParameter, LoadParameter};
use crate::transmission::play::{PlayModel, PlayParameter};

/// Everything that decides which code runs; equal over a lane block.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Structure {
    pub(super) drive: DriveKind,
    pub(super) control: ControlStructure,
    pub(super) motor: MotorStructure,
    pub(super) control_every_step: bool,
    /// Steps from the sampling of the currents to the update of the duties.
    pub(super) duty_delay: Steps,
    pub(super) semi_implicit: bool,
    pub(super) acquisition: bool,
    pub(super) full: bool,
    pub(super) bridge: bool,
    pub(super) bridge_structure: BridgeStructure,
    pub(super) elastic: bool,
    pub(super) measured_current: bool,
    pub(super) resolver: bool,
    pub(super) accounts: bool,
    pub(super) loaded: bool,
    pub(super) sloped: bool,
    pub(super) jams: bool,
    pub(super) thermal: bool,
    /// Any of the following: details that only some servos have.
    pub(super) extra: bool,
    pub(super) linear: bool,
    /// A load side with damping and dry friction of its own.
    pub(super) load_side: bool,
    pub(super) heat: bool,
    pub(super) tap: bool,
    pub(super) unbalance: bool,
    pub(super) spall: bool,
    pub(super) debris: bool,
    pub(super) current_filter: bool,
    pub(super) six_step: bool,
    /// A lost resolver turns the field, too.
    pub(super) commutated: bool,
    /// A lost resolver opens the bridge.
    pub(super) stops: bool,
}

impl Structure {
    pub(super) fn read<F: Form>(setup: &Setup) -> Self {
        let raw = Raw(setup.raw);
        let at = |i: usize| setup.raw[i];
        let departs = |i: usize, healthy: f64| setup.departs(i, healthy);
        let drive = DriveKind::read(at(DriveParameter::Kind.at()));
        let control = ControlStructure::read(raw.control());
        let unbalance = departs(UnbalanceParameter::UnbalanceInertia.at(), 0.0);
        let motor = MotorStructure {
            trapezoidal: EmfShape::read(at(MotorParameter::EmfShape.at())) == EmfShape::Trapezoidal,
            shorted_loop: ShortModel::read(at(MotorParameter::ShortModel.at())) == ShortModel::Loop,
            static_eccentricity: departs(MotorParameter::EccentricityStatic.at(), 0.0),
            dynamic_eccentricity: unbalance || departs(MotorParameter::EccentricityDynamic.at(), 0.0),
        };
        let resolver_lost = departs(ResolverParameter::PowerOff.at(), 0.0);
        let open_phase = (MotorParameter::OpenA.at()..=MotorParameter::OpenC.at()).any(|i| departs(i, 0.0));
        let base = InverterParameter::SupplyVoltage.at();
        let detailed = InverterParameter::DETAIL.clone().any(|i| departs(base + i, 0.0));
        let stops = resolver_lost && FeedbackLoss::read(at(DriveParameter::FeedbackLoss.at())) == FeedbackLoss::Stop;
        let bridge = open_phase || detailed || drive == DriveKind::Off || stops;
        let switches = InverterParameter::OpenAHigh as usize..=InverterParameter::ShortedCLow as usize;
        let switch_faults = switches.into_iter().any(|i| departs(base + i, 0.0));
        let trips = switch_faults || departs(InverterParameter::TripCurrent.at(), 0.0);
        let bridge_structure = BridgeStructure { switch_faults, open_phases: open_phase, trips };
        let elastic = PlayModel::read(at(PlayParameter::Model.at())) == PlayModel::Elastic;
        let first_gain = CurrentSensorParameter::GainA.at();
        let measured_current = !CurrentSensor::<f64>::ideal(raw.current_sensor()) || (0..9).any(|i| setup.touched[first_gain + i]);
        let first_resolver = ResolverParameter::Mismatch.at();
        let resolver = !Resolver::<f64>::ideal(raw.resolver()) || (0..5).any(|i| setup.touched[first_resolver + i]);
        let accounts = setup.recorded.iter().any(|&s| F::HIGH[s].name.starts_with("energy"));
        let loaded = F::LINEAR || departs(GearParameter::Efficiency.at(), 1.0) || departs(GearParameter::EfficiencyAiding.at(), 1.0);
        let sloped = departs(FrictionParameter::ViscousSlope.at(), 0.0);
        let jams = departs(FrictionParameter::JamTorque.at(), 0.0);
        let mechanical = loaded || sloped || jams;
        let thermal =
            departs(MotorParameter::TemperatureCoefficient.at(), 0.0) || departs(MotorParameter::FluxTemperatureCoefficient.at(), 0.0);
        let told = control.feedback != Feedback::User;
        let heat = ThermalModel::read(at(ThermalParameter::Model.at())) != ThermalModel::Off;
        let tap = (TapParameter::TapLevelA.at()..=TapParameter::TapLevelC.at()).any(|i| departs(i, 0.0));
        let load_side = F::LINEAR || departs(LoadParameter::Damping.at(), 0.0) || departs(LoadParameter::Friction.at(), 0.0);
        let current_filter = setup.raw[CurrentSensorParameter::Bandwidth.at()] > 0.0;
        let six_step = Commutation::read(at(DriveParameter::Commutation.at())) == Commutation::SixStep;
        let commutated = CommutationSource::read(at(DriveParameter::CommutationSource.at())) == CommutationSource::Resolver;
        let (spall, debris) = F::worn(&departs);
        let separate = resolver && !commutated;
        let extra = load_side || heat || tap || unbalance || spall || debris || current_filter || six_step || separate || stops;
        let full = bridge
            || extra
            || elastic
            || measured_current
            || resolver
            || accounts
            || mechanical
            || thermal
            || told
            || motor.trapezoidal
            || motor.shorted_loop
            || motor.dynamic_eccentricity;
        Self {
            drive,
            control,
            motor,
            duty_delay: duty_delay(setup.raw, drive),
            control_every_step: sample_steps(setup.raw, ControlParameter::SampleTime.at()) <= 1,
            semi_implicit: Method::read(at(SolverParameter::Method.at())) == Method::SemiImplicit,
            acquisition: setup
                .recorded
                .iter()
                .any(|&s| (HighSignal::CurrentQMeas as usize..=HighSignal::VoltageQMeas as usize).contains(&s)),
            full,
            bridge,
            bridge_structure,
            elastic,
            measured_current,
            resolver,
            accounts,
            loaded,
            sloped,
            jams,
            thermal,
            extra,
            linear: F::LINEAR,
            load_side,
            heat,
            tap,
            unbalance,
            spall,
            debris,
            current_filter,
            six_step,
            commutated,
            stops,
        }
    }
}

/// Whole solver steps of a carrier drive's computation delay.
fn duty_delay(raw: &[f64], drive: DriveKind) -> Steps {
    let delay = raw[PwmParameter::ComputationDelay.at()] * raw[PwmParameter::SampleTime.at()];
    if drive == DriveKind::Pwm {
        (delay / raw[SolverParameter::Step.at()]).round() as Steps
    } else {
        0
    }
}

/// Whole solver steps in a sample time.
pub(super) fn sample_steps(raw: &[f64], index: usize) -> Steps {
    (raw[index] / raw[SolverParameter::Step.at()]).round() as Steps
}
