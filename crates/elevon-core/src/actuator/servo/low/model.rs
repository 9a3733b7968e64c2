//! Constants and state of a run in the reduced-order model.

use super::control::Control;
use super::driven::DrivenState;
use super::jump::JumpState;
use super::loops::Loops;
use super::phase::Phase;
use crate::actuator::servo::form::Form;
use crate::actuator::servo::high::model::{heated, network};
use crate::actuator::servo::layout::*;
use crate::actuator::servo::sensing::{Sensed, Sensing, SensingDetails};
use crate::actuator::servo::shaft::{Shaft, ShaftDetails, ShaftNeeds, ShaftState};
use crate::control::current_dq::PwmParameter;
use crate::control::position_speed::{ControlParameter, ControlStructure};
use crate::details;
use crate::inverter::bridge::{Bridge, BridgeState, BridgeStructure, InverterParameter};
use crate::inverter::link::{DcLink, DcLinkState};
use crate::kept;
use crate::motor::equivalent::{Circuit, LowParameter};
use crate::motor::pole::WeakPole;
use crate::motor::star::{interrupted, MotorParameter, MotorStructure, ShortModel, Star, StarState};
use crate::motor::thermal::{Network, NetworkState};
use crate::scalar::Scalar;
use crate::sensor::current::CurrentSensorParameter;
use crate::sensor::filter::closing;
use crate::sensor::resolver::{Resolver, ResolverParameter};
use crate::three;

/// Error of the references, rad or relative, from which on three windings are stepped for good: the cosine is 0.995.
const WHOLE: f64 = 0.1;

details! {
    /// What of a reduced-order servo model a run needs; equal over a lane block.
    Structure, read<F>(parts: Parts)
    always {
        drive: DriveKind = DriveKind::read(parts.drive().value(DriveParameter::Kind));
        bridge: BridgeStructure = BridgeStructure::gateless(&parts.inverter()).with_trips(DcLink::<f64>::trips(&parts.link()));
        /// The references are blocks, not sines.
        six_step: bool = Commutation::read(parts.drive().value(DriveParameter::Commutation)) == Commutation::SixStep;
        control: ControlStructure = ControlStructure::read(&parts.control());
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
        link = DcLink::<f64>::needed(&parts.link());
        extra_shaft = shaft.extra;
        extra_sensing = sensing.extra;
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Model<S> {
    pub dt: S,
    pub star: Star<S>,
    pub pole: WeakPole<S>,
    pub resistance: [S; 3],
    pub inductance: [S; 3],
    pub healthy: Phase<S>,
    /// Constant, resistance and inductance of the healthy phase at the reference temperature.
    pub cold: [S; 3],
    pub control: Control<S>,
    pub drive: Drive<S>,
    pub circuits: Loops<S>,
    pub shaft: Shaft<S>,
    /// Of the shaft alone.
    pub per_inertia: S,
    pub sensing: Sensing<S>,
    pub filter: S,
    pub temperature: S,
    pub network: Network<S>,
}

/// The current loop and the voltage it has.
#[derive(Clone, Copy, Debug)]
pub struct Drive<S> {
    pub voltage_ratio: S,
    pub band: S,
    /// Of the PWM current loop, 1/s.
    pub bandwidth: S,
    /// Share of the current's error that a step of the PWM loop closes.
    pub tracking: S,
    pub supply_scale: S,
    /// p L of the cross coupling.
    pub electrical_inductance: S,
    pub bridge: Bridge<S>,
    /// 1: a switch is shorted, the first gate of its partner trips the drive.
    pub shorted: S,
    pub trip_current: S,
    /// Largest excess of a phase current over its reference.
    pub half_band: S,
    /// Time constant of the filter of the currents that relays see.
    pub filter_time: S,
    /// One over the gain of each current sensor; none of an interrupted phase.
    pub weight: [S; 3],
    pub gain: [S; 3],
    pub link: DcLink<S>,
    /// Share of the three windings' step in what a step does; the rest is that of one current.
    pub apart: S,
}

#[derive(Clone, Copy, Debug)]
pub struct State<S> {
    pub link: DcLinkState<S>,
    pub resistance_factor: S,
    pub flux_factor: S,
    pub network: NetworkState<S>,
    /// Command of the last step; NaN before the first.
    pub command: S,
    pub copper: S,
    /// Amplitude of the imposed currents.
    pub current: S,
    /// Its quadrature component in the rotor's frame, and as drive and acquisition see it.
    pub current_q: S,
    pub current_seen: S,
    /// Phase currents; stepped while the bridge has no gates, else the imposed ones.
    pub phases: [S; 3],
    pub loops: [S; 3],
    pub bridge: BridgeState<S>,
    pub driven: DrivenState<S>,
    pub command_noise: S,
    pub jumps: JumpState<S>,
    /// 1: the reported speed was zero at the last step.
    pub rested: S,
    pub voltage: S,
    pub integral: S,
    /// Position error as the PID's filter has it; NaN before the first step.
    pub filtered_error: S,
    pub speed_ref: S,
    pub torque_ref: S,
    pub motor_torque: S,
    pub sensed: Sensed<S>,
    pub filtered: [S; 2],
    pub tripped: S,
    pub shaft: ShaftState<S>,
}

kept!(State<f64> as State {
    link, resistance_factor, flux_factor, network, command, copper, current, current_q, current_seen, phases, loops, bridge, driven,
    command_noise, jumps, rested, voltage, integral, filtered_error, speed_ref, torque_ref, motor_torque, sensed, filtered, tripped,
    shaft
});

impl<S: Scalar> Drive<S> {
    /// Between what one current and what three windings make.
    #[inline(always)]
    pub(super) fn share(&self, one: S, three: S) -> S {
        let part = self.apart.fma(three - one, one);
        S::select(self.apart.equals(S::one()), three, part)
    }

    fn derive(raw: &[S], structure: &Structure, star: &Star<S>, sensing: &Sensing<S>, dt: S) -> Self {
        let at = |i: usize| raw[i];
        let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
        let inductance = at(MotorParameter::WindingInductance.at());
        let gain: [S; 3] = three!(|j| at(CurrentSensorParameter::GainA.at() + j));
        // A dead sensor: its phase takes whatever lets the others follow.
        let tiny = S::splat(1e-9);
        let followed: [S; 3] = three!(|j| one / gain[j].signed(gain[j].abs().maximum(tiny)));
        let shorted = (0..6).fold(S::zero(), |most, i| most.maximum(at(InverterParameter::ShortedAHigh.at() + i)));
        Self {
            voltage_ratio: match structure.drive {
                DriveKind::Hysteresis | DriveKind::Off => at(LowParameter::VoltageRatio.at()),
                DriveKind::Pwm => linear_range(at(InverterParameter::DeadTime.at()) * at(PwmParameter::Frequency.at())),
            },
            band: at(LowParameter::BandRatio.at()) * at(InverterParameter::HysteresisBand.at()),
            bandwidth: at(PwmParameter::ProportionalGain.at()) / inductance,
            tracking: match structure.drive {
                DriveKind::Pwm => one - (-(at(PwmParameter::ProportionalGain.at()) / inductance * dt)).exp(),
                DriveKind::Hysteresis | DriveKind::Off => one,
            },
            supply_scale: at(InverterParameter::SupplyScale.at()),
            electrical_inductance: at(MotorParameter::PolePairs.at()) * inductance,
            bridge: Bridge::derive(Raw(raw).inverter()),
            shorted: S::indicator(half.le(shorted)),
            trip_current: at(InverterParameter::TripCurrent.at()),
            half_band: match structure.drive {
                DriveKind::Hysteresis => at(InverterParameter::HysteresisBand.at()),
                DriveKind::Pwm | DriveKind::Off => zero,
            },
            filter_time: time_constant(at(CurrentSensorParameter::Bandwidth.at())),
            weight: three!(|j| S::select(half.le(star.open[j]), zero, followed[j])),
            gain,
            link: DcLink::derive(Raw(raw).link(), dt),
            apart: if structure.gradual { apart(structure, star, sensing, gain) } else { one },
        }
    }
}

/// Errors of angle (electrical, rad) and of gains up to `WHOLE` go from one current to three windings, with no slope at either
/// end: one current stands for three within their cosine, and what the two forms differ by in rounding their steps is no jump.
fn apart<S: Scalar>(structure: &Structure, star: &Star<S>, sensing: &Sensing<S>, gain: [S; 3]) -> S {
    let one = S::one();
    let unlike = (gain[0] - one).abs().maximum((gain[1] - one).abs()).maximum((gain[2] - one).abs());
    let turned = if structure.misled { star.pole_pairs * sensing.errors() } else { S::zero() };
    let share = (turned.maximum(unlike) * S::splat(1.0 / WHOLE)).minimum(one);
    share * share * (S::splat(3.0) - (share + share))
}

/// Of a first-order filter; none where there is no filter.
fn time_constant<S: Scalar>(bandwidth: S) -> S {
    let there = S::zero().lt(bandwidth);
    S::select(there, S::one() / (S::splat(std::f64::consts::TAU) * S::select(there, bandwidth, S::one())), S::zero())
}

/// Largest phase voltage of a min-max modulated carrier drive over its link: 1 / sqrt 3, less the fundamental of the
/// volt-seconds that the dead times take, a square wave of `dead` (their share of a carrier period) times the link.
fn linear_range<S: Scalar>(dead: S) -> S {
    let fundamental = S::splat(4.0 / std::f64::consts::PI) * dead;
    (S::splat(1.0 / 3.0_f64.sqrt()) - fundamental).maximum(S::zero())
}

impl<S: Scalar> Model<S> {
    pub(super) fn derive<F: Form>(raw: &[S], structure: &Structure) -> Self {
        let at = |p: MotorParameter| raw[p.at()];
        let one = S::one();
        let dt = raw[LowParameter::Step.at()];
        let shaft = Shaft::derive::<F>(raw, &structure.shaft, dt);
        // The turns outside the short; those inside are loops of their own.
        let outside = MotorStructure { shorted_loop: false, ..structure.motor };
        let mut star = Star::derive(Raw(raw).motor(), &outside, dt);
        star.add_eccentricity(shaft.unbalance.eccentricity(shaft.inertia));
        let circuits = Loops::derive(raw, dt);
        let control = Control::derive(raw, structure, shaft.gear.ratio, dt);
        let sensing = Sensing::derive_low(raw, &structure.sensing);
        let constant = S::splat(1.5) * at(MotorParameter::EmfConstant) * at(MotorParameter::FluxFraction);
        let cold = [constant, at(MotorParameter::WindingResistance), at(MotorParameter::WindingInductance)];
        let rise = at(MotorParameter::WindingTemperature) - at(MotorParameter::ReferenceTemperature);
        let resistance_factor = one + at(MotorParameter::TemperatureCoefficient) * rise;
        let flux_factor = one + at(MotorParameter::FluxTemperatureCoefficient) * rise;
        let circuit = Circuit::new(cold[1] * resistance_factor, cold[2], dt);
        Self {
            dt,
            resistance: star.resistance,
            inductance: if structure.loops { circuits.intact } else { three!(|j| one / star.per_inductance[j]) },
            healthy: Phase::new(constant * flux_factor, circuit, &control, shaft.inertia),
            cold,
            drive: Drive::derive(raw, structure, &star, &sensing, dt),
            circuits,
            star,
            pole: WeakPole::derive(Raw(raw).pole(), raw[MotorParameter::PolePairs.at()]),
            control,
            per_inertia: one / shaft.inertia,
            shaft,
            sensing,
            filter: closing(raw[CurrentSensorParameter::FilterCutoff.at()], dt.lane(0)),
            temperature: at(MotorParameter::WindingTemperature),
            network: network(raw, dt.lane(0)),
        }
    }

    pub(super) fn start(&self, raw: &[S], initial: &[S]) -> State<S> {
        let (zero, nan) = (S::zero(), S::splat(f64::NAN));
        let mut shaft = self.shaft.start([initial[0], initial[1]], [initial[2], nan]);
        let warm = self.network.start_at([initial[3], initial[4]]);
        self.shaft.lubricate(&mut shaft, self.network.housing(heated(raw), &warm));
        let (resistance_factor, flux_factor) = heat(raw, &warm);
        State {
            link: DcLinkState::initial(),
            resistance_factor,
            flux_factor,
            network: warm,
            command: nan,
            copper: zero,
            current: zero,
            current_q: zero,
            current_seen: zero,
            phases: [zero; 3],
            loops: [zero; 3],
            bridge: BridgeState::initial(),
            driven: DrivenState::initial(),
            command_noise: zero,
            jumps: JumpState::start(shaft.motor_speed),
            rested: zero,
            voltage: zero,
            integral: zero,
            filtered_error: nan,
            speed_ref: zero,
            torque_ref: zero,
            motor_torque: zero,
            sensed: self.sensing.start(&shaft),
            filtered: [zero; 2],
            tripped: zero,
            shaft,
        }
    }
}

impl<S: Scalar> Model<S> {
    /// Gives the lubricant the housing's temperature.
    pub(super) fn lubricate(&self, structure: &Structure, s: &mut State<S>) {
        if structure.shaft.lubricated {
            self.shaft.lubricate(&mut s.shaft, self.network.housing(structure.heat, &s.network));
        }
    }
}

impl<S: Scalar> State<S> {
    pub(super) fn refresh(&mut self, raw: &[S]) {
        (self.resistance_factor, self.flux_factor) = heat(raw, &self.network);
    }
}

/// Factors of the winding's resistance and of the flux.
fn heat<S: Scalar>(raw: &[S], warm: &NetworkState<S>) -> (S, S) {
    if !heated(raw) {
        let mut star = StarState::initial();
        star.heat(Raw(raw).motor(), raw[MotorParameter::WindingTemperature.at()]);
        return (star.resistance_factor, star.flux_factor);
    }
    network(raw, raw[LowParameter::Step.at()].lane(0)).factors(warm)
}
