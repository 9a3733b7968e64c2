//! Six-step commutation (P 2.1.2): a conducting leg is HIGH or LOW/PWM while the demand is at or above a saw-tooth carrier.
//! Above it the LOW leg is ZERO, both switches off, and the HIGH one stays at the upper rail (low-side chopping) or is
//! ZERO as well. For the software brake all legs are LOW.

use crate::scalar::Scalar;
use crate::three;
use crate::{choices, variables};

choices! {
    /// Which of the two conducting legs the carrier switches.
    Chopping { LowSide "low_side", Both "both" }
}

variables! {
    /// Modulator and protection of the bridge.
    SixStepParameter, SIX_STEP {
        SwitchingPeriod => "switching_period", "T_PWM", "s", Positive, Controller, None, "period of the carrier";
        CurrentCutoff => "current_cutoff", "I_cut", "A", Positive, Controller, None, "phase current above which the legs stay at ZERO until the next carrier period";
        Chopping => "chopping", "-", "1", Choice(Chopping::NAMES), Controller, Some(0.0), "legs that the carrier switches: the LOW one alone (P 2.1.2: +V_s, OPEN, or PWM between ground and OPEN), or both together";
        TerminalsShorted => "terminals_shorted", "-", "1", Flag, Plant, Some(0.0), "1: the motor's terminals are shorted to the lower rail";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct SixStep<S> {
    pub period: S,
    per_period: S,
    pub cutoff: S,
}

/// Commutation demand of the legs from the Hall codes: 1 high, -1 low, 0 open. An invalid code opens all three.
#[inline(always)]
pub fn demand<S: Scalar>(code: [S; 3]) -> [S; 3] {
    [code[0] - code[1], code[1] - code[2], code[2] - code[0]]
}

impl<S: Scalar> SixStep<S> {
    pub fn derive(raw: &[S]) -> Self {
        let period = raw[SixStepParameter::SwitchingPeriod as usize];
        Self { period, per_period: S::one() / period, cutoff: raw[SixStepParameter::CurrentCutoff as usize] }
    }

    /// Carrier periods since the start.
    #[inline(always)]
    pub fn carrier(&self, t: S) -> S {
        t * self.per_period
    }

    /// Fraction of a step from `carrier` on, `dt` long, during which the demand's duty is at or above the carrier.
    #[inline(always)]
    pub fn on_fraction(&self, carrier: S, dt: S, duty: S) -> S {
        let length = dt * self.per_period;
        let on = |c: S| {
            let whole = c.floor();
            whole * duty + (c - whole).minimum(duty)
        };
        let share = (on(carrier + length) - on(carrier)) / length;
        // A share within rounding of all or nothing is all or nothing.
        let tiny = S::splat(1e-6);
        let full = S::select((S::one() - tiny).lt(share), S::one(), share);
        S::select(full.lt(tiny), S::zero(), full)
    }

    /// Carrier count until which the legs stay off, after phase currents have been seen.
    #[inline(always)]
    pub fn cut(&self, until: S, carrier: S, current: [S; 3]) -> S {
        let largest = current[0].abs().maximum(current[1].abs()).maximum(current[2].abs());
        S::select(self.cutoff.lt(largest), carrier.floor() + S::one(), until)
    }
}

/// Legs while the carrier is above the demand, from those below it.
#[inline(always)]
pub fn chopped<S: Scalar>(chopping: Chopping, legs: [S; 3]) -> [S; 3] {
    match chopping {
        Chopping::LowSide => three!(|j| legs[j].maximum(S::zero())),
        Chopping::Both => [S::zero(); 3],
    }
}
