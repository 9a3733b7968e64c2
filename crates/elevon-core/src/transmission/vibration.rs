//! An accelerometer on the nut's housing (docs/explanation/theory/ballscrew.md, "Vibration"): forces at the orders of the shaft through
//! one resonance of the structure, a second-order system with a state of its own.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::{choices, kept, variables};

choices! {
    /// How the housing answers.
    VibrationModel { Off "off", Resonance "resonance" }
}

variables! {
    /// The housing on which an accelerometer sits.
    VibrationParameter, VIBRATION {
        Model => "model", "-", "1", Choice(VibrationModel::NAMES), Sensor, Some(0.0), "resonance: one mode of the structure carries the forces to the accelerometer; off: none is recorded", high_only("it has no accelerometer");
        Mass => "mass", "m", "kg", Positive, Sensor, Some(5.0), "mass of the mode", high_only("it has no accelerometer").when(&[Chosen("vibration.model", &["resonance"])]);
        Frequency => "frequency", "f_n", "Hz", Positive, Sensor, Some(1200.0), "natural frequency of the mode", high_only("it has no accelerometer").when(&[Chosen("vibration.model", &["resonance"])]);
        Damping => "damping", "zeta", "1", Unit, Sensor, Some(0.05), "damping ratio of the mode", high_only("it has no accelerometer").when(&[Chosen("vibration.model", &["resonance"])]);
        Approach => "approach", "delta_H", "m", Positive, Sensor, Some(1e-5), "elastic approach of a loaded ball: a spall that is deeper unloads the ball altogether", high_only("it has no accelerometer").when(&[Chosen("vibration.model", &["resonance"]), Either(&[Away("screw.spall_groove", 0.0), Away("screw.spall_nut", 0.0), Away("screw.spall_ball", 0.0)])]);
        GearTeeth => "gear_teeth", "z", "1", Count(0.0, f64::INFINITY), Sensor, Some(0.0), "teeth on the motor's shaft: order of the mesh; 0: no gear", high_only("it has no accelerometer").when(&[Chosen("vibration.model", &["resonance"]), Away("vibration.gear_ripple", 0.0)]);
        GearRipple => "gear_ripple", "-", "1/m", NonNegative, Sensor, Some(0.0), "force of the mesh per motor torque", high_only("it has no accelerometer").when(&[Chosen("vibration.model", &["resonance"]), Away("vibration.gear_teeth", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Vibration<S> {
    /// Per mass: stiffness 1/s2 and damping 1/s.
    stiffness: S,
    damping: S,
    per_mass: S,
    pub per_approach: S,
    teeth: S,
    ripple: S,
}

/// Displacement and speed of the mode.
#[derive(Clone, Copy, Debug)]
pub struct VibrationState<S> {
    pub displacement: S,
    pub speed: S,
    pub acceleration: S,
}

kept!(VibrationState<f64> as VibrationState { displacement, speed, acceleration });

impl<S: Scalar> VibrationState<S> {
    pub fn initial() -> Self {
        Self { displacement: S::zero(), speed: S::zero(), acceleration: S::zero() }
    }
}

impl<S: Scalar> Vibration<S> {
    /// No accelerometer.
    pub fn none() -> Self {
        let zero = S::zero();
        Self { stiffness: zero, damping: zero, per_mass: zero, per_approach: zero, teeth: zero, ripple: zero }
    }

    pub fn needed(view: &View<VibrationParameter>) -> bool {
        VibrationModel::read(view.value(VibrationParameter::Model)) != VibrationModel::Off
    }

    pub fn derive(raw: &[S]) -> Self {
        use VibrationParameter as P;
        let g = |p: P| raw[p as usize];
        let rate = S::splat(std::f64::consts::TAU) * g(P::Frequency);
        Self {
            stiffness: rate * rate,
            damping: S::splat(2.0) * g(P::Damping) * rate,
            per_mass: S::one() / g(P::Mass),
            per_approach: S::one() / g(P::Approach),
            teeth: g(P::GearTeeth),
            ripple: g(P::GearRipple),
        }
    }

    /// Force of the mesh, which follows the torque that it carries.
    #[inline(always)]
    pub fn mesh(&self, angle: S, torque: S) -> S {
        let (_, cos) = (self.teeth * angle).sin_cos();
        self.ripple * torque * cos
    }

    /// One step under a force, semi-implicit.
    #[inline(always)]
    pub fn step(&self, s: &mut VibrationState<S>, force: S, dt: S) {
        s.acceleration = self.per_mass * force - self.damping * s.speed - self.stiffness * s.displacement;
        s.speed = dt.fma(s.acceleration, s.speed);
        s.displacement = dt.fma(s.speed, s.displacement);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn mode() -> Vibration<f64> {
        let mut raw: Vec<f64> = VIBRATION.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        raw[VibrationParameter::Frequency as usize] = 1000.0;
        Vibration::derive(&raw)
    }

    /// Amplitude of the acceleration under a unit force of a frequency, after the start has died away.
    fn response(hertz: f64) -> f64 {
        let (mode, dt) = (mode(), 1e-6);
        let mut state = VibrationState::initial();
        let (mut sine, mut cosine) = (0.0, 0.0);
        let (begin, end) = (200_000, 300_000);
        for k in 0..end {
            let angle = TAU * hertz * f64::from(k) * dt;
            mode.step(&mut state, angle.sin(), dt);
            if k >= begin {
                sine += state.acceleration * angle.sin();
                cosine += state.acceleration * angle.cos();
            }
        }
        2.0 * sine.hypot(cosine) / f64::from(end - begin)
    }

    #[test]
    fn the_mode_answers_as_a_second_order_system() {
        for hertz in [100.0, 500.0, 1000.0, 3000.0] {
            let r: f64 = hertz / 1000.0;
            let exact = r * r / (1.0 - r * r).hypot(2.0 * 0.05 * r) / 5.0;
            assert!((response(hertz) / exact - 1.0).abs() < 5e-3, "{hertz}: {} {exact}", response(hertz));
        }
    }
}
