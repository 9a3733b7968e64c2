//! Shorted turns as a loop of their own, in the reduced-order model. The phase current i_j is imposed; behind the contact resistance
//! R_c the loop of mu turns carries i_f:
//!
//!     L_f di_f/dt = R_c (i_j - i_f) - mu R i_f - M di_j/dt - mu k_j omega,   L_f = mu L - M, M = kappa mu (1 - mu) L
//!
//! With i_f = i_j all turns link the flux of the whole winding, L_f + M = mu L, whatever kappa: the split of the high
//! fidelity (motor/short). Turns that are not shorted carry the phase's current. The loop is stepped exactly for held right-hand
//! sides, so any R_c runs; R_c without limit is the healthy winding.

use super::model::State;
use super::phase::Phase;
use crate::actuator::servo::layout::*;
use crate::motor::star::MotorParameter;
use crate::scalar::Scalar;
use crate::three;

/// Constants of the loops; those of phases without a short are zero.
#[derive(Clone, Copy, Debug)]
pub struct Loops<S> {
    /// Shorted turns over all and over the remaining ones.
    turns: [S; 3],
    ratio: [S; 3],
    resistance: [S; 3],
    contact: S,
    mutual_per_dt: [S; 3],
    /// dt / L_f.
    dt_per_inductance: [S; 3],
    /// Inductance of the turns outside the short, N L - M.
    pub(super) intact: [S; 3],
}

/// What the loops add to a step.
pub(super) struct Added<S> {
    pub torque: S,
    /// Loss in the shorted copper of each phase and in the contacts, W.
    pub copper: [S; 3],
    pub contact: S,
}

impl<S: Scalar> Loops<S> {
    pub(super) fn derive(raw: &[S], dt: S) -> Self {
        let at = |p: MotorParameter| raw[p.at()];
        let (zero, one) = (S::zero(), S::one());
        let intact: [S; 3] = three!(|j| raw[MotorParameter::TurnsA.at() + j]);
        let turns: [S; 3] = three!(|j| one - intact[j]);
        let inductance = at(MotorParameter::WindingInductance);
        Self {
            turns,
            ratio: three!(|j| turns[j] / intact[j]),
            resistance: three!(|j| turns[j] * at(MotorParameter::WindingResistance)),
            contact: at(MotorParameter::ShortContactResistance),
            mutual_per_dt: three!(|j| at(MotorParameter::ShortCoupling) * turns[j] * intact[j] * inductance / dt),
            dt_per_inductance: three!(|j| {
                let there = zero.lt(turns[j]);
                let value = turns[j] * (one - at(MotorParameter::ShortCoupling) * intact[j]) * inductance;
                S::select(there, dt / S::select(there, value, one), zero)
            }),
            intact: three!(|j| intact[j] * (one - at(MotorParameter::ShortCoupling) * turns[j]) * inductance),
        }
    }

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
