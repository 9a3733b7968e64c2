//! Temperature of a screw's nut: its friction heats it, the air cools it (docs/explanation/theory/thermal.md, "The nut").
//!
//! One node on the tick of the motor's network: C dT/dt = P - (T - T_a)/R, backward Euler with the mean heat of the tick.

use crate::kept;
use crate::scalar::Scalar;

#[derive(Clone, Copy, Debug)]
pub struct NutHeat<S> {
    /// Part of the screw's loss that the nut takes.
    pub share: S,
    /// Heat capacity over the tick, W/K.
    inertia: S,
    /// W/K to the air.
    conductance: S,
    ambient: S,
    per_period: S,
}

#[derive(Clone, Copy, Debug)]
pub struct NutState<S> {
    pub temperature: S,
    /// Heat since the last tick, J.
    pub collected: S,
    /// Mean of the last tick, W.
    pub power: S,
}

kept!(NutState<f64> as NutState { temperature, collected, power });

impl<S: Scalar> NutHeat<S> {
    /// Heat capacity J/K, resistance to the air K/W, share of the loss, the air's temperature and the tick, s.
    pub fn derive(capacity: S, resistance: S, share: S, ambient: S, period: f64) -> Self {
        let period = S::splat(period);
        Self { share, inertia: capacity / period, conductance: S::one() / resistance, ambient, per_period: S::one() / period }
    }

    /// No nut: nothing warms it.
    pub fn none() -> Self {
        let (zero, one) = (S::zero(), S::one());
        Self { share: zero, inertia: one, conductance: one, ambient: zero, per_period: zero }
    }

    pub fn start(&self) -> NutState<S> {
        NutState { temperature: self.ambient, collected: S::zero(), power: S::zero() }
    }

    pub fn tick(&self, s: &mut NutState<S>) {
        s.power = s.collected * self.per_period;
        let given = self.inertia * s.temperature + s.power + self.conductance * self.ambient;
        s.temperature = given / (self.inertia + self.conductance);
        s.collected = S::zero();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steady_heat_follows_the_exponential_and_closes_the_balance() {
        let (capacity, resistance, ambient, period, power) = (700.0, 1.2, 293.15, 0.01, 25.0);
        let node = NutHeat::<f64>::derive(capacity, resistance, 0.5, ambient, period);
        let mut state = node.start();
        let mut given = 0.0;
        for k in 1..=200_000 {
            state.collected = power * period;
            node.tick(&mut state);
            given += period * (state.temperature - ambient) / resistance;
            if k % 50_000 == 0 {
                let t = f64::from(k) * period;
                let rise = power * resistance * (1.0 - (-t / (capacity * resistance)).exp());
                assert!((state.temperature - ambient - rise).abs() < 1e-3);
            }
        }
        let stored = capacity * (state.temperature - ambient);
        assert!((power * 2000.0 - stored - given).abs() < 1e-6 * power * 2000.0);
    }
}
