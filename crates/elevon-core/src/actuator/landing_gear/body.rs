//! What both fidelities share: motor constants, sensors, supply, mechanics and control units, and their state.

use super::layout::*;
use super::mechanics::{Acting, Mechanics, Motion};
use super::signals::{Quantity as Q, ENERGIES};
use super::unit::{PlantSignals, Unit};
use crate::actuator::{Inputs, Setup};
use crate::control::pi_rate::PiRateParameter;
use crate::control::sequence::COMMANDS;
use crate::inverter::bridge::{BridgeStructure, InverterParameter as Inverter};
use crate::inverter::six_step::{Chopping, SixStep, SixStepParameter};
use crate::inverter::supply::{Link, Supply};
use crate::kept;
use crate::motor::star::{interrupted, MotorParameter, MotorStructure, Star};
use crate::scalar::Scalar;
use crate::sensor::hall::{Hall, HallState};
use crate::sensor::proximity::ProximityParameter;
use crate::three;
use crate::transmission::lock::LockParameter;
use crate::transmission::planetary::ReleaseParameter;

/// Everything that decides which code runs; equal over a lane block.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Structure {
    pub motor: MotorStructure,
    pub bridge: BridgeStructure,
    /// What the legs do while the carrier is above the demand.
    pub chopping: Chopping,
    /// The motor's terminals are shorted at some time.
    pub shorted: bool,
    /// The friction rig moves the ram.
    pub rig: bool,
    pub accounts: bool,
}

impl Structure {
    pub fn read(setup: &Setup) -> Self {
        let parts = Parts(setup);
        let shorted = parts.six_step().away(SixStepParameter::TerminalsShorted);
        let mut bridge = BridgeStructure::read(&parts.inverter(), interrupted(&parts.motor()));
        // Terminals shorted by a fault act through the switches.
        bridge.switch_faults |= shorted;
        bridge.trips |= shorted;
        Self {
            motor: MotorStructure::read(&parts.motor()),
            bridge,
            chopping: Chopping::read(setup.raw[SixStepParameter::Chopping.at()]),
            shorted,
            rig: setup.driven[RIG],
            accounts: setup.recorded.iter().any(|s| ENERGIES.contains(s)),
        }
    }
}

/// Constants of a run.
#[derive(Clone, Debug)]
pub struct Constants<S> {
    pub dt: S,
    pub star: Star<S>,
    pub hall: Hall<S>,
    pub modulator: SixStep<S>,
    pub supply: Supply<S>,
    supply_scale: S,
    pub mechanics: Mechanics<S>,
    pub cutoff: S,
    resistance_factor: S,
    flux_factor: S,
    temperature: S,
    ambient: S,
    per_control_period: S,
    cell_noise: S,
    /// 1 while the release's cable pulls.
    cable: S,
    /// Parameters of each lane as plain numbers, for the control unit.
    pub raw: Vec<Vec<f64>>,
}

/// All that changes during a run, except the currents.
#[derive(Clone, Debug)]
pub struct Body<S> {
    pub motion: Motion<S>,
    pub hall: HallState<S>,
    units: Vec<Unit>,
    pub demand: S,
    pub driving: S,
    /// 1 while all low switches are on.
    pub short: S,
    pub brake_free: S,
    pub released: S,
    pub link: S,
    pub flow: Link<S>,
    pub bus: S,
    charge: S,
    /// Sum and largest magnitude of the line current since the last tick, and what they were then.
    line: [S; 2],
    line_reading: [S; 2],
    cell_noise: S,
    /// Share of the lock's strength in use, at the last tick.
    pub lock_use: S,
    pub energy: [S; 5],
}

kept!(Body<f64> as Body {
    motion, hall, units, demand, driving, short, brake_free, released, link, flow, bus, charge, line, line_reading, cell_noise, lock_use,
    energy
});

pub const E_SUPPLY: usize = 0;
pub const E_SOURCE: usize = 1;
pub const E_DUMP: usize = 2;
pub const E_COPPER: usize = 3;
pub const E_INVERTER: usize = 4;

impl<S: Scalar> Constants<S> {
    pub fn derive(raw: &[S], structure: &Structure, mut plain: Vec<Vec<f64>>, dt: S, mechanical: S) -> Self {
        plain.resize_with(S::LANES, Vec::new);
        for (lane, numbers) in plain.iter_mut().enumerate() {
            numbers.clear();
            numbers.extend(raw.iter().map(|x| x.lane(lane)));
        }
        let view = Raw(raw);
        let at = |i: usize| raw[i];
        let rise = at(MotorParameter::WindingTemperature.at()) - at(MotorParameter::ReferenceTemperature.at());
        let modulator = SixStep::derive(view.six_step());
        Self {
            dt,
            star: Star::derive(view.motor(), &structure.motor, dt),
            hall: Hall::derive(view.hall(), at(MotorParameter::PolePairs.at())),
            cutoff: modulator.cutoff,
            modulator,
            supply: Supply::derive(view.supply(), dt),
            supply_scale: at(Inverter::SupplyScale.at()),
            mechanics: Mechanics::derive(raw, mechanical),
            resistance_factor: S::one() + at(MotorParameter::TemperatureCoefficient.at()) * rise,
            flux_factor: S::one() + at(MotorParameter::FluxTemperatureCoefficient.at()) * rise,
            temperature: at(MotorParameter::WindingTemperature.at()),
            ambient: at(LubricantStateParameter::Temperature.at()),
            per_control_period: S::one() / at(PiRateParameter::Period.at()),
            cell_noise: at(CellParameter::LoadCellNoise.at()),
            cable: S::one() - S::indicator(S::splat(0.5).le(at(ReleaseParameter::CableFailed.at()))),
            raw: plain,
        }
    }

    /// `initial` is the nut position and the motor speed; without one the gear is retracted and at rest.
    pub fn start(&self, raw: &[S], initial: &[S]) -> Body<S> {
        let or = |i: usize, other: S| S::select(initial[i].equals(initial[i]), initial[i], other);
        let nut = or(0, S::splat(0.5) * raw[ProximityParameter::Position0.at()]);
        let locked = S::indicator(raw[LockParameter::EngageTravel.at()].le(nut - self.mechanics.lever.stroke));
        let motion = self.mechanics.start(nut, locked, or(1, S::zero()));
        let units: Vec<Unit> = (0..S::LANES).map(|lane| Unit::start(&self.raw[lane], nut.lane(lane))).collect();
        let zero = S::zero();
        let mut body = Body {
            motion,
            hall: self.hall.start(self.star.electrical_angle(motion.motor_position)),
            units,
            demand: zero,
            driving: zero,
            short: zero,
            brake_free: zero,
            released: zero,
            link: raw[Inverter::SupplyVoltage.at()] * self.supply_scale,
            flow: Link { source: zero, dump: zero },
            bus: zero,
            charge: zero,
            line: [zero; 2],
            line_reading: [zero; 2],
            cell_noise: zero,
            lock_use: zero,
            energy: [zero; 5],
        };
        body.obey(self.cable);
        body
    }

    pub fn source(&self, inputs: &Inputs<S>, t: S) -> S {
        inputs[SUPPLY].at(t) * self.supply_scale
    }

    /// The control units' tick; `tripped` is positive where the bridge has given up.
    pub fn tick(&self, structure: &Structure, s: &mut Body<S>, inputs: &Inputs<S>, t: S, tripped: S, noise: &mut dyn FnMut(u64) -> S) {
        let command = inputs[COMMAND].at(t);
        let wheels = inputs[WHEELS].at(t);
        let speed = self.hall.speed(&s.hall, t);
        let counted = s.hall.count * self.hall.pitch * self.mechanics.travel;
        let bus = s.charge * self.per_control_period;
        s.line_reading = [s.line[0] * self.dt * self.per_control_period, s.line[1]];
        s.line = [S::zero(); 2];
        let high = s.hall.code[0] + s.hall.code[1] + s.hall.code[2];
        if S::any(t.equals(S::zero())) {
            // The link starts at the source's own voltage.
            s.link = self.source(inputs, t);
        }
        for lane in 0..S::LANES {
            let plant = PlantSignals {
                time: t.lane(lane),
                command: command.lane(lane),
                on_wheels: wheels.lane(lane) > 0.5,
                supply: s.link.lane(lane),
                bus: bus.lane(lane),
                speed: speed.lane(lane),
                ram: s.motion.nut_position.lane(lane).min(self.mechanics.lever.stroke.lane(lane)),
                locked: s.motion.locked.lane(lane),
                line: s.line_reading[0].lane(lane),
                counted: counted.lane(lane),
                travel: self.mechanics.travel.lane(lane),
                pitch: (self.hall.pitch * self.mechanics.travel).lane(lane),
                hall_errors: s.hall.errors.lane(lane),
                hall_valid: high.lane(lane) > 0.5 && high.lane(lane) < 2.5,
                tripped: tripped.lane(lane) > 0.5,
                rig: structure.rig,
                nut_speed: s.motion.nut_speed.lane(lane),
            };
            s.units[lane].tick(&self.raw[lane], &plant);
        }
        self.obey(s, inputs[OUTPUT].at(t), noise);
    }

    /// What the unit's answer sets, and what is read anew once a tick.
    fn obey(&self, s: &mut Body<S>, output: S, noise: &mut dyn FnMut(u64) -> S) {
        s.charge = S::zero();
        s.lock_use = s.motion.locked * self.mechanics.end_load(output).abs() * self.mechanics.lock.per_strength;
        s.obey(self.cable);
        if S::any(S::zero().lt(self.cell_noise)) {
            s.cell_noise = self.cell_noise * noise(0);
        }
    }

    /// Coefficients k_j of the phases at the present angle, and the angle.
    #[inline(always)]
    pub fn coupling(&self, structure: &Structure, motor_position: S) -> ([S; 3], S) {
        let angle = self.star.electrical_angle(motor_position);
        let plain = structure.motor.trapezoidal && !structure.motor.modulated();
        let (sin, cos) = if plain { (S::zero(), S::one()) } else { angle.sin_cos() };
        (self.star.coefficients::<true>(&structure.motor, None, motor_position, [sin, cos], Some(self.flux_factor)), angle)
    }

    #[inline(always)]
    pub fn resistance(&self) -> [S; 3] {
        three!(|j| self.star.resistance[j] * self.resistance_factor)
    }

    #[inline(always)]
    pub fn acting(&self, s: &Body<S>, inputs: &Inputs<S>, motor_torque: S, t: S) -> Acting<S> {
        Acting { motor_torque, output: inputs[OUTPUT].at(t), brake_free: s.brake_free, released: s.released, rig_speed: inputs[RIG].at(t) }
    }

    /// The motor turns on for a step from `t`, and the Hall sensors see where it has come.
    #[inline(always)]
    pub fn turn(&self, body: &mut Body<S>, t: S) {
        let before = body.motion.motor_position;
        self.mechanics.drift(&mut body.motion, self.dt);
        let angle = self.star.electrical_angle(body.motion.motor_position);
        let advance = (body.motion.motor_position - before) * self.star.pole_pairs;
        self.hall.observe(&mut body.hall, angle, advance, t + self.dt, self.dt);
    }

    /// The link after a step in which the bridge drew `bus` from it.
    #[inline(always)]
    pub fn feed(&self, s: &mut Body<S>, source: S, bus: S, accounts: bool) {
        let flow = self.supply.currents(source, s.link);
        if accounts {
            let e = &mut s.energy;
            e[E_SUPPLY] = e[E_SUPPLY] + self.dt * source * flow.source;
            e[E_SOURCE] = e[E_SOURCE] + self.dt * (source - s.link) * flow.source;
            e[E_DUMP] = e[E_DUMP] + self.dt * s.link * flow.dump;
        }
        s.link = self.supply.charge(s.link, &flow, bus);
        s.charge = self.dt.fma(bus, s.charge);
        s.bus = bus;
        s.flow = flow;
    }

    /// Keeps account of the line current of a step.
    #[inline(always)]
    pub fn meter(s: &mut Body<S>, line: S) {
        s.line = [s.line[0] + line, s.line[1].maximum(line.abs())];
    }

    pub fn trip_reason(&self, s: &Body<S>, lane: usize) -> Option<String> {
        s.units[lane].reason()
    }

    /// All signals but those of currents and phases.
    pub fn observe(&self, structure: &Structure, inputs: &Inputs<S>, s: &Body<S>, torque: S, t: S, out: &mut [S]) {
        // A repeated command differs by the number of commands.
        let command = inputs[COMMAND].at(t);
        let number = S::splat(COMMANDS.len() as f64);
        out[Q::Command as usize] = S::select(number.le(command), command - number, command);
        out[Q::MotorTorque as usize] = torque;
        s.write_units(out);
        self.write_electric(s, out);
        self.write_motion(structure, s, inputs[OUTPUT].at(t), out);
        for (i, x) in s.energy.iter().enumerate() {
            out[Q::EnergySupply as usize + i] = *x;
        }
        for (i, x) in s.motion.energy.iter().enumerate() {
            out[Q::EnergyMotor as usize + i] = *x;
        }
        out[Q::EnergyKinetic as usize] = self.mechanics.kinetic_energy(&s.motion, s.released);
        out[Q::EnergyCapacitor as usize] = S::splat(0.5) * self.supply.capacitance * s.link * s.link;
    }

    fn write_electric(&self, s: &Body<S>, out: &mut [S]) {
        let mut set = |q: Q, x: S| out[q as usize] = x;
        set(Q::VoltageRef, s.demand);
        set(Q::Duty, self.duty(s));
        set(Q::CurrentBus, s.bus);
        set(Q::CurrentSource, s.flow.source);
        set(Q::SupplyVoltage, s.link);
        set(Q::CurrentMean, s.line_reading[0]);
        set(Q::CurrentPeak, s.line_reading[1]);
        set(Q::HallA, s.hall.code[0]);
        set(Q::HallB, s.hall.code[1]);
        set(Q::HallC, s.hall.code[2]);
        set(Q::WindingTemperature, self.temperature);
        set(Q::AmbientTemperature, self.ambient);
        set(Q::SoftwareBrake, s.short);
        set(Q::LoadCell, s.motion.rig_force + s.cell_noise);
    }

    /// Motor, nut, ram and lever under the force `output` on the ram.
    fn write_motion(&self, structure: &Structure, s: &Body<S>, output: S, out: &mut [S]) {
        let mut set = |q: Q, x: S| out[q as usize] = x;
        let m = &self.mechanics;
        set(Q::MotorPosition, s.motion.motor_position);
        set(Q::MotorSpeed, s.motion.motor_speed);
        set(Q::NutPosition, s.motion.nut_position);
        let ram = m.ram(&s.motion, output);
        set(Q::OutputPosition, ram);
        let moving = S::splat(0.5).lt(s.motion.carrying);
        set(Q::OutputSpeed, S::select(moving, s.motion.nut_speed, S::zero()));
        set(Q::DetentTorque, m.detent_torque(s.motion.motor_position));
        set(Q::BrakeTorque, m.brake_torque(s.brake_free));
        set(Q::BrakeReleased, m.brake_open(s.brake_free));
        let forces = m.forces(&s.motion, output, structure.rig);
        set(Q::FrictionForce, m.friction_force(&s.motion, s.released));
        let locked = S::splat(0.5).lt(s.motion.locked);
        set(Q::LoadForce, S::select(locked, m.end_load(output), forces.load));
        set(Q::LockForce, S::select(locked, m.end_load(output), forces.spring));
        set(Q::Efficiency, m.efficiency(&forces, s.released));
        set(Q::Locked, s.motion.locked);
        set(Q::Released, s.released);
        let swing = m.lever.angle(ram.minimum(m.lever.stroke)) - m.lever.angle(S::zero());
        set(Q::LeverAngle, swing);
        set(Q::LeverArm, S::one() / forces.arm.per_square.sqrt());
        set(Q::Inertia, m.inertia(&s.motion, &forces.arm));
    }

    #[inline(always)]
    pub fn duty(&self, s: &Body<S>) -> S {
        (s.demand.abs() / s.link.maximum(S::splat(1e-6))).minimum(S::one())
    }
}

impl<S: Scalar> Body<S> {
    /// Takes over what the control units order.
    fn obey(&mut self, cable: S) {
        let units = &self.units;
        let flag = |f: &dyn Fn(&Unit) -> bool| S::from_fn(|lane| f64::from(u8::from(f(&units[lane]))));
        self.demand = S::from_fn(|lane| units[lane].demand);
        self.driving = flag(&|u| u.driving);
        self.brake_free = flag(&|u| u.coil.free);
        self.short = flag(&|u| u.short);
        self.released = self.released.maximum(flag(&|u| u.sequence.released) * cable);
    }

    /// What the control units report.
    fn write_units(&self, out: &mut [S]) {
        let mut set = |q: Q, x: S| out[q as usize] = x;
        let unit = |f: &dyn Fn(&Unit) -> f64| S::from_fn(|lane| f(&self.units[lane]));
        let flag = |f: &dyn Fn(&Unit) -> bool| S::from_fn(|lane| f64::from(u8::from(f(&self.units[lane]))));
        set(Q::State, unit(&|u| f64::from(u.sequence.phase as u8)));
        set(Q::CommandRefused, unit(&|u| f64::from(u.sequence.refused)));
        set(Q::FaultCode, unit(&|u| f64::from(u.sequence.fault)));
        set(Q::WarningCode, unit(&|u| f64::from(u.sequence.warning)));
        set(Q::SpeedRef, unit(&|u| u.speed.reference));
        set(Q::SpeedMeas, unit(&|u| u.speed_meas));
        set(Q::Proximity0, flag(&|u| u.switches.reading[0]));
        set(Q::Proximity25, flag(&|u| u.switches.reading[1]));
        set(Q::Proximity75, flag(&|u| u.switches.reading[2]));
        set(Q::Proximity100, flag(&|u| u.switches.reading[3]));
        set(Q::ProximityWheels, flag(&|u| u.switches.reading[4]));
    }

    /// Positive where something went otherwise than commanded.
    pub fn tripped(&self) -> S {
        S::from_fn(|lane| f64::from(u8::from(self.units[lane].sequence.notes.any())))
    }
}
