//! The controller of the reduced-order model: P, and PID whose derivative acts as inertia (docs/explanation/theory/low-fidelity.md, "The speed
//! derivative as inertia"); or one PID on the position. Jumps of the speed error pass the derivative's filter (`jump.rs`).

use super::model::{Model, State};
use super::structure::Structure;
use crate::actuator::servo::advance::Instant;
use crate::control::position_speed::{ErrorHold, Mode};
use crate::scalar::Scalar;
use crate::sensor::resolver::Reading;

/// What the controller demands before the derivative of the speed is known.
pub(super) struct Demand<S> {
    speed_ref: S,
    error: S,
    position_error: S,
    /// What the sensors report of the speed.
    speed: S,
    pub torque: S,
    /// Of jumps: what the torque limit cuts off them, N m s.
    cut: S,
}

/// Largest slope of the torque that the believed torque constant gives the bridge's voltage, N m/s.
#[inline(always)]
fn slew<S: Scalar>(m: &Model<S>, supply: S) -> S {
    m.drive.voltage_ratio * supply * m.drive.supply_scale / (m.cold[2] * m.control.per_torque_constant)
}

/// Commanded speed, within its limit, and what the command adds to it by the step's end: a torque that is held over the step
/// answers to what happens in it, not before it.
#[inline(always)]
fn speed_reference<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    [command, added]: [S; 2],
    position_error: S,
) -> [S; 2] {
    let c = &m.control;
    let demanded = match structure.control.mode {
        Mode::Position if structure.control.feedforward => {
            let ahead = c.position.ahead(&mut s.command, command);
            c.position.gain * position_error + ahead
        }
        Mode::Position => c.position.gain * position_error,
        Mode::Speed | Mode::Torque => command,
    };
    let rise = if structure.control.mode == Mode::Position { c.position.gain * added } else { added };
    let reference = demanded.clamp_abs(c.speed_limit);
    [reference, (demanded + rise).clamp_abs(c.speed_limit) - reference]
}

/// Change of the speed that the resolver reports on top of the shaft's acceleration, which is solved for.
#[inline(always)]
fn reading_deviation<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &mut State<S>, speed: S) -> S {
    if !(FULL && structure.sensing.resolver) {
        return S::zero();
    }
    let deviation = speed - s.jumps.reading - m.sensing.follows() * (s.shaft.motor_speed - s.jumps.motion);
    (s.jumps.reading, s.jumps.motion) = (speed, s.shaft.motor_speed);
    deviation
}

/// The controller's answer to a command and the sensors' readings.
#[inline(always)]
pub(super) fn demand<S: Scalar, const FULL: bool>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    x: &Instant<S>,
    position: S,
    reading: &Reading<S>,
) -> Demand<S> {
    let c = &m.control;
    let (zero, speed) = (S::zero(), reading.speed);
    let command = x.command + s.command_noise;
    let position_error = command - position;
    if structure.control.pid {
        return position_pid(m, structure, s, position_error, speed);
    }
    let [speed_ref, ahead] = speed_reference(m, structure, s, [command, x.next - x.command], position_error);
    let error = speed_ref - speed;
    let none = Demand { speed_ref, error, position_error, speed, torque: command, cut: zero };
    if structure.control.mode == Mode::Torque {
        return none;
    }
    let change = speed_ref - s.jumps.reference - reading_deviation::<S, FULL>(m, structure, s, speed);
    s.jumps.reference = speed_ref + ahead;
    let mut torque = c.speed_gain * error + s.integral;
    let mut cut = zero;
    if structure.control.derivative {
        let (smooth, jump) = c.jumps.split(&mut s.jumps, change);
        torque = torque + c.derivative_inertia * ((smooth + ahead) * c.per_dt);
        if S::any(!(jump.equals(zero) & s.jumps.level.equals(zero))) {
            let kick = c.jumps.pass(&mut s.jumps, jump, s.torque_limit, slew(m, x.supply));
            torque = torque + kick.torque;
            cut = kick.cut;
        }
    }
    Demand { torque, cut, ..none }
}

/// Steps the integrator, with the anti-windup of the switching model's PID.
#[inline(always)]
pub(super) fn integrate<S: Scalar>(m: &Model<S>, structure: &Structure, s: &mut State<S>, demand: &Demand<S>, unlimited: S) {
    let c = &m.control;
    s.speed_ref = demand.speed_ref;
    if !structure.integral {
        return;
    }
    let zero = S::zero();
    let mut change = c.integral_step * demand.error;
    if structure.control.conditional {
        change = S::select(s.torque_ref.equals(unlimited), change, zero);
    }
    if structure.control.back_calculation {
        let excess = (s.torque_ref - unlimited) / c.per_dt - demand.cut;
        change = c.back_calculation.fma(excess, change);
    }
    if structure.control.hold_at_rest {
        let at_rest = demand.speed.equals(zero);
        change = S::select(at_rest & zero.lt(s.rested), zero, change);
        s.rested = S::indicator(at_rest);
    }
    if structure.control.hold_on_error != ErrorHold::Off {
        let below = demand.position_error.abs().lt(c.threshold);
        let frozen = if structure.control.hold_on_error == ErrorHold::Below { below } else { !below };
        change = S::select(frozen, zero, change);
    }
    s.integral = s.integral + change;
}

/// What one PID makes of the position error.
#[inline(always)]
fn position_pid<S: Scalar>(m: &Model<S>, structure: &Structure, s: &mut State<S>, error: S, speed: S) -> Demand<S> {
    let c = &m.control;
    let mut torque = c.speed_gain.fma(error, s.integral);
    if structure.control.derivative {
        let known = s.filtered_error.equals(s.filtered_error);
        let difference = S::select(known, error - s.filtered_error, S::zero());
        s.filtered_error = c.derivative_decay.fma(difference, error - difference);
        torque = c.derivative_gain.fma(difference, torque);
    }
    Demand { speed_ref: S::zero(), error, position_error: error, speed, torque, cut: S::zero() }
}
