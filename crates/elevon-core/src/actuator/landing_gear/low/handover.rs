//! The phase that left the pair: its current dies while the next takes over (docs/explanation/theory/landing-gear.md, "The outgoing
//! phase").

use super::pair::Pair;
use super::{Model, State};
use crate::inverter::six_step::{self, Chopping};
use crate::kept;
use crate::scalar::Scalar;
use crate::three;

/// The current that the phase that left the pair last still carries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Handover<S> {
    /// Of the pair's sign, no more than its current.
    pub(super) outgoing: S,
    /// The pair's demand, and what the last change of sector added to it.
    pub(super) demand: [S; 3],
    pub(super) change: [S; 3],
}

kept!(Handover<f64> as Handover { outgoing, demand, change });

/// Current that the phase which left the pair still carries, its mean over the step (docs/explanation/theory/landing-gear.md, "The
/// outgoing phase"): L do/dt = -(v + (e - 2 h)/3) with the pair's EMF e, that of the incoming phase less that of the
/// outgoing one h, and v from the rails.
#[inline(always)]
pub(super) fn handed_over<S: Scalar>(m: &Model<S>, chopping: Chopping, p: &Pair<S>, s: &mut State<S>, duty: S, i: S) -> S {
    let (zero, half, one, third) = (S::zero(), S::splat(0.5), S::one(), S::splat(1.0 / 3.0));
    let (link, diode) = (s.body.link, m.diode_drop);
    let rails = match chopping {
        Chopping::LowSide => {
            let upper = (S::splat(2.0) - duty) * link + (S::splat(3.0) - duty) * diode;
            S::select(zero.lt(p.upper), upper, duty * link + (one + duty) * diode)
        }
        Chopping::Both => link + diode + diode,
    };
    let emf = (p.constant - (p.handed + p.handed)) * s.body.motion.motor_speed;
    let inductance = half * S::select(zero.lt(p.inductance), p.inductance, S::splat(2.0));
    let falls = (m.c.dt * third * (rails + i.signed(one) * emf) / inductance).maximum(zero);
    let before = S::select(zero.le(s.handover.outgoing * i), s.handover.outgoing.abs().minimum(i.abs()), zero);
    s.handover.outgoing = i.signed((before - falls).maximum(zero));
    // A ramp that may end within the step.
    let lasts = S::select(before.lt(falls), before / S::select(zero.lt(falls), falls, one), one);
    i.signed(lasts * (before - half * falls * lasts))
}

/// With another sector the phase that leaves carries all of the pair's current.
#[inline(always)]
pub(super) fn hand_over<S: Scalar>(s: &mut State<S>) {
    let demand = six_step::demand(s.body.hall.code);
    let change: [S; 3] = three!(|j| demand[j] - s.handover.demand[j]);
    let changed = S::zero().lt(change[0].abs() + change[1].abs() + change[2].abs());
    s.handover.change = three!(|j| S::select(changed, change[j], s.handover.change[j]));
    s.handover.outgoing = S::select(changed, s.current, s.handover.outgoing);
    s.handover.demand = demand;
}
