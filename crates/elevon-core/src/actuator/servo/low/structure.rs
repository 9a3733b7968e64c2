//! What of a reduced-order servo model a run needs.

use crate::actuator::servo::details::records;
use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::actuator::servo::sensing::SensingDetails;
use crate::actuator::servo::shaft::{ShaftDetails, ShaftNeeds};
use crate::control::limits::LimitStructure;
use crate::control::position_speed::{ControlParameter, ControlStructure};
use crate::details;
use crate::inverter::bridge::BridgeStructure;
use crate::inverter::link::DcLink;
use crate::motor::flux_map::FluxMap;
use crate::motor::pole::WeakPole;
use crate::motor::star::{interrupted, MotorParameter, MotorStructure, ShortModel};
use crate::motor::thermal::Network;
use crate::sensor::current::CurrentSensorParameter;
use crate::sensor::resolver::{Resolver, ResolverParameter};

details! {
    /// What of a reduced-order servo model a run needs; equal over a lane block.
    Structure, read<F>(parts: Parts)
    always {
        drive: DriveKind = DriveKind::read(parts.drive().value(DriveParameter::Kind));
        bridge: BridgeStructure = BridgeStructure::gateless(&parts.inverter()).with_trips(DcLink::<f64>::trips(&parts.link()));
        /// The references are blocks, not sines.
        six_step: bool = Commutation::read(parts.drive().value(DriveParameter::Commutation)) == Commutation::SixStep;
        control: ControlStructure = ControlStructure::read(&parts.control());
        limits: LimitStructure = LimitStructure::read(&parts.limits(), drive == DriveKind::Pwm, Network::<f64>::needed(&parts.thermal()));
        integral: bool = parts.control().used(if control.pid { ControlParameter::PidIntegralTime } else { ControlParameter::IntegralTime });
        /// The command carries noise.
        noisy_command: bool = parts.control().used(ControlParameter::NoiseDeviation);
        shaft: ShaftDetails = ShaftDetails::read::<F>(&ShaftNeeds::low::<F>(parts));
        sensing: SensingDetails = SensingDetails::read::<F>(parts);
        motor: MotorStructure = MotorStructure::read(&parts.motor()).with_unbalance(shaft.unbalance).with_weak_pole(WeakPole::<f64>::needed(&parts.pole()));
    }
    full {
        detailed_shaft = shaft.full;
        detailed_sensing = sensing.full;
    }
    extra {
        shorted = parts.motor().any_away([MotorParameter::TurnsA, MotorParameter::TurnsB, MotorParameter::TurnsC]);
        /// A lost resolver opens the bridge.
        stops = Resolver::<f64>::lost(&parts.resolver())
            && FeedbackLoss::read(parts.drive().value(DriveParameter::FeedbackLoss)) == FeedbackLoss::Stop;
        /// The bridge is without gates, now or later.
        passive = drive == DriveKind::Off || stops || bridge.trips;
        /// The current sensors of the phases differ.
        gains = parts.current_sensor().any_away([
            CurrentSensorParameter::GainA, CurrentSensorParameter::GainB, CurrentSensorParameter::GainC,
        ]);
        /// Shorted turns have currents of their own.
        loops = shorted && ShortModel::read(parts.motor().value(MotorParameter::ShortModel)) == ShortModel::Loop;
        /// The reading is lost or stands still: the drive comes to its voltage limit, where currents lag.
        unseen = sensing.resolver && Resolver::<f64>::stands(&parts.resolver());
        /// Coefficients vary with the rotor angle.
        angle = (sensing.resolver && sensing.commutated)
            || motor.dynamic_eccentricity
            || motor.weak_pole
            || motor.static_eccentricity
            || motor.trapezoidal
            || loops
            || six_step
            || passive
            || gains
            || unseen
            || interrupted(&parts.motor())
            || shorted;
        /// The drive places its references by a reading that is not the shaft's angle.
        misled = sensing.resolver && sensing.commutated;
        /// One current does not stand for three: references that are not the rotor's or no sines, relays whose
        /// references the star's currents cannot have all, integrals that no current follows, a voltage limit for long.
        driven = match drive {
            DriveKind::Hysteresis => six_step || gains || unseen || misled || interrupted(&parts.motor()),
            DriveKind::Pwm => unseen || misled || interrupted(&parts.motor()),
            DriveKind::Off => false,
        };
        /// Faults that come by degrees alone make it so: small ones leave one current.
        gradual = driven && !(six_step || unseen || interrupted(&parts.motor()));
        /// The references stand apart from the rotor by an angle that does not change.
        turned = misled && parts.resolver().away(ResolverParameter::Offset);
        heat = Network::<f64>::needed(&parts.thermal());
        /// The phase has a direct current, or linkages other than L i.
        field = limits.direct || FluxMap::<f64>::needed(&parts.flux_map());
        /// Electrical energies are recorded.
        accounts = records(parts, F::LOW, "energy");
        link = DcLink::<f64>::needed(&parts.link());
        extra_shaft = shaft.extra;
        extra_sensing = sensing.extra;
    }
}
