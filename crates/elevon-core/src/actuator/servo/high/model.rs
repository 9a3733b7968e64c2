//! Constants and state of a run.

use crate::actuator::servo::details::Structure;
use crate::actuator::servo::form::Form;
use crate::actuator::servo::heat::{network, network_period};
use crate::actuator::servo::layout::*;
use crate::actuator::servo::sensing::{Sensed, Sensing};
use crate::actuator::servo::shaft::{Shaft, ShaftState};
use crate::control::current_dq::{CurrentControl, CurrentControlState, PwmParameter};
use crate::control::limits::Limits;
use crate::control::position_speed::{ControlParameter, PositionSpeed, PositionSpeedState};
use crate::inverter::bridge::{Bridge, BridgeState, InverterParameter};
use crate::inverter::carrier::{Carrier, Window};
use crate::inverter::link::{DcLink, DcLinkState};
use crate::inverter::losses::{DriveHeat, DriveHeatState, SwitchingParameter};
use crate::kept;
use crate::motor::flux_map::FluxMap;
use crate::motor::pole::WeakPole;
use crate::motor::short::{Discrete, Shorts};
use crate::motor::star::{MotorParameter, Star, StarState};
use crate::motor::thermal::{Network, NetworkState, ThermalParameter};
use crate::scalar::Scalar;
use crate::sensor::current::{CurrentSensor, CurrentSensorParameter};
use crate::sensor::filter::closing;

/// Constants of a run.
#[derive(Clone, Copy, Debug)]
pub struct Model<S> {
    pub(crate) dt: S,
    pub(crate) star: Star<S>,
    pub(crate) bridge: Bridge<S>,
    pub(crate) half_band: S,
    pub(crate) supply_scale: S,
    pub(crate) control: PositionSpeed<S>,
    pub(crate) current_control: CurrentControl<S>,
    pub(crate) carrier: Carrier<S>,
    pub(crate) shaft: Shaft<S>,
    pub(crate) sensing: Sensing<S>,
    pub(crate) sensor: CurrentSensor<S>,
    pub(crate) filter: S,
    pub(crate) noise_deviation: S,
    pub(crate) temperature: S,
    pub(crate) extra: Extra<S>,
}

/// Constants of what only some servos have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extra<S> {
    pub shorts: Shorts<S>,
    pub pole: WeakPole<S>,
    pub map: FluxMap<S>,
    pub limits: Limits<S>,
    pub link: DcLink<S>,
    pub switching_time: S,
    pub network: Network<S>,
    pub drive_heat: DriveHeat<S>,
    /// Filter of the controlled current.
    pub closing: S,
}

/// All that changes during a run.
#[derive(Clone, Copy, Debug)]
pub struct State<S> {
    pub(crate) star: StarState<S>,
    /// Rotor position expected at the middle of the next step, where steps are of second order.
    pub(crate) middle: S,
    /// Commands of the legs (+1 high, -1 low, 0 off); behind a carrier their means over the last step.
    pub(crate) legs: [S; 3],
    /// Edges of the carrier's present period.
    pub(crate) window: Window<S>,
    /// Commands at the end of the last step, behind a carrier with a detailed bridge.
    pub(crate) commands: [S; 3],
    pub(crate) bridge: BridgeState<S>,
    pub(crate) control: PositionSpeedState<S>,
    pub(crate) current_ref: S,
    pub(crate) current_control: CurrentControlState<S>,
    pub(crate) shaft: ShaftState<S>,
    pub(crate) command_noise: S,
    pub(crate) current_noise: [S; 3],
    pub(crate) sensed: Sensed<S>,
    /// What the current sensors showed last.
    pub(crate) current_reading: [S; 3],
    pub(crate) filtered: [S; 3],
    /// Of relays; the window counts those behind a carrier.
    pub(crate) transitions: S,
    /// Phase-to-neutral voltages of the last step (detailed bridge).
    pub(crate) voltage: [S; 3],
    pub(crate) energy: [S; 5],
    pub(crate) extra: ExtraState<S>,
}

kept!(State<f64> as State {
    star, middle, legs, window, commands, bridge, control, current_ref, current_control, shaft, command_noise, current_noise, sensed,
    current_reading, filtered, transitions, voltage, energy, extra
});

/// State of what only some servos have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExtraState<S> {
    pub network: NetworkState<S>,
    /// Currents as the drive sees them.
    pub sensed: [S; 3],
    /// Current reference of the last step, where crossings of the relays are located.
    pub last_reference: S,
    /// Direct current of the field weakening, A, and the share of the current limit that the temperature leaves.
    pub weakening: S,
    pub derated: S,
    pub link: DcLinkState<S>,
    pub drive_heat: DriveHeatState<S>,
    /// The contacts' network at the present parameters and temperature.
    pub contacts: Discrete<S>,
}

kept!(ExtraState<f64> as ExtraState { network, sensed, last_reference, weakening, derated, link, drive_heat, contacts });

/// Accounts of the electrical part; those of the shaft are its own.
pub(crate) const E_SUPPLY: usize = 0;
pub(crate) const E_COPPER: usize = 1;
pub(crate) const E_INVERTER: usize = 2;
pub(crate) const E_TAP: usize = 3;
pub(crate) const E_CONTACT: usize = 4;

impl<S: Scalar> Model<S> {
    /// The electrical part over a share of a step.
    #[inline(always)]
    pub(crate) fn over(&self, share: S) -> Self {
        // A contact's conductance has no meaning over no time at all.
        let share = share.maximum(S::splat(1e-9));
        let extra = Extra { shorts: self.extra.shorts.over(share), ..self.extra };
        Self { dt: share * self.dt, star: self.star.over(share), extra, ..*self }
    }

    pub(crate) fn derive<F: Form>(raw: &[S], structure: &Structure) -> Self {
        let view = Raw(raw);
        let at = |i: usize| raw[i];
        let dt = at(SolverParameter::Step.at());
        let dt0 = dt.lane(0);
        let ts = at(ControlParameter::SampleTime.at()).lane(0).max(dt0);
        let shaft = Shaft::derive::<F>(raw, &structure.shaft, dt);
        let mut star = Star::derive(view.motor(), &structure.motor, dt);
        if structure.shaft.unbalance {
            star.add_eccentricity(shaft.unbalance.eccentricity(shaft.whole_inertia));
        }
        if structure.drive == DriveKind::Pwm || structure.located {
            star = star.at_the_middle();
        }
        Self {
            dt,
            star,
            bridge: Bridge::derive(view.inverter()),
            half_band: at(InverterParameter::HysteresisBand.at()),
            supply_scale: at(InverterParameter::SupplyScale.at()),
            control: PositionSpeed::derive(view.control(), ts, shaft.gear.ratio),
            current_control: CurrentControl::derive(view.pwm(), at(MotorParameter::PolePairs.at())),
            carrier: Carrier::derive(at(PwmParameter::Frequency.at()), dt),
            shaft,
            sensing: Sensing::derive(raw, &structure.sensing),
            sensor: CurrentSensor::derive(view.current_sensor()),
            filter: closing(at(CurrentSensorParameter::FilterCutoff.at()), dt0),
            noise_deviation: at(ControlParameter::NoiseDeviation.at()),
            temperature: at(MotorParameter::WindingTemperature.at()),
            extra: Extra {
                shorts: Shorts::derive(view.motor(), view.tap(), view.short(), &star, structure.motor.shorted_loop, dt),
                pole: WeakPole::derive(view.pole(), at(MotorParameter::PolePairs.at())),
                map: FluxMap::derive(view.flux_map(), view.motor()),
                limits: Limits::derive(
                    view.limits(),
                    [at(MotorParameter::PolePairs.at()) * at(PwmParameter::Inductance.at()), at(PwmParameter::EmfConstant.at())],
                    at(ControlParameter::CurrentLimit.at()),
                    at(PwmParameter::SampleTime.at()),
                ),
                link: DcLink::derive(view.link(), dt),
                switching_time: at(SwitchingParameter::SwitchingTime.at()),
                network: network(raw, dt0),
                drive_heat: DriveHeat::derive(view.drive_heat(), at(ThermalParameter::Ambient.at()), S::splat(network_period(raw, dt0))),
                closing: closing(at(CurrentSensorParameter::Bandwidth.at()), dt0),
            },
        }
    }
}
