//! Low fidelity: one equivalent phase (reference sheet 1.9). Same blocks, same parameters where shared; PID
//! without anti-windup and derivative filter, linear viscous friction; Borello friction and play kept.

use super::high::model::network;
use super::high::observe::low_screw;
use crate::actuator::servo::advance::{Instant, Stepper, Stretch};
use crate::actuator::servo::form::Form;
use crate::actuator::servo::layout::*;
use crate::actuator::servo::signals::{LowSignal as Q, LOW};
use crate::actuator::{Finding, Inputs, Overheat, Port, Setup, Tick, Watch, Wiring, WATCHED};
use crate::control::current_dq::PwmParameter;
use crate::control::position_speed::{ControlParameter, Feedback, Mode};
use crate::fault::FaultKind;
use crate::inverter::bridge::InverterParameter;
use crate::motor::equivalent::{equivalent, imposed_shape, Circuit, LowParameter};
use crate::motor::star::{MotorParameter, MotorStructure, Star, StarState};
use crate::motor::thermal::{Network, NetworkState, ThermalModel, ThermalParameter};
use crate::motor::unbalance::{Unbalance, UnbalanceParameter};
use crate::scalar::{three_phase, Scalar};
use crate::sensor::current::CurrentSensorParameter;
use crate::sensor::encoder::Encoder;
use crate::sensor::filter::{closing, low_pass};
use crate::sensor::resolver::{Reading, Resolver, ResolverParameter};
use crate::three;
use crate::time::Steps;
use crate::transmission::friction::{Friction, FrictionParameter};
use crate::transmission::gear::{Gear, GearParameter, LoadParameter};
use crate::transmission::play::Play;
use crate::transmission::screw::Screw;
use crate::variable::{Group, Signal};
use std::marker::PhantomData;

/// A servo at low fidelity.
pub struct Low<F>(PhantomData<F>);

const TICK_THERMAL: u8 = 0;
const TICK_DEBRIS: u8 = 1;

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Structure {
    mode: Mode,
    feedback: Feedback,
    drive: DriveKind,
    integral: bool,
    resolver: bool,
    /// The resolver commutates, too.
    commutated: bool,
    /// Coefficients vary with the rotor angle.
    angle: bool,
    feedforward: bool,
    linear: bool,
    load_side: bool,
    heat: bool,
    unbalance: bool,
    spall: bool,
    debris: bool,
    dynamic_eccentricity: bool,
    loaded: bool,
    jams: bool,
}

#[derive(Clone, Copy, Debug)]
pub struct Model<S> {
    dt: S,
    per_dt: S,
    star: Star<S>,
    resistance: [S; 3],
    inductance: [S; 3],
    healthy: Phase<S>,
    /// Constant, resistance and inductance of the healthy phase at the reference temperature.
    cold: [S; 3],
    electrical_inductance: S,
    voltage_ratio: S,
    band: S,
    tracking: S,
    supply_scale: S,
    tripped: S,
    position_gain: S,
    feedforward: S,
    speed_gain: S,
    integral_step: S,
    derivative_inertia: S,
    speed_limit: S,
    torque_limit: S,
    per_torque_constant: S,
    friction: Friction<S>,
    gear: Gear<S>,
    play: Play<S>,
    encoder: Encoder<S>,
    resolver: Resolver<S>,
    filter: S,
    inertia: S,
    dt_per_inertia: S,
    temperature: S,
    screw: Screw<S>,
    unbalance: Unbalance<S>,
    network: Network<S>,
    load_friction: S,
    load_viscous: S,
}

#[derive(Clone, Copy, Debug)]
pub struct State<S> {
    resistance_factor: S,
    flux_factor: S,
    network: NetworkState<S>,
    scatter: S,
    /// Command of the last step; NaN before the first.
    command: S,
    copper: S,
    current: S,
    voltage: S,
    integral: S,
    speed_ref: S,
    torque_ref: S,
    motor_torque: S,
    friction_torque: S,
    motor_position: S,
    motor_speed: S,
    user_position: S,
    held_angle: S,
    jam_side: S,
    jammed: S,
    filtered: [S; 2],
    tripped: S,
}

/// The equivalent phase at one rotor angle.
#[derive(Clone, Copy, Debug)]
struct Phase<S> {
    torque_constant: S,
    circuit: Circuit<S>,
    /// Torque per torque the controller believes in.
    efficacy: S,
    /// 1 / (J + efficacy K_p T_d): the derivative of the speed acts as inertia.
    per_effective_inertia: S,
}

impl<S: Scalar> Phase<S> {
    #[inline(always)]
    fn new(torque_constant: S, circuit: Circuit<S>, per_torque_constant: S, inertia: S, derivative_inertia: S) -> Self {
        let efficacy = torque_constant * per_torque_constant;
        Self { torque_constant, circuit, efficacy, per_effective_inertia: S::one() / efficacy.fma(derivative_inertia, inertia) }
    }
}

impl<S: Scalar> Model<S> {
    /// The healthy phase at the present temperatures.
    #[inline(always)]
    fn warm(&self, s: &State<S>) -> Phase<S> {
        let [constant, resistance, inductance] = self.cold;
        let circuit = Circuit::new(resistance * s.resistance_factor, inductance, self.dt);
        Phase::new(constant * s.flux_factor, circuit, self.per_torque_constant, self.inertia, self.derivative_inertia)
    }
}

#[inline(always)]
fn phase<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, commutation: S) -> Phase<S> {
    if !structure.angle {
        return if structure.heat { m.warm(s) } else { m.healthy };
    }
    let (sin, cos) = m.star.electrical_angle(s.motor_position).sin_cos();
    let (shape, _) = three_phase(sin, cos);
    let mut gap = m.star.static_gap(sin, cos);
    if structure.dynamic_eccentricity {
        let turning = m.star.dynamic_gap(s.motor_position);
        gap = three!(|j| gap[j] * turning[j]);
    }
    let k = m.star.coefficients(shape, gap);
    let sines = if structure.resolver && structure.commutated {
        let (sin, cos) = m.star.electrical_angle(commutation).sin_cos();
        three_phase(sin, cos).0
    } else {
        shape
    };
    let resistance = three!(|j| m.resistance[j] * s.resistance_factor);
    let e = equivalent(k, resistance, m.inductance, imposed_shape(sines, m.star.open));
    let circuit = Circuit::new(e.resistance, e.inductance, m.dt);
    Phase::new(e.torque_constant * s.flux_factor, circuit, m.per_torque_constant, m.inertia, m.derivative_inertia)
}

#[inline(always)]
fn step<S: Scalar>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
    let zero = S::zero();
    let speed = s.motor_speed;
    // Sensors.
    let (mut angle, mut shown_speed, mut shown_position) = (s.motor_position, speed, s.motor_position);
    if structure.resolver {
        let reading = m.resolver.read(s.motor_position, speed, &mut s.held_angle);
        (angle, shown_speed, shown_position) = (reading.angle, reading.speed, reading.position);
    }
    let position = match structure.feedback {
        Feedback::User => s.user_position,
        Feedback::Encoder => m.encoder.read(s.user_position),
        Feedback::Resolver => shown_position * m.gear.per_ratio,
    };

    // Control electronics: P and PID; the derivative of the measured speed is solved with the acceleration.
    let command = x.command;
    let demanded = match structure.mode {
        Mode::Position if structure.feedforward => {
            let moved = command - s.command;
            s.command = command;
            let ahead = S::select(moved.equals(moved), m.feedforward * moved, zero);
            m.position_gain * (command - position) + ahead
        }
        Mode::Position => m.position_gain * (command - position),
        _ => command,
    };
    let speed_ref = demanded.clamp_abs(m.speed_limit);
    let error = speed_ref - shown_speed;
    let slope = (speed_ref - s.speed_ref) * m.per_dt;
    let torque_mode = structure.mode == Mode::Torque;
    let derivative_inertia = m.derivative_inertia;
    let demand = if torque_mode { command } else { m.speed_gain * error + s.integral + derivative_inertia * slope };

    // Loads.
    let brake = x.brake;
    let user_torque = x.user + m.gear.stiffness * (s.user_position - m.gear.spring_zero);
    let mut load = x.shaft + user_torque * m.gear.per_ratio;
    let p = phase(m, structure, s, angle);
    let efficacy = p.efficacy;
    let mut added = if structure.linear { (brake + m.load_friction) * m.gear.per_ratio } else { brake };
    if structure.jams {
        added = added + s.jammed * m.friction.jam_torque;
    }
    let mut viscous = m.friction.viscous * speed;
    if structure.load_side {
        viscous = viscous + m.load_viscous * speed;
        if !structure.linear {
            added = added + m.load_friction * m.gear.per_ratio;
        }
    }
    if structure.spall {
        let (torque, friction) = m.screw.spall(s.motor_position, user_torque, s.motor_position * m.gear.per_ratio);
        load = load - torque;
        added = added + friction;
    }
    if structure.unbalance {
        load = load - m.unbalance.torque(s.motor_position);
    }
    if structure.loaded {
        let start = (efficacy * demand - load).sign();
        let direction = S::select(speed.equals(zero), start, speed.sign());
        added = added + m.gear.load_friction(user_torque, direction);
    }
    let (mut static_limit, mut dynamic) = (m.friction.static_limit + added, m.friction.dynamic + added);
    if structure.debris {
        (static_limit, dynamic) = (static_limit * s.scatter, dynamic * s.scatter);
    }
    let resist = load + speed.signed(dynamic) + viscous;
    let acceleration = Friction::net_torque(efficacy * demand, load, resist, speed, static_limit) * p.per_effective_inertia;
    s.torque_ref = (demand - derivative_inertia * acceleration).clamp_abs(m.torque_limit);
    s.speed_ref = speed_ref;
    if structure.integral {
        s.integral = s.integral + m.integral_step * error;
    }

    // Equivalent phase.
    let emf = S::splat(2.0 / 3.0) * p.torque_constant * speed;
    let current_ref = s.torque_ref * m.per_torque_constant;
    let circuit = &p.circuit;
    let target = match structure.drive {
        // The relays act only at the edges of their band; inside it the EMF drives the current.
        DriveKind::Hysteresis => circuit.current(s.current, -emf).clamp(current_ref - m.band, current_ref + m.band),
        DriveKind::Pwm => s.current + m.tracking * (current_ref - s.current),
        DriveKind::Off => zero,
    };
    let driving = circuit.voltage(s.current, target);
    let supply = x.supply * m.supply_scale;
    let cross = m.electrical_inductance * speed * s.current;
    let largest = m.voltage_ratio * supply;
    // v_q^2 + v_d^2 stays inside the largest phase voltage; v_d is the cross coupling p omega L i_q.
    let room = largest * largest - cross * cross;
    s.voltage = driving + emf;
    let limited = room.lt(s.voltage * s.voltage);
    let mut reached = target;
    if S::any(limited) {
        let held = s.voltage.clamp_abs(room.maximum(zero).sqrt());
        s.voltage = S::select(limited, held, s.voltage);
        reached = S::select(limited, circuit.current(s.current, held - emf), target);
    }
    s.tripped = s.tripped.maximum(m.tripped);
    let before = s.current;
    s.current = reached * (S::one() - s.tripped);
    if structure.heat {
        // Sum of R_j i_j^2 of the three phases, at the step's middle.
        let middle = S::splat(0.5) * (before + s.current);
        let heat = S::splat(1.5) * middle * middle * m.dt / p.circuit.per_resistance;
        s.network.collected[0] = s.network.collected[0] + heat;
        s.copper = s.copper + heat;
    }

    // Motor and transmission dynamics.
    s.motor_torque = m.star.saturate(p.torque_constant * s.current);
    let active = s.motor_torque - load;
    s.friction_torque = Friction::dry_torque(active, speed, static_limit, dynamic) + viscous;
    let free = m.dt_per_inertia.fma(Friction::net_torque(s.motor_torque, load, resist, speed, static_limit), speed);
    let new_speed = Friction::stop_at_reversal(speed, free);
    let (position, held) = m.gear.stop(s.motor_position + m.dt * new_speed, new_speed);
    s.motor_position = position;
    s.motor_speed = held;
    s.user_position = m.play.drag(position * m.gear.per_ratio, s.user_position);
    if structure.jams {
        let passed = ((s.user_position - m.friction.jam_position) * s.jam_side).le(zero);
        s.jammed = S::select(passed | S::splat(0.5).lt(m.friction.jam_anywhere), S::one(), s.jammed);
    }

    // Acquisition.
    s.filtered[0] = low_pass(m.filter, s.filtered[0], s.current);
    s.filtered[1] = low_pass(m.filter, s.filtered[1], s.voltage);
}

struct LowStep;

impl<S: Scalar> Stepper<S> for LowStep {
    type Model = Model<S>;
    type Structure = Structure;
    type State = State<S>;

    #[inline(always)]
    fn dt(model: &Model<S>) -> S {
        model.dt
    }
    #[inline(always)]
    fn step(model: &Model<S>, structure: &Structure, instant: &Instant<S>, state: &mut State<S>) {
        step(model, structure, instant, state);
    }
}

impl<F: Form> Wiring for Low<F> {
    type Structure = Structure;
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    const PORTS: &'static [Port] = F::PORTS;
    const INITIAL: &'static [&'static str] = &["motor_position", "motor_speed", "user_position"];

    fn groups() -> &'static [Group] {
        F::GROUPS
    }
    fn signals() -> &'static [Signal] {
        F::LOW
    }
    fn faults() -> Vec<FaultKind> {
        F::faults()
    }
    fn step(raw: &[f64]) -> f64 {
        raw[LowParameter::Step.at()]
    }
    fn fault_grid(raw: &[f64]) -> f64 {
        raw[SolverParameter::FaultGrid.at()].max(raw[LowParameter::Step.at()])
    }

    fn structure(setup: &Setup) -> Structure {
        let raw = setup.raw;
        let departs = |i: usize, healthy: f64| setup.departs(i, healthy);
        let feedback = Feedback::read(raw[ControlParameter::PositionFeedback.at()]);
        let first = ResolverParameter::Mismatch.at();
        let resolver = !Resolver::<f64>::ideal(Raw(raw).resolver()) || (0..5).any(|i| setup.touched[first + i]);
        let phases = MotorParameter::TurnsA.at()..=MotorParameter::TurnsC.at();
        let opens = MotorParameter::OpenA.at()..=MotorParameter::OpenC.at();
        let unbalance = departs(UnbalanceParameter::UnbalanceInertia.at(), 0.0);
        let dynamic_eccentricity = unbalance || departs(MotorParameter::EccentricityDynamic.at(), 0.0);
        let commutated = CommutationSource::read(raw[DriveParameter::CommutationSource.at()]) == CommutationSource::Resolver;
        let (spall, debris) = F::worn(&departs);
        let mut turns = phases.map(|i| departs(i, 1.0));
        Structure {
            mode: crate::control::position_speed::ControlStructure::read(Raw(raw).control()).mode,
            feedback,
            drive: DriveKind::read(raw[DriveParameter::Kind.at()]),
            integral: raw[ControlParameter::IntegralTime.at()] > 0.0,
            resolver,
            commutated,
            feedforward: raw[ControlParameter::SpeedFeedforward.at()] != 0.0,
            linear: F::LINEAR,
            load_side: F::LINEAR || departs(LoadParameter::Damping.at(), 0.0) || departs(LoadParameter::Friction.at(), 0.0),
            heat: ThermalModel::read(raw[ThermalParameter::Model.at()]) != ThermalModel::Off,
            unbalance,
            spall,
            debris,
            angle: (resolver && commutated)
                || dynamic_eccentricity
                || turns.any(|x| x)
                || opens.clone().any(|i| departs(i, 0.0))
                || departs(MotorParameter::EccentricityStatic.at(), 0.0),
            dynamic_eccentricity,
            jams: departs(FrictionParameter::JamTorque.at(), 0.0),
            loaded: F::LINEAR || departs(GearParameter::Efficiency.at(), 1.0) || departs(GearParameter::EfficiencyAiding.at(), 1.0),
        }
    }

    fn ticks(raw: &[f64], structure: &Structure) -> Vec<Tick> {
        let period = |seconds: f64| ((seconds / raw[LowParameter::Step.at()]).round() as Steps).max(1);
        let mut ticks = Vec::new();
        if structure.heat {
            ticks.push(Tick::every(period(raw[ThermalParameter::SampleTime.at()]), TICK_THERMAL));
        }
        if structure.debris {
            ticks.push(Tick::every(period(raw[ControlParameter::SampleTime.at()]), TICK_DEBRIS));
        }
        ticks
    }
    fn check(raw: &[f64]) -> Vec<Finding> {
        crate::actuator::servo::checks::low::<F>(raw)
    }

    fn check_faulted(raw: &[f64]) -> Vec<Finding> {
        crate::actuator::servo::checks::faulted::<F>(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure) -> Model<S> {
        let view = Raw(raw);
        let at = |i: usize| raw[i];
        let one = S::one();
        let dt = at(LowParameter::Step.at());
        let (screw, ratio) = (F::screw(raw), F::ratio(raw));
        let gear = Gear::derive(ratio, view.gear(), view.stop(), view.load(), [screw.efficiency, screw.efficiency_aiding]);
        let unbalance = Unbalance::derive(view.unbalance());
        let rotor = at(MotorParameter::Inertia.at()) + at(GearParameter::Inertia.at()) + (F::screw_inertia(raw) + unbalance.inertia);
        let inertia = rotor + at(LoadParameter::Inertia.at()) * gear.per_ratio * gear.per_ratio;
        let mut friction = Friction::derive(view.friction());
        friction.preloaded(screw.preload_torque, screw.viscous, at(FrictionParameter::Static.at()), at(FrictionParameter::Dynamic.at()));
        // The reduced short: missing turns only; loop currents do not show in one phase.
        let reduced = MotorStructure { trapezoidal: false, shorted_loop: false, static_eccentricity: false, dynamic_eccentricity: false };
        let mut star = Star::derive(view.motor(), &reduced, dt);
        star.lean(unbalance.eccentricity(inertia));
        let gain = at(ControlParameter::SpeedGain.at()) * at(ControlParameter::SpeedGainScale.at());
        let ti = at(ControlParameter::IntegralTime.at());
        let has_integral = S::zero().lt(ti);
        let first_shorted = InverterParameter::ShortedAHigh.at();
        let shorted = (0..6).fold(S::zero(), |sum, i| sum + at(first_shorted + i));
        let per_torque_constant = one / at(ControlParameter::TorqueConstant.at());
        // A torque command passes the loops by, their derivative included.
        let torque_mode = structure.mode == Mode::Torque;
        let derivative_inertia = if torque_mode { S::zero() } else { gain * at(ControlParameter::DerivativeTime.at()) };
        let constant = S::splat(1.5) * at(MotorParameter::EmfConstant.at()) * at(MotorParameter::FluxFraction.at());
        let cold = [constant, at(MotorParameter::WindingResistance.at()), at(MotorParameter::WindingInductance.at())];
        let rise = at(MotorParameter::WindingTemperature.at()) - at(MotorParameter::ReferenceTemperature.at());
        let resistance_factor = one + at(MotorParameter::TemperatureCoefficient.at()) * rise;
        let flux_factor = one + at(MotorParameter::FluxTemperatureCoefficient.at()) * rise;
        let circuit = Circuit::new(cold[1] * resistance_factor, cold[2], dt);
        let healthy = Phase::new(constant * flux_factor, circuit, per_torque_constant, inertia, derivative_inertia);
        Model {
            dt,
            per_dt: one / dt,
            resistance: star.resistance,
            inductance: three!(|j| one / star.per_inductance[j]),
            healthy,
            cold,
            electrical_inductance: at(MotorParameter::PolePairs.at()) * at(MotorParameter::WindingInductance.at()),
            star,
            voltage_ratio: at(LowParameter::VoltageRatio.at()),
            band: at(LowParameter::BandRatio.at()) * at(InverterParameter::HysteresisBand.at()),
            tracking: if structure.drive == DriveKind::Pwm {
                one - (-(at(PwmParameter::ProportionalGain.at()) / at(MotorParameter::WindingInductance.at()) * dt)).exp()
            } else {
                one
            },
            supply_scale: at(InverterParameter::SupplyScale.at()),
            tripped: S::indicator(S::splat(0.5).lt(shorted)),
            position_gain: at(ControlParameter::PositionGain.at()) * at(ControlParameter::PositionGainScale.at()),
            feedforward: at(ControlParameter::SpeedFeedforward.at()) * ratio / dt,
            speed_gain: gain,
            integral_step: S::select(has_integral, gain / S::select(has_integral, ti, one) * dt, S::zero()),
            derivative_inertia,
            speed_limit: at(ControlParameter::SpeedLimit.at()),
            torque_limit: at(ControlParameter::TorqueConstant.at()) * at(ControlParameter::CurrentLimit.at()),
            per_torque_constant,
            friction,
            load_friction: at(LoadParameter::Friction.at()),
            load_viscous: at(LoadParameter::Damping.at()) * gear.per_ratio * gear.per_ratio,
            gear,
            play: Play::derive(view.play()),
            encoder: Encoder::derive(view.encoder(), if F::LINEAR { 1.0 } else { std::f64::consts::TAU }),
            resolver: Resolver::derive(view.resolver()),
            filter: closing(at(CurrentSensorParameter::FilterCutoff.at()), dt.lane(0)),
            inertia,
            dt_per_inertia: dt / inertia,
            temperature: at(MotorParameter::WindingTemperature.at()),
            screw,
            unbalance,
            network: network(raw, dt.lane(0)),
        }
    }

    fn start<S: Scalar>(m: &Model<S>, raw: &[S], initial: &[S]) -> State<S> {
        let or = |i: usize, other: S| S::select(initial[i].equals(initial[i]), initial[i], other);
        let zero = S::zero();
        let motor_position = or(0, zero);
        let driver = motor_position * m.gear.per_ratio;
        let user_position = m.play.drag(driver, or(2, driver));
        let warm = m.network.start(m.temperature, m.temperature);
        let (resistance_factor, flux_factor) = heat(raw, &warm);
        State {
            resistance_factor,
            flux_factor,
            network: warm,
            scatter: S::one(),
            command: S::splat(f64::NAN),
            copper: zero,
            current: zero,
            voltage: zero,
            integral: zero,
            speed_ref: zero,
            torque_ref: zero,
            motor_torque: zero,
            friction_torque: zero,
            motor_position,
            motor_speed: or(1, zero),
            user_position,
            held_angle: motor_position,
            jam_side: (user_position - m.friction.jam_position).sign(),
            jammed: S::indicator(S::splat(0.5).lt(m.friction.jam_anywhere)),
            filtered: [zero; 2],
            tripped: zero,
        }
    }

    fn refresh<S: Scalar>(raw: &[S], s: &mut State<S>) {
        (s.resistance_factor, s.flux_factor) = heat(raw, &s.network);
        let side = (s.user_position - raw[FrictionParameter::JamPosition.at()]).sign();
        let unset = s.jam_side.equals(S::zero()) & s.jammed.equals(S::zero());
        s.jam_side = S::select(unset, side, s.jam_side);
    }

    fn tick<S: Scalar>(
        kind: u8,
        _structure: &Structure,
        m: &Model<S>,
        _inputs: &Inputs<S>,
        s: &mut State<S>,
        _t: S,
        noise: &mut dyn FnMut(u64) -> S,
    ) {
        if kind == TICK_THERMAL {
            m.network.tick(&mut s.network);
            (s.resistance_factor, s.flux_factor) = m.network.factors(&s.network);
        } else {
            s.scatter = m.screw.scatter.fma(noise(4), S::one()).maximum(S::zero());
        }
    }

    #[inline(always)]
    fn advance<S: Scalar>(
        structure: &Structure,
        models: &[Model<S>],
        inputs: &[Inputs<S>],
        states: &mut [State<S>],
        from: Steps,
        count: Steps,
    ) {
        Stretch { structure, models, inputs, states, from, count }.run::<LowStep>();
    }

    #[inline(always)]
    fn observe<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
        let lag = s.motor_position * m.gear.per_ratio - s.user_position;
        let pushing = (m.play.half * S::splat(1.0 - 1e-9)).le(lag.abs()) & S::zero().le(lag * s.motor_speed);
        let mut held = s.held_angle;
        let ideal = Reading { angle: s.motor_position, position: s.motor_position, speed: s.motor_speed };
        let reading = if structure.resolver { m.resolver.read(s.motor_position, s.motor_speed, &mut held) } else { ideal };
        let user_torque = inputs[USER].at(t) + m.gear.stiffness * (s.user_position - m.gear.spring_zero);
        let mut set = |q: Q, x: S| out[q as usize] = x;
        set(Q::Command, inputs[COMMAND].at(t));
        set(Q::UserPosition, s.user_position);
        set(Q::UserSpeed, S::select(pushing, s.motor_speed * m.gear.per_ratio, S::zero()));
        set(Q::MotorPosition, s.motor_position);
        set(Q::MotorSpeed, s.motor_speed);
        set(Q::SpeedRef, s.speed_ref);
        set(Q::TorqueRef, s.torque_ref);
        set(Q::CurrentRef, s.torque_ref * m.per_torque_constant);
        set(Q::CurrentQ, s.current);
        set(Q::CurrentQMeas, s.filtered[0]);
        set(Q::VoltageQRef, s.voltage);
        set(Q::VoltageQMeas, s.filtered[1]);
        set(Q::MotorTorque, s.motor_torque);
        set(Q::FrictionTorque, s.friction_torque);
        set(Q::BrakeTorque, inputs[BRAKE].at(t).maximum(S::zero()));
        set(Q::LoadTorque, inputs[SHAFT].at(t) + user_torque * m.gear.per_ratio);
        set(Q::SupplyVoltage, inputs[SUPPLY].at(t) * m.supply_scale);
        set(Q::WindingTemperature, if structure.heat { s.network.winding } else { m.temperature });
        set(Q::SurfaceTemperature, s.network.surface);
        set(Q::HeatCopper, s.network.power[0]);
        set(Q::HeatAir, s.network.power[2]);
        set(Q::ThermalWarning, m.network.warns(&s.network));
        let limited = m.speed_limit.le(s.speed_ref.abs()) | m.torque_limit.le(s.torque_ref.abs());
        set(Q::Limited, S::indicator(limited));
        set(Q::EnergyCopper, s.copper);
        set(Q::EnergyHeatStored, m.network.stored(&s.network));
        set(Q::EnergyAir, s.network.heat_out);
        set(Q::EncoderPosition, m.encoder.read(s.user_position));
        set(Q::ResolverPosition, reading.position);
        set(Q::ResolverSpeed, reading.speed);
        set(Q::Tripped, s.tripped.maximum(s.network.over));
        if F::LINEAR {
            let efficiency = [m.screw.efficiency, m.screw.efficiency_aiding];
            out[LOW.len()..].copy_from_slice(&low_screw(
                m.gear.per_ratio,
                s.motor_position,
                s.motor_speed,
                user_torque,
                efficiency,
                s.current,
                s.voltage,
            ));
        }
    }

    #[inline(always)]
    fn watch<S: Scalar>(s: &State<S>) -> [Watch<S>; WATCHED] {
        [
            Watch { name: "motor_speed", value: s.motor_speed, limit: 1e6 },
            Watch { name: "current_q", value: s.current, limit: 1e7 },
            Watch { name: "user_position", value: s.user_position, limit: 1e9 },
            Watch { name: "torque_ref", value: s.integral, limit: 1e12 },
        ]
    }
    #[inline(always)]
    fn tripped<S: Scalar>(s: &State<S>) -> S {
        s.tripped.maximum(s.network.over)
    }
    fn overheated<S: Scalar>(s: &State<S>) -> Option<Overheat<S>> {
        Some(Overheat { over: s.network.over, temperature: s.network.winding })
    }
}

/// Factors of the winding's resistance and of the flux.
fn heat<S: Scalar>(raw: &[S], warm: &NetworkState<S>) -> (S, S) {
    if ThermalModel::read(raw[ThermalParameter::Model.at()]) == ThermalModel::Off {
        let mut star = StarState::rest();
        star.heat(Raw(raw).motor(), raw[MotorParameter::WindingTemperature.at()]);
        return (star.resistance_factor, star.flux_factor);
    }
    network(raw, raw[LowParameter::Step.at()].lane(0)).factors(warm)
}
