//! Reduced-order model: the conducting pair as one circuit, its current averaged over a carrier period, continuous or not;
//! the commutations as a resistance that grows with speed.

mod current;
mod handover;
mod pair;

use self::current::{braked_power, mean_current, shorted_current, third_current, Lag};
use self::handover::{hand_over, handed_over, Handover};
use self::pair::pair;
use super::body::{Body, Constants, Structure, E_COPPER, E_INVERTER};
use super::layout::*;
use super::signals::{Quantity as Q, ALL, PHASES};
use super::Fidelity;
use crate::actuator::{Finding, Inputs, Observation};
use crate::inverter::bridge::InverterParameter;
use crate::inverter::six_step::{self, Chopping, SixStepParameter};
use crate::kept;
use crate::scalar::Scalar;
use crate::three;
use crate::time::Steps;
use crate::variable::Signal;

/// The reduced-order model of the landing-gear actuator.
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

#[derive(Clone, Debug)]
pub struct State<S> {
    body: Body<S>,
    current: S,
    /// With the half of the third phase's current in it.
    line: S,
    torque: S,
    /// 1 once the drive has tripped.
    tripped: S,
    handover: Handover<S>,
}

kept!(State<f64> as State { body, current, line, torque, tripped, handover });

#[inline(always)]
fn step<S: Scalar>(m: &Model<S>, structure: &Structure, inputs: &Inputs<S>, s: &mut State<S>, k: Steps) {
    let dt = m.c.dt;
    let t = S::splat(k as f64) * dt;
    let one = S::one();
    let source = m.c.source(inputs, t);
    let p = pair(m, structure, s).weakened(&m.c.star, s.current);
    let zero = S::zero();
    let half = S::splat(0.5);
    let duty = m.c.duty(&s.body) * s.body.driving * (one - s.body.short);
    let mut current = mean_current(m, structure.chopping, &p, s, duty * (one - s.tripped));
    let shorted = m.terminals.maximum(s.body.short * (one - s.tripped));
    let short = half.lt(shorted) & half.lt(p.closed);
    let mut chopped = S::mask(false);
    if S::any(short) {
        let inductance = S::select(zero.lt(p.inductance), p.inductance, one);
        let lag = Lag { share: (dt * p.resistance / inductance).minimum(one), from: s.current };
        let windings = shorted_current(m, &p, &s.body);
        chopped = windings.chopped;
        current = S::select(short, lag.to(windings.line), current);
    }
    if structure.shorted {
        // Driving into shorted terminals is a short of the link.
        s.tripped = S::select(half.lt(m.terminals) & zero.lt(duty), one, s.tripped);
    }
    // What decays to nothing is nothing: numbers without full precision are slow.
    s.current = S::select(current.abs().lt(S::splat(1e-30)), zero, current);
    let i = s.current;
    // Half of the third phase's current comes from each of the pair; it brakes.
    let (mut line, mut third_torque) = (i, zero);
    if structure.chopping == Chopping::LowSide {
        let third = third_current(m, &p, &s.body, duty * (one - s.tripped));
        line = i + i.signed(S::select(short, zero, half * third.shared + third.alone));
        third_torque = S::select(short, zero, third.shared * p.emf_shared + third.alone * p.emf_alone);
    }
    s.line = line;
    Constants::meter(&mut s.body, line);
    let square = i * i;
    let outgoing = handed_over(m, structure.chopping, &p, s, duty, i);
    let driving = p.constant * i - S::select(short, zero, p.handed * outgoing);
    s.torque = m.c.star.saturate(driving - third_torque);
    let speed = s.body.motion.motor_speed;
    let drop = match structure.chopping {
        Chopping::LowSide => m.diode_drop,
        Chopping::Both => m.diode_drop + m.diode_drop,
    };
    let mut winding = p.winding * square;
    let mut drops = i.abs() * (one - duty) * drop + (p.resistance - p.winding) * square + third_torque * speed;
    let mut drawn = (driving - third_torque) * speed + winding + drops;
    if S::any(short) {
        let braked = braked_power(m, &p, s, chopped);
        winding = S::select(short, braked.copper, winding);
        drops = S::select(short, braked.drops, drops);
        drawn = S::select(short, braked.drawn, drawn);
    }
    let bus = drawn / s.body.link.maximum(one);
    if structure.accounts {
        s.body.energy[E_COPPER] = s.body.energy[E_COPPER] + dt * winding;
        s.body.energy[E_INVERTER] = s.body.energy[E_INVERTER] + dt * drops;
    }
    m.c.feed(&mut s.body, source, bus, structure.accounts);
    let acting = m.c.acting(&s.body, inputs, s.torque, t);
    m.c.mechanics.kick(&mut s.body.motion, &acting, structure.rig);
    m.c.turn(&mut s.body, t);
    hand_over(s);
}

impl Fidelity for Low {
    type Model<S: Scalar> = Model<S>;
    type State<S: Scalar> = State<S>;

    fn signals() -> &'static [Signal] {
        &ALL[..PHASES]
    }
    fn step(raw: &[f64]) -> f64 {
        raw[LowParameter::Step.at()]
    }
    fn check(raw: &[f64]) -> Vec<Finding> {
        super::checks::low(raw)
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Structure, plain: Vec<Vec<f64>>) -> Model<S> {
        let dt = raw[LowParameter::Step.at()];
        let c = Constants::derive(raw, structure, plain, dt, dt);
        Model {
            on_resistance: raw[InverterParameter::OnResistance.at()],
            diode_drop: raw[InverterParameter::DiodeDrop.at()],
            inductance: three!(|j| S::one() / c.star.per_inductance[j]),
            commutation: raw[LowParameter::CommutationFactor.at()] * c.star.pole_pairs,
            terminals: S::indicator(S::splat(0.5).le(raw[SixStepParameter::TerminalsShorted.at()])),
            c,
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
        let handover = Handover { outgoing: zero, demand: six_step::demand(body.hall.code), change: [zero; 3] };
        State { body, current: zero, line: zero, torque: zero, tripped: zero, handover }
    }
    #[inline(always)]
    fn advance<S: Scalar>(model: &Model<S>, structure: &Structure, inputs: &Inputs<S>, state: &mut State<S>, k: Steps) {
        step(model, structure, inputs, state, k);
    }
    fn tripped<S: Scalar>(state: &State<S>) -> S {
        state.tripped
    }
    fn current<S: Scalar>(state: &State<S>) -> S {
        state.current
    }

    fn observe<S: Scalar>(x: Observation<'_, Structure, Model<S>, State<S>, S>) {
        let Observation { structure, model: m, inputs, state: s, t, out, .. } = x;
        m.c.observe(structure, inputs, &s.body, s.torque, t, out);
        out[Q::CurrentLine as usize] = s.line;
        out[Q::EnergyMagnetic as usize] = S::splat(0.5) * pair(m, structure, s).inductance * s.current * s.current;
    }
}
