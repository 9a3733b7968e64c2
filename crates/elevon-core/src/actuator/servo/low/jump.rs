//! Jumps of the speed error behind the derivative's filter. A step of the reduced-order model is long against the filter's time
//! T = T_d / N: of a jump y its answer K_p N y exp(-t/T) passes as the mean over the step of what the torque's limit and
//! the slope g of the current leave of it. What changes smoothly has a slope instead, K_p T_d times it.
//!
//!     above the limit until   t_1 = T ln(K_p N y / limit)
//!     met by the current at   t_2 = T W(K_p N y / (g T)), W the inverse of x exp(x)
//!     torque x time           g t_2 (t_2/2 + max(t_2/2, T)): up with the slope g; down with it, or with the filter

use crate::actuator::servo::layout::*;
use crate::control::position_speed::ControlParameter;
use crate::kept;
use crate::scalar::Scalar;

/// What a step's slope may demand, of the torque limit, before a change counts as a jump.
const SMOOTH: f64 = 0.1;
/// A remainder of a jump that demands less than this part of the torque limit is none.
const GONE: f64 = 1e-6;
/// Time of a filter that passes at once, s.
const INSTANT: f64 = 1e-12;

/// Constants of the derivative's filter.
#[derive(Clone, Copy, Debug)]
pub struct Jumps<S> {
    /// K_p N and T.
    gain: S,
    time: S,
    decay: S,
    dt: S,
    /// Smallest jump, and smallest rest of one.
    least: S,
    gone: S,
}

/// What the filter holds of jumps, and the readings before.
#[derive(Clone, Copy, Debug)]
pub struct JumpState<S> {
    change: S,
    pub(super) level: S,
    /// Set point of the step before; before the first step the shaft's speed, of which the filter knows nothing.
    pub(super) reference: S,
    /// Speed that the resolver showed, and that of the shaft.
    pub(super) reading: S,
    pub(super) motion: S,
}

kept!(JumpState<f64> as JumpState { change, level, reference, reading, motion });

/// Mean torque over a step, and what the torque's limit cuts off, N m s.
pub(super) struct Kick<S> {
    pub torque: S,
    pub cut: S,
}

impl<S: Scalar> Jumps<S> {
    pub(super) fn derive(raw: &[S], active: bool, dt: S) -> Self {
        let at = |p: ControlParameter| raw[p.at()];
        let (zero, one) = (S::zero(), S::one());
        let td = at(ControlParameter::DerivativeTime);
        let there = S::mask(active);
        // With T_d = 0 the filter passes at once: a time that no step sees, with the slope of T_d.
        let time = S::select(zero.lt(td), td, td + S::splat(INSTANT)) / at(ControlParameter::DerivativeFilter);
        let speed_gain = at(ControlParameter::SpeedGain) * at(ControlParameter::SpeedGainScale);
        let gain = S::select(there, speed_gain * at(ControlParameter::DerivativeFilter), zero);
        let limit = at(ControlParameter::TorqueConstant) * at(ControlParameter::CurrentLimit);
        let never = S::splat(f64::INFINITY);
        let demands = zero.lt(gain);
        let per = |x: S| S::select(demands, limit / S::select(demands, x, one), never);
        Self {
            gain,
            time,
            decay: (-(dt / time)).exp(),
            dt,
            least: S::splat(SMOOTH) * per(speed_gain * td) * dt,
            gone: S::splat(GONE) * per(gain),
        }
    }

    /// A change over a step as a slope and a jump: what the step before did not do is a jump where it is large.
    #[inline(always)]
    pub(super) fn split(&self, s: &mut JumpState<S>, change: S) -> (S, S) {
        let zero = S::zero();
        let alike = zero.lt(change * s.change);
        let steady = S::select(alike, change.signed(change.abs().minimum(s.change.abs())), zero);
        s.change = change;
        let remainder = change - steady;
        let jump = S::select(self.least.lt(remainder.abs()), remainder, zero);
        (change - jump, jump)
    }

    /// The answer to a new jump and what is left of those before.
    #[inline(always)]
    pub(super) fn pass(&self, s: &mut JumpState<S>, jump: S, limit: S, slew: S) -> Kick<S> {
        let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
        let level = s.level + jump;
        let request = self.gain * level.abs();
        let limit = limit.maximum(S::splat(f64::MIN_POSITIVE));
        let until = (self.time * (request / limit).maximum(one).ln()).minimum(self.dt);
        let cut = (request * self.time * (one - (-(until / self.time)).exp()) - limit * until).maximum(zero);
        let whole = request * self.time * (one - self.decay) - cut;
        let t = (self.time * lambert(request / (slew * self.time))).minimum(self.dt);
        let followed = slew * t * (half * t + (half * t).maximum(self.time));
        let remainder = level * self.decay;
        s.level = S::select(remainder.abs().lt(self.gone), zero, remainder);
        Kick { torque: level.signed(whole.minimum(followed)) / self.dt, cut: level.signed(cut) }
    }
}

impl<S: Scalar> JumpState<S> {
    pub(super) fn start(speed: S) -> Self {
        Self { change: S::zero(), level: S::zero(), reference: speed, reading: speed, motion: speed }
    }
}

/// W(x) for x >= 0 within 2 % (Winitzki's form).
#[inline(always)]
fn lambert<S: Scalar>(x: S) -> S {
    let one = S::one();
    let l = (one + x).ln();
    l * (one - (one + l).ln() / (S::splat(2.0) + l))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jumps(gain: f64, time: f64) -> Jumps<f64> {
        let dt = 5e-4;
        Jumps { gain, time, decay: (-dt / time).exp(), dt, least: 1.0, gone: 1e-9 }
    }

    #[test]
    fn the_inverse_is_one() {
        for w in [1e-3_f64, 0.1, 0.5, 1.0, 3.0, 9.0, 20.0] {
            assert!((lambert(w * w.exp()) / w - 1.0).abs() < 0.02, "{w}");
        }
    }

    #[test]
    fn a_slow_filter_passes_all_of_a_jump() {
        let (j, mut s) = (jumps(2.0, 2e-3), JumpState::start(0.0));
        let mut sum = 0.0;
        for k in 0..60 {
            let kick = j.pass(&mut s, if k == 0 { 3.0 } else { 0.0 }, 1e9, 1e9);
            sum += kick.torque * j.dt;
            assert_eq!(kick.cut, 0.0);
        }
        let passed = 1.0 - f64::exp(-60.0 * j.dt / 2e-3);
        assert!((sum / (2.0 * 2e-3 * 3.0) - passed).abs() < 1e-12, "{sum}");
    }

    #[test]
    fn limit_and_slope_leave_little_of_a_sharp_one() {
        let (gain, time, limit, slew) = (200.0, 1e-5, 30.0, 1e4);
        let (j, mut s) = (jumps(gain, time), JumpState::start(0.0));
        let kick = j.pass(&mut s, -40.0, limit, slew);
        // The reference and a current of a limited slope, step by step.
        let (mut t, mut torque, mut sum, mut cut, h) = (0.0, 0.0_f64, 0.0, 0.0, 1e-8);
        while t < 5e-4 {
            let wanted = gain * 40.0 * f64::exp(-t / time);
            cut += (wanted - limit).max(0.0) * h;
            torque += (wanted.min(limit) - torque).clamp(-slew * h, slew * h);
            sum += torque * h;
            t += h;
        }
        assert!((kick.torque * j.dt / -sum - 1.0).abs() < 0.1, "{} {sum}", kick.torque * j.dt);
        assert!((kick.cut / -cut - 1.0).abs() < 1e-3, "{} {cut}", kick.cut);
        assert_eq!(s.level, 0.0);
    }

    #[test]
    fn what_changes_smoothly_is_no_jump() {
        let (j, mut s) = (jumps(2.0, 2e-3), JumpState::start(0.0));
        for k in 1..50 {
            assert_eq!(j.split(&mut s, 0.3 * f64::from(k)), (0.3 * f64::from(k), 0.0));
        }
        assert_eq!(j.split(&mut s, 40.0), (14.7, 40.0 - 14.7));
        assert_eq!(j.split(&mut s, -0.2), (-0.2, 0.0));
    }
}
