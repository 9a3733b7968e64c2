//! High fidelity: three phases, switching inverter, fixed step (reference sheet 1.2 to 1.7).
//!
//! `step` reads like the block diagram: sensors, control electronics, power electronics, motor, transmission,
//! acquisition. With `FULL` false the optional details compile to nothing; a detail at its healthy value
//! changes no bit, so both forms agree exactly where both apply.

use super::layout::*;
use super::march::{march, Moment, Stepper};
use super::signals::{HighSignal, HIGH};
use crate::actuator::{Finding, Inputs, Port, Setup, Tick, Watch, Wiring, WATCHED};
use crate::control::current_dq::{CurrentControl, CurrentControlState, CurrentSample, PwmParameter};
use crate::control::position_speed::{ControlParameter, ControlStructure, PositionSpeed, PositionSpeedState};
use crate::fault::FaultKind;
use crate::inverter::bridge::{quench, Bridge, BridgeState, BridgeStructure, InverterParameter, Windings};
use crate::inverter::hysteresis::{count_transitions, relays};
use crate::motor::star::{MotorParameter, MotorStructure, Star, StarState};
use crate::scalar::{three_phase, Scalar};
use crate::sensor::current::{CurrentSensor, CurrentSensorParameter};
use crate::sensor::encoder::Encoder;
use crate::sensor::filter::{closing, low_pass};
use crate::sensor::resolver::{Reading, Resolver, ResolverParameter};
use crate::time::Steps;
use crate::transmission::friction::{Friction, FrictionParameter};
use crate::transmission::gear::{Gear, GearParameter, LoadParameter};
use crate::transmission::play::{Play, PlayParameter};
use crate::variable::{Group, Signal};
use crate::three;

/// The rotary actuator at high fidelity.
pub struct High;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Drive {
    Hysteresis,
    Pwm,
    Off,
}

/// Everything that decides which code runs; equal over a lane block.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Structure {
    pub(super) drive: Drive,
    pub(super) control: ControlStructure,
    pub(super) motor: MotorStructure,
    pub(super) control_every_step: bool,
    pub(super) semi_implicit: bool,
    pub(super) acquisition: bool,
    pub(super) full: bool,
    pub(super) bridge: bool,
    bridge_structure: BridgeStructure,
    pub(super) elastic: bool,
    pub(super) measured_current: bool,
    pub(super) resolver: bool,
    pub(super) accounts: bool,
    loaded: bool,
    sloped: bool,
    jams: bool,
    thermal: bool,
}

/// Constants of a run.
#[derive(Clone, Copy, Debug)]
pub struct Model<S> {
    pub(super) dt: S,
    pub(super) star: Star<S>,
    pub(super) bridge: Bridge<S>,
    pub(super) half_band: S,
    pub(super) supply_scale: S,
    pub(super) control: PositionSpeed<S>,
    pub(super) current_control: CurrentControl<S>,
    pub(super) friction: Friction<S>,
    pub(super) gear: Gear<S>,
    pub(super) play: Play<S>,
    pub(super) sensor: CurrentSensor<S>,
    pub(super) encoder: Encoder<S>,
    pub(super) resolver: Resolver<S>,
    pub(super) filter: S,
    pub(super) inertia: S,
    pub(super) dt_per_inertia: S,
    pub(super) user_inertia: S,
    pub(super) per_user_inertia: S,
    pub(super) noise_deviation: S,
    pub(super) temperature: S,
}

/// All that changes during a run.
#[derive(Clone, Copy, Debug)]
pub struct State<S> {
    pub(super) star: StarState<S>,
    pub(super) legs: [S; 3],
    pub(super) bridge: BridgeState<S>,
    pub(super) control: PositionSpeedState<S>,
    pub(super) current_ref: S,
    pub(super) current_control: CurrentControlState<S>,
    pub(super) motor_position: S,
    pub(super) motor_speed: S,
    pub(super) user_position: S,
    pub(super) user_speed: S,
    pub(super) command_noise: S,
    pub(super) current_noise: [S; 3],
    pub(super) held_angle: S,
    pub(super) jam_side: S,
    pub(super) jammed: S,
    pub(super) filtered: [S; 3],
    pub(super) transitions: S,
    /// Phase-to-neutral voltages of the last step (detailed bridge).
    pub(super) voltage: [S; 3],
    pub(super) energy: [S; 7],
}

pub(super) const E_SUPPLY: usize = 0;
pub(super) const E_COPPER: usize = 1;
pub(super) const E_INVERTER: usize = 2;
pub(super) const E_FRICTION: usize = 3;
pub(super) const E_BRAKE: usize = 4;
pub(super) const E_LOAD: usize = 5;
pub(super) const E_IMPACT: usize = 6;

const TICK_COMMAND_NOISE: u8 = 0;
const TICK_CURRENT_NOISE: u8 = 1;
const TICK_CONTROL: u8 = 2;
const TICK_CURRENT_CONTROL: u8 = 3;

/// What acts on the fast shaft.
#[derive(Clone, Copy)]
pub(super) struct ShaftLoads<S> {
    pub brake: S,
    pub user_torque: S,
    /// Signed torque on the fast shaft, and the part of it that is not the contact of the elastic play.
    pub load: S,
    own: S,
    /// Torque between gear and user, at the user.
    pub through: S,
    pub static_limit: S,
    pub dynamic: S,
}

impl Structure {
    fn read(setup: &Setup) -> Self {
        let raw = Raw(setup.raw);
        let choice = |i: usize| setup.raw[i] as u8;
        let departs = |i: usize, healthy: f64| setup.departs(i, healthy);
        let drive = match choice(DriveParameter::Kind.at()) {
            0 => Drive::Hysteresis,
            1 => Drive::Pwm,
            _ => Drive::Off,
        };
        let control = ControlStructure::read(raw.control());
        let motor = MotorStructure {
            trapezoidal: choice(MotorParameter::EmfShape.at()) == 1,
            shorted_loop: choice(MotorParameter::ShortModel.at()) == 1,
            static_eccentricity: departs(MotorParameter::EccentricityStatic.at(), 0.0),
            dynamic_eccentricity: departs(MotorParameter::EccentricityDynamic.at(), 0.0),
        };
        let open_phase = (MotorParameter::OpenA.at()..=MotorParameter::OpenC.at()).any(|i| departs(i, 0.0));
        let base = InverterParameter::SupplyVoltage.at();
        let detailed = InverterParameter::DETAIL.clone().any(|i| departs(base + i, 0.0));
        let bridge = open_phase || detailed || drive == Drive::Off;
        let switches = InverterParameter::OpenAHigh as usize..=InverterParameter::ShortedCLow as usize;
        let switch_faults = switches.into_iter().any(|i| departs(base + i, 0.0));
        let trips = switch_faults || departs(InverterParameter::TripCurrent.at(), 0.0);
        let bridge_structure = BridgeStructure { switch_faults, open_phases: open_phase, trips };
        let elastic = choice(PlayParameter::Model.at()) == 1;
        let first_gain = CurrentSensorParameter::GainA.at();
        let measured_current = !CurrentSensor::<f64>::ideal(raw.current_sensor()) || (0..9).any(|i| setup.touched[first_gain + i]);
        let first_resolver = ResolverParameter::Mismatch.at();
        let resolver = !Resolver::<f64>::ideal(raw.resolver()) || (0..5).any(|i| setup.touched[first_resolver + i]) || control.feedback == 2;
        let accounts = setup.recorded.iter().any(|&s| s >= HighSignal::EnergySupply as usize);
        let loaded = departs(GearParameter::Efficiency.at(), 1.0) || departs(GearParameter::EfficiencyAiding.at(), 1.0);
        let sloped = departs(FrictionParameter::ViscousSlope.at(), 0.0);
        let jams = departs(FrictionParameter::JamTorque.at(), 0.0);
        let mechanical = loaded || sloped || jams;
        let thermal = departs(MotorParameter::TemperatureCoefficient.at(), 0.0) || departs(MotorParameter::FluxTemperatureCoefficient.at(), 0.0);
        let saturable = control.feedback == 1;
        let full = bridge
            || elastic
            || measured_current
            || resolver
            || accounts
            || mechanical
            || thermal
            || saturable
            || motor.trapezoidal
            || motor.shorted_loop
            || motor.dynamic_eccentricity;
        Self {
            drive,
            control,
            motor,
            control_every_step: sample_steps(setup.raw, ControlParameter::SampleTime.at()) <= 1,
            semi_implicit: choice(SolverParameter::Method.at()) == 1,
            acquisition: setup.recorded.iter().any(|&s| (HighSignal::CurrentQMeas as usize..=HighSignal::VoltageQMeas as usize).contains(&s)),
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
        }
    }
}

/// Whole solver steps in a sample time.
fn sample_steps(raw: &[f64], index: usize) -> Steps {
    (raw[index] / raw[SolverParameter::Step.at()]).round() as Steps
}

#[inline(always)]
pub(super) fn shaft_loads<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, x: &Moment<S>, s: &State<S>, torque: S) -> ShaftLoads<S> {
    let user_torque = m.gear.stiffness.fma(s.user_position - m.gear.spring_zero, x.user);
    let elastic = FULL && structure.elastic;
    let through = if elastic { contact_torque(m, s) } else { user_torque };
    let load = through.fma(m.gear.per_ratio, x.shaft);
    let own = if elastic { x.shaft } else { load };
    let mut added = x.brake;
    if FULL {
        if structure.loaded {
            let moving = s.motor_speed.sign();
            let direction = S::select(s.motor_speed.equals(S::zero()), (torque - load).sign(), moving);
            added = added + m.gear.load_friction(through, direction);
        }
        if structure.jams {
            added = added + s.jammed * m.friction.jam_torque;
        }
    }
    ShaftLoads { brake: x.brake, user_torque, load, own, through, static_limit: m.friction.static_limit + added, dynamic: m.friction.dynamic + added }
}

/// Torque on the user through the elastic play.
#[inline(always)]
pub(super) fn contact_torque<S: Scalar>(m: &Model<S>, s: &State<S>) -> S {
    let displacement = s.motor_position * m.gear.per_ratio - s.user_position;
    let rate = s.motor_speed * m.gear.per_ratio - s.user_speed;
    m.play.contact(displacement, rate)
}

/// Electromagnetic coefficients of the present rotor angle.
#[derive(Clone, Copy)]
pub(super) struct Coupling<S> {
    /// k_j of the phases.
    pub k: [S; 3],
    /// k_j of the shorted turns.
    pub loop_k: [S; 3],
}

#[inline(always)]
pub(super) fn coupling<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &State<S>, sin: S, cos: S) -> Coupling<S> {
    let (mut shape, _) = three_phase(sin, cos);
    let eccentric = structure.motor.static_eccentricity;
    if !FULL && !eccentric {
        return Coupling { k: m.star.even_coefficients(shape), loop_k: [S::zero(); 3] };
    }
    let mut gap = [S::one(); 3];
    if eccentric {
        gap = m.star.static_gap(sin, cos);
    }
    let mut loop_k = [S::zero(); 3];
    if FULL {
        if structure.motor.trapezoidal {
            shape = m.star.trapezoid(m.star.electrical_angle(s.motor_position));
        }
        if structure.motor.dynamic_eccentricity {
            let turning = m.star.dynamic_gap(s.motor_position);
            gap = three!(|j| gap[j] * turning[j]);
        }
        if structure.thermal {
            gap = three!(|j| gap[j] * s.star.flux_factor);
        }
        if structure.motor.shorted_loop {
            loop_k = m.star.loop_coefficients(shape, gap);
        }
    }
    Coupling { k: m.star.coefficients(shape, gap), loop_k }
}

#[inline(always)]
pub(super) fn motor_torque<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &State<S>, c: &Coupling<S>) -> S {
    let mut torque = m.star.torque(c.k, s.star.current);
    if FULL && structure.motor.shorted_loop {
        torque = torque + m.star.torque(c.loop_k, s.star.loop_current);
    }
    m.star.saturate(torque)
}

/// What the controller is told of the shaft.
#[inline(always)]
fn shaft_reading<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &mut State<S>) -> Reading<S> {
    if FULL && structure.resolver {
        m.resolver.read(s.motor_position, s.motor_speed, &mut s.held_angle)
    } else {
        Reading { angle: s.motor_position, position: s.motor_position, speed: s.motor_speed }
    }
}

#[inline(always)]
fn control_step<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, command: S, s: &mut State<S>, reading: &Reading<S>) {
    let position = match structure.control.feedback {
        1 if FULL => m.encoder.read(s.user_position),
        2 if FULL => reading.position * m.gear.per_ratio,
        _ => s.user_position,
    };
    let command = command + s.command_noise;
    s.current_ref = m.control.step(&structure.control, &mut s.control, command, position, reading.speed);
}

#[inline(always)]
pub(super) fn measured_current<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &State<S>) -> [S; 3] {
    if FULL && structure.measured_current {
        m.sensor.measure(s.star.current, s.current_noise)
    } else {
        s.star.current
    }
}

/// Quadrature and direct components of three phase quantities (sheet 1.4).
#[inline(always)]
pub(super) fn park<S: Scalar>(x: [S; 3], sin: [S; 3], cos: [S; 3]) -> (S, S) {
    let two_thirds = S::splat(2.0 / 3.0);
    let q = two_thirds * (x[0] * sin[0] + x[1] * sin[1] + x[2] * sin[2]);
    let d = -(two_thirds * (x[0] * cos[0] + x[1] * cos[1] + x[2] * cos[2]));
    (q, d)
}

#[inline(always)]
fn step<S: Scalar, const FULL: bool, const PWM: bool>(m: &Model<S>, structure: &Structure, x: &Moment<S>, s: &mut State<S>) {
    // Sensors and control electronics.
    let reading = shaft_reading::<S, FULL>(m, structure, s);
    if structure.control_every_step {
        control_step::<S, FULL>(m, structure, x.command, s, &reading);
    }
    let (sin, cos) = m.star.electrical_angle(s.motor_position).sin_cos();
    let measured = measured_current::<S, FULL>(m, structure, s);
    let (sin_c, cos_c) = if FULL && structure.resolver { m.star.electrical_angle(reading.angle).sin_cos() } else { (sin, cos) };
    let (sin_phases, cos_phases) = three_phase(sin_c, cos_c);

    // Power electronics.
    let half_supply = S::splat(0.5) * (x.supply * m.supply_scale);
    let old_legs = s.legs;
    if PWM {
        s.legs = m.current_control.compare(&s.current_control, x.t);
    } else if FULL && structure.drive == Drive::Off {
        s.legs = [S::zero(); 3];
    } else {
        let error = three!(|j| s.current_ref * sin_phases[j] - measured[j]);
        s.legs = relays(m.half_band, old_legs, error);
    }
    s.transitions = count_transitions(s.transitions, old_legs, s.legs);

    // Motor electromagnetics.
    let c = coupling::<S, FULL>(m, structure, s, sin, cos);
    let torque = motor_torque::<S, FULL>(m, structure, s, &c);
    let (current, voltage) = electric_step::<S, FULL>(m, structure, s, &c, half_supply, old_legs);
    if structure.acquisition {
        let (q, d) = park(measured, sin_phases, cos_phases);
        let (v_q, _) = park(voltage, sin_phases, cos_phases);
        s.filtered[0] = low_pass(m.filter, s.filtered[0], q);
        s.filtered[1] = low_pass(m.filter, s.filtered[1], d);
        s.filtered[2] = low_pass(m.filter, s.filtered[2], v_q);
    }

    // Motor and transmission dynamics.
    mechanical_step::<S, FULL>(m, structure, x, s, torque);
    s.star.current = current;
}

/// New phase currents and the phase-to-neutral voltages of this step.
#[inline(always)]
fn electric_step<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &mut State<S>, c: &Coupling<S>, half_supply: S, old_legs: [S; 3]) -> ([S; 3], [S; 3]) {
    let speed = s.motor_speed;
    let i = s.star.current;
    let mut emf: [S; 3] = three!(|j| c.k[j] * speed);
    let mut resistance = m.star.resistance;
    if FULL {
        if structure.thermal {
            resistance = three!(|j| resistance[j] * s.star.resistance_factor);
        }
        if structure.motor.shorted_loop {
            let added = m.star.loop_emf(&s.star, c.loop_k, speed);
            emf = three!(|j| emf[j] + added[j]);
        }
    }
    let mut terminal = three!(|j| s.legs[j] * half_supply);
    let mut rail = terminal;
    let mut legs = None;
    let drops = |terminal: &[S; 3]| three!(|j| (-resistance[j]).fma(i[j], terminal[j] - emf[j]));
    let neutral;
    if FULL && structure.bridge {
        let windings = Windings { current: i, emf, per_inductance: m.star.per_inductance, resistance, open: m.star.open };
        let connection = m.bridge.connect(&mut s.bridge, &structure.bridge_structure, old_legs, s.legs, half_supply, &windings);
        terminal = connection.legs.voltage;
        rail = connection.legs.rail;
        let plain = m.star.neutral(drops(&terminal));
        if let Some(v_n) = connection.loose {
            let connected = connection.legs.connected;
            neutral = S::select(connected[0] & connected[1] & connected[2], plain, v_n);
            // A floating phase shows its EMF over the neutral.
            terminal = three!(|j| S::select(connected[j], terminal[j], neutral + emf[j]));
            legs = Some(connection.legs);
        } else {
            neutral = plain;
        }
    } else {
        neutral = m.star.neutral(drops(&terminal));
    }
    let voltage: [S; 3] = three!(|j| terminal[j] - neutral);
    let drop = drops(&terminal);
    let mut current = m.star.currents_after(i, drop, neutral);
    if FULL {
        s.voltage = voltage;
        if let Some(legs) = &legs {
            current = quench(legs, i, current);
        }
        let loops = if structure.motor.shorted_loop {
            let slope = three!(|j| (drop[j] - neutral) * m.star.per_inductance[j]);
            m.star.step_loops(&s.star, c.loop_k, speed, slope, m.dt)
        } else {
            s.star.loop_current
        };
        if structure.accounts {
            account_electric(m, s, i, current, loops, rail, terminal, resistance);
        }
        s.star.loop_current = loops;
    }
    (current, voltage)
}

/// Energies of a step at its midpoint: products at the start of a step are wrong by tens of percent, since the
/// current ripples at the switching instants.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn account_electric<S: Scalar>(m: &Model<S>, s: &mut State<S>, old: [S; 3], new: [S; 3], loops: [S; 3], rail: [S; 3], terminal: [S; 3], resistance: [S; 3]) {
    let half = S::splat(0.5);
    let middle: [S; 3] = three!(|j| half * (old[j] + new[j]));
    for j in 0..3 {
        s.energy[E_SUPPLY] = s.energy[E_SUPPLY] + m.dt * rail[j] * middle[j];
        s.energy[E_INVERTER] = s.energy[E_INVERTER] + m.dt * (rail[j] - terminal[j]) * middle[j];
        s.energy[E_COPPER] = s.energy[E_COPPER] + m.dt * resistance[j] * middle[j] * middle[j];
    }
    let middle_loops: [S; 3] = three!(|j| half * (s.star.loop_current[j] + loops[j]));
    s.energy[E_COPPER] = s.energy[E_COPPER] + m.dt * m.star.loop_loss(&s.star, middle_loops);
}

#[inline(always)]
fn mechanical_step<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, x: &Moment<S>, s: &mut State<S>, torque: S) {
    let loads = shaft_loads::<S, FULL>(m, structure, x, s, torque);
    let speed = s.motor_speed;
    let viscous = if FULL && structure.sloped { m.friction.viscous_torque(speed) } else { m.friction.viscous * speed };
    let resist = loads.load + speed.signed(loads.dynamic) + viscous;
    let net = Friction::net_torque(torque, loads.load, resist, speed, loads.static_limit);
    let free = m.dt_per_inertia.fma(net, speed);
    let new_speed = Friction::stop_at_reversal(speed, free);
    let moved = m.dt.fma(if structure.semi_implicit { new_speed } else { speed }, s.motor_position);
    let (position, held_speed) = m.gear.stop(moved, new_speed);
    if FULL && structure.accounts {
        let dry = Friction::dry_torque(torque - loads.load, speed, loads.static_limit, loads.dynamic);
        account_mechanical(m, s, &loads, speed, new_speed, held_speed, dry, viscous);
    }
    if FULL && structure.elastic {
        user_step(m, structure, s, &loads);
    } else {
        s.user_position = m.play.drag(position * m.gear.per_ratio, s.user_position);
    }
    if FULL && structure.jams {
        let passed = ((s.user_position - m.friction.jam_position) * s.jam_side).le(S::zero());
        let seized = passed | S::splat(0.5).lt(m.friction.jam_anywhere);
        s.jammed = S::select(seized, S::one(), s.jammed);
    }
    s.motor_position = position;
    s.motor_speed = held_speed;
}

/// The second mass of the elastic play.
#[inline(always)]
fn user_step<S: Scalar>(m: &Model<S>, structure: &Structure, s: &mut State<S>, loads: &ShaftLoads<S>) {
    let through = loads.through;
    let speed = s.user_speed;
    let new_speed = speed + m.dt * (m.per_user_inertia * (through - loads.user_torque));
    if structure.accounts {
        let middle = S::splat(0.5) * (speed + new_speed);
        s.energy[E_LOAD] = s.energy[E_LOAD] + m.dt * loads.user_torque * middle;
        let motor = s.motor_speed * m.gear.per_ratio;
        s.energy[E_IMPACT] = s.energy[E_IMPACT] + m.dt * through * (motor - middle);
    }
    s.user_position = s.user_position + m.dt * if structure.semi_implicit { new_speed } else { speed };
    s.user_speed = new_speed;
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn account_mechanical<S: Scalar>(m: &Model<S>, s: &mut State<S>, loads: &ShaftLoads<S>, old: S, new: S, held: S, dry: S, viscous: S) {
    let half = S::splat(0.5);
    let middle = half * (old + new);
    // The brake takes its share of the dry friction.
    let share = loads.brake / loads.dynamic.maximum(S::splat(1e-300));
    s.energy[E_BRAKE] = s.energy[E_BRAKE] + m.dt * (dry * share) * middle;
    s.energy[E_FRICTION] = s.energy[E_FRICTION] + m.dt * (dry * (S::one() - share) + viscous) * middle;
    s.energy[E_LOAD] = s.energy[E_LOAD] + m.dt * loads.own * middle;
    s.energy[E_IMPACT] = s.energy[E_IMPACT] + half * m.inertia * (new * new - held * held);
}

/// The step of the inner loop with and without details, behind relays or a carrier.
struct HighStep<const FULL: bool, const PWM: bool>;

impl<S: Scalar, const FULL: bool, const PWM: bool> Stepper<S> for HighStep<FULL, PWM> {
    type Model = Model<S>;
    type Structure = Structure;
    type State = State<S>;

    #[inline(always)]
    fn dt(model: &Model<S>) -> S {
        model.dt
    }
    #[inline(always)]
    fn step(model: &Model<S>, structure: &Structure, moment: &Moment<S>, state: &mut State<S>) {
        step::<S, FULL, PWM>(model, structure, moment, state);
    }
}

impl Wiring for High {
    type Structure = Structure;
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    const PORTS: &'static [Port] = PORTS;
    const INITIAL: &'static [&'static str] = &["motor_position", "motor_speed", "user_position", "user_speed", "current_a", "current_b", "current_c"];

    fn groups() -> &'static [Group] {
        GROUPS
    }
    fn signals() -> &'static [Signal] {
        HIGH
    }
    fn faults() -> Vec<FaultKind> {
        super::faults::catalogue()
    }
    fn step(raw: &[f64]) -> f64 {
        raw[SolverParameter::Step.at()]
    }
    fn fault_grid(raw: &[f64]) -> f64 {
        raw[SolverParameter::FaultGrid.at()]
    }
    fn structure(setup: &Setup) -> Structure {
        Structure::read(setup)
    }

    fn ticks(raw: &[f64], structure: &Structure) -> Vec<Tick> {
        let mut ticks = Vec::new();
        let mut add = |present: bool, index: usize, kind: u8| {
            if present {
                ticks.push(Tick { period: sample_steps(raw, index).max(1), kind });
            }
        };
        add(raw[ControlParameter::NoiseDeviation.at()] != 0.0, ControlParameter::NoiseSampleTime.at(), TICK_COMMAND_NOISE);
        add(raw[CurrentSensorParameter::NoiseDeviation.at()] != 0.0, CurrentSensorParameter::NoiseSampleTime.at(), TICK_CURRENT_NOISE);
        add(!structure.control_every_step, ControlParameter::SampleTime.at(), TICK_CONTROL);
        add(structure.drive == Drive::Pwm, PwmParameter::SampleTime.at(), TICK_CURRENT_CONTROL);
        ticks
    }

    fn check(raw: &[f64]) -> Vec<Finding> {
        super::checks::high(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure) -> Model<S> {
        let view = Raw(raw);
        let at = |i: usize| raw[i];
        let dt = at(SolverParameter::Step.at());
        let dt0 = dt.lane(0);
        let ts = at(ControlParameter::SampleTime.at()).lane(0).max(dt0);
        let gear = Gear::derive(view.gear(), view.stop(), view.load());
        let user_inertia = at(LoadParameter::Inertia.at());
        let rotor = at(MotorParameter::Inertia.at()) + at(GearParameter::Inertia.at());
        let inertia = if structure.elastic { rotor } else { rotor + user_inertia * gear.per_ratio * gear.per_ratio };
        Model {
            dt,
            star: Star::derive(view.motor(), &structure.motor, dt),
            bridge: Bridge::derive(view.inverter(), dt0),
            half_band: at(InverterParameter::HysteresisBand.at()),
            supply_scale: at(InverterParameter::SupplyScale.at()),
            control: PositionSpeed::derive(view.control(), ts),
            current_control: CurrentControl::derive(view.pwm(), at(MotorParameter::PolePairs.at())),
            friction: Friction::derive(view.friction()),
            gear,
            play: Play::derive(view.play()),
            sensor: CurrentSensor::derive(view.current_sensor()),
            encoder: Encoder::derive(view.encoder()),
            resolver: Resolver::derive(view.resolver()),
            filter: closing(at(CurrentSensorParameter::FilterCutoff.at()), dt0),
            inertia,
            dt_per_inertia: dt / inertia,
            user_inertia: if structure.elastic { user_inertia } else { S::zero() },
            per_user_inertia: S::one() / S::select(S::zero().lt(user_inertia), user_inertia, S::one()),
            noise_deviation: at(ControlParameter::NoiseDeviation.at()),
            temperature: at(MotorParameter::WindingTemperature.at()),
        }
    }

    fn start<S: Scalar>(model: &Model<S>, raw: &[S], initial: &[S]) -> State<S> {
        let or = |i: usize, other: S| S::select(initial[i].equals(initial[i]), initial[i], other);
        let zero = S::zero();
        let motor_position = or(0, zero);
        let driver = motor_position * model.gear.per_ratio;
        let mut star = StarState::rest();
        star.current = three!(|j| or(4 + j, zero));
        star.heat(Raw(raw).motor(), model.temperature);
        let user_position = model.play.drag(driver, or(2, driver));
        State {
            star,
            legs: [-S::one(); 3],
            bridge: BridgeState::rest(),
            control: PositionSpeedState::rest(),
            current_ref: zero,
            current_control: CurrentControlState::rest(),
            motor_position,
            motor_speed: or(1, zero),
            user_position,
            user_speed: or(3, zero),
            command_noise: zero,
            current_noise: [zero; 3],
            held_angle: motor_position,
            jam_side: (user_position - model.friction.jam_position).sign(),
            jammed: S::select(S::splat(0.5).lt(model.friction.jam_anywhere), S::one(), zero),
            filtered: [zero; 3],
            transitions: zero,
            voltage: [zero; 3],
            energy: [zero; 7],
        }
    }

    fn refresh<S: Scalar>(raw: &[S], state: &mut State<S>) {
        let temperature = raw[MotorParameter::WindingTemperature.at()];
        state.star.heat(Raw(raw).motor(), temperature);
        let position = raw[FrictionParameter::JamPosition.at()];
        let free = state.jammed.equals(S::zero());
        let side = (state.user_position - position).sign();
        state.jam_side = S::select(free & state.jam_side.equals(S::zero()), side, state.jam_side);
    }

    #[inline(always)]
    fn tick<S: Scalar>(kind: u8, structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &mut State<S>, t: S, noise: &mut dyn FnMut(u64) -> S) {
        match kind {
            TICK_COMMAND_NOISE => s.command_noise = m.noise_deviation * noise(0),
            TICK_CURRENT_NOISE => s.current_noise = three!(|j| noise(1 + j as u64)),
            TICK_CONTROL => {
                let reading = shaft_reading::<S, true>(m, structure, s);
                control_step::<S, true>(m, structure, inputs[COMMAND].at(t), s, &reading);
            }
            _ => {
                let reading = shaft_reading::<S, true>(m, structure, s);
                let angle = m.star.electrical_angle(reading.angle);
                let (sin, cos) = angle.sin_cos();
                let (sines, cosines) = three_phase(sin, cos);
                let (current_q, current_d) = park(measured_current::<S, true>(m, structure, s), sines, cosines);
                let supply = inputs[SUPPLY].at(t) * m.supply_scale;
                let sample = CurrentSample { reference_d: S::zero(), reference_q: s.current_ref, current_d, current_q, speed: reading.speed, angle, supply };
                m.current_control.step(&mut s.current_control, &sample);
            }
        }
    }

    #[inline(always)]
    fn advance<S: Scalar>(structure: &Structure, models: &[Model<S>], inputs: &[Inputs<S>], states: &mut [State<S>], from: Steps, count: Steps) {
        match (structure.full, structure.drive == Drive::Pwm) {
            (false, false) => march::<HighStep<false, false>, S>(structure, models, inputs, states, from, count),
            (false, true) => march::<HighStep<false, true>, S>(structure, models, inputs, states, from, count),
            (true, false) => march::<HighStep<true, false>, S>(structure, models, inputs, states, from, count),
            (true, true) => march::<HighStep<true, true>, S>(structure, models, inputs, states, from, count),
        }
    }

    #[inline(always)]
    fn observe<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, state: &State<S>, t: S, out: &mut [S]) {
        super::observe::high(structure, m, inputs, state, t, out);
    }

    #[inline(always)]
    fn watch<S: Scalar>(s: &State<S>) -> [Watch<S>; WATCHED] {
        let currents = s.star.current[0].abs() + s.star.current[1].abs() + s.star.current[2].abs() + s.star.loop_current[0].abs() + s.star.loop_current[1].abs() + s.star.loop_current[2].abs();
        [
            Watch { name: "motor_speed", value: s.motor_speed, limit: 1e6 },
            Watch { name: "current_a", value: currents, limit: 1e7 },
            Watch { name: "user_position", value: s.user_position, limit: 1e9 },
            Watch { name: "torque_ref", value: s.control.integral + s.control.filtered_error, limit: 1e12 },
        ]
    }

    #[inline(always)]
    fn tripped<S: Scalar>(s: &State<S>) -> S {
        s.bridge.tripped
    }
}
