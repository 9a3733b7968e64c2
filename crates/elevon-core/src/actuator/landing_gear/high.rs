//! Switching model: three phases, a bridge whose legs are chopped to ZERO, diodes; speeds on a coarser step.

use super::body::{Body, Constants, Structure, E_COPPER, E_INVERTER};
use super::layout::*;
use super::signals::{Quantity as Q, ALL};
use super::Fidelity;
use crate::actuator::{Finding, Inputs, Observation};
use crate::inverter::bridge::{extinguish, Bridge, BridgeState, BridgeStructure, InverterParameter, Windings, INVERTER};
use crate::inverter::six_step::{self, SixStepParameter};
use crate::kept;
use crate::scalar::Scalar;
use crate::three;
use crate::time::Steps;
use crate::variable::Signal;

/// The switching model of the landing-gear actuator.
#[derive(Clone)]
pub struct High;

#[derive(Clone, Debug)]
pub struct Model<S> {
    c: Constants<S>,
    bridge: Bridge<S>,
    per_torque_steps: S,
    mechanical: Steps,
}

#[derive(Clone, Debug)]
pub struct State<S> {
    body: Body<S>,
    current: [S; 3],
    legs: [S; 3],
    bridge: BridgeState<S>,
    /// Carrier count until which the legs stay off after the current cut-off.
    cut: S,
    /// Sum of the torque since the last mechanical step.
    torque: S,
    voltage: [S; 3],
}

kept!(State<f64> as State { body, current, legs, bridge, cut, torque, voltage });

/// A part of an electrical step with the legs as they are.
#[derive(Clone, Copy)]
struct Part<S> {
    current: [S; 3],
    voltage: [S; 3],
    /// Times the part's length: charge from the upper rail, angular momentum, losses.
    charge: S,
    impulse: S,
    copper: S,
    inverter: S,
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn part<S: Scalar>(
    m: &Model<S>,
    structure: &BridgeStructure,
    s: &mut State<S>,
    legs: [S; 3],
    k: [S; 3],
    resistance: [S; 3],
    dt: S,
    start: [S; 3],
) -> Part<S> {
    let half = S::splat(0.5);
    let zero = S::zero();
    let half_supply = half * s.body.link;
    let speed = s.body.motion.motor_speed;
    let i = start;
    let emf: [S; 3] = three!(|j| k[j] * speed);
    let windings = Windings { current: i, emf, per_inductance: m.c.star.per_inductance, resistance, open: m.c.star.open };
    let connection = m.bridge.connect(&mut s.bridge, structure, s.legs, legs, half_supply, &windings, dt);
    let state = connection.legs;
    let all = state.connected[0] & state.connected[1] & state.connected[2];
    let plain = m.c.star.neutral(three!(|j| (-resistance[j]).fma(i[j], state.voltage[j] - emf[j])));
    let neutral = connection.loose.map_or(plain, |loose| S::select(all, plain, loose));
    s.legs = legs;
    let terminal: [S; 3] = three!(|j| S::select(state.connected[j], state.voltage[j], neutral + emf[j]));
    let free: [S; 3] = three!(|j| {
        let slope = (terminal[j] - neutral - emf[j] - resistance[j] * i[j]) * m.c.star.per_inductance[j];
        dt.fma(slope, i[j])
    });
    let current = extinguish(&state, i, free);
    // A phase that stopped conducting within the part conducted for a share of it.
    let tiny = S::splat(1e-30);
    let middle: [S; 3] = three!(|j| {
        let whole = free[j] - i[j];
        let share = S::select(
            whole.abs().lt(tiny),
            S::one(),
            ((current[j] - i[j]) / S::select(whole.abs().lt(tiny), S::one(), whole)).clamp(zero, S::one()),
        );
        half * (i[j] + current[j]) * share
    });
    let mut out = Part { current, voltage: three!(|j| terminal[j] - neutral), charge: zero, impulse: zero, copper: zero, inverter: zero };
    for j in 0..3 {
        out.charge = out.charge + S::select(zero.lt(state.rail[j]), dt * middle[j], zero);
        out.impulse = out.impulse + dt * k[j] * middle[j];
        out.copper = out.copper + dt * resistance[j] * middle[j] * middle[j];
        out.inverter = out.inverter + dt * (state.rail[j] - terminal[j]) * middle[j];
    }
    out
}

#[inline(always)]
fn electric<S: Scalar>(m: &Model<S>, structure: &Structure, s: &mut State<S>, source: S, t: S) {
    let zero = S::zero();
    let dt = m.c.dt;
    let (k, _) = m.c.coupling(structure, s.body.motion.motor_position);
    let k = m.c.star.under_load(k, s.current);
    let resistance = m.c.resistance();
    let carrier = m.c.modulator.carrier(t);
    let duty = m.c.duty(&s.body);
    s.cut = m.c.modulator.cut(s.cut, carrier, s.current);
    let uncut = s.cut.le(carrier);
    let short = S::splat(0.5).lt(s.body.short);
    let live = S::splat(0.5).lt(s.body.driving) & uncut & !short;
    let on = S::select(live, m.c.modulator.on_fraction(carrier, dt, duty), zero);
    let wanted = six_step::demand(s.body.hall.code);
    let sign = s.body.demand.sign();
    let armed = zero.lt(on) & !short;
    let gated: [S; 3] = three!(|j| wanted[j] * sign);
    let chopped = six_step::chopped(structure.chopping, gated);
    let idle: [S; 3] = three!(|j| S::select(live, chopped[j], zero));
    let low: [S; 3] = three!(|j| S::select(short & uncut, -S::one(), idle[j]));
    let legs: [S; 3] = three!(|j| S::select(armed, gated[j], low[j]));
    let split = armed & on.lt(S::one());
    let first = S::select(split, on * dt, dt);
    let start = s.current;
    let mut whole = part(m, &structure.bridge, s, legs, k, resistance, first, start);
    if S::any(split) {
        let blanking = s.bridge;
        let kept = s.legs;
        let off = three!(|j| S::select(split, chopped[j], legs[j]));
        let second = part(m, &structure.bridge, s, off, k, resistance, dt - first, whole.current);
        s.bridge.keep(split, &blanking);
        s.legs = three!(|j| S::select(split, chopped[j], kept[j]));
        let add = |a: S, b: S| S::select(split, a + b, a);
        whole.current = three!(|j| S::select(split, second.current[j], whole.current[j]));
        whole.voltage = three!(|j| S::select(split, second.voltage[j], whole.voltage[j]));
        whole.charge = add(whole.charge, second.charge);
        whole.impulse = add(whole.impulse, second.impulse);
        whole.copper = add(whole.copper, second.copper);
        whole.inverter = add(whole.inverter, second.inverter);
    }
    s.current = whole.current;
    s.voltage = whole.voltage;
    s.torque = s.torque + whole.impulse;
    let size = S::splat(0.5) * (s.current[0].abs() + s.current[1].abs() + s.current[2].abs());
    Constants::meter(&mut s.body, whole.impulse.signed(size));
    if structure.accounts {
        s.body.energy[E_COPPER] = s.body.energy[E_COPPER] + whole.copper;
        s.body.energy[E_INVERTER] = s.body.energy[E_INVERTER] + whole.inverter;
    }
    m.c.feed(&mut s.body, source, whole.charge / dt, structure.accounts);
}

#[inline(always)]
fn step<S: Scalar>(m: &Model<S>, structure: &Structure, inputs: &Inputs<S>, s: &mut State<S>, k: Steps) {
    let t = S::splat(k as f64) * m.c.dt;
    let source = m.c.source(inputs, t);
    electric(m, structure, s, source, t);
    m.c.turn(&mut s.body, t);
    if (k + 1).is_multiple_of(m.mechanical) {
        let torque = s.torque * m.per_torque_steps;
        let acting = m.c.acting(&s.body, inputs, torque, t);
        m.c.mechanics.kick(&mut s.body.motion, &acting, structure.rig);
        s.torque = S::zero();
    }
}

/// The bridge's parameters; shorted terminals are what three lower switches shorted together are.
fn terminals<S: Scalar>(raw: &[S]) -> [S; INVERTER.len()] {
    let mut inverter = [S::zero(); INVERTER.len()];
    inverter.copy_from_slice(Raw(raw).inverter());
    let shorted = S::indicator(S::splat(0.5).le(raw[SixStepParameter::TerminalsShorted.at()]));
    for low in [InverterParameter::ShortedALow, InverterParameter::ShortedBLow, InverterParameter::ShortedCLow] {
        inverter[low as usize] = inverter[low as usize].maximum(shorted);
    }
    inverter
}

impl Fidelity for High {
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    fn signals() -> &'static [Signal] {
        ALL
    }
    fn step(raw: &[f64]) -> f64 {
        raw[SolverParameter::Step.at()]
    }
    fn check(raw: &[f64]) -> Vec<Finding> {
        super::checks::high(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure, plain: Vec<Vec<f64>>) -> Model<S> {
        let dt = raw[SolverParameter::Step.at()];
        let mechanical = raw[SolverParameter::MechanicalStep.at()];
        Model {
            c: Constants::derive(raw, structure, plain, dt, mechanical),
            bridge: Bridge::derive(&terminals(raw)),
            per_torque_steps: S::one() / mechanical,
            mechanical: ((mechanical.lane(0) / dt.lane(0)).round() as Steps).max(1),
        }
    }
    fn constants<S: Scalar>(model: &Model<S>) -> &Constants<S> {
        &model.c
    }
    fn plain<S: Scalar>(model: &mut Model<S>) -> Vec<Vec<f64>> {
        std::mem::take(&mut model.c.raw)
    }
    fn body<S: Scalar>(state: &State<S>) -> &Body<S> {
        &state.body
    }
    fn body_mut<S: Scalar>(state: &mut State<S>) -> &mut Body<S> {
        &mut state.body
    }

    fn start<S: Scalar>(body: Body<S>) -> State<S> {
        let zero = S::zero();
        State { body, current: [zero; 3], legs: [zero; 3], bridge: BridgeState::initial(), cut: zero, torque: zero, voltage: [zero; 3] }
    }
    #[inline(always)]
    fn advance<S: Scalar>(model: &Model<S>, structure: &Structure, inputs: &Inputs<S>, state: &mut State<S>, k: Steps) {
        step(model, structure, inputs, state, k);
    }
    /// Positive where the bridge has given up.
    fn tripped<S: Scalar>(state: &State<S>) -> S {
        state.bridge.tripped
    }
    fn current<S: Scalar>(state: &State<S>) -> S {
        state.current[0].abs() + state.current[1].abs() + state.current[2].abs()
    }

    fn observe<S: Scalar>(x: Observation<'_, Structure, Model<S>, State<S>, S>) {
        let Observation { structure, model: m, inputs, state: s, t, out, .. } = x;
        let (k, _) = m.c.coupling(structure, s.body.motion.motor_position);
        let torque = m.c.star.saturate(m.c.star.torque(k, s.current));
        m.c.observe(structure, inputs, &s.body, torque, t, out);
        let half = S::splat(0.5);
        let size = half * Self::current(s);
        out[Q::CurrentLine as usize] = torque.signed(size);
        let mut magnetic = S::zero();
        for j in 0..3 {
            out[Q::CurrentA as usize + j] = s.current[j];
            out[Q::VoltageA as usize + j] = s.voltage[j];
            out[Q::EmfA as usize + j] = k[j] * s.body.motion.motor_speed;
            magnetic = magnetic + half * s.current[j] * s.current[j] / m.c.star.per_inductance[j];
        }
        out[Q::EnergyMagnetic as usize] = magnetic;
    }
}
