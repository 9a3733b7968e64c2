//! What the bridge feeds.

use crate::scalar::Scalar;
use crate::three;

/// What lies behind the three terminals of the bridge during a step.
pub trait Circuit<S: Scalar> {
    /// Currents of the legs at its start.
    fn currents(&self) -> [S; 3];
    /// 1: the phase is interrupted (as soon as its current has passed zero).
    fn open(&self) -> [S; 3];
    /// Potentials of the terminals and of the neutral: connected legs hold theirs, the others float without current.
    fn potentials(&self, voltage: [S; 3], connected: [S::Mask; 3]) -> ([S; 3], S);
}

/// Currents and EMF of the windings at the bridge at the start of a step.
#[derive(Clone, Copy, Debug)]
pub struct Windings<S> {
    pub current: [S; 3],
    pub emf: [S; 3],
    /// v_n weighs the phases by 1 / L_j.
    pub per_inductance: [S; 3],
    pub resistance: [S; 3],
    /// 1: the phase is interrupted (as soon as its current has passed zero).
    pub open: [S; 3],
}

impl<S: Scalar> Circuit<S> for Windings<S> {
    #[inline(always)]
    fn currents(&self) -> [S; 3] {
        self.current
    }

    #[inline(always)]
    fn open(&self) -> [S; 3] {
        self.open
    }

    /// v_n over the connected phases; with none connected the EMFs float symmetrically between the rails.
    #[inline(always)]
    fn potentials(&self, voltage: [S; 3], connected: [S::Mask; 3]) -> ([S; 3], S) {
        let (mut sum, mut weight) = (S::zero(), S::zero());
        for j in 0..3 {
            let g = S::select(connected[j], self.per_inductance[j], S::zero());
            sum = sum + g * (voltage[j] - self.emf[j] - self.resistance[j] * self.current[j]);
            weight = weight + g;
        }
        let none = weight.equals(S::zero());
        let highest = self.emf[0].maximum(self.emf[1]).maximum(self.emf[2]);
        let lowest = self.emf[0].minimum(self.emf[1]).minimum(self.emf[2]);
        let floating = S::splat(-0.5) * (highest + lowest);
        let neutral = S::select(none, floating, sum / S::select(none, S::one(), weight));
        (three!(|j| S::select(connected[j], voltage[j], neutral + self.emf[j])), neutral)
    }
}
