//! Relays that act at the instant of their crossing: the electrical step in two parts.
//!
//! The step is taken whole; where a relay's error is then beyond its threshold, the step is taken again up to the crossing
//! (on the straight line between the errors at both ends, exact to the order of the step), the relay turns, and the rest
//! follows. A second crossing within the same step is found at the begin of the next.

use super::electric::{Coupling, Detailed};
use super::model::{Model, State};
use super::shorted::discrete;
use super::step::{lose_switching, measured_current};
use crate::actuator::servo::details::Structure;
use crate::inverter::hysteresis::{count_transitions, crossing, six_step};
use crate::scalar::{Kernel, Scalar};
use crate::sensor::filter::low_pass;
use crate::three;

/// What the relays see at the begin of a step.
pub(crate) struct Seen<S> {
    pub error: [S; 3],
    /// Of the phase angles, and the rate of the rotor that they turn with.
    pub sines: [S; 3],
    pub cosines: [S; 3],
    pub rate: S,
}

/// Errors of the relays at the end of a step after which the currents are `current`: the reference goes on as it went.
#[inline(always)]
fn error_after<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>, current: [S; 3], x: &Seen<S>) -> [S; 3] {
    let mut after = *s;
    after.star.current = current;
    let mut measured = measured_current::<S, true, true>(m, structure, &after);
    if structure.current_filter {
        measured = three!(|j| low_pass(m.extra.closing, s.extra.sensed[j], measured[j]));
    }
    let turned = m.dt * m.star.pole_pairs * x.rate;
    let shape = if structure.six_step { six_step(x.sines) } else { three!(|j| turned.fma(x.cosines[j], x.sines[j])) };
    let mut reference = s.current_ref;
    if structure.control_every_step {
        reference = reference + (reference - s.extra.last_reference);
    }
    three!(|j| reference * shape[j] - measured[j])
}

/// As `electric_step`, in two parts where a relay crosses its threshold within the step. A function of its own: few runs need
/// it, and its copies of the state would slow the compilation of every step.
pub(crate) struct Located<'a, S: Scalar> {
    pub model: &'a Model<S>,
    pub structure: &'a Structure,
    pub state: &'a mut State<S>,
    pub coupling: &'a Coupling<S>,
    pub half_supply: S,
    pub old_legs: [S; 3],
    pub seen: Seen<S>,
}

impl<S: Scalar> Located<'_, S> {
    #[inline(never)]
    pub(crate) fn step(self) -> ([S; 3], [S; 3]) {
        S::vectorize(self)
    }
}

impl<S: Scalar> Kernel for Located<'_, S> {
    type Output = ([S; 3], [S; 3]);
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model, structure, state, coupling, half_supply, old_legs, seen } = self;
        located_step(model, structure, state, coupling, half_supply, old_legs, &seen)
    }
}

#[inline(always)]
fn located_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    c: &Coupling<S>,
    half_supply: S,
    old_legs: [S; 3],
    x: &Seen<S>,
) -> ([S; 3], [S; 3]) {
    let electric =
        |model: &Model<S>, state: &mut State<S>, old_legs| Detailed { model, structure, state, coupling: c, half_supply, old_legs }.step();
    let part = |share: S, state: &mut State<S>, old_legs| {
        let model = m.over(share);
        if structure.shorted {
            state.extra.contacts = discrete(&model, &state.star);
        }
        electric(&model, state, old_legs)
    };
    let before = *s;
    let whole = electric(m, s, old_legs);
    let end = error_after(m, structure, s, whole.0, x);
    s.extra.last_reference = s.current_ref;
    let Some((share, which)) = crossing(m.half_band, s.legs, x.error, end) else {
        return whole;
    };
    let split = which[0] | which[1] | which[2];
    let kept = *s;
    *s = before;
    let first = part(share, s, old_legs);
    s.star.current = first.0;
    let turned = three!(|j| S::select(which[j], -s.legs[j], s.legs[j]));
    s.transitions = count_transitions(s.transitions, s.legs, turned);
    if structure.switching {
        lose_switching(m, s, half_supply + half_supply, s.legs, turned);
    }
    let legs = s.legs;
    s.legs = turned;
    let rest = S::one() - share;
    let second = part(rest, s, legs);
    s.star.current = before.star.current;
    s.extra.last_reference = kept.extra.last_reference;
    s.extra.contacts = kept.extra.contacts;
    choose(s, split, &kept);
    let mean: [S; 3] = three!(|j| share * first.1[j] + rest * second.1[j]);
    (three!(|j| S::select(split, second.0[j], whole.0[j])), three!(|j| S::select(split, mean[j], whole.1[j])))
}

/// Lanes that were not split keep what the whole step made of them.
#[inline(always)]
fn choose<S: Scalar>(s: &mut State<S>, split: S::Mask, kept: &State<S>) {
    let pick = |mine: S, other: S| S::select(split, mine, other);
    s.transitions = pick(s.transitions, kept.transitions);
    s.legs = three!(|j| pick(s.legs[j], kept.legs[j]));
    s.voltage = three!(|j| pick(s.voltage[j], kept.voltage[j]));
    for (mine, other) in s.star.contact.iter_mut().flatten().zip(kept.star.contact.iter().flatten()) {
        *mine = pick(*mine, *other);
    }
    s.bridge.keep(split, &kept.bridge);
    for (mine, other) in s.energy.iter_mut().zip(kept.energy) {
        *mine = pick(*mine, other);
    }
    for (mine, other) in s.extra.network.collected.iter_mut().zip(kept.extra.network.collected) {
        *mine = pick(*mine, other);
    }
}
