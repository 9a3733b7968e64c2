//! The conducting pair at one instant.

use super::super::body::Structure;
use super::{Model, State};
use crate::inverter::six_step;
use crate::motor::star::Star;
use crate::scalar::Scalar;

/// The conducting pair in series.
#[derive(Clone, Copy)]
pub(super) struct Pair<S> {
    pub(super) constant: S,
    pub(super) winding: S,
    pub(super) resistance: S,
    pub(super) inductance: S,
    pub(super) closed: S,
    /// Coefficient of the phase that is not used less the mean of those that are; none of an interrupted phase.
    pub(super) emf_shared: S,
    /// The same less that of the HIGH leg's.
    pub(super) emf_alone: S,
    /// Coefficient of the phase that took over last less that of the one that left.
    pub(super) handed: S,
    /// 1: the HIGH leg's; -1: the LOW leg's.
    pub(super) upper: S,
}

impl<S: Scalar> Pair<S> {
    /// With the flux that the current leaves it.
    #[inline(always)]
    pub(super) fn weakened(mut self, star: &Star<S>, current: S) -> Self {
        let torque = self.constant * current;
        if star.saturates(torque) {
            let share = star.unsaturated(torque);
            for k in [&mut self.constant, &mut self.emf_shared, &mut self.emf_alone, &mut self.handed] {
                *k = share * *k;
            }
        }
        self
    }
}

#[inline(always)]
pub(super) fn pair<S: Scalar>(m: &Model<S>, structure: &Structure, s: &State<S>) -> Pair<S> {
    let (k, _) = m.c.coupling(structure, s.body.motion.motor_position);
    let resistance = m.c.resistance();
    let demand = six_step::demand(s.body.hall.code);
    let zero = S::zero();
    let direction = s.body.demand.signed(S::one());
    let mut pair = Pair {
        constant: zero,
        winding: zero,
        resistance: zero,
        inductance: zero,
        closed: zero,
        emf_shared: zero,
        emf_alone: zero,
        handed: zero,
        upper: zero,
    };
    let (mut open, mut spare) = (zero, zero);
    for j in 0..3 {
        let used = demand[j].abs();
        pair.constant = pair.constant + demand[j] * k[j];
        pair.winding = pair.winding + used * resistance[j];
        pair.inductance = pair.inductance + used * m.inductance[j];
        let cut = S::indicator(S::splat(0.5).le(m.c.star.open[j]));
        open = open + used * cut;
        pair.emf_shared = pair.emf_shared + S::select(S::splat(0.5).lt(used), S::splat(-0.5) * k[j], k[j]);
        let high = S::indicator(S::splat(0.5).lt(demand[j] * direction));
        pair.emf_alone = pair.emf_alone + (S::one() - used - high) * k[j];
        spare = spare + (S::one() - used) * (S::one() - cut);
        pair.closed = pair.closed + used;
        pair.handed = pair.handed + s.handover.change[j] * k[j];
        pair.upper = pair.upper + s.handover.change[j] * used * direction;
    }
    pair.resistance = pair.winding + m.on_resistance + m.on_resistance;
    pair.emf_shared = pair.emf_shared * spare;
    pair.emf_alone = pair.emf_alone * spare;
    pair.closed = S::indicator(S::splat(0.5).lt(pair.closed) & open.lt(S::splat(0.5)));
    pair
}
