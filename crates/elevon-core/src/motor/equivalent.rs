//! The single equivalent phase of the reduced-order model (reference sheet 1.9): the quadrature current.
//!
//! A current-controlled drive imposes i_j = i_q sin a_j, so the three-phase model collapses to one phase
//! whose coefficients depend on the rotor angle (derivation: docs/explanation/theory/low-fidelity.md):
//! k_T = sum k_j sin a_j, R_q = 2/3 sum R_j sin^2 a_j, L_q likewise, v_q = R_q i + L_q di/dt + 2/3 k_T omega.

use crate::scalar::Scalar;
use crate::three;
use crate::variables;

variables! {
    /// The few numbers that only the reduced-order model has.
    LowParameter, LOW {
        Step => "step", "dt", "s", Between(1e-12, 1.0), Solver, Some(5e-4), "solver step of the reduced-order model",
            low_only("it has solver.step");
        VoltageRatio => "voltage_ratio", "-", "1", Positive, Plant, Some(std::f64::consts::FRAC_2_PI), "largest phase voltage, peak, over the DC link: 2/pi in six-step, 1/sqrt 3 for a linear PWM",
            low_only("it has the relays themselves").when(&[Chosen("drive.kind", &["hysteresis"])]);
        BandRatio => "band_ratio", "-", "1", Between(0.0, 2.0), Plant, Some(0.5), "mean current error the relays allow before they act, in half bands",
            low_only("it has the relays themselves").when(&[Chosen("drive.kind", &["hysteresis"])]);
    }
}

/// The equivalent phase at a rotor angle.
#[derive(Clone, Copy, Debug)]
pub struct Equivalent<S> {
    pub torque_constant: S,
    pub resistance: S,
    pub inductance: S,
}

/// Coefficients for currents i_q `imposed[j]` in phases of `k`, `resistance`, `inductance`; `sensed[j]`
/// projects phase quantities on the quadrature axis.
#[inline(always)]
pub fn equivalent<S: Scalar>(k: [S; 3], resistance: [S; 3], inductance: [S; 3], imposed: [S; 3]) -> Equivalent<S> {
    let two_thirds = S::splat(2.0 / 3.0);
    let weight: [S; 3] = three!(|j| two_thirds * imposed[j] * imposed[j]);
    let dot = |a: [S; 3], b: [S; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    Equivalent { torque_constant: dot(k, imposed), resistance: dot(resistance, weight), inductance: dot(inductance, weight) }
}

/// Shape of the phase currents per ampere of the reference. A drive brings gain times current to its reference in each
/// phase up to an error that all share, since the star's currents sum to zero: h_j = w_j (r_j + e), w_j one over the
/// sensor's gain, none of an interrupted phase. One phase interrupted: the other two carry half the difference of their
/// references; two: nothing flows.
#[inline(always)]
pub fn imposed_shape<S: Scalar>(reference: [S; 3], weight: [S; 3]) -> [S; 3] {
    let sum = weight[0] + weight[1] + weight[2];
    let uneven = weight[0] * reference[0] + weight[1] * reference[1] + weight[2] * reference[2];
    let none = sum.equals(S::zero());
    let shared = uneven / S::select(none, S::one(), sum);
    three!(|j| weight[j] * (reference[j] - shared))
}

/// Quadrature component of three phase quantities over the sines of an angle.
#[inline(always)]
pub fn quadrature<S: Scalar>(x: [S; 3], sines: [S; 3]) -> S {
    S::splat(2.0 / 3.0) * (x[0] * sines[0] + x[1] * sines[1] + x[2] * sines[2])
}

/// One step of the equivalent R-L circuit, exact for held voltages and stable at any step: exp(-x) by its
/// diagonal Pade form of order 3 (error x^7 / 100800, x = R dt / L).
#[derive(Clone, Copy, Debug)]
pub struct Circuit<S> {
    pub resistance: S,
    pub per_resistance: S,
    /// exp(-x).
    decay: S,
    /// R / (1 - exp(-x)).
    stiffness: S,
}

impl<S: Scalar> Circuit<S> {
    #[inline(always)]
    pub fn new(resistance: S, inductance: S, dt: S) -> Self {
        let x = resistance * dt / inductance;
        let square = x * x;
        let even = S::one() + square * S::splat(0.1);
        let odd = x * (S::splat(0.5) + square * S::splat(1.0 / 120.0));
        let per_denominator = S::one() / (even + odd);
        Self {
            resistance,
            per_resistance: S::one() / resistance,
            decay: (even - odd) * per_denominator,
            // 1 - (even - odd) / (even + odd), without cancellation.
            stiffness: resistance * (even + odd) / (odd + odd),
        }
    }

    /// Current after the step under the driving voltage (terminal voltage less EMF).
    #[inline(always)]
    pub fn current(&self, start: S, driving: S) -> S {
        let settled = driving * self.per_resistance;
        (start - settled).fma(self.decay, settled)
    }

    /// Driving voltage that brings the current from `start` to `end` in the step.
    #[inline(always)]
    pub fn voltage(&self, start: S, end: S) -> S {
        self.stiffness * (-start).fma(self.decay, end)
    }
}
