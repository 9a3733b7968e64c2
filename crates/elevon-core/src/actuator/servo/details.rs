//! What of a switching servo model a run needs: the components state it, `full` and `extra` follow. Equal over a lane block.

use super::form::Form;
use super::layout::*;
use super::sensing::SensingDetails;
use super::shaft::{ShaftDetails, ShaftNeeds};
use super::signals::HighSignal as Q;
use crate::actuator::Setup;
use crate::control::current_dq::PwmParameter;
use crate::control::limits::LimitStructure;
use crate::control::position_speed::{ControlParameter, ControlStructure};
use crate::details;
use crate::inverter::bridge::{self, BridgeStructure};
use crate::inverter::hysteresis::RelayCrossing;
use crate::inverter::link::DcLink;
use crate::inverter::losses;
use crate::motor::flux_map::FluxMap;
use crate::motor::pole::WeakPole;
use crate::motor::short::{self, ShortStructure};
use crate::motor::star::{interrupted, warms, MotorStructure};
use crate::motor::thermal::Network;
use crate::sensor::current::{CurrentSensor, CurrentSensorParameter};
use crate::sensor::resolver::Resolver;
use crate::time::Steps;
use crate::variable::Signal;

details! {
    /// Everything that decides which code runs.
    Structure, read<F>(x: &Needs)
    always {
        drive: DriveKind = DriveKind::read(x.parts.drive().value(DriveParameter::Kind));
        control: ControlStructure = ControlStructure::read(&x.parts.control());
        limits: LimitStructure = LimitStructure::read(&x.parts.limits(), drive == DriveKind::Pwm, Network::<f64>::needed(&x.parts.thermal()));
        shaft: ShaftDetails = ShaftDetails::read::<F>(&ShaftNeeds::high::<F>(x.parts, records(x.parts, F::HIGH, "energy")));
        sensing: SensingDetails = SensingDetails::read::<F>(x.parts);
        motor: MotorStructure = MotorStructure::read(&x.parts.motor()).with_unbalance(shaft.unbalance).with_weak_pole(WeakPole::<f64>::needed(&x.parts.pole()));
        /// Which kinds of contacts in or at the windings.
        shorts: ShortStructure = short::kinds(&x.parts.motor(), &x.parts.tap(), &x.parts.short());
        bridge_structure: BridgeStructure = BridgeStructure::read(&x.parts.inverter(), interrupted(&x.parts.motor())).with_trips(DcLink::<f64>::trips(&x.parts.link()));
        /// Steps from the sampling of the currents to the update of the duties.
        duty_delay: Steps = duty_delay(x.parts.0.raw, drive);
        control_every_step: bool = sample_steps(x.parts.0.raw, ControlParameter::SampleTime.at()) <= 1;
        /// Relays act at the instant of their crossing.
        located: bool = drive == DriveKind::Hysteresis && RelayCrossing::located(&x.parts.relays());
        /// Filtered quantities are recorded.
        acquisition: bool = x.parts.0.recorded.iter().any(|s| (Q::CurrentQMeas as usize..=Q::VoltageQMeas as usize).contains(s));
    }
    full {
        /// More than ideal switches.
        bridge = bridge_structure.open_phases || bridge::detailed(&x.parts.inverter()) || bridge_structure.trips || drive == DriveKind::Off || x.stops();
        measured_current = CurrentSensor::<f64>::needed(&x.parts.current_sensor());
        /// Electrical energies are accounted: recorded, or needed by the link or the drive's heat.
        accounts = shaft.accounts || x.link() || x.switches() || (bridge && Network::<f64>::needed(&x.parts.thermal()));
        thermal = warms(&x.parts.motor());
        detailed_motor = motor.detailed();
        detailed_shaft = shaft.full;
        detailed_sensing = sensing.full;
    }
    extra {
        link = x.link();
        switching = x.switches();
        heat = Network::<f64>::needed(&x.parts.thermal());
        shorted = shorts.contains(&true);
        /// The flux linkages are other than L i.
        mapped = FluxMap::<f64>::needed(&x.parts.flux_map());
        current_filter = x.parts.current_sensor().value(CurrentSensorParameter::Bandwidth) > 0.0;
        six_step = Commutation::read(x.parts.drive().value(DriveParameter::Commutation)) == Commutation::SixStep;
        /// A lost resolver opens the bridge.
        stops = x.stops();
        extra_shaft = shaft.extra;
        extra_sensing = sensing.extra;
    }
}

/// What a run reports of its servo.
pub(super) struct Needs<'a> {
    pub parts: Parts<'a>,
}

impl<'a> Needs<'a> {
    pub(super) fn new(setup: &'a Setup<'a>) -> Self {
        Self { parts: Parts(setup) }
    }

    fn link(&self) -> bool {
        DcLink::<f64>::needed(&self.parts.link())
    }

    fn switches(&self) -> bool {
        let drive = DriveKind::read(self.parts.drive().value(DriveParameter::Kind));
        losses::switches(&self.parts.switching()) && drive != DriveKind::Off
    }

    fn stops(&self) -> bool {
        let stop = FeedbackLoss::read(self.parts.drive().value(DriveParameter::FeedbackLoss)) == FeedbackLoss::Stop;
        stop && Resolver::<f64>::lost(&self.parts.resolver())
    }
}

/// Is a signal recorded whose name begins so?
pub(super) fn records(parts: Parts<'_>, signals: &[Signal], begin: &str) -> bool {
    parts.0.recorded.iter().any(|&s| signals[s].name.starts_with(begin))
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
