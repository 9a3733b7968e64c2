//! Low fidelity: the conducting pair as one circuit, its current averaged over a carrier period, continuous or not;
//! the commutations as a resistance that grows with speed.

use super::body::{Body, Constants, Structure, E_COPPER, E_INVERTER};
use super::layout::*;
use super::signals::{Quantity as Q, ALL, PHASES};
use crate::actuator::{Finding, Inputs, Port, Setup, Tick, Watch, Wiring, WATCHED};
use crate::control::pi_rate::PiRateParameter;
use crate::fault::FaultKind;
use crate::inverter::bridge::InverterParameter;
use crate::inverter::six_step;
use crate::scalar::Scalar;
use crate::three;
use crate::time::Steps;
use crate::variable::{Group, Signal};

/// The landing-gear actuator at low fidelity.
pub struct Low;

#[derive(Clone, Debug)]
pub struct Model<S> {
    c: Constants<S>,
    on_resistance: S,
    diode_drop: S,
    inductance: [S; 3],
    /// Commutation resistance per motor speed and inductance: c p.
    commutation: S,
}

#[derive(Clone, Debug)]
pub struct State<S> {
    body: Body<S>,
    current: S,
    torque: S,
}

/// The conducting pair in series.
#[derive(Clone, Copy)]
struct Pair<S> {
    constant: S,
    winding: S,
    resistance: S,
    inductance: S,
    closed: S,
}

#[inline(always)]
fn pair<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>) -> Pair<S> {
    let (k, _) = m.c.coupling(structure, s.body.motion.motor_position);
    let resistance = m.c.resistance();
    let demand = six_step::demand(s.body.hall.code);
    let zero = S::zero();
    let mut pair = Pair { constant: zero, winding: zero, resistance: zero, inductance: zero, closed: zero };
    let mut open = zero;
    for j in 0..3 {
        let used = demand[j].abs();
        pair.constant = pair.constant + demand[j] * k[j];
        pair.winding = pair.winding + used * resistance[j];
        pair.inductance = pair.inductance + used * m.inductance[j];
        open = open + used * S::indicator(S::splat(0.5).lt(m.c.star.open[j]));
        pair.closed = pair.closed + used;
    }
    pair.resistance = pair.winding + m.on_resistance + m.on_resistance;
    pair.closed = S::indicator(S::splat(0.5).lt(pair.closed) & open.lt(S::splat(0.5)));
    pair
}

/// Mean current over a carrier period (`docs/theory/landing-gear.md`).
#[inline(always)]
fn mean_current<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &Body<S>, duty: S) -> S {
    let (zero, one) = (S::zero(), S::one());
    let speed = s.motion.motor_speed;
    let emf = p.constant * speed;
    let link = s.link;
    let two_drops = m.diode_drop + m.diode_drop;
    let inductance = S::select(zero.lt(p.inductance), p.inductance, one);
    let resistance = S::select(zero.lt(p.resistance), p.resistance, one) + m.commutation * speed.abs() * (S::splat(0.5) * inductance);
    let rail = link + two_drops;
    let excess = (emf.abs() - rail).maximum(zero);
    let passive = -(emf.signed(excess) / resistance);
    let sign = s.demand.signed(one);
    let along = sign * emf;
    let (rise, fall) = (link - along, rail + along);
    let usable = zero.lt(rise) & zero.lt(fall);
    let safe_fall = S::select(usable, fall, one);
    let safe_rise = S::select(usable, rise, zero);
    let boundary = safe_fall / (safe_rise + safe_fall);
    let gap = duty.minimum(boundary);
    let pulsed = S::splat(0.5) * gap * gap * m.c.modulator.period / inductance * safe_rise * (one + safe_rise / safe_fall);
    let continuous = (duty * link - (one - duty) * rail - along) / resistance;
    let driven = S::select(boundary.lt(duty), pulsed.maximum(continuous), pulsed) * sign;
    let both = driven + S::select(zero.lt(driven * emf), passive, zero);
    let plugging = (sign * link * duty - emf) / resistance;
    let idle = rise.le(zero) | duty.le(zero);
    let active = S::select(idle, passive, S::select(fall.le(zero), plugging, both));
    active.clamp_abs(m.c.cutoff) * p.closed
}

#[inline(always)]
fn step<S: Scalar>(m: &Model<S>, structure: &Structure, inputs: &Inputs<S>, s: &mut State<S>, k: Steps) {
    let dt = m.c.dt;
    let t = S::splat(k as f64) * dt;
    let one = S::one();
    let source = m.c.source(inputs, t);
    let p = pair(m, structure, s);
    let duty = m.c.duty(&s.body) * s.body.driving;
    let target = mean_current(m, &p, &s.body, duty);
    let inductance = S::select(S::zero().lt(p.inductance), p.inductance, one);
    let follow = S::select(S::splat(0.5).lt(p.closed), (dt * p.resistance / inductance).minimum(one), one);
    s.current = follow.fma(target - s.current, s.current);
    let i = s.current;
    Constants::meter(&mut s.body, i);
    let square = i * i;
    s.torque = m.c.star.saturate(p.constant * i);
    let speed = s.body.motion.motor_speed;
    let winding = p.winding * square;
    let drops = i.abs() * (one - duty) * (m.diode_drop + m.diode_drop) + (p.resistance - p.winding) * square;
    let drawn = p.constant * speed * i + winding + drops;
    let bus = drawn / s.body.link.maximum(one);
    if structure.accounts {
        s.body.energy[E_COPPER] = s.body.energy[E_COPPER] + dt * winding;
        s.body.energy[E_INVERTER] = s.body.energy[E_INVERTER] + dt * drops;
    }
    m.c.feed(&mut s.body, source, bus, structure.accounts);
    let acting = m.c.acting(&s.body, inputs, s.torque, t);
    m.c.mechanics.kick(&mut s.body.motion, &acting, structure.rig);
    let before = s.body.motion.motor_position;
    m.c.mechanics.drift(&mut s.body.motion, dt);
    let angle = m.c.star.electrical_angle(s.body.motion.motor_position);
    let advance = (s.body.motion.motor_position - before) * m.c.star.pole_pairs;
    m.c.hall.observe(&mut s.body.hall, angle, advance, t + dt, dt);
}

impl Wiring for Low {
    type Structure = Structure;
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    const PORTS: &'static [Port] = PORTS;
    const INITIAL: &'static [&'static str] = super::INITIAL;
    const MODES: &'static [&'static str] = super::MODES;
    const ACTIONS: &'static [&'static str] = super::ACTIONS;

    fn groups() -> &'static [Group] {
        GROUPS
    }
    fn signals() -> &'static [Signal] {
        &ALL[..PHASES]
    }
    fn faults() -> Vec<FaultKind> {
        super::faults::catalogue()
    }
    fn step(raw: &[f64]) -> f64 {
        raw[LowParameter::Step.at()]
    }
    fn fault_grid(raw: &[f64]) -> f64 {
        raw[SolverParameter::FaultGrid.at()].max(raw[LowParameter::Step.at()])
    }
    fn structure(setup: &Setup) -> Structure {
        Structure::read(setup)
    }
    fn ticks(raw: &[f64], _structure: &Structure) -> Vec<Tick> {
        super::control_tick(raw[PiRateParameter::Period.at()], raw[LowParameter::Step.at()])
    }
    fn check(raw: &[f64]) -> Vec<Finding> {
        super::checks::low(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure) -> Model<S> {
        let dt = raw[LowParameter::Step.at()];
        let c = Constants::derive(raw, structure, dt, dt);
        Model {
            on_resistance: raw[InverterParameter::OnResistance.at()],
            diode_drop: raw[InverterParameter::DiodeDrop.at()],
            inductance: three!(|j| S::one() / c.star.per_inductance[j]),
            commutation: raw[LowParameter::CommutationFactor.at()] * c.star.pole_pairs,
            c,
        }
    }

    fn start<S: Scalar>(model: &Model<S>, raw: &[S], initial: &[S]) -> State<S> {
        State { body: model.c.start(raw, initial), current: S::zero(), torque: S::zero() }
    }

    fn tick<S: Scalar>(
        _kind: u8,
        _structure: &Structure,
        m: &Model<S>,
        inputs: &Inputs<S>,
        s: &mut State<S>,
        t: S,
        noise: &mut dyn FnMut(u64) -> S,
    ) {
        m.c.tick(&mut s.body, inputs, t, noise);
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
        for k in from..from + count {
            for ((model, inputs), state) in models.iter().zip(inputs).zip(states.iter_mut()) {
                step(model, structure, inputs, state, k);
            }
        }
    }

    fn observe<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, out: &mut [S]) {
        m.c.observe(structure, inputs, &s.body, s.torque, t, out);
        out[Q::CurrentLine as usize] = s.current;
        out[Q::EnergyMagnetic as usize] = S::splat(0.5) * pair(m, structure, s).inductance * s.current * s.current;
    }

    fn watch<S: Scalar>(s: &State<S>) -> [Watch<S>; WATCHED] {
        super::watch(&s.body, s.current)
    }
    fn tripped<S: Scalar>(s: &State<S>) -> S {
        s.body.tripped()
    }
    fn trip_reason<S: Scalar>(m: &Model<S>, s: &State<S>, lane: usize) -> Option<String> {
        m.c.trip_reason(&s.body, lane)
    }
}
