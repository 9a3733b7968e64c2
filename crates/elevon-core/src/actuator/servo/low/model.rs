//! Constants and state of a run in the reduced-order model.

use super::jump::{JumpState, Jumps};
use super::structure::Structure;
use crate::actuator::servo::form::Form;
use crate::actuator::servo::heat::{heated, network};
use crate::actuator::servo::layout::*;
use crate::actuator::servo::sensing::{Sensed, Sensing};
use crate::actuator::servo::shaft::{Shaft, ShaftState};
use crate::control::current_dq::PwmParameter;
use crate::control::limits::Limits;
use crate::control::position_speed::{ControlParameter, Mode, PositionLoop};
use crate::inverter::bridge::{Bridge, BridgeState, InverterParameter};
use crate::inverter::link::{DcLink, DcLinkState};
use crate::kept;
use crate::motor::equivalent::{Circuit, LowParameter};
use crate::motor::flux_map::FluxMap;
use crate::motor::pole::WeakPole;
use crate::motor::star::{MotorParameter, MotorStructure, Star, StarState};
use crate::motor::thermal::{Network, NetworkState};
use crate::scalar::Scalar;
use crate::sensor::current::CurrentSensorParameter;
use crate::sensor::filter::closing;
use crate::three;

/// Error of the references, rad or relative, from which on three windings are stepped for good: the cosine is 0.995.
const WHOLE: f64 = 0.1;

#[derive(Clone, Copy, Debug)]
pub struct Model<S> {
    pub dt: S,
    pub star: Star<S>,
    pub pole: WeakPole<S>,
    pub map: FluxMap<S>,
    pub limits: Limits<S>,
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

/// What the controller believes: P, and PID whose derivative acts as inertia; or one PID on the position with a filter.
#[derive(Clone, Copy, Debug)]
pub struct Control<S> {
    pub(super) per_dt: S,
    pub(super) position: PositionLoop<S>,
    pub(super) speed_gain: S,
    pub(super) integral_step: S,
    pub derivative_inertia: S,
    /// Of the position PID: torque per difference of its filter, and the filter's share of a step.
    pub(super) derivative_gain: S,
    pub(super) derivative_decay: S,
    pub(super) jumps: Jumps<S>,
    pub(super) back_calculation: S,
    pub(super) threshold: S,
    pub noise_deviation: S,
    pub speed_limit: S,
    pub torque_limit: S,
    pub per_torque_constant: S,
}

impl<S: Scalar> Control<S> {
    pub(super) fn derive(raw: &[S], structure: &Structure, ratio: S, dt: S) -> Self {
        let at = |p: ControlParameter| raw[p.at()];
        let (zero, one) = (S::zero(), S::one());
        let pid = structure.control.pid;
        let gain = if pid { at(ControlParameter::PidGain) } else { at(ControlParameter::SpeedGain) * at(ControlParameter::SpeedGainScale) };
        let ti = at(if pid { ControlParameter::PidIntegralTime } else { ControlParameter::IntegralTime });
        let integrates = zero.lt(ti);
        // A torque command passes the loops by, their derivative included.
        let by_inertia = structure.control.mode != Mode::Torque && !pid;
        let td = at(ControlParameter::PidDerivativeTime);
        let derives = zero.lt(td);
        let passing = (-(at(ControlParameter::PidDerivativeFilter) * dt / S::select(derives, td, one))).exp();
        let decay = S::select(derives, one - passing, one);
        Self {
            per_dt: one / dt,
            position: PositionLoop::derive(Raw(raw).control(), ratio, dt),
            speed_gain: gain,
            integral_step: S::select(integrates, gain / S::select(integrates, ti, one) * dt, zero),
            derivative_inertia: if by_inertia { gain * at(ControlParameter::DerivativeTime) } else { zero },
            derivative_gain: gain * td / dt * decay,
            derivative_decay: decay,
            jumps: Jumps::derive(raw, by_inertia, dt),
            back_calculation: at(ControlParameter::AntiWindupBackCalculation),
            threshold: at(ControlParameter::AntiWindupThreshold),
            noise_deviation: at(ControlParameter::NoiseDeviation),
            speed_limit: at(ControlParameter::SpeedLimit),
            torque_limit: at(ControlParameter::TorqueConstant) * at(ControlParameter::CurrentLimit),
            per_torque_constant: one / at(ControlParameter::TorqueConstant),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Phase<S> {
    pub torque_constant: S,
    pub circuit: Circuit<S>,
    /// Torque per torque the controller believes in.
    pub efficacy: S,
    /// 1 / (J + efficacy K_p T_d): the derivative of the speed acts as inertia.
    pub per_effective_inertia: S,
    /// k_j of the phases, and the currents per ampere of the reference.
    pub coefficients: [S; 3],
    pub imposed: [S; 3],
    /// Direct component of the EMF over the speed, in the frame of the references: none where they are well placed.
    pub direct: S,
    /// Angle and speed of the shaft by which the references are placed.
    pub believed: [S; 2],
    /// Quadrature component of the imposed currents in the rotor's frame, and as the drive's sensors report it.
    pub quadrature: S,
    pub seen: S,
    /// Torque of the magnets per quadrature current; the torque constant holds what the currents add to their flux.
    pub magnets: S,
}

impl<S: Scalar> Phase<S> {
    #[inline(always)]
    pub(super) fn new(torque_constant: S, circuit: Circuit<S>, control: &Control<S>, inertia: S) -> Self {
        let efficacy = torque_constant * control.per_torque_constant;
        let per_effective_inertia = S::one() / efficacy.fma(control.derivative_inertia, inertia);
        let (zero, one) = ([S::zero(); 3], S::one());
        Self {
            torque_constant,
            circuit,
            efficacy,
            per_effective_inertia,
            coefficients: zero,
            imposed: zero,
            direct: S::zero(),
            believed: [S::zero(); 2],
            quadrature: one,
            seen: one,
            magnets: torque_constant,
        }
    }

    /// With the flux that the currents (d, q) add to the magnets', and the slope of the quadrature linkage.
    #[inline(always)]
    pub(super) fn in_field(&self, m: &Model<S>, [direct, quadrature]: [S; 2]) -> Self {
        let linked = m.map.at([direct, quadrature]);
        let across = S::select(quadrature.equals(S::zero()), linked.slope[2], linked.flux[1] / quadrature);
        let added = S::splat(1.5) * m.star.pole_pairs * (linked.flux[0] - across * direct);
        let circuit = Circuit::new(self.circuit.resistance, linked.slope[2], m.dt);
        Self {
            coefficients: self.coefficients,
            imposed: self.imposed,
            direct: self.direct,
            believed: self.believed,
            quadrature: self.quadrature,
            seen: self.seen,
            magnets: self.torque_constant,
            ..Self::new(self.torque_constant + added, circuit, &m.control, m.shaft.inertia)
        }
    }

    /// With a share of its flux.
    pub(super) fn weakened(&self, share: S, control: &Control<S>, inertia: S) -> Self {
        Self {
            coefficients: three!(|j| share * self.coefficients[j]),
            imposed: self.imposed,
            direct: share * self.direct,
            believed: self.believed,
            quadrature: self.quadrature,
            seen: self.seen,
            ..Self::new(share * self.torque_constant, self.circuit, control, inertia)
        }
    }
}

/// Constants of the loops; those of phases without a short are zero.
#[derive(Clone, Copy, Debug)]
pub struct Loops<S> {
    /// Shorted turns over all and over the remaining ones.
    pub(super) turns: [S; 3],
    pub(super) ratio: [S; 3],
    pub(super) resistance: [S; 3],
    pub(super) contact: S,
    pub(super) mutual_per_dt: [S; 3],
    /// dt / L_f.
    pub(super) dt_per_inductance: [S; 3],
    /// Inductance of the turns outside the short, N L - M.
    pub(super) intact: [S; 3],
}

impl<S: Scalar> Loops<S> {
    pub(super) fn derive(raw: &[S], dt: S) -> Self {
        let at = |p: MotorParameter| raw[p.at()];
        let (zero, one) = (S::zero(), S::one());
        let intact: [S; 3] = three!(|j| raw[MotorParameter::TurnsA.at() + j]);
        let turns: [S; 3] = three!(|j| one - intact[j]);
        let inductance = at(MotorParameter::WindingInductance);
        Self {
            turns,
            ratio: three!(|j| turns[j] / intact[j]),
            resistance: three!(|j| turns[j] * at(MotorParameter::WindingResistance)),
            contact: at(MotorParameter::ShortContactResistance),
            mutual_per_dt: three!(|j| at(MotorParameter::ShortCoupling) * turns[j] * intact[j] * inductance / dt),
            dt_per_inductance: three!(|j| {
                let there = zero.lt(turns[j]);
                let value = turns[j] * (one - at(MotorParameter::ShortCoupling) * intact[j]) * inductance;
                S::select(there, dt / S::select(there, value, one), zero)
            }),
            intact: three!(|j| intact[j] * (one - at(MotorParameter::ShortCoupling) * turns[j]) * inductance),
        }
    }
}

/// What a drive remembers of its legs and integrals, V.
#[derive(Clone, Copy, Debug)]
pub struct DrivenState<S> {
    pub(super) legs: [S; 3],
    pub(super) integral: [S; 2],
}

kept!(DrivenState<f64> as DrivenState { legs, integral });

impl<S: Scalar> DrivenState<S> {
    pub(super) fn initial() -> Self {
        Self { legs: [S::zero(); 3], integral: [S::zero(); 2] }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct State<S> {
    pub link: DcLinkState<S>,
    pub resistance_factor: S,
    pub flux_factor: S,
    pub network: NetworkState<S>,
    /// Command of the last step; NaN before the first.
    pub command: S,
    /// Since the start, J: drawn from the link, lost in the copper.
    pub drawn: S,
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
    /// Limit of the torque reference: the controller's, or what derating and a direct current leave of it.
    pub torque_limit: S,
    /// Direct current, its part from the field weakening, A; share of the current limit that the temperature leaves.
    pub direct: S,
    pub weakening: S,
    pub derated: S,
    pub shaft: ShaftState<S>,
}

kept!(State<f64> as State {
    link, resistance_factor, flux_factor, network, command, drawn, copper, current, current_q, current_seen, phases, loops, bridge, driven,
    command_noise, jumps, rested, voltage, integral, filtered_error, speed_ref, torque_ref, motor_torque, sensed, filtered, tripped,
    torque_limit, direct, weakening, derated, shaft
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
            map: FluxMap::derive(Raw(raw).flux_map(), Raw(raw).motor()),
            limits: Limits::derive(
                Raw(raw).limits(),
                [at(MotorParameter::PolePairs) * raw[PwmParameter::Inductance.at()], raw[PwmParameter::EmfConstant.at()]],
                raw[ControlParameter::CurrentLimit.at()],
                dt,
            ),
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
            drawn: zero,
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
            torque_limit: self.control.torque_limit,
            direct: zero,
            weakening: zero,
            derated: self.limits.derated(warm.winding),
            shaft,
        }
    }
}

impl<S: Scalar> Model<S> {
    /// Limit of the torque reference at the present temperature and direct current.
    #[inline(always)]
    pub(super) fn limit(&self, structure: &Structure, s: &mut State<S>) {
        s.torque_limit = self.control.torque_limit;
        if structure.limits.moves() {
            let derated = if structure.limits.derates { s.derated } else { S::one() };
            s.torque_limit = self.control.torque_limit * self.limits.left(derated, self.limits.reference(s.weakening));
        }
    }

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
