//! What the parameters of the landing-gear actuator cannot be together, with the limit in each message.

use super::layout::*;
use crate::actuator::Finding;
use crate::control::pi_rate::PiRateParameter;
use crate::control::sequence::SequenceParameter as Sequence;
use crate::inverter::bridge::InverterParameter as Inverter;
use crate::inverter::six_step::SixStepParameter;
use crate::inverter::supply::{Regeneration, SupplyParameter};
use crate::motor::star::{MotorParameter as Motor, ShortModel};
use crate::sensor::proximity::ProximityParameter as Proximity;
use crate::transmission::lever::{opens_at, LeverParameter};
use crate::transmission::lock::LockParameter as Lock;
use crate::transmission::roller_screw::ScrewParameter as Screw;
use crate::transmission::train_friction::{TrainFrictionParameter as Friction, SPEEDS};

fn finding(path: &str, value: f64, limit: f64, message: String) -> Finding {
    Finding::error(path, value, limit, message)
}

/// `low` below (or, with `equal`, not above) `high`.
fn ordered(out: &mut Vec<Finding>, raw: &[f64], low: (usize, &str), high: (usize, &str), equal: bool, unit: &str) {
    let (a, b) = (raw[low.0], raw[high.0]);
    if a > b || (a == b && !equal) {
        let relation = if equal { "exceeds" } else { "is not below" };
        out.push(finding(low.1, a, b, format!("{}: {a} {unit} {relation} {}, {b} {unit}", low.1, high.1)));
    }
}

fn lever(out: &mut Vec<Finding>, raw: &[f64]) {
    let view = Raw(raw);
    if let Some(x) = opens_at(view.lever()) {
        let at = |p: LeverParameter| raw[p.at()];
        let (g, d, l) = (
            at(LeverParameter::Arm),
            at(LeverParameter::PivotX).hypot(at(LeverParameter::PivotY)),
            at(LeverParameter::LengthRetracted) + x,
        );
        let message = format!(
            "lever.arm: the triangle of actuator, lever and airframe does not close at output_position = {:.1} mm: the actuator is {l:.4} m long there and must lie between |D - g_a| = {:.4} m and D + g_a = {:.4} m (D = {d:.4} m, g_a = {g:.4} m)",
            1e3 * x, (d - g).abs(), d + g
        );
        out.push(finding("lever.arm", g, (d - l).abs(), message));
    }
    if at_or_below_zero(raw) {
        out.push(finding(
            "lever.pivot_x",
            raw[LeverParameter::PivotX.at()],
            0.0,
            "lever.pivot_x: the pivot of the leg must lie in front of the actuator's (above 0 m)".into(),
        ));
    }
}

fn at_or_below_zero(raw: &[f64]) -> bool {
    raw[LeverParameter::PivotX.at()] <= 0.0
}

fn tables(out: &mut Vec<Finding>, raw: &[f64]) {
    for k in 0..SPEEDS {
        let speed = |k: usize| (Friction::Speed1.at() + k, format!("friction.speed_{}", k + 1));
        if k + 1 < SPEEDS {
            let (a, b) = (speed(k), speed(k + 1));
            ordered(out, raw, (a.0, &a.1), (b.0, &b.1), false, "m/s");
        }
        for (ff, ffm, direction) in [
            (Friction::FfExtension1, Friction::FfmExtension1, "extension"),
            (Friction::FfRetraction1, Friction::FfmRetraction1, "retraction"),
        ] {
            let (low, high) = (format!("friction.ff_{direction}_{}", k + 1), format!("friction.ffm_{direction}_{}", k + 1));
            ordered(out, raw, (ff.at() + k, &low), (ffm.at() + k, &high), true, "N");
        }
    }
}

fn common(out: &mut Vec<Finding>, raw: &[f64]) {
    lever(out, raw);
    tables(out, raw);
    ways(out, raw);
    dump(out, raw);
    let (v, low, high) = (raw[Inverter::SupplyVoltage.at()], raw[Sequence::Undervoltage.at()], raw[Sequence::Overvoltage.at()]);
    if !(low..=high).contains(&v) {
        let limit = if v < low { low } else { high };
        out.push(finding("inverter.supply_voltage", v, limit, format!("inverter.supply_voltage: {v} V is outside control.undervoltage = {low} V to control.overvoltage = {high} V: every move would be refused")));
    }
    if ShortModel::read(raw[Motor::ShortModel.at()]) != ShortModel::Reduced {
        out.push(finding(
            "motor.short_model",
            1.0,
            0.0,
            "motor.short_model: this actuator has the reduced model of shorted turns only".into(),
        ));
    }
}

/// The dump resistor against the trips of the supply in motion and against the supply itself.
fn dump(out: &mut Vec<Finding>, raw: &[f64]) {
    if Regeneration::read(raw[SupplyParameter::Regeneration.at()]) == Regeneration::Accept {
        return;
    }
    let path = "supply.dump_voltage";
    let (begin, trip) = (raw[SupplyParameter::DumpVoltage.at()], raw[Sequence::Overvoltage.at()]);
    let supply = raw[Inverter::SupplyVoltage.at()] * raw[Inverter::SupplyScale.at()];
    if begin >= trip {
        let message = format!(
            "{path}: a braking motor ends its move with fault 11 (supply in motion): the dump resistor conducts above {begin} V, \
             control.overvoltage is {trip} V"
        );
        out.push(Finding::warning(path, begin, trip, message));
    }
    if begin <= supply {
        let message = format!("{path}: the dump resistor conducts all the time: {begin} V is not above the supply's {supply} V");
        out.push(Finding::warning(path, begin, supply, message));
    }
}

/// What must stand in one order: efficiencies, travels, switches along the stroke, speeds.
fn ways(out: &mut Vec<Finding>, raw: &[f64]) {
    let (loaded, unloaded) =
        ((Screw::EfficiencyLoaded.at(), "screw.efficiency_loaded"), (Screw::EfficiencyUnloaded.at(), "screw.efficiency_unloaded"));
    let (release, engage) = ((Lock::ReleaseTravel.at(), "lock.release_travel"), (Lock::EngageTravel.at(), "lock.engage_travel"));
    let (travel, block) = ((Lock::Travel.at(), "lock.travel"), (Lock::BlockTravel.at(), "lock.block_travel"));
    let first = (Proximity::Position0.at(), "proximity.position_0");
    let second = (Proximity::Position25.at(), "proximity.position_25");
    let third = (Proximity::Position75.at(), "proximity.position_75");
    let stroke = (LeverParameter::Stroke.at(), "lever.stroke");
    let (slow, fast) = ((Sequence::SpeedLow.at(), "control.speed_low"), (Sequence::SpeedHigh.at(), "control.speed_high"));
    let over = (Sequence::Overspeed.at(), "control.overspeed");
    for (low, high, equal, unit) in [
        (loaded, unloaded, true, ""),
        (release, engage, false, "m"),
        (engage, travel, false, "m"),
        (block, engage, false, "m"),
        (first, second, false, "m"),
        (second, third, false, "m"),
        (third, stroke, false, "m"),
        (slow, fast, true, "rad/s"),
        (fast, over, false, "rad/s"),
    ] {
        ordered(out, raw, low, high, equal, unit);
    }
}

fn whole_multiple(out: &mut Vec<Finding>, raw: &[f64], (index, path): (usize, &str), (step, step_path): (usize, &str)) {
    let ratio = raw[index] / raw[step];
    if ratio.round() < 1.0 || (ratio - ratio.round()).abs() > 1e-6 * ratio {
        out.push(finding(
            path,
            raw[index],
            raw[step],
            format!("{path}: {:e} s is not a whole multiple of {step_path}, {:e} s", raw[index], raw[step]),
        ));
    }
}

fn step_limit(out: &mut Vec<Finding>, path: &str, dt: f64, limit: f64, pole: &str) {
    if dt > limit {
        out.push(finding(path, dt, limit, format!("{path}: {dt:e} s is too large for the {pole}; at most {limit:.3e} s")));
    }
}

fn link(raw: &[f64]) -> f64 {
    raw[SupplyParameter::Resistance.at()] * raw[SupplyParameter::Capacitance.at()]
}

pub fn high(raw: &[f64]) -> Vec<Finding> {
    let mut out = Vec::new();
    common(&mut out, raw);
    let dt = raw[SolverParameter::Step.at()];
    let step = (SolverParameter::Step.at(), "solver.step");
    whole_multiple(&mut out, raw, (SolverParameter::MechanicalStep.at(), "solver.mechanical_step"), step);
    whole_multiple(&mut out, raw, (PiRateParameter::Period.at(), "control.period"), step);
    let turns = (0..3).map(|j| raw[Motor::TurnsA.at() + j]).fold(1.0, f64::min);
    let (l, r) = (turns * raw[Motor::WindingInductance.at()], raw[Motor::WindingResistance.at()] + raw[Inverter::OnResistance.at()]);
    step_limit(&mut out, "solver.step", dt, l / r, "electrical pole R / L of motor.winding_resistance and motor.winding_inductance");
    step_limit(&mut out, "solver.step", dt, link(raw), "pole of supply.resistance and supply.capacitance");
    step_limit(
        &mut out,
        "solver.step",
        dt,
        0.1 * raw[SixStepParameter::SwitchingPeriod.at()],
        "carrier: inverter.switching_period needs ten steps",
    );
    out
}

pub fn low(raw: &[f64]) -> Vec<Finding> {
    let mut out = Vec::new();
    common(&mut out, raw);
    let dt = raw[LowParameter::Step.at()];
    whole_multiple(&mut out, raw, (PiRateParameter::Period.at(), "control.period"), (LowParameter::Step.at(), "low.step"));
    step_limit(&mut out, "low.step", dt, link(raw), "pole of supply.resistance and supply.capacitance");
    let (k, r) = (2.0 * raw[Motor::EmfConstant.at()], 2.0 * (raw[Motor::WindingResistance.at()] + raw[Inverter::OnResistance.at()]));
    step_limit(
        &mut out,
        "low.step",
        dt,
        raw[Motor::Inertia.at()] * r / (k * k),
        "electromechanical pole (2 k)^2 / (R J) of motor.emf_constant and motor.inertia",
    );
    out
}
