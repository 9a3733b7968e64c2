//! A resistor from a terminal to the star's centre tap: the stand's way to seed a short (N 4.3).
//!
//! The centre is no longer floating: the windings' currents sum to minus the resistors'. That makes the neutral
//! voltage stiff, so it is solved with the step's end: sum i_j + sum g_j (v_j - v_n) = 0 holds exactly after each
//! step, for any conductance, and returns to sum i_j = 0 in one step when the resistor is taken away.

use crate::scalar::Scalar;
use crate::three;
use crate::variable::Own;
use crate::variables;

variables! {
    /// Resistors between terminals and centre tap.
    TapParameter, TAP {
        TapLevelA => "tap_level_a", "f_a", "1", Between(0.0, 0.9), Plant, Some(0.0), "healthy 0; level f of the resistor R = ref (1 - f)/f from terminal a to the centre",
            high_only("the resistor draws its own current from the link and leaves the winding's alone");
        TapLevelB => "tap_level_b", "f_b", "1", Between(0.0, 0.9), Plant, Some(0.0), "healthy 0; level f of the resistor R = ref (1 - f)/f from terminal b to the centre",
            high_only("the resistor draws its own current from the link and leaves the winding's alone");
        TapLevelC => "tap_level_c", "f_c", "1", Between(0.0, 0.9), Plant, Some(0.0), "healthy 0; level f of the resistor R = ref (1 - f)/f from terminal c to the centre",
            high_only("the resistor draws its own current from the link and leaves the winding's alone");
        TapReference => "tap_reference", "ref", "ohm", Positive, Plant, Some(25.0), "resistance that stands for a level of one half",
            high_only("the resistor draws its own current from the link and leaves the winding's alone").when(&[Either(&[
                Away("motor.tap_level_a", 0.0), Away("motor.tap_level_b", 0.0), Away("motor.tap_level_c", 0.0),
            ])]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Tap<S> {
    pub conductance: [S; 3],
    per_dt: S,
}

impl<S: Scalar> Tap<S> {
    pub fn derive(raw: &[S], dt: S) -> Self {
        use TapParameter as P;
        let reference = raw[P::TapReference as usize];
        let conductance = three!(|j| {
            let level = raw[P::TapLevelA as usize + j];
            level / (reference * (S::one() - level))
        });
        Self { conductance, per_dt: S::one() / dt }
    }

    pub fn needed(own: &Own<TapParameter>) -> bool {
        own.any_away([TapParameter::TapLevelA, TapParameter::TapLevelB, TapParameter::TapLevelC])
    }

    /// The same over a share of a step.
    #[inline(always)]
    pub fn over(&self, share: S) -> Self {
        Self { per_dt: self.per_dt / share, ..*self }
    }

    /// Neutral voltage that closes Kirchhoff's law at the end of the step. `drop` is terminal voltage less EMF and R i.
    #[inline(always)]
    pub fn neutral(&self, terminal: [S; 3], drop: [S; 3], current: [S; 3], per_inductance: [S; 3]) -> S {
        let g = self.conductance;
        let driven = drop[0] * per_inductance[0] + drop[1] * per_inductance[1] + drop[2] * per_inductance[2];
        let tapped = g[0] * terminal[0] + g[1] * terminal[1] + g[2] * terminal[2];
        let sum = current[0] + current[1] + current[2];
        let weight = per_inductance[0] + per_inductance[1] + per_inductance[2];
        (driven + self.per_dt * (tapped + sum)) / (weight + self.per_dt * (g[0] + g[1] + g[2]))
    }

    /// Currents in the resistors at phase-to-neutral voltages.
    #[inline(always)]
    pub fn currents(&self, voltage: [S; 3]) -> [S; 3] {
        three!(|j| self.conductance[j] * voltage[j])
    }
}
