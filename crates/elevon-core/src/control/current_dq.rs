//! Carrier-PWM current control: PI in the rotor frame with decoupling, as the real drive has
//! (reference sheet 1.1: 4 kHz pulses). Sign convention of sheet 1.4:
//! v_q = R i_q + L di_q/dt + p omega L i_d + k omega, v_d = R i_d + L di_d/dt - p omega L i_q.

use crate::scalar::{three_phase, Scalar};
use crate::three;
use crate::variables;

variables! {
    /// The current controller and its carrier.
    PwmParameter, PWM {
        Frequency => "frequency", "f_pwm", "Hz", Positive, Controller, Some(4000.0), "frequency of the triangular carrier",
            high_only("a first-order lag stands for carrier, sampling and integral").when(&[Chosen("drive.kind", &["pwm"])]);
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
    }
}

#[derive(Clone, Copy, Debug)]
pub struct CurrentControl<S> {
    proportional: S,
    integral_step: S,
    inductance: S,
    emf_constant: S,
    pole_pairs: S,
    frequency: S,
    lead: S,
}

#[derive(Clone, Copy, Debug)]
pub struct CurrentControlState<S> {
    integral_d: S,
    integral_q: S,
    pub voltage_d: S,
    pub voltage_q: S,
    /// Phase voltage references over half the supply, to be compared with the carrier.
    pub modulation: [S; 3],
}

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
            frequency: g(P::Frequency),
            // The voltage acts over the coming tick: turn it by half of what the rotor moves meanwhile.
            lead: S::splat(0.5) * g(P::SampleTime) * pole_pairs,
        }
    }

    /// One tick; the voltage vector is limited to what a min-max modulated bridge can give, V / sqrt 3,
    /// and the integrators stand still while it is.
    #[inline(always)]
    pub fn step(&self, s: &mut CurrentControlState<S>, x: &CurrentSample<S>) {
        let (error_d, error_q) = (x.reference_d - x.current_d, x.reference_q - x.current_q);
        let electrical = self.pole_pairs * x.speed;
        let v_d = self.proportional * error_d + s.integral_d - electrical * self.inductance * x.current_q;
        let v_q = self.proportional * error_q + s.integral_q + electrical * self.inductance * x.current_d + self.emf_constant * x.speed;
        let limit = x.supply * S::splat(0.577_350_269_189_625_8);
        let magnitude = (v_d * v_d + v_q * v_q).sqrt();
        let limited = limit.lt(magnitude);
        let scale = S::select(limited, limit / magnitude, S::one());
        s.voltage_d = v_d * scale;
        s.voltage_q = v_q * scale;
        s.integral_d = S::select(limited, s.integral_d, s.integral_d + self.integral_step * error_d);
        s.integral_q = S::select(limited, s.integral_q, s.integral_q + self.integral_step * error_q);
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
        s.modulation = three!(|j| phase[j] - shift);
    }

    /// Gate signals: +1 while the reference stands above the triangular carrier, else -1.
    #[inline(always)]
    pub fn compare(&self, s: &CurrentControlState<S>, t: S) -> [S; 3] {
        let x = t * self.frequency;
        let cycle = x - x.floor();
        let carrier = S::splat(4.0) * (cycle - S::splat(0.5)).abs() - S::one();
        three!(|j| S::select(carrier.le(s.modulation[j]), S::one(), -S::one()))
    }
}

impl<S: Scalar> CurrentControlState<S> {
    pub fn rest() -> Self {
        let zero = S::zero();
        Self { integral_d: zero, integral_q: zero, voltage_d: zero, voltage_q: zero, modulation: [zero; 3] }
    }
}
