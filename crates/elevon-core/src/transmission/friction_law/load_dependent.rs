//! Dry friction that grows with the torques on both sides of a gear, as the identification of servo actuators found it
//! (Duclusaud, Passault, Padois and Ly 2024, models m3 to m6; written for a load that is positive when it opposes):
//!
//! m3, m4: K |T + L|; m5: |K_m T + K_e L|; m6: Q_e L^2 where the motor drives against the load, Q_m T^2 where the load
//! drives against the motor. The second sets K_s, and the squares, fade with Stribeck's law.

use crate::scalar::Scalar;

/// Coefficients of the motor's and of the load's torque.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadTerms<S> {
    pub sliding: [S; 2],
    pub sticking: [S; 2],
    pub quadratic: [S; 2],
}

impl<S: Scalar> LoadTerms<S> {
    /// Friction at any speed, and what is added to it at rest.
    #[inline(always)]
    pub fn terms(&self, torque: S, load: S) -> [S; 2] {
        let along = |k: [S; 2]| k[0].fma(torque, k[1] * load).abs();
        let opposes = S::zero().lt(torque * load);
        let driven = load.abs().lt(torque.abs());
        let square = S::select(driven, self.quadratic[1] * load * load, self.quadratic[0] * torque * torque);
        [along(self.sliding), along(self.sticking) + S::select(opposes, square, S::zero())]
    }
}
