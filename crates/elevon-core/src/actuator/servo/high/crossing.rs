//! Relays that act at the instant of their crossing: the electrical step in parts.
//!
//! The step is taken whole; where a relay's error is then beyond its threshold, the step is taken again up to the crossing
//! (on the straight line between the errors at both ends, exact to the order of the step), the relay turns, and the rest
//! follows, in which another relay may cross in turn.

use super::electric::{electric_step, Coupling, Detailed};
use super::model::{Model, State};
use super::shorted::discrete;
use super::step::{lose_switching, measured_current};
use crate::actuator::servo::details::Structure;
use crate::inverter::hysteresis::{count_transitions, crossing, six_step};
use crate::scalar::{apart, Scalar};
use crate::sensor::filter::low_pass;
use crate::three;

/// Crossings that a step may have; further ones act at the begin of the next.
const CROSSINGS: usize = 3;

/// What the relays see at the begin of a step.
pub(crate) struct Seen<S> {
    pub error: [S; 3],
    /// References per ampere at the end of the step.
    pub shape: [S; 3],
}

/// What a step makes of the windings: currents at its end, their means and those of the voltages over it.
#[derive(Clone, Copy)]
pub(crate) struct Wound<S> {
    pub current: [S; 3],
    pub mean: [S; 3],
    pub voltage: [S; 3],
}

/// References per ampere after the rotor has turned on at `rate` for a step.
#[inline(always)]
pub(crate) fn turned<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, [sines, cosines]: [[S; 3]; 2], rate: S) -> [S; 3] {
    if FULL && structure.six_step {
        return six_step(sines);
    }
    let angle = m.dt * m.star.pole_pairs * rate;
    let along = S::splat(-0.5).fma(angle * angle, S::one());
    three!(|j| angle.fma(cosines[j], along * sines[j]))
}

/// Windings and bridge, and what feeds them during a step.
pub(crate) struct Switched<'a, S: Scalar> {
    pub model: &'a Model<S>,
    pub structure: &'a Structure,
    pub coupling: &'a Coupling<S>,
    pub half_supply: S,
}

/// The part of a step behind the last crossing, and the sums over what lies before it.
struct Open<S> {
    start: [S; 3],
    legs: [S; 3],
    errors: [S; 3],
    length: S,
    mean: [S; 3],
    voltage: [S; 3],
}

impl<S: Scalar> Open<S> {
    /// In the lanes that were split; the others go on as they were.
    #[inline(always)]
    fn only(&self, split: S::Mask, other: &Self) -> Self {
        let pick = |mine: &[S; 3], other: &[S; 3]| three!(|j| S::select(split, mine[j], other[j]));
        Self {
            start: pick(&self.start, &other.start),
            legs: pick(&self.legs, &other.legs),
            errors: pick(&self.errors, &other.errors),
            length: S::select(split, self.length, other.length),
            mean: pick(&self.mean, &other.mean),
            voltage: pick(&self.voltage, &other.voltage),
        }
    }

    /// With this part, whose currents end at `end`.
    #[inline(always)]
    fn closed(&self, end: [S; 3], voltage: [S; 3], length: S) -> [[S; 3]; 2] {
        let half = S::splat(0.5) * length;
        [three!(|j| half.fma(self.start[j] + end[j], self.mean[j])), three!(|j| length.fma(voltage[j], self.voltage[j]))]
    }
}

impl<S: Scalar> Switched<'_, S> {
    /// A step under relays whose errors were `seen`.
    #[inline(always)]
    pub fn step<const FULL: bool>(&self, s: &mut State<S>, old_legs: [S; 3], seen: &Seen<S>) -> Wound<S> {
        let begin = three!(|j| s.star.current[j]);
        let before = FULL.then_some(*s);
        let (end, voltage) = self.part::<FULL>(s, begin, old_legs, S::one());
        let reference = self.reference_after(s);
        let ends = self.errors_after::<FULL>(s, end, reference, seen);
        let zero = [S::zero(); 3];
        let open = Open { start: begin, legs: old_legs, errors: seen.error, length: S::one(), mean: zero, voltage: zero };
        let [mean, _] = open.closed(end, voltage, S::one());
        let mut wound = Wound { current: end, mean, voltage };
        if crossing(self.model.half_band, s.legs, seen.error, ends).is_some() {
            wound = self.in_parts::<FULL>(s, open, before, (end, voltage, ends), reference, seen);
        }
        s.extra.last_reference = s.current_ref;
        s.star.current = begin;
        wound
    }

    /// The same again in parts, from crossing to crossing; the state at the begin of the open part is needed in full only.
    #[inline(always)]
    fn in_parts<const FULL: bool>(
        &self,
        s: &mut State<S>,
        mut open: Open<S>,
        mut from: Option<State<S>>,
        (mut end, mut voltage, mut ends): ([S; 3], [S; 3], [S; 3]),
        reference: S,
        seen: &Seen<S>,
    ) -> Wound<S> {
        for _ in 0..CROSSINGS {
            let Some((share, which)) = crossing(self.model.half_band, s.legs, open.errors, ends) else {
                break;
            };
            let split = which[0] | which[1] | which[2];
            let (kept, legs, count) = (FULL.then_some(*s), s.legs, s.transitions);
            if let Some(from) = &from {
                *s = *from;
                (s.legs, s.transitions) = (legs, count);
            }
            let length = open.length * share;
            let (at, v) = self.part::<FULL>(s, open.start, open.legs, length);
            let [mean, volts] = open.closed(at, v, length);
            s.star.current = at;
            let new_legs = three!(|j| S::select(which[j], -legs[j], legs[j]));
            if FULL && self.structure.switching {
                lose_switching(self.model, s, self.half_supply + self.half_supply, legs, new_legs);
            }
            s.transitions = count_transitions(count, legs, new_legs);
            s.legs = new_legs;
            from = FULL.then_some(*s);
            let rest = open.length * (S::one() - share);
            let (e, v) = self.part::<FULL>(s, at, legs, rest);
            if let Some(kept) = &kept {
                choose(s, split, kept);
            }
            let pick = |new: S, old: S| S::select(split, new, old);
            s.transitions = pick(s.transitions, count);
            s.legs = three!(|j| pick(new_legs[j], legs[j]));
            let errors = three!(|j| share.fma(ends[j] - open.errors[j], open.errors[j]));
            open = Open { start: at, legs, errors, length: rest, mean, voltage: volts }.only(split, &open);
            end = three!(|j| pick(e[j], end[j]));
            voltage = three!(|j| pick(v[j], voltage[j]));
            ends = self.errors_after::<FULL>(s, end, reference, seen);
        }
        let [mean, voltage] = open.closed(end, voltage, open.length);
        if FULL && self.structure.shorted {
            s.extra.contacts = discrete(self.model, &s.star);
        }
        Wound { current: end, mean, voltage }
    }

    /// Windings and bridge over a share of the step: currents at its end and mean voltages.
    #[inline(always)]
    fn part<const FULL: bool>(&self, s: &mut State<S>, start: [S; 3], old_legs: [S; 3], share: S) -> ([S; 3], [S; 3]) {
        let model = self.model.over(share);
        s.star.current = start;
        if !FULL {
            return electric_step::<S, false, false>(&model, self.structure, s, self.coupling, self.half_supply, old_legs);
        }
        if self.structure.shorted {
            s.extra.contacts = discrete(&model, &s.star);
        }
        let Self { structure, coupling, half_supply, .. } = *self;
        // Contacts and bridge are the largest code of a step, and are wanted in three places.
        apart::<S, _>(Detailed { model: &model, structure, state: s, coupling, half_supply, old_legs })
    }

    /// Current reference at the end of the step, which goes on as it went.
    #[inline(always)]
    fn reference_after(&self, s: &State<S>) -> S {
        if self.structure.control_every_step {
            s.current_ref + (s.current_ref - s.extra.last_reference)
        } else {
            s.current_ref
        }
    }

    /// Errors of the relays at the end of a step after which the currents are `current`.
    #[inline(always)]
    fn errors_after<const FULL: bool>(&self, s: &State<S>, current: [S; 3], reference: S, seen: &Seen<S>) -> [S; 3] {
        let mut measured = current;
        if FULL {
            let mut after = *s;
            after.star.current = current;
            measured = measured_current::<S, true, true>(self.model, self.structure, &after);
            if self.structure.current_filter {
                measured = three!(|j| low_pass(self.model.extra.closing, s.extra.sensed[j], measured[j]));
            }
        }
        three!(|j| reference * seen.shape[j] - measured[j])
    }
}

/// Lanes that were not split keep what the whole step made of them.
#[inline(always)]
fn choose<S: Scalar>(s: &mut State<S>, split: S::Mask, kept: &State<S>) {
    let pick = |mine: S, other: S| S::select(split, mine, other);
    s.voltage = three!(|j| pick(s.voltage[j], kept.voltage[j]));
    for (mine, other) in s.star.contact.iter_mut().flatten().zip(kept.star.contact.iter().flatten()) {
        *mine = pick(*mine, *other);
    }
    s.bridge.keep(split, &kept.bridge);
    for (mine, other) in s.energy.iter_mut().zip(kept.energy) {
        *mine = pick(*mine, other);
    }
    let (heat, other) = (&mut s.extra.network, &kept.extra.network);
    heat.collected = three!(|j| pick(heat.collected[j], other.collected[j]));
    heat.windings = three!(|j| pick(heat.windings[j], other.windings[j]));
}
