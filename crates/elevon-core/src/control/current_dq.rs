//! Carrier-PWM current control: PI in the rotor frame with decoupling, as the real drive has
//! (reference sheet 1.1: 4 kHz pulses). Sign convention of sheet 1.4:
//! v_q = R i_q + L di_q/dt + p omega L i_d + k omega, v_d = R i_d + L di_d/dt - p omega L i_q.

use crate::kept;
use crate::scalar::{three_phase, Scalar};
use crate::three;
use crate::variables;

variables! {
    /// The current controller and its carrier.
    PwmParameter, PWM {
        Frequency => "frequency", "f_pwm", "Hz", Positive, Controller, Some(4000.0), "frequency of the triangular carrier",
            when(&[Chosen("drive.kind", &["pwm"]), In(Low, &[Away("inverter.dead_time", 0.0)])]);
        SampleTime => "sample_time", "T_i", "s", Positive, Controller, Some(125e-6), "sample time of the current controller, half a carrier period: sampled at its peaks and valleys",
            high_only("a first-order lag stands for carrier, sampling and integral").when(&[Chosen("drive.kind", &["pwm"])]);
        ProportionalGain => "proportional_gain", "K_pi", "V/A", NonNegative, Controller, Some(0.0), "proportional gain of the current PI; L / tau gives the closed-loop time constant tau",
            when(&[Chosen("drive.kind", &["pwm"])]);
        IntegralGain => "integral_gain", "K_ii", "V/(A s)", NonNegative, Controller, Some(0.0), "integral gain of the current PI; R / tau cancels the motor's pole",
            high_only("a first-order lag stands for carrier, sampling and integral").when(&[Chosen("drive.kind", &["pwm"])]);
        Inductance => "inductance", "L_hat", "H", NonNegative, Controller, Some(0.0), "phase inductance the decoupling believes",
            high_only("a first-order lag stands for carrier, sampling and integral").when(&[Chosen("drive.kind", &["pwm"])]);
        EmfConstant => "emf_constant", "k_hat", "V s/rad", NonNegative, Controller, Some(0.0), "phase EMF constant (peak) the feed-forward believes",
            high_only("a first-order lag stands for carrier, sampling and integral").when(&[Chosen("drive.kind", &["pwm"])]);
        ComputationDelay => "computation_delay", "d", "1", Unit, Controller, Some(1.0), "sample times from the sampling of the currents until the duties computed from them act: 1, the usual drive, at the next sampling; 0: at once",
            high_only("a first-order lag stands for carrier, sampling and integral").when(&[Chosen("drive.kind", &["pwm"])]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct CurrentControl<S> {
    proportional: S,
    integral_step: S,
    inductance: S,
    emf_constant: S,
    pole_pairs: S,
    lead: S,
}

#[derive(Clone, Copy, Debug)]
pub struct CurrentControlState<S> {
    integral_d: S,
    integral_q: S,
    pub voltage_d: S,
    pub voltage_q: S,
    /// Size of the voltage that the controller wanted, before its limit.
    pub wanted: S,
    /// Phase voltage references over half the supply, to be compared with the carrier.
    pub modulation: [S; 3],
    /// Those of the last sample, which act after the computation delay.
    computed: [S; 3],
}

kept!(CurrentControlState<f64> as CurrentControlState { integral_d, integral_q, voltage_d, voltage_q, wanted, modulation, computed });

/// What the current controller sees at a tick.
#[derive(Clone, Copy, Debug)]
pub struct CurrentSample<S> {
    pub reference_d: S,
    pub reference_q: S,
    pub current_d: S,
    pub current_q: S,
    pub speed: S,
    pub angle: S,
    pub supply: S,
}

/// Proportional gain, in units of inductance per sample time, at which the current loop oscillates: with the duties
/// acting a share `delay` of a sample late, i(k+1) = i(k) + g (delay v(k-1) + (1 - delay) v(k)), v = -i, and Jury's
/// conditions on z^2 - (1 - g (1 - delay)) z + g delay are g delay < 1 and g (1 - 2 delay) < 2.
pub fn largest_gain(delay: f64) -> f64 {
    let alternating = if delay < 0.5 { 2.0 / (1.0 - 2.0 * delay) } else { f64::INFINITY };
    let turning = if delay > 0.0 { 1.0 / delay } else { f64::INFINITY };
    alternating.min(turning)
}

/// A voltage vector (d, q) that a circle limits: the direct component first, the quadrature one with what is left. The current
/// that makes no torque stays controlled, and all the voltage there is turns the rotor.
#[derive(Clone, Copy, Debug)]
pub struct Bounded<S> {
    wanted: [S; 2],
    pub voltage: [S; 2],
}

impl<S: Scalar> Bounded<S> {
    #[inline(always)]
    pub fn within(limit: S, wanted: [S; 2]) -> Self {
        let direct = wanted[0].clamp_abs(limit);
        let room = (limit * limit - direct * direct).maximum(S::zero()).sqrt();
        Self { wanted, voltage: [direct, wanted[1].clamp_abs(room)] }
    }

    /// Does the integrator of component `k` stand still? While its voltage is limited and the error drives it further out.
    #[inline(always)]
    pub fn holds(&self, k: usize, error: S) -> S::Mask {
        S::zero().lt((self.wanted[k] - self.voltage[k]) * error)
    }
}

impl<S: Scalar> CurrentControl<S> {
    pub fn derive(raw: &[S], pole_pairs: S) -> Self {
        use PwmParameter as P;
        let g = |p: P| raw[p as usize];
        Self {
            proportional: g(P::ProportionalGain),
            integral_step: g(P::IntegralGain) * g(P::SampleTime),
            inductance: g(P::Inductance),
            emf_constant: g(P::EmfConstant),
            pole_pairs,
            // The voltage acts over a tick after the delay: turn it by what the rotor moves until the middle of that tick.
            lead: (S::splat(0.5) + g(P::ComputationDelay)) * g(P::SampleTime) * pole_pairs,
        }
    }

    /// One tick; the voltage vector is limited to what a min-max modulated bridge can give, V / sqrt 3.
    #[inline(always)]
    pub fn step(&self, s: &mut CurrentControlState<S>, x: &CurrentSample<S>) {
        let (error_d, error_q) = (x.reference_d - x.current_d, x.reference_q - x.current_q);
        let electrical = self.pole_pairs * x.speed;
        let v_d = self.proportional * error_d + s.integral_d - electrical * self.inductance * x.current_q;
        let v_q = self.proportional * error_q + s.integral_q + electrical * self.inductance * x.current_d + self.emf_constant * x.speed;
        let limit = x.supply * S::splat(0.577_350_269_189_625_8);
        let bounded = Bounded::within(limit, [v_d, v_q]);
        [s.voltage_d, s.voltage_q] = bounded.voltage;
        s.wanted = (v_d * v_d + v_q * v_q).sqrt();
        s.integral_d = S::select(bounded.holds(0, error_d), s.integral_d, s.integral_d + self.integral_step * error_d);
        s.integral_q = S::select(bounded.holds(1, error_q), s.integral_q, s.integral_q + self.integral_step * error_q);
        self.modulate(s, x);
    }

    #[inline(always)]
    fn modulate(&self, s: &mut CurrentControlState<S>, x: &CurrentSample<S>) {
        let (sin, cos) = (x.angle + self.lead * x.speed).sin_cos();
        let (sa, ca) = three_phase(sin, cos);
        let per_half = S::splat(2.0) / x.supply;
        let phase: [S; 3] = three!(|j| (s.voltage_q * sa[j] - s.voltage_d * ca[j]) * per_half);
        let high = phase[0].maximum(phase[1]).maximum(phase[2]);
        let low = phase[0].minimum(phase[1]).minimum(phase[2]);
        let shift = S::splat(0.5) * (high + low);
        s.computed = three!(|j| phase[j] - shift);
    }
}

impl<S: Scalar> CurrentControlState<S> {
    pub fn initial() -> Self {
        let zero = S::zero();
        Self {
            integral_d: zero,
            integral_q: zero,
            voltage_d: zero,
            voltage_q: zero,
            wanted: zero,
            modulation: [zero; 3],
            computed: [zero; 3],
        }
    }

    /// The duties computed from the last sample act from now on.
    #[inline(always)]
    pub fn update(&mut self) {
        self.modulation = self.computed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 125e-6;

    /// A winding without resistance behind the controller, sampled each period; the error after a unit step.
    fn errors(gain: f64, delay: f64, samples: usize) -> Vec<f64> {
        let (inductance, supply) = (30e-3, 1e4);
        let mut raw = vec![0.0; PWM.len()];
        raw[PwmParameter::SampleTime as usize] = PERIOD;
        raw[PwmParameter::ProportionalGain as usize] = gain * inductance / PERIOD;
        raw[PwmParameter::ComputationDelay as usize] = delay;
        let control = CurrentControl::derive(&raw, 4.0);
        let mut state = CurrentControlState::initial();
        let mut current = 0.0;
        let mut errors = Vec::new();
        for _ in 0..samples {
            let sample =
                CurrentSample { reference_d: 0.0, reference_q: 1.0, current_d: 0.0, current_q: current, speed: 0.0, angle: 0.0, supply };
            // At angle zero the quadrature voltage stands between the phases c and b.
            let volts = |s: &CurrentControlState<f64>| (s.modulation[2] - s.modulation[1]) * supply / (2.0 * 3.0_f64.sqrt());
            let before = volts(&state);
            control.step(&mut state, &sample);
            state.update();
            current += PERIOD / inductance * (delay * before + (1.0 - delay) * volts(&state));
            errors.push(1.0 - current);
        }
        errors
    }

    #[test]
    fn at_its_limit_the_direct_voltage_comes_first_and_each_integrator_stops_by_itself() {
        let within = Bounded::within(5.0, [3.0, 1.0]);
        assert_eq!((within.voltage, within.holds(0, 0.1), within.holds(1, -0.1)), ([3.0, 1.0], false, false));
        let beyond = Bounded::within(5.0, [-3.0, 9.0]);
        assert_eq!(beyond.voltage, [-3.0, 4.0]);
        assert_eq!([beyond.holds(0, -0.1), beyond.holds(1, 0.1), beyond.holds(1, -0.1)], [false, true, false]);
        assert_eq!(Bounded::within(5.0, [-8.0, 9.0]).voltage, [-5.0, 0.0]);
    }

    #[test]
    fn an_integrating_winding_is_stable_up_to_the_gain_of_the_delay() {
        for delay in [0.0, 0.3, 0.5, 1.0] {
            let limit = largest_gain(delay);
            let size = |share: f64| errors(share * limit, delay, 600).iter().rev().take(9).fold(0.0, |a: f64, b| a.max(b.abs()));
            assert!(size(0.97) < 0.05, "{delay}: {}", size(0.97));
            assert!(size(1.03) > 1.0, "{delay}: {}", size(1.03));
        }
    }
}
