//! Findings that need several parameters at once: steps too large for a pole, gains that cannot be stable.

use super::form::Form;
use super::layout::*;
use super::shaft;
use crate::actuator::Finding;
use crate::control::current_dq::{largest_gain, PwmParameter};
use crate::control::derivative::{Carrier, Relays, SpeedLoop};
use crate::control::limits::LimitParameter;
use crate::control::position_speed::ControlParameter as Control;
use crate::inverter::bridge::InverterParameter as Inverter;
use crate::motor::equivalent::LowParameter;
use crate::motor::flux_map::FluxMapParameter;
use crate::motor::star::{MotorParameter as Motor, ShortModel};
use crate::motor::thermal::{ThermalModel, ThermalParameter as Thermal};
use crate::motor::unbalance::UnbalanceParameter;
use crate::sensor::current::CurrentSensorParameter;
use crate::sensor::resolver::ResolverParameter as Resolver;
use crate::transmission::backlash::BacklashParameter;
use crate::transmission::friction::FrictionParameter;
use crate::transmission::gear::{GearParameter, LoadParameter, StopParameter};
use crate::transmission::gear_train::GearTrain;

pub fn finding(path: &str, value: f64, limit: f64, message: String) -> Finding {
    Finding::error(path, value, limit, message)
}

fn drive(raw: &[f64]) -> DriveKind {
    DriveKind::read(raw[DriveParameter::Kind.at()])
}

fn step_limit(out: &mut Vec<Finding>, dt: f64, limit: f64, pole: &str) {
    if dt > limit {
        out.push(finding("solver.step", dt, limit, format!("solver.step: {dt:e} s is too large for the {pole}; at most {limit:.3e} s")));
    }
}

/// Factor to the limit below which the derivative action is warned of.
const CLOSE: f64 = 1.25;

/// Speed gain at which the derivative action becomes unstable, where that is below `CLOSE` times the present one, and
/// whether the run should not be at all beyond it.
fn derivative_limit(raw: &[f64], inertia: f64, dt: f64) -> Option<(f64, bool)> {
    let speed = SpeedLoop {
        gain: raw[Control::SpeedGain.at()] * raw[Control::SpeedGainScale.at()],
        derivative_time: raw[Control::DerivativeTime.at()],
        filter: raw[Control::DerivativeFilter.at()],
        tick: raw[Control::SampleTime.at()].max(dt),
        inertia,
    };
    if !(speed.ratio() > 0.0 && speed.ratio().is_finite()) {
        return None;
    }
    match DriveKind::read(raw[DriveParameter::Kind.at()]) {
        DriveKind::Pwm => {
            let carrier = Carrier {
                proportional: raw[PwmParameter::ProportionalGain.at()],
                integral: raw[PwmParameter::IntegralGain.at()],
                sample: raw[PwmParameter::SampleTime.at()],
                delay: raw[PwmParameter::ComputationDelay.at()],
                resistance: raw[Motor::WindingResistance.at()],
                inductance: raw[Motor::WindingInductance.at()],
            };
            let margin = carrier.margin(&speed, CLOSE);
            (margin < CLOSE).then_some((margin * speed.gain, true))
        }
        DriveKind::Hysteresis => {
            let slew = raw[Inverter::SupplyVoltage.at()] * (2.0 / 3.0) / raw[Motor::WindingInductance.at()];
            let relays = Relays { half_band: raw[Inverter::HysteresisBand.at()], slew };
            let margin = relays.largest_ratio(&speed) / speed.ratio();
            let ticks = raw[Control::SampleTime.at()] > dt;
            (ticks && margin < CLOSE).then_some((margin * speed.gain, relays.leaves_band(speed.tick)))
        }
        DriveKind::Off => None,
    }
}

/// K_p T_d acts like an inertia; how much of it is borne depends on the drive.
fn derivative_inertia(out: &mut Vec<Finding>, raw: &[f64], inertia: f64, dt: f64, refuse: bool) {
    let Some((limit, grows)) = derivative_limit(raw, inertia, dt) else {
        return;
    };
    let (gain, td) = (raw[Control::SpeedGain.at()] * raw[Control::SpeedGainScale.at()], raw[Control::DerivativeTime.at()]);
    let ratio = gain * td / inertia;
    let what = format!("control.speed_gain: K_p T_d = {gain} N m s/rad * {td} s is {ratio:.3} of the inertia, {inertia:.4e} kg m2");
    if gain < limit {
        let message = format!("{what}; the derivative action becomes unstable at K_p = {limit:.4} N m s/rad");
        out.push(Finding::warning("control.speed_gain", gain, limit, message));
    } else if grows && refuse {
        let message = format!("{what}: more than this drive's current loop bears; at most {limit:.4} N m s/rad");
        out.push(finding("control.speed_gain", gain, limit, message));
    } else if refuse {
        let message =
            format!("{what}: the torque reference alternates from tick to tick above {limit:.4} N m s/rad, within the relays' band");
        out.push(Finding::warning("control.speed_gain", gain, limit, message));
    } else {
        let message =
            format!("{what}: stable here, where the current has no delay, but not in the switching model above {limit:.4} N m s/rad");
        out.push(Finding::warning("control.speed_gain", gain, limit, message));
    }
}

fn common<F: Form>(out: &mut Vec<Finding>, raw: &[f64]) {
    out.extend(F::check(raw));
    thermal(out, raw);
    drivetrain(out, raw);
    out.extend(resolver(raw));
    link(out, raw);
    limits(out, raw);
    linkages(out, raw);
    let (fsj, fdj) = (raw[FrictionParameter::Static.at()], raw[FrictionParameter::Dynamic.at()]);
    if fdj > fsj {
        out.push(finding("friction.dynamic", fdj, fsj, format!("friction.dynamic: {fdj} N m exceeds friction.static, {fsj} N m")));
    }
    let unit = if F::LINEAR { "m" } else { "rad" };
    let (lower, upper) = (raw[StopParameter::Lower.at()], raw[StopParameter::Upper.at()]);
    if lower >= upper {
        out.push(finding("stop.lower", lower, upper, format!("stop.lower: {lower} {unit} is not below stop.upper, {upper} {unit}")));
    }
}

/// Field weakening and derating against the current limit and each other.
fn limits(out: &mut Vec<Finding>, raw: &[f64]) {
    use crate::variable::Switch;
    let at = |p: LimitParameter| raw[p.at()];
    let on = |p: LimitParameter| Switch::read(at(p)) == Switch::On;
    let most = raw[Control::CurrentLimit.at()];
    let mut direct = at(LimitParameter::DirectCurrent).abs();
    let mut path = "control.direct_current";
    if on(LimitParameter::FieldWeakening) {
        direct += at(LimitParameter::FieldWeakeningCurrent);
        path = "control.field_weakening_current";
    }
    if drive(raw) == DriveKind::Pwm && direct >= most {
        let message = format!("{path}: {direct} A of direct current leave nothing for the torque below control.current_limit, {most} A");
        out.push(finding(path, direct, most, message));
    }
    let (start, end) = (at(LimitParameter::DeratingStart), at(LimitParameter::DeratingEnd));
    if on(LimitParameter::Derating) && end <= start {
        let path = "control.derating_end";
        out.push(finding(path, end, start, format!("{path}: {end} K must be above control.derating_start, {start} K")));
    }
}

/// Are the flux linkages other than L i? Then no turns may be missing.
fn linkages(out: &mut Vec<Finding>, raw: &[f64]) {
    use crate::motor::short::{ShortParameter as S, TapParameter as T};
    let at = |p: FluxMapParameter| raw[p.at()];
    let mapped = at(FluxMapParameter::Saliency) != 1.0 || at(FluxMapParameter::SaturationCurrent) != 0.0;
    let turns = (0..3).map(|j| raw[Motor::TurnsA.at() + j]).fold(1.0, f64::min);
    let contacts = [T::TapLevelA, T::TapLevelB, T::TapLevelC].map(|p| raw[p.at()]).into_iter().fold(0.0, f64::max);
    let shorts = [S::PhaseShortAb, S::PhaseShortBc, S::PhaseShortCa, S::GroundShortA, S::GroundShortB, S::GroundShortC];
    let shorts = shorts.map(|p| raw[p.at()]).into_iter().fold(contacts, f64::max);
    if mapped && (turns < 1.0 || shorts > 0.0) {
        let path = if at(FluxMapParameter::Saliency) != 1.0 { "motor.saliency" } else { "motor.saturation_current" };
        let message = format!(
            "{path}: the flux linkages of a salient or saturating motor are those of a whole winding; with shorted turns (motor.turns_a to c), \
             taps or contacts they are not modelled: set motor.saliency = 1 and motor.saturation_current = 0"
        );
        out.push(finding(path, turns, 1.0, message));
    }
}

/// Share of the inductances that is left at the current limit, at least.
fn least_inductance(raw: &[f64]) -> f64 {
    let at = |p: FluxMapParameter| raw[p.at()];
    let (saliency, limit) = (at(FluxMapParameter::Saliency), at(FluxMapParameter::SaturationCurrent));
    let most = raw[Control::CurrentLimit.at()];
    let reached =
        if limit > 0.0 { (most * most + saliency * (most + at(FluxMapParameter::SaturationBias)).powi(2)) / (limit * limit) } else { 0.0 };
    saliency.min(1.0) / (1.0 + reached).powf(1.5)
}

/// Link, chopper and trips against each other: what trips at once cannot run, what comes too late or never is warned of.
fn link(out: &mut Vec<Finding>, raw: &[f64]) {
    use crate::inverter::link::{LinkParameter as L, SourceRegeneration};
    let at = |p: L| raw[p.at()];
    let capacitance = at(L::LinkCapacitance);
    if capacitance == 0.0 {
        return;
    }
    let supply = raw[Inverter::SupplyVoltage.at()] * raw[Inverter::SupplyScale.at()];
    let (least, most) = (at(L::UnderVoltageTrip), at(L::OverVoltageTrip));
    let (chops, begin) = (at(L::ChopperResistance) > 0.0, at(L::ChopperVoltage));
    let blocks = SourceRegeneration::read(at(L::SourceRegeneration)) == SourceRegeneration::Block || at(L::ConnectorOpen) >= 0.5;
    if least >= supply {
        let path = "inverter.under_voltage_trip";
        out.push(finding(path, least, supply, format!("{path}: the drive trips at once: {least} V is not below the supply's {supply} V")));
    }
    if most > 0.0 && most <= supply {
        let path = "inverter.over_voltage_trip";
        out.push(finding(path, most, supply, format!("{path}: the drive trips at once: {most} V is not above the supply's {supply} V")));
    }
    if chops && begin - at(L::ChopperBand) <= supply {
        let (path, end) = ("inverter.chopper_voltage", begin - at(L::ChopperBand));
        let message =
            format!("{path}: once on the chopper stays on: it goes off at {end} V (less inverter.chopper_band), the supply has {supply} V");
        out.push(Finding::warning(path, begin, supply, message));
    }
    if chops && most > 0.0 && begin >= most {
        let path = "inverter.chopper_voltage";
        let message = format!("{path}: the drive trips at inverter.over_voltage_trip = {most} V before the chopper is on at {begin} V");
        out.push(Finding::warning(path, begin, most, message));
    }
    if blocks && !chops && most == 0.0 {
        let speed = raw[Control::SpeedLimit.at()].min(supply / (3.0_f64.sqrt() * raw[Motor::EmfConstant.at()]));
        let inertia = raw[Motor::Inertia.at()] + raw[GearParameter::Inertia.at()];
        let reached = (supply * supply + inertia * speed * speed / capacitance).sqrt();
        let message = format!(
            "inverter.link_capacitance: nothing takes what the braking motor gives: its rotor alone brings the link from {supply} V to \
             {reached:.0} V at {speed:.0} rad/s; state inverter.chopper_resistance or inverter.over_voltage_trip"
        );
        out.push(Finding::warning("inverter.link_capacitance", capacitance, reached, message));
    }
}

/// Channels whose errors leave no angle that turns with the shaft.
fn resolver(raw: &[f64]) -> Option<Finding> {
    let (errors, amplitude) = crate::sensor::resolver::Resolver::derive(Raw(raw).resolver()).eccentricity();
    (errors >= amplitude).then(|| {
        let path = "sensor.resolver.sine_offset";
        let message = format!(
            "{path}: offsets and quadrature error of the resolver come to {errors:.3}, its weaker channel has {amplitude:.3}: the reported \
             angle would not turn with the shaft"
        );
        finding(path, errors, amplitude, message)
    })
}

/// Friction that no motor torque overcomes, balls that do not fit.
fn drivetrain(out: &mut Vec<Finding>, raw: &[f64]) {
    use crate::transmission::bearing::BearingParameter as B;
    use crate::transmission::friction_law::{FrictionLaw, FrictionLawParameter as L};
    let sum = raw[L::LoadMotor.at()] + raw[L::LoadMotorStribeck.at()];
    if FrictionLaw::read(raw[L::Law.at()]) == FrictionLaw::LoadDependent && sum >= 1.0 {
        out.push(finding(
            "friction.load_motor",
            sum,
            1.0,
            format!("friction.load_motor: with friction.load_motor_stribeck {sum}, the friction at rest grows as the motor's torque does and is never overcome; below 1"),
        ));
    }
    let [balls, ball, pitch] = [B::Balls, B::BallDiameter, B::PitchDiameter].map(|p| raw[p.at()]);
    let fits = std::f64::consts::PI * pitch / balls;
    if ball >= fits {
        out.push(finding(
            "bearing.ball_diameter",
            ball,
            fits,
            format!("bearing.ball_diameter: {balls} balls of {ball} m do not fit on a circle of {pitch} m (bearing.pitch_diameter); below {fits:.4e} m"),
        ));
    }
}

/// Temperatures that no motor can have.
fn thermal(out: &mut Vec<Finding>, raw: &[f64]) {
    if ThermalModel::read(raw[Thermal::Model.at()]) == ThermalModel::Off {
        return;
    }
    let [convection, emissivity] = [Thermal::Convection, Thermal::Emissivity].map(|p| raw[p.at()]);
    if convection == 0.0 && emissivity == 0.0 {
        out.push(finding(
            "thermal.convection",
            0.0,
            0.0,
            "thermal.convection: 0 W/(m2 K) with thermal.emissivity 0 leaves the heat no path out; one of them must be above 0".into(),
        ));
    }
    let names = ["thermal.ambient", "thermal.warning", "thermal.trip"];
    let values = [Thermal::Ambient, Thermal::Warning, Thermal::Trip].map(|p| raw[p.at()]);
    for i in 1..3 {
        if values[i] <= values[i - 1] {
            let message = format!("{}: {} K must be above {}, {} K", names[i], values[i], names[i - 1], values[i - 1]);
            out.push(finding(names[i], values[i], values[i - 1], message));
        }
    }
}

/// What holds of the parameters with every fault of a run at its whole severity: a fault may not make the plant faster
/// than the step any more than a set parameter may.
pub fn faulted_high<F: Form>(raw: &[f64]) -> Vec<Finding> {
    let mut out = F::check(raw);
    steps::<F>(&mut out, raw);
    out.extend(resolver(raw));
    out
}

/// The same for the reduced-order model, whose steps are exact or implicit.
pub fn faulted_low<F: Form>(raw: &[f64]) -> Vec<Finding> {
    let mut out = F::check(raw);
    out.extend(resolver(raw));
    out
}

fn whole_multiple(out: &mut Vec<Finding>, raw: &[f64], index: usize, path: &str) {
    let (period, dt) = (raw[index], raw[SolverParameter::Step.at()]);
    let steps = period / dt;
    if period > 0.0 && (steps.round() < 1.0 || (steps - steps.round()).abs() > 1e-6 * steps.max(1.0)) {
        out.push(finding(path, period, dt, format!("{path}: {period:e} s is not a whole multiple of solver.step, {dt:e} s")));
    }
}

pub fn high<F: Form>(raw: &[f64]) -> Vec<Finding> {
    let mut out = Vec::new();
    common::<F>(&mut out, raw);
    let dt = raw[SolverParameter::Step.at()];
    steps::<F>(&mut out, raw);
    current_loop(&mut out, raw, turns_left(raw).powi(2) * raw[Motor::WindingInductance.at()]);
    derivative_inertia(&mut out, raw, inertia::<F>(raw).1, dt, true);
    if Commutation::read(raw[DriveParameter::Commutation.at()]) == Commutation::SixStep && drive(raw) == DriveKind::Pwm {
        out.push(finding(
            "drive.commutation",
            1.0,
            0.0,
            "drive.commutation: six_step needs drive.kind = hysteresis; a carrier-PWM drive controls sinusoidal currents".into(),
        ));
    }
    for (index, path) in [
        (Control::SampleTime.at(), "control.sample_time"),
        (Control::NoiseSampleTime.at(), "control.noise_sample_time"),
        (CurrentSensorParameter::NoiseSampleTime.at(), "sensor.current.noise_sample_time"),
        (Resolver::NoiseSampleTime.at(), "sensor.resolver.noise_sample_time"),
        (PwmParameter::SampleTime.at(), "pwm.sample_time"),
        (Thermal::SampleTime.at(), "thermal.sample_time"),
    ] {
        let used = match path {
            "control.noise_sample_time" => raw[Control::NoiseDeviation.at()] > 0.0,
            "sensor.current.noise_sample_time" => raw[CurrentSensorParameter::NoiseDeviation.at()] > 0.0,
            "sensor.resolver.noise_sample_time" => {
                raw[Resolver::NoiseDeviation.at()] > 0.0 || raw[Resolver::SpeedNoiseDeviation.at()] > 0.0
            }
            "thermal.sample_time" => ThermalModel::read(raw[Thermal::Model.at()]) != ThermalModel::Off,
            "pwm.sample_time" => drive(raw) == DriveKind::Pwm,
            _ => true,
        };
        if used {
            whole_multiple(&mut out, raw, index, path);
        }
    }
    out
}

/// The current loop of a carrier drive against the delay of its own duties.
fn current_loop(out: &mut Vec<Finding>, raw: &[f64], inductance: f64) {
    if DriveKind::read(raw[DriveParameter::Kind.at()]) != DriveKind::Pwm {
        return;
    }
    let (gain, sample) = (raw[PwmParameter::ProportionalGain.at()], raw[PwmParameter::SampleTime.at()]);
    let delay = raw[PwmParameter::ComputationDelay.at()];
    let limit = largest_gain(delay) * inductance / sample;
    if gain >= limit {
        let message = format!(
            "pwm.proportional_gain: {gain} V/A makes the current loop oscillate: with pwm.sample_time {sample:e} s and pwm.computation_delay {delay} it must stay below {limit:.4} V/A"
        );
        out.push(finding("pwm.proportional_gain", gain, limit, message));
    }
}

/// Inertia of the rotor with what turns rigidly with it, and of all that the speed loop moves.
fn inertia<F: Form>(raw: &[f64]) -> (f64, f64) {
    let rotor = raw[Motor::Inertia.at()]
        + raw[GearParameter::Inertia.at()]
        + F::screw_inertia(raw)
        + raw[UnbalanceParameter::UnbalanceInertia.at()];
    let elastic = shaft::elastic::<F>(raw);
    let ratio = F::ratio(raw);
    let output = raw[LoadParameter::Inertia.at()] / (ratio * ratio);
    (rotor, if elastic { rotor } else { rotor + output })
}

/// The solver's step against every pole of the plant.
fn steps<F: Form>(out: &mut Vec<Finding>, raw: &[f64]) {
    let dt = raw[SolverParameter::Step.at()];
    windings(out, raw, dt);
    let (rotor, inertia) = inertia::<F>(raw);
    if drive(raw) == DriveKind::Pwm {
        // A step with more than two edges of a leg is none of this carrier.
        step_limit(out, dt, 0.5 / raw[PwmParameter::Frequency.at()], "carrier: half its period at pwm.frequency");
    }
    let viscous = raw[FrictionParameter::Viscous.at()] * raw[FrictionParameter::ViscousScale.at()];
    if viscous > 0.0 {
        step_limit(out, dt, inertia / viscous, "viscous pole C / J of friction.viscous");
    }
    let layout = F::layout(raw);
    if layout.bodies() {
        meshes(out, raw, &F::train(raw, layout), [rotor, raw[LoadParameter::Inertia.at()]]);
    } else if shaft::elastic::<F>(raw) {
        let ratio = F::ratio(raw);
        contact::<F>(out, raw, dt, rotor * ratio * ratio, raw[LoadParameter::Inertia.at()]);
    }
}

/// Missing turns make a phase faster. Turns shorted in a loop, as every other contact, do not: their currents move
/// implicitly, and the leg's slope is limited by the phases through which its current returns.
fn windings(out: &mut Vec<Finding>, raw: &[f64], dt: f64) {
    let (r, l) = (raw[Motor::WindingResistance.at()], raw[Motor::WindingInductance.at()] * least_inductance(raw));
    let turns = turns_left(raw);
    step_limit(out, dt, turns * l / r, "electrical pole R / L of motor.winding_resistance and motor.winding_inductance");
    let reduced = ShortModel::read(raw[Motor::ShortModel.at()]) == ShortModel::Reduced;
    let left = std::array::from_fn(|j| raw[Motor::TurnsA.at() + j]);
    let slope = if reduced { (2.0 / 3.0) / (turns * turns * l) } else { steepest(left, raw[Motor::ShortCoupling.at()], l) };
    relay_band(out, raw, dt, slope);
}

/// Turns of the phase that has lost most of them; those shorted in a loop are not lost.
fn turns_left(raw: &[f64]) -> f64 {
    if ShortModel::read(raw[Motor::ShortModel.at()]) == ShortModel::Loop {
        return 1.0;
    }
    (0..3).map(|j| raw[Motor::TurnsA.at() + j]).fold(1.0, f64::min)
}

/// Largest di/dt per volt of a leg with dead shorts in loops: y (s - y) / s of the legs' admittances y and their sum s.
fn steepest(left: [f64; 3], coupling: f64, inductance: f64) -> f64 {
    let y = left.map(|n| (1.0 + (1.0 - n) / ((1.0 - coupling).max(1e-9) * n)) / inductance);
    let sum: f64 = y.iter().sum();
    y.iter().map(|y| y * (sum - y) / sum).fold(0.0, f64::max)
}

/// `slope` is di/dt per volt of the link.
fn relay_band(out: &mut Vec<Finding>, raw: &[f64], dt: f64, slope: f64) {
    if drive(raw) == DriveKind::Hysteresis {
        let slew = raw[Inverter::SupplyVoltage.at()] * slope;
        step_limit(
            out,
            dt,
            raw[Inverter::HysteresisBand.at()] / slew,
            "relays: the current would cross inverter.hysteresis_band in one step",
        );
    }
}

/// Two masses on the contact spring: semi-implicit needs dt below 2 / omega, explicit Euler below C / K.
fn contact<F: Form>(out: &mut Vec<Finding>, raw: &[f64], dt: f64, motor: f64, output: f64) {
    if output <= 0.0 {
        let (path, unit) = if F::LINEAR { ("load.mass", "kg") } else { ("load.inertia", "kg m2") };
        out.push(finding(path, output, 0.0, format!("{path}: the elastic backlash needs a second mass, above 0 {unit}")));
        return;
    }
    let (k, c) = (raw[BacklashParameter::Stiffness.at()], raw[BacklashParameter::Damping.at()]);
    let per_mass = 1.0 / motor + 1.0 / output;
    let omega = (k * per_mass).sqrt();
    let damped = if c > 0.0 { 1.0 / (c * per_mass) } else { f64::INFINITY };
    let semi = Method::read(raw[SolverParameter::Method.at()]) == Method::SemiImplicit;
    let limit = if semi { 1.0 / omega } else { c / k };
    step_limit(out, dt, limit.min(damped), "contact stiffness backlash.stiffness and damping backlash.damping");
}

/// Bodies on the stiffness of their meshes, as two masses on a contact.
fn meshes(out: &mut Vec<Finding>, raw: &[f64], train: &GearTrain<f64>, [motor, output]: [f64; 2]) {
    if output <= 0.0 {
        let message = "load.inertia: a gear of several bodies (gear.model) needs a mass at the output, above 0 kg m2".into();
        out.push(finding("load.inertia", output, 0.0, message));
        return;
    }
    let [square, damping, ratio] = train.fastest(motor, output);
    let semi = Method::read(raw[SolverParameter::Method.at()]) == Method::SemiImplicit;
    let limit = if semi { 1.0 / square.sqrt() } else { ratio };
    let pole = "meshes of the gear: gear.mesh_stiffness_1 to 3, gear.mesh_damping_1 to 3 on gear.inertia_1 and 2";
    step_limit(out, raw[SolverParameter::Step.at()], limit.min(1.0 / damping), pole);
}

pub fn low<F: Form>(raw: &[f64]) -> Vec<Finding> {
    let mut out = Vec::new();
    common::<F>(&mut out, raw);
    let ratio = F::ratio(raw);
    let inertia = raw[Motor::Inertia.at()]
        + raw[GearParameter::Inertia.at()]
        + F::screw_inertia(raw)
        + raw[UnbalanceParameter::UnbalanceInertia.at()]
        + raw[LoadParameter::Inertia.at()] / (ratio * ratio)
        + F::train(raw, F::layout(raw)).reflected;
    derivative_inertia(&mut out, raw, inertia, raw[SolverParameter::Step.at()], false);
    let dt = raw[LowParameter::Step.at()];
    let gain = raw[Control::SpeedGain.at()] * raw[Control::SpeedGainScale.at()];
    let effective = inertia + gain * raw[Control::DerivativeTime.at()];
    let pole = (gain + raw[FrictionParameter::Viscous.at()]) / effective;
    if dt * pole > 1.0 {
        out.push(finding(
            "low.step",
            dt,
            1.0 / pole,
            format!("low.step: {dt:e} s is too large for the speed loop's pole K_p / J; at most {:.3e} s", 1.0 / pole),
        ));
    }
    out
}
