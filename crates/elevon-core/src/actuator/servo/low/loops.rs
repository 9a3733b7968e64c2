//! Shorted turns as a loop of their own, in the reduced-order model. The phase current i_j is imposed; behind the contact resistance
//! R_c the loop of mu turns carries i_f:
//!
//!     L_f di_f/dt = R_c (i_j - i_f) - mu R i_f - M di_j/dt - mu k_j omega,   L_f = mu L - M, M = kappa mu (1 - mu) L
//!
//! With i_f = i_j all turns link the flux of the whole winding, L_f + M = mu L, whatever kappa: the split of the high
//! fidelity (motor/short). Turns that are not shorted carry the phase's current. The loop is stepped exactly for held right-hand
//! sides, so any R_c runs; R_c without limit is the healthy winding.

use super::model::{Loops, Phase, State};
use crate::scalar::Scalar;
use crate::three;

/// What the loops add to a step.
pub(super) struct Added<S> {
    pub torque: S,
    /// Loss in the shorted copper of each phase and in the contacts, W.
    pub copper: [S; 3],
    pub contact: S,
}

impl<S: Scalar> Loops<S> {
    /// Steps the loops under phase currents that went from `before` to `after`.
    #[inline(always)]
    pub(super) fn step(&self, s: &mut State<S>, p: &Phase<S>, before: [S; 3], after: [S; 3]) -> Added<S> {
        let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
        let speed = s.shaft.motor_speed;
        let mut added = Added { torque: zero, copper: [zero; 3], contact: zero };
        for j in 0..3 {
            let there = zero.lt(self.turns[j]);
            let value = self.resistance[j] * s.resistance_factor;
            let total = S::select(there, value + self.contact, one);
            let k = p.coefficients[j] * self.ratio[j];
            let driven = self.contact * after[j] - self.mutual_per_dt[j] * (after[j] - before[j]) - k * speed;
            let settled = driven / total;
            let decay = (-(total * self.dt_per_inductance[j])).exp();
            let new = S::select(there, (s.loops[j] - settled).fma(decay, settled), after[j]);
            let middle = half * (s.loops[j] + new);
            added.torque = added.torque + k * middle;
            let through = S::select(there, half * (before[j] + after[j]) - middle, zero);
            added.copper[j] = value * middle * middle;
            added.contact = added.contact + self.contact * through * through;
            s.loops[j] = new;
        }
        added
    }

    /// Torque of the loops in the coming step, the phases at the amplitude they have: what the controller's derivative answers to.
    #[inline(always)]
    pub(super) fn torque(&self, s: &State<S>, p: &Phase<S>) -> S {
        let mut after = *s;
        self.step(&mut after, p, s.phases, three!(|j| p.imposed[j] * s.current)).torque
    }

    /// Quadrature voltage that the phases see across the contacts, with the loops at rest against their own time.
    #[inline(always)]
    pub(super) fn voltage(&self, s: &State<S>, p: &Phase<S>) -> S {
        let speed = s.shaft.motor_speed;
        let across = |j: usize| {
            let value = self.resistance[j] * s.resistance_factor;
            let guarded = S::select(S::zero().lt(self.turns[j]), value + self.contact, S::one());
            let felt = self.contact / guarded * S::indicator(S::zero().lt(self.turns[j]));
            p.imposed[j] * felt * (value * s.phases[j] + p.coefficients[j] * self.ratio[j] * speed)
        };
        S::splat(2.0 / 3.0) * (across(0) + across(1) + across(2))
    }
}
