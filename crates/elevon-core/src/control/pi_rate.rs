//! PI speed control behind a rate limiter, gains by direction (P 2.1.4 and Table 2.1). It runs at control ticks.

use crate::kept;
use crate::scalar::Scalar;
use crate::variables;

variables! {
    /// Speed control.
    PiRateParameter, PI_RATE {
        GainExtension => "gain_extension", "K_cw", "V s/rad", NonNegative, Controller, None, "proportional gain in extension";
        GainRetraction => "gain_retraction", "K_cw", "V s/rad", NonNegative, Controller, None, "proportional gain in retraction";
        ZeroExtension => "zero_extension", "z_cw", "1/s", NonNegative, Controller, None, "zero of the PI in extension";
        ZeroRetraction => "zero_retraction", "z_cw", "1/s", NonNegative, Controller, None, "zero of the PI in retraction";
        AccelerationLimit => "acceleration_limit", "-", "rad/s2", Positive, Controller, None, "largest change of the speed reference";
        Period => "period", "T", "s", Positive, Controller, None, "period of the control unit";
    }
}

/// State of one controller.
#[derive(Clone, Copy, Debug, Default)]
pub struct PiRate {
    pub reference: f64,
    integral: f64,
}

kept!(PiRate as PiRate { reference, integral });

impl PiRate {
    /// Demanded voltage, within the supply; the integral stops where it would push further into the limit.
    pub fn step(&mut self, raw: &[f64], extending: bool, target: f64, measured: f64, supply: f64) -> f64 {
        use PiRateParameter as P;
        let side = usize::from(!extending);
        let (gain, zero) = (raw[P::GainExtension as usize + side], raw[P::ZeroExtension as usize + side]);
        let period = raw[P::Period as usize];
        let change = raw[P::AccelerationLimit as usize] * period;
        self.reference += (target - self.reference).clamp_abs(change);
        let error = self.reference - measured;
        let step = gain * zero * error * period;
        let wanted = gain * error + self.integral + step;
        if wanted.abs() <= supply || wanted * error < 0.0 {
            self.integral += step;
        }
        (gain * error + self.integral).clamp_abs(supply)
    }
}
