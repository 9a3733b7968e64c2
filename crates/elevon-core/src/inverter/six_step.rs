//! Six-step commutation with both conducting legs chopped together (P 2.1.2): a leg is HIGH or LOW while the demand is
//! at or above a saw-tooth carrier, else ZERO, both switches off.

use crate::scalar::Scalar;
use crate::three;
use crate::variables;

variables! {
    /// Modulator and protection of the bridge.
    SixStepParameter, SIX_STEP {
        SwitchingPeriod => "switching_period", "T_PWM", "s", Positive, Controller, None, "period of the carrier";
        CurrentCutoff => "current_cutoff", "I_cut", "A", Positive, Controller, None, "phase current above which the legs stay at ZERO until the next carrier period";
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

/// Leg states for a sign of the demand.
#[inline(always)]
pub fn gates<S: Scalar>(demand: [S; 3], sign: S) -> [S; 3] {
    three!(|j| demand[j] * sign)
}
