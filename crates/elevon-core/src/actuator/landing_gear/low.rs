//! Low fidelity: the conducting pair as one circuit, its current averaged over a carrier period, continuous or not;
//! the commutations as a resistance that grows with speed.

use super::body::{Body, Constants, Structure, E_COPPER, E_INVERTER};
use super::layout::*;
use super::signals::{Quantity as Q, ALL, PHASES};
use super::LandingGear;
use crate::actuator::{Finding, Inputs, Setup, Signals, Tick, Watch, Wiring, WATCHED};
use crate::control::pi_rate::PiRateParameter;
use crate::inverter::bridge::InverterParameter;
use crate::inverter::six_step::{self, Chopping, SixStepParameter};
use crate::scalar::Scalar;
use crate::three;
use crate::time::Steps;
use crate::variable::Signal;

/// The landing-gear actuator at low fidelity.
#[derive(Clone)]
pub struct Low;

#[derive(Clone, Debug)]
pub struct Model<S> {
    c: Constants<S>,
    on_resistance: S,
    diode_drop: S,
    inductance: [S; 3],
    /// Commutation resistance per motor speed and inductance: c p.
    commutation: S,
    /// 1 while the motor's terminals are shorted.
    terminals: S,
}

/// Fundamental of a trapezoid with flats of 120 degrees over its top: (4/pi) sin(30 deg)/(pi/6).
const FUNDAMENTAL: f64 = 1.215_854_203_708_053_3;

#[derive(Clone, Debug)]
pub struct State<S> {
    body: Body<S>,
    current: S,
    /// With the half of the third phase's current in it.
    line: S,
    torque: S,
    /// 1 once the drive has tripped.
    tripped: S,
}

/// The conducting pair in series.
#[derive(Clone, Copy)]
struct Pair<S> {
    constant: S,
    winding: S,
    resistance: S,
    inductance: S,
    closed: S,
    /// Coefficient of the phase that is not used less the mean of those that are; none of an interrupted phase.
    beside: S,
    /// The same less that of the HIGH leg's.
    apart: S,
}

#[inline(always)]
fn pair<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>) -> Pair<S> {
    let (k, _) = m.c.coupling(structure, s.body.motion.motor_position);
    let resistance = m.c.resistance();
    let demand = six_step::demand(s.body.hall.code);
    let zero = S::zero();
    let way = s.body.demand.signed(S::one());
    let mut pair = Pair { constant: zero, winding: zero, resistance: zero, inductance: zero, closed: zero, beside: zero, apart: zero };
    let (mut open, mut spare) = (zero, zero);
    for j in 0..3 {
        let used = demand[j].abs();
        pair.constant = pair.constant + demand[j] * k[j];
        pair.winding = pair.winding + used * resistance[j];
        pair.inductance = pair.inductance + used * m.inductance[j];
        let cut = S::indicator(S::splat(0.5).le(m.c.star.open[j]));
        open = open + used * cut;
        pair.beside = pair.beside + S::select(S::splat(0.5).lt(used), S::splat(-0.5) * k[j], k[j]);
        let high = S::indicator(S::splat(0.5).lt(demand[j] * way));
        pair.apart = pair.apart + (S::one() - used - high) * k[j];
        spare = spare + (S::one() - used) * (S::one() - cut);
        pair.closed = pair.closed + used;
    }
    pair.resistance = pair.winding + m.on_resistance + m.on_resistance;
    pair.beside = pair.beside * spare;
    pair.apart = pair.apart * spare;
    pair.closed = S::indicator(S::splat(0.5).lt(pair.closed) & open.lt(S::splat(0.5)));
    pair
}

/// What the pair sees while the carrier is above the demand, against the current: with low-side chopping one diode, else the
/// link and two of them.
#[inline(always)]
fn against<S: Scalar>(m: &Model<S>, chopping: Chopping, link: S) -> S {
    match chopping {
        Chopping::LowSide => m.diode_drop,
        Chopping::Both => link + m.diode_drop + m.diode_drop,
    }
}

/// The pair's L di/dt = V - R i over a step, the commutations a part of R: share of the way to V/R.
#[derive(Clone, Copy)]
struct Lag<S> {
    share: S,
    from: S,
}

impl<S: Scalar> Lag<S> {
    #[inline(always)]
    fn to(&self, settled: S) -> S {
        self.share.fma(settled - self.from, self.from)
    }
}

/// Mean current over a carrier period after a step (`docs/theory/landing-gear.md`). The continuous current lags, and decays
/// towards what its circuit drives back; the pulses, which start from none in each period, do not.
#[inline(always)]
fn mean_current<S: Scalar>(m: &Model<S>, chopping: Chopping, p: &Pair<S>, body: &State<S>, duty: S) -> S {
    let (zero, one) = (S::zero(), S::one());
    let s = &body.body;
    let speed = s.motion.motor_speed;
    let emf = p.constant * speed;
    let link = s.link;
    let inductance = S::select(zero.lt(p.inductance), p.inductance, one);
    let resistance = S::select(zero.lt(p.resistance), p.resistance, one) + m.commutation * speed.abs() * (S::splat(0.5) * inductance);
    // The diodes rectify an EMF above the link, which no switch can cut off.
    let excess = (emf.abs() - (link + m.diode_drop + m.diode_drop)).maximum(zero);
    let passive = -(emf.signed(excess) / resistance);
    let sign = s.demand.signed(one);
    let along = sign * emf;
    let share = (m.c.dt * resistance / inductance).minimum(one);
    let lag = Lag { share, from: sign * body.current };
    let off = against(m, chopping, link);
    let (rise, fall) = (link - along, off + along);
    let usable = zero.lt(rise) & zero.lt(fall);
    let safe_fall = S::select(usable, fall, one);
    let safe_rise = S::select(usable, rise, zero);
    let boundary = safe_fall / (safe_rise + safe_fall);
    let gap = duty.minimum(boundary);
    let pulsed = S::splat(0.5) * gap * gap * m.c.modulator.period / inductance * safe_rise * (one + safe_rise / safe_fall);
    let continuous = (duty * link - (one - duty) * off - along) / resistance;
    let plugging = match chopping {
        // The EMF drives its current on through the HIGH leg.
        Chopping::LowSide => continuous,
        Chopping::Both => (duty * link - along) / resistance,
    };
    // An EMF above the link drives a current back through the closed switches.
    let back = duty * rise / resistance;
    let forced = S::select(zero.lt(duty), S::select(rise.le(zero), back, plugging), zero);
    let settled = S::select(usable, pulsed.maximum(continuous), forced);
    let reached = S::select(usable, pulsed.maximum(lag.to(continuous)), lag.to(forced));
    let cut = settled.clamp_abs(m.c.cutoff) * sign;
    let braking = passive.signed(passive.abs().maximum((cut * passive.sign()).maximum(zero)));
    let rectified = S::select(zero.lt(cut * passive), braking, cut + passive);
    let rectified = share.fma(rectified - body.current, body.current);
    S::select(passive.equals(zero), reached.clamp_abs(m.c.cutoff) * sign, rectified) * p.closed
}

/// Share of a carrier period in which the pair, switched off, still carries current (low-side chopping): its pulse falls to
/// none before the next, or the EMF drives it on.
#[inline(always)]
fn freewheels<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &Body<S>, duty: S) -> S {
    let (zero, one) = (S::zero(), S::one());
    let along = s.demand.signed(one) * p.constant * s.motion.motor_speed;
    let (rise, fall) = ((s.link - along).maximum(zero), m.diode_drop + along);
    let off = one - duty;
    let lasts = (duty * rise / S::select(zero.lt(fall), fall, one)).minimum(off);
    S::select(zero.lt(fall), lasts, off)
}

/// Mean currents of the phase that is not used: beside the pair, and alone with the HIGH leg.
struct Third<S> {
    shared: S,
    alone: S,
}

/// With low-side chopping the pair lies at the upper rail while it freewheels; an EMF above the pair's by half a diode then
/// drives a current through the third phase's diode, x = e_3 - (e_1 + e_2)/2 - V_f/2 over 3/2 L. Once the pair's own has ended
/// the HIGH leg is left, e_3 - e_1 - V_f over 2 L; while the pair is on it falls by (V + V_f)/2 - x over 3/2 L.
#[inline(always)]
fn third_current<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &Body<S>, duty: S) -> Third<S> {
    let (zero, half, one) = (S::zero(), S::splat(0.5), S::one());
    let inductance = S::select(zero.lt(p.inductance), p.inductance, one);
    let per_volt = m.c.modulator.period / inductance;
    let speed = s.motion.motor_speed;
    let excess = (p.beside * speed - half * m.diode_drop).maximum(zero);
    let against = (half * (s.link + m.diode_drop) - excess).maximum(S::splat(1e-3) * s.link.maximum(one));
    let rise = S::splat(4.0 / 3.0) * per_volt * excess;
    let fall = S::splat(4.0 / 3.0) * per_volt * against;
    let drift = per_volt * (p.apart * speed - m.diode_drop);
    let off = freewheels(m, p, s, duty);
    let floats = (one - duty - off).maximum(zero);
    let peak = rise * off;
    let dies = drift.lt(zero);
    let lasts = S::select(dies, (peak / S::select(dies, -drift, one)).minimum(floats), floats);
    let last = (peak + drift * lasts).maximum(zero);
    let falls = (last / fall).minimum(duty);
    let conducts = p.closed * S::indicator(zero.lt(duty));
    Third { shared: conducts * (half * peak * off + falls * (last - half * fall * falls)), alone: conducts * half * (peak + last) * lasts }
}

/// Line current that gives the mean torque of the windings shorted by the low switches: 3/2 k_1^2 w R/(R^2 + (p w L)^2)
/// with the fundamental k_1 of the EMF, up to the current cut-off.
#[inline(always)]
fn shorted_current<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &Body<S>) -> S {
    let (half, one) = (S::splat(0.5), S::one());
    let constant = S::select(p.constant.equals(S::zero()), one, p.constant);
    let fundamental = S::splat(FUNDAMENTAL * 0.5) * constant;
    let resistance = half * p.resistance;
    let speed = s.motion.motor_speed;
    let reactance = m.c.star.pole_pairs * speed * (half * p.inductance);
    let impedance = resistance * resistance + reactance * reactance;
    let torque = S::splat(1.5) * fundamental * fundamental * speed * resistance / impedance;
    // No cut-off opens a short across the terminals.
    let limit = S::select(half.lt(m.terminals), S::splat(1e9), m.c.cutoff);
    -(torque / constant).clamp_abs(limit)
}

#[inline(always)]
fn step<S: Scalar>(m: &Model<S>, structure: &Structure, inputs: &Inputs<S>, s: &mut State<S>, k: Steps) {
    let dt = m.c.dt;
    let t = S::splat(k as f64) * dt;
    let one = S::one();
    let source = m.c.source(inputs, t);
    let p = pair(m, structure, s);
    let zero = S::zero();
    let half = S::splat(0.5);
    let duty = m.c.duty(&s.body) * s.body.driving * (one - s.body.short);
    let mut current = mean_current(m, structure.chopping, &p, s, duty * (one - s.tripped));
    let shorted = m.terminals.maximum(s.body.short * (one - s.tripped));
    let short = half.lt(shorted) & half.lt(p.closed);
    if S::any(short) {
        let inductance = S::select(zero.lt(p.inductance), p.inductance, one);
        let lag = Lag { share: (dt * p.resistance / inductance).minimum(one), from: s.current };
        current = S::select(short, lag.to(shorted_current(m, &p, &s.body)), current);
    }
    if structure.shorted {
        // Driving into shorted terminals is a short of the link.
        s.tripped = S::select(half.lt(m.terminals) & zero.lt(duty), one, s.tripped);
    }
    // What decays to nothing is nothing: numbers without full precision are slow.
    s.current = S::select(current.abs().lt(S::splat(1e-30)), zero, current);
    let i = s.current;
    // Half of the third phase's current comes from each of the pair; it brakes.
    let (mut line, mut dragged) = (i, zero);
    if structure.chopping == Chopping::LowSide {
        let third = third_current(m, &p, &s.body, duty * (one - s.tripped));
        line = i + i.signed(S::select(short, zero, half * third.shared + third.alone));
        dragged = S::select(short, zero, third.shared * p.beside + third.alone * p.apart);
    }
    s.line = line;
    Constants::meter(&mut s.body, line);
    let square = i * i;
    s.torque = m.c.star.saturate(p.constant * i - dragged);
    let speed = s.body.motion.motor_speed;
    let drop = match structure.chopping {
        Chopping::LowSide => m.diode_drop,
        Chopping::Both => m.diode_drop + m.diode_drop,
    };
    let mut winding = p.winding * square;
    let mut drops = i.abs() * (one - duty) * drop + (p.resistance - p.winding) * square + dragged * speed;
    let mut drawn = (p.constant * i - dragged) * speed + winding + drops;
    if S::any(short) {
        // All that a shorted winding brakes becomes heat in its own circuit.
        let heat = -(p.constant * speed * i);
        let share = p.winding / S::select(zero.lt(p.resistance), p.resistance, one);
        winding = S::select(short, heat * share, winding);
        drops = S::select(short, heat * (one - share), drops);
        drawn = S::select(short, zero, drawn);
    }
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

    type Machine = LandingGear;
    const INITIAL: &'static [&'static str] = super::INITIAL;

    fn signals() -> &'static [Signal] {
        &ALL[..PHASES]
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
            terminals: S::indicator(S::splat(0.5).le(raw[SixStepParameter::TerminalsShorted.at()])),
            c,
        }
    }

    fn start<S: Scalar>(model: &Model<S>, raw: &[S], initial: &[S]) -> State<S> {
        State { body: model.c.start(raw, initial), current: S::zero(), line: S::zero(), torque: S::zero(), tripped: S::zero() }
    }

    fn tick<S: Scalar>(
        _kind: u8,
        structure: &Structure,
        m: &Model<S>,
        inputs: &Inputs<S>,
        s: &mut State<S>,
        t: S,
        noise: &mut dyn FnMut(u64) -> S,
    ) {
        m.c.tick(structure, &mut s.body, inputs, t, s.tripped, noise);
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

    fn observe<S: Scalar>(structure: &Structure, m: &Model<S>, inputs: &Inputs<S>, s: &State<S>, t: S, _asked: Signals, out: &mut [S]) {
        m.c.observe(structure, inputs, &s.body, s.torque, t, out);
        out[Q::CurrentLine as usize] = s.line;
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
