//! Constants and state of a run.

use crate::actuator::servo::details::Structure;
use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::control::current_dq::{CurrentControl, CurrentControlState};
use crate::control::position_speed::{ControlParameter, PositionSpeed, PositionSpeedState};
use crate::inverter::bridge::{Bridge, BridgeState, InverterParameter};
use crate::motor::star::{MotorParameter, Star, StarState};
use crate::motor::tap::Tap;
use crate::motor::thermal::{Network, NetworkState, ThermalParameter};
use crate::motor::unbalance::Unbalance;
use crate::scalar::Scalar;
use crate::sensor::current::{CurrentSensor, CurrentSensorParameter};
use crate::sensor::encoder::Encoder;
use crate::sensor::filter::closing;
use crate::sensor::resolver::{Resolver, ResolverParameter};
use crate::transmission::friction::{Friction, FrictionParameter};
use crate::transmission::gear::{Gear, GearParameter, LoadParameter};
use crate::transmission::play::Play;
use crate::transmission::screw::Screw;

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
    pub(crate) friction: Friction<S>,
    pub(crate) gear: Gear<S>,
    pub(crate) play: Play<S>,
    pub(crate) sensor: CurrentSensor<S>,
    pub(crate) encoder: Encoder<S>,
    pub(crate) resolver: Resolver<S>,
    pub(crate) filter: S,
    pub(crate) inertia: S,
    pub(crate) dt_per_inertia: S,
    pub(crate) user_inertia: S,
    pub(crate) per_user_inertia: S,
    pub(crate) noise_deviation: S,
    pub(crate) temperature: S,
    pub(crate) extra: Extra<S>,
}

/// Constants of what only some servos have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extra<S> {
    pub screw: Screw<S>,
    pub unbalance: Unbalance<S>,
    pub tap: Tap<S>,
    pub network: Network<S>,
    /// Dry friction and damping of the load side.
    pub load_friction: S,
    pub load_damping: S,
    /// Filter of the controlled current.
    pub closing: S,
    pub resolver_off: S,
}

/// All that changes during a run.
#[derive(Clone, Copy, Debug)]
pub struct State<S> {
    pub(crate) star: StarState<S>,
    pub(crate) legs: [S; 3],
    pub(crate) bridge: BridgeState<S>,
    pub(crate) control: PositionSpeedState<S>,
    pub(crate) current_ref: S,
    pub(crate) current_control: CurrentControlState<S>,
    pub(crate) motor_position: S,
    pub(crate) motor_speed: S,
    pub(crate) user_position: S,
    pub(crate) user_speed: S,
    pub(crate) command_noise: S,
    pub(crate) current_noise: [S; 3],
    pub(crate) held_angle: S,
    pub(crate) jam_side: S,
    pub(crate) jammed: S,
    pub(crate) filtered: [S; 3],
    pub(crate) transitions: S,
    /// Phase-to-neutral voltages of the last step (detailed bridge).
    pub(crate) voltage: [S; 3],
    pub(crate) energy: [S; 8],
    pub(crate) extra: ExtraState<S>,
}

/// State of what only some servos have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExtraState<S> {
    pub network: NetworkState<S>,
    /// Currents as the drive sees them.
    pub sensed: [S; 3],
    /// Factor on the dry friction of a screw with debris in it.
    pub scatter: S,
}

pub(crate) const E_SUPPLY: usize = 0;
pub(crate) const E_COPPER: usize = 1;
pub(crate) const E_INVERTER: usize = 2;
pub(crate) const E_FRICTION: usize = 3;
pub(crate) const E_BRAKE: usize = 4;
pub(crate) const E_LOAD: usize = 5;
pub(crate) const E_IMPACT: usize = 6;

pub(crate) const E_TAP: usize = 7;

impl<S: Scalar> Model<S> {
    pub(crate) fn derive<F: Form>(raw: &[S], structure: &Structure) -> Self {
        let view = Raw(raw);
        let at = |i: usize| raw[i];
        let dt = at(SolverParameter::Step.at());
        let dt0 = dt.lane(0);
        let ts = at(ControlParameter::SampleTime.at()).lane(0).max(dt0);
        let screw = F::screw(raw);
        let ratio = F::ratio(raw);
        let gear = Gear::derive(ratio, view.gear(), view.stop(), view.load(), [screw.efficiency, screw.efficiency_aiding]);
        let user_inertia = at(LoadParameter::Inertia.at());
        let reflected = user_inertia * gear.per_ratio * gear.per_ratio;
        let unbalance = Unbalance::derive(view.unbalance());
        let mut rotor = at(MotorParameter::Inertia.at()) + at(GearParameter::Inertia.at());
        let mut star = Star::derive(view.motor(), &structure.motor, dt);
        if structure.extra {
            rotor = rotor + F::screw_inertia(raw) + unbalance.inertia;
            star.lean(unbalance.eccentricity(rotor + reflected));
        }
        let inertia = if structure.elastic { rotor } else { rotor + reflected };
        let mut friction = Friction::derive(view.friction());
        friction.preloaded(screw.preload_torque, screw.viscous, at(FrictionParameter::Static.at()), at(FrictionParameter::Dynamic.at()));
        Self {
            dt,
            star,
            bridge: Bridge::derive(view.inverter()),
            half_band: at(InverterParameter::HysteresisBand.at()),
            supply_scale: at(InverterParameter::SupplyScale.at()),
            control: PositionSpeed::derive(view.control(), ts, ratio),
            current_control: CurrentControl::derive(view.pwm(), at(MotorParameter::PolePairs.at())),
            friction,
            gear,
            play: Play::derive(view.play()),
            sensor: CurrentSensor::derive(view.current_sensor()),
            encoder: Encoder::derive(view.encoder(), if F::LINEAR { 1.0 } else { std::f64::consts::TAU }),
            resolver: Resolver::derive(view.resolver()),
            filter: closing(at(CurrentSensorParameter::FilterCutoff.at()), dt0),
            inertia,
            dt_per_inertia: dt / inertia,
            user_inertia: if structure.elastic { user_inertia } else { S::zero() },
            per_user_inertia: S::one() / S::select(S::zero().lt(user_inertia), user_inertia, S::one()),
            noise_deviation: at(ControlParameter::NoiseDeviation.at()),
            temperature: at(MotorParameter::WindingTemperature.at()),
            extra: Extra {
                screw,
                unbalance,
                tap: Tap::derive(view.tap(), dt),
                network: network(raw, dt0),
                load_friction: at(LoadParameter::Friction.at()),
                load_damping: at(LoadParameter::Damping.at()),
                closing: closing(at(CurrentSensorParameter::Bandwidth.at()), dt0),
                resolver_off: at(ResolverParameter::PowerOff.at()),
            },
        }
    }
}

/// The thermal network at the whole number of solver steps next to its sample time.
pub(crate) fn network<S: Scalar>(raw: &[S], dt: f64) -> Network<S> {
    let at = |p: MotorParameter| raw[p.at()];
    let period = (raw[ThermalParameter::SampleTime.at()].lane(0) / dt).round().max(1.0) * dt;
    let temperature = [
        at(MotorParameter::ReferenceTemperature),
        at(MotorParameter::TemperatureCoefficient),
        at(MotorParameter::FluxTemperatureCoefficient),
    ];
    Network::derive(Raw(raw).thermal(), temperature, period)
}
