//! Iron loss of the motor as a drag on its rotor: hysteresis, a torque that does not depend on the speed, and eddy currents, a
//! torque in proportion to it. The work against it is heat of the stator's iron, not friction of the shaft.
//!
//! Both stand for the magnets' flux that turns past the teeth, P ~ psi^2; what the currents add to that flux, and the iron's
//! temperature, are left out.

use crate::motor::star::MotorParameter;
use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;

variables! {
    /// Iron loss of the motor.
    IronLossParameter, IRON_LOSS {
        IronLoss => "iron_loss", "P_Fe", "W", NonNegative, Plant, Some(0.0), "iron loss at motor.iron_loss_speed and the healthy flux; 0: none";
        IronLossSpeed => "iron_loss_speed", "omega_r", "rad/s", Positive, Plant, Some(209.439_510_239_319_55), "speed at which motor.iron_loss is stated. ASSUMED: 2000 rpm",
            when(&[Away("motor.iron_loss", 0.0)]);
        IronLossEddy => "iron_loss_eddy", "-", "1", Unit, Plant, Some(0.5), "share of eddy currents in motor.iron_loss; the rest is hysteresis. ASSUMED: halves, usual for 0.35 mm sheets at 100 to 200 Hz",
            when(&[Away("motor.iron_loss", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct IronLoss<S> {
    /// Torque of the hysteresis, N m, and of the eddy currents over the speed.
    hysteresis: S,
    eddy: S,
}

impl<S: Scalar> IronLoss<S> {
    /// Is there any?
    pub fn needed(view: &View<IronLossParameter>) -> bool {
        view.away(IronLossParameter::IronLoss)
    }

    pub fn derive(raw: &[S], motor: &[S]) -> Self {
        use IronLossParameter as P;
        let flux = motor[MotorParameter::FluxFraction as usize];
        let rated = raw[P::IronLoss as usize] * flux * flux / raw[P::IronLossSpeed as usize];
        let eddy = raw[P::IronLossEddy as usize];
        Self { hysteresis: rated * (S::one() - eddy), eddy: rated * eddy / raw[P::IronLossSpeed as usize] }
    }

    /// Torque that opposes the rotor at a speed; at rest what it takes to turn it.
    #[inline(always)]
    pub fn drag(&self, speed: S) -> S {
        self.eddy.fma(speed.abs(), self.hysteresis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::star::MOTOR;

    #[test]
    fn the_stated_loss_is_lost_at_the_stated_speed() {
        let mut motor = vec![0.0; MOTOR.len()];
        motor[MotorParameter::FluxFraction as usize] = 1.0;
        let iron = |eddy: f64, motor: &[f64]| IronLoss::derive(&[11.0, 200.0, eddy], motor);
        for eddy in [0.0, 0.3, 1.0] {
            let x = iron(eddy, &motor);
            assert!((x.drag(200.0) * 200.0 - 11.0).abs() < 1e-12);
            // Half the speed: half the hysteresis, a quarter of the eddy currents.
            let half = 11.0 * (0.5 * (1.0 - eddy) + 0.25 * eddy);
            assert!((x.drag(-100.0) * 100.0 - half).abs() < 1e-12);
        }
        motor[MotorParameter::FluxFraction as usize] = 0.8;
        assert!((iron(0.5, &motor).drag(200.0) * 200.0 - 0.64 * 11.0).abs() < 1e-12);
    }
}
