//! Cogging: the torque by which the magnets hold on to the teeth of the stator, without any current.
//!
//! The air gap's energy is periodic in the rotor's angle with the least common multiple of slots and poles, so the torque is
//! T = -A (sin N a + r sin 2 N a), a = theta + phi: its mean is zero, and no work is done over a turn.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;

variables! {
    /// Cogging of the motor.
    CoggingParameter, COGGING {
        CoggingTorque => "cogging_torque", "A", "N m", NonNegative, Plant, Some(0.0), "amplitude of the cogging torque; 0: none";
        CoggingCycles => "cogging_cycles", "N", "1", Count(1.0, f64::INFINITY), Plant, Some(24.0), "cycles of the cogging torque in a turn, the least common multiple of slots and poles; ASSUMED: 12 slots, 8 poles",
            when(&[Away("motor.cogging_torque", 0.0)]);
        CoggingSecond => "cogging_second", "r", "1", Between(-1.0, 1.0), Plant, Some(0.0), "second harmonic of the cogging torque over the first",
            when(&[Away("motor.cogging_torque", 0.0)]);
        CoggingPhase => "cogging_phase", "phi", "rad", Any, Plant, Some(0.0), "mechanical angle from a place where the rotor rests to the rotor's zero",
            when(&[Away("motor.cogging_torque", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Cogging<S> {
    amplitude: S,
    cycles: S,
    second: S,
    phase: S,
}

impl<S: Scalar> Cogging<S> {
    /// Is there any?
    pub fn needed(view: &View<CoggingParameter>) -> bool {
        view.away(CoggingParameter::CoggingTorque)
    }

    pub fn derive(raw: &[S]) -> Self {
        use CoggingParameter as P;
        let g = |p: P| raw[p as usize];
        Self { amplitude: g(P::CoggingTorque), cycles: g(P::CoggingCycles), second: g(P::CoggingSecond), phase: g(P::CoggingPhase) }
    }

    /// Torque on the shaft, positive where it drives forwards.
    #[inline(always)]
    pub fn torque(&self, angle: S) -> S {
        let (sin, cos) = (self.cycles * (angle + self.phase)).sin_cos();
        // sin 2x = 2 sin x cos x.
        -(self.amplitude * sin * (S::splat(2.0) * self.second).fma(cos, S::one()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn cogging(second: f64) -> Cogging<f64> {
        Cogging::derive(&[0.05, 24.0, second, 0.1])
    }

    #[test]
    fn follows_its_two_harmonics() {
        let c = cogging(0.3);
        for i in 0..50 {
            let angle = 0.013 * f64::from(i);
            let x = 24.0 * (angle + 0.1);
            assert!((c.torque(angle) + 0.05 * (x.sin() + 0.3 * (2.0 * x).sin())).abs() < 1e-12);
        }
    }

    #[test]
    fn does_no_work_over_a_turn() {
        let c = cogging(0.3);
        let n = 4800;
        let work: f64 = (0..n).map(|i| c.torque(TAU * f64::from(i) / f64::from(n)) * TAU / f64::from(n)).sum();
        assert!(work.abs() < 1e-12, "{work}");
    }

    #[test]
    fn holds_the_rotor_where_it_rests() {
        let c = cogging(0.0);
        assert!(c.torque(-0.1).abs() < 1e-15);
        assert!(c.torque(-0.1 + 1e-3) < 0.0 && c.torque(-0.1 - 1e-3) > 0.0);
    }

    #[test]
    fn no_amplitude_is_no_torque() {
        assert_eq!(Cogging::<f64>::derive(&[0.0, 24.0, 0.5, 0.0]).torque(0.37), 0.0);
    }
}
