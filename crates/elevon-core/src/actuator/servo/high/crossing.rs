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
use crate::scalar::{apart, Kernel, Scalar};
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

impl<S: Scalar> Kernel for Located<'_, S> {
    type Output = ([S; 3], [S; 3]);
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model: m, structure, state: s, coupling, half_supply, old_legs, seen } = self;
        let circuit = Switched { structure, coupling, half_supply };
        let before = *s;
        let whole = circuit.step(m, s, old_legs);
        let end = error_after(m, structure, s, whole.0, &seen);
        s.extra.last_reference = s.current_ref;
        let Some((share, which)) = crossing(m.half_band, s.legs, seen.error, end) else {
            return whole;
        };
        let kept = *s;
        *s = before;
        let parts = circuit.step_in_two(m, s, old_legs, share, which);
        s.star.current = before.star.current;
        s.extra.last_reference = kept.extra.last_reference;
        s.extra.contacts = kept.extra.contacts;
        let split = which[0] | which[1] | which[2];
        choose(s, split, &kept);
        (three!(|j| S::select(split, parts.0[j], whole.0[j])), three!(|j| S::select(split, parts.1[j], whole.1[j])))
    }
}

/// Windings and bridge, and what feeds them during a step.
struct Switched<'a, S: Scalar> {
    structure: &'a Structure,
    coupling: &'a Coupling<S>,
    half_supply: S,
}

impl<S: Scalar> Switched<'_, S> {
    #[inline(always)]
    fn step(&self, model: &Model<S>, state: &mut State<S>, old_legs: [S; 3]) -> ([S; 3], [S; 3]) {
        let Self { structure, coupling, half_supply } = *self;
        apart::<S, _>(Detailed { model, structure, state, coupling, half_supply, old_legs })
    }

    /// Over a share of the step.
    #[inline(always)]
    fn part(&self, m: &Model<S>, s: &mut State<S>, old_legs: [S; 3], share: S) -> ([S; 3], [S; 3]) {
        let model = m.over(share);
        if self.structure.shorted {
            s.extra.contacts = discrete(&model, &s.star);
        }
        self.step(&model, s, old_legs)
    }

    /// Up to the crossing, where the relays of `which` turn, and from there on: currents at the end, mean voltages.
    #[inline(always)]
    fn step_in_two(&self, m: &Model<S>, s: &mut State<S>, old_legs: [S; 3], share: S, which: [S::Mask; 3]) -> ([S; 3], [S; 3]) {
        let first = self.part(m, s, old_legs, share);
        s.star.current = first.0;
        let turned = three!(|j| S::select(which[j], -s.legs[j], s.legs[j]));
        s.transitions = count_transitions(s.transitions, s.legs, turned);
        if self.structure.switching {
            lose_switching(m, s, self.half_supply + self.half_supply, s.legs, turned);
        }
        let legs = s.legs;
        s.legs = turned;
        let remainder = S::one() - share;
        let second = self.part(m, s, legs, remainder);
        (second.0, three!(|j| share * first.1[j] + remainder * second.1[j]))
    }
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
