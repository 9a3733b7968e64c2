//! Position P and speed PID with limits and anti-windup (T2, T3; reference sheet 1.3), or one PID from the position error to
//! the torque, T = K (e + 1/T_i int e dt + T_d de/dt), its derivative filtered at N / T_d (Astrom and Hagglund 1995, ch. 3).
//! A cascade has the real zeros -G and -1/T_i; those of a PID may be complex.

use crate::scalar::Scalar;
use crate::variable::acts::When;
use crate::variable::{Switch, View};
use crate::{choices, kept, variables};

choices! {
    /// What a command sets.
    Mode { Position "position", Speed "speed", Torque "torque" }
    /// When the position error freezes the integrator.
    ErrorHold { Off "off", Below "below", Above "above" }
    /// What makes a torque of a position command.
    Structure { Cascade "cascade", Pid "pid" }
    /// What closes the position loop.
    Feedback { Output "output", Encoder "encoder", Resolver "resolver" }
}

variables! {
    /// What the actuator control electronics believe and do.
    ControlParameter, CONTROL {
        Mode => "mode", "-", "1", Choice(Mode::NAMES), Controller, Some(0.0), "what the command is: a position, a speed (bypasses the position loop) or a torque (bypasses both loops)",
            nowhere("the command of the scenario states what it is");
        PositionGain => "position_gain", "G", "1/s", NonNegative, Controller, None, "output position error to motor-shaft speed reference",
            when(&[Chosen("control.mode", &["position"]), Chosen("control.structure", &["cascade"])]);
        PositionGainScale => "position_gain_scale", "-", "1", NonNegative, Controller, Some(1.0), "healthy 1; drift of the position gain",
            when(&[Chosen("control.mode", &["position"]), Chosen("control.structure", &["cascade"])]);
        SpeedFeedforward => "speed_feedforward", "g_ff", "1", Between(0.0, 1.5), Controller, Some(0.0), "share of the commanded speed (difference of the command over one tick) added to the speed reference",
            when(&[Chosen("control.mode", &["position"]), Chosen("control.structure", &["cascade"])]);
        SpeedGain => "speed_gain", "K_p", "N m s/rad", NonNegative, Controller, None, "proportional gain of the speed PID, on all branches",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE]);
        SpeedGainScale => "speed_gain_scale", "-", "1", NonNegative, Controller, Some(1.0), "healthy 1; drift of the speed gain",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE]);
        IntegralTime => "integral_time", "T_i", "s", NonNegative, Controller, Some(0.0), "K_i = K_p / T_i; 0: no integral action",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE]);
        DerivativeTime => "derivative_time", "T_d", "s", NonNegative, Controller, Some(0.0), "derivative time; 0: no derivative action",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE]);
        DerivativeFilter => "derivative_filter", "N", "1", Positive, Controller, Some(1000.0), "the derivative's filter pole stands at N / T_d",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE, Away("control.derivative_time", 0.0)]);
        SpeedLimit => "speed_limit", "omega_max", "rad/s", Positive, Controller, None, "limit of the speed reference",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE]);
        CurrentLimit => "current_limit", "I_max", "A", Positive, Controller, None, "limit of the quadrature current reference, peak";
        TorqueConstant => "torque_constant", "k_t", "N m/A", Positive, Controller, None, "torque per peak ampere that the controller believes, 1.5 k when it knows the motor";
        AntiWindupRest => "anti_windup_rest", "AW1", "1", Choice(Switch::NAMES), Controller, Some(0.0), "freeze the integrator while the speed is zero for more than one step",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE, Away("control.integral_time", 0.0)]);
        AntiWindupError => "anti_windup_error", "AW2", "1", Choice(ErrorHold::NAMES), Controller, Some(0.0), "freeze the integrator while the position error is below (T2) or above (T3) the threshold",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE, Away("control.integral_time", 0.0)]);
        AntiWindupThreshold => "anti_windup_threshold", "-", "rad", NonNegative, Controller, Some(0.0), "position error threshold of anti_windup_error, at the output",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE, Away("control.integral_time", 0.0), Chosen("control.anti_windup_error", &["below", "above"])]);
        AntiWindupBackCalculation => "anti_windup_back_calculation", "AW3", "1/s", NonNegative, Controller, Some(0.0), "gain from (saturated - demanded) torque back to the integrator; 0: off",
            when(&[Chosen("control.mode", &["position", "speed"]), CASCADE, Away("control.integral_time", 0.0)]);
        ConditionalIntegration => "conditional_integration", "-", "1", Choice(Switch::NAMES), Controller, Some(0.0), "integrate only while the torque reference is not limited",
            when(&[Chosen("control.mode", &["position", "speed"]), Either(&[Away("control.integral_time", 0.0), Away("control.pid_integral_time", 0.0)])]);
        SampleTime => "sample_time", "T_s", "s", NonNegative, Controller, Some(0.0), "sample time of the controller; 0: every solver step",
            when(&[In(Low, &[Away("screw.debris", 0.0)])]);
        NoiseDeviation => "noise_deviation", "-", "rad", NonNegative, Controller, Some(0.0), "standard deviation of the band-limited noise on the command line (unit of the output position)";
        NoiseSampleTime => "noise_sample_time", "-", "s", Positive, Controller, Some(1e-3), "the noise is held over this time, which sets its band",
            when(&[Away("control.noise_deviation", 0.0)]);
        PositionFeedback => "position_feedback", "-", "1", Choice(Feedback::NAMES), Controller, Some(0.0), "what closes the position loop: the output position itself (the papers' model), the output encoder's counts, or the motor resolver divided by the ratio",
            when(&[Chosen("control.mode", &["position"])]);
        Structure => "structure", "-", "1", Choice(Structure::NAMES), Controller, Some(0.0), "a position error commands a speed and the speed error a torque (cascade), or one PID makes a torque of the position error (pid)",
            when(&[Chosen("control.mode", &["position"])]);
        PidGain => "pid_gain", "K", "N m/rad", NonNegative, Controller, Some(0.0), "output position error to torque on the motor shaft, on all branches of the position PID",
            when(&[Chosen("control.mode", &["position"]), Chosen("control.structure", &["pid"])]);
        PidIntegralTime => "pid_integral_time", "T_i", "s", NonNegative, Controller, Some(0.0), "integral time of the position PID; 0: no integral action",
            when(&[Chosen("control.mode", &["position"]), Chosen("control.structure", &["pid"]), Away("control.pid_gain", 0.0)]);
        PidDerivativeTime => "pid_derivative_time", "T_d", "s", NonNegative, Controller, Some(0.0), "derivative time of the position PID, on the error; 0: no derivative action",
            when(&[Chosen("control.mode", &["position"]), Chosen("control.structure", &["pid"]), Away("control.pid_gain", 0.0)]);
        PidDerivativeFilter => "pid_derivative_filter", "N", "1", Positive, Controller, Some(10.0), "the position PID's derivative filter stands at N / T_d",
            when(&[Chosen("control.mode", &["position"]), Chosen("control.structure", &["pid"]), Away("control.pid_gain", 0.0), Away("control.pid_derivative_time", 0.0)]);
    }
}

/// The loops of the cascade are closed: always under a speed command.
const CASCADE: When = When::Either(&[When::Chosen("control.mode", &["speed"]), When::Chosen("control.structure", &["cascade"])]);

/// The switches that give a controller its structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ControlStructure {
    pub mode: Mode,
    pub derivative: bool,
    pub hold_at_rest: bool,
    pub hold_on_error: ErrorHold,
    pub back_calculation: bool,
    pub feedforward: bool,
    pub conditional: bool,
    pub feedback: Feedback,
    /// One PID makes a torque of the position error.
    pub pid: bool,
}

impl ControlStructure {
    /// Does one PID close the position loop?
    pub fn single<S: Scalar>(raw: &[S]) -> bool {
        let mode = Mode::read(raw[ControlParameter::Mode as usize]);
        mode == Mode::Position && Structure::read(raw[ControlParameter::Structure as usize]) == Structure::Pid
    }

    pub fn read(view: &View<ControlParameter>) -> Self {
        use ControlParameter as P;
        let (raw, on) = (view.raw, |p: P| view.used(p));
        let switched = |p: P| Switch::read(raw[p as usize]) == Switch::On;
        let pid = Self::single(raw);
        Self {
            mode: Mode::read(raw[P::Mode as usize]),
            pid,
            derivative: on(if pid { P::PidDerivativeTime } else { P::DerivativeTime }),
            hold_at_rest: switched(P::AntiWindupRest) && !pid,
            hold_on_error: if pid { ErrorHold::Off } else { ErrorHold::read(raw[P::AntiWindupError as usize]) },
            back_calculation: on(P::AntiWindupBackCalculation) && !pid,
            feedforward: on(P::SpeedFeedforward) && !pid,
            conditional: switched(P::ConditionalIntegration),
            feedback: Feedback::read(raw[P::PositionFeedback as usize]),
        }
    }
}

/// The position loop of a cascade: a speed for the output's error, and a share of the commanded speed.
#[derive(Clone, Copy, Debug)]
pub struct PositionLoop<S> {
    pub gain: S,
    /// Command difference of one tick to speed reference.
    feedforward: S,
}

impl<S: Scalar> PositionLoop<S> {
    /// `ratio` is the motor's angle over the commanded coordinate, `dt` the tick.
    pub fn derive(raw: &[S], ratio: S, dt: S) -> Self {
        let g = |p: ControlParameter| raw[p as usize];
        Self {
            gain: g(ControlParameter::PositionGain) * g(ControlParameter::PositionGainScale),
            feedforward: g(ControlParameter::SpeedFeedforward) * ratio / dt,
        }
    }

    /// Speed that the change of the command since the last tick asks for; `before` keeps the command, NaN before the first.
    #[inline(always)]
    pub fn ahead(&self, before: &mut S, command: S) -> S {
        let moved = command - *before;
        *before = command;
        S::select(moved.equals(moved), self.feedforward * moved, S::zero())
    }
}

/// Constants of the controller at its tick `ts`, discretised exactly for inputs held over a tick.
#[derive(Clone, Copy, Debug)]
pub struct PositionSpeed<S> {
    position: PositionLoop<S>,
    speed_gain: S,
    integral_step: S,
    derivative_gain: S,
    derivative_decay: S,
    speed_limit: S,
    pub torque_limit: S,
    per_torque_constant: S,
    threshold: S,
    back_step: S,
}

#[derive(Clone, Copy, Debug)]
pub struct PositionSpeedState<S> {
    pub integral: S,
    pub filtered_error: S,
    /// 1 if the speed was zero at the previous tick.
    pub rested: S,
    pub speed_ref: S,
    pub torque_ref: S,
    /// Limit of the torque reference: the controller's, or what derating and a direct current leave of it.
    pub torque_limit: S,
    /// Command of the previous tick; NaN before the first.
    command: S,
}

kept!(PositionSpeedState<f64> as PositionSpeedState { integral, filtered_error, rested, speed_ref, torque_ref, torque_limit, command });

impl<S: Scalar> PositionSpeed<S> {
    /// `ratio` is the motor's angle over the commanded coordinate.
    pub fn derive(raw: &[S], ts: f64, ratio: S) -> Self {
        use ControlParameter as P;
        let g = |p: P| raw[p as usize];
        let pid = ControlStructure::single(raw);
        let gain = if pid { g(P::PidGain) } else { g(P::SpeedGain) * g(P::SpeedGainScale) };
        let guarded = |x: S| S::select(x.equals(S::zero()), S::one(), x);
        let present = |x: S| S::indicator(S::zero().lt(x));
        let (ti, td, filter) = if pid {
            (g(P::PidIntegralTime), g(P::PidDerivativeTime), g(P::PidDerivativeFilter))
        } else {
            (g(P::IntegralTime), g(P::DerivativeTime), g(P::DerivativeFilter))
        };
        let dt = S::splat(ts);
        // The filter decays exactly over a tick, and a ramp gives K_p T_d times its slope at any tick: the gain N of the
        // continuous form is its limit for short ticks, the difference of two samples that for long ones.
        let decay = S::one() - present(td) * (-(filter * dt / guarded(td))).exp();
        Self {
            position: PositionLoop::derive(raw, ratio, dt),
            speed_gain: gain,
            integral_step: present(ti) * gain / guarded(ti) * dt,
            derivative_gain: gain * td / dt * decay,
            derivative_decay: decay,
            speed_limit: g(P::SpeedLimit),
            torque_limit: g(P::TorqueConstant) * g(P::CurrentLimit),
            per_torque_constant: S::one() / g(P::TorqueConstant),
            threshold: g(P::AntiWindupThreshold),
            back_step: g(P::AntiWindupBackCalculation) * dt,
        }
    }

    /// One tick: the quadrature current reference from the command and the sensors' readings.
    #[inline(always)]
    pub fn step(&self, structure: &ControlStructure, s: &mut PositionSpeedState<S>, command: S, position: S, speed: S) -> S {
        let position_error = command - position;
        if structure.pid {
            return self.single(structure, s, command, position_error, speed);
        }
        let demanded = match structure.mode {
            Mode::Position if structure.feedforward => {
                let ahead = self.position.ahead(&mut s.command, command);
                self.position.gain.fma(position_error, ahead)
            }
            Mode::Position => self.position.gain * position_error,
            Mode::Speed => command,
            Mode::Torque => {
                s.torque_ref = command.clamp_abs(s.torque_limit);
                return s.torque_ref * self.per_torque_constant;
            }
        };
        s.speed_ref = demanded.clamp_abs(self.speed_limit);
        let error = s.speed_ref - speed;
        let mut torque = self.speed_gain.fma(error, s.integral);
        if structure.derivative {
            let difference = error - s.filtered_error;
            torque = self.derivative_gain.fma(difference, torque);
            s.filtered_error = self.derivative_decay.fma(difference, s.filtered_error);
        }
        s.torque_ref = torque.clamp_abs(s.torque_limit);
        self.integrate(structure, s, error, torque, position_error, speed);
        s.torque_ref * self.per_torque_constant
    }

    /// One tick of the position PID.
    #[inline(always)]
    fn single(&self, structure: &ControlStructure, s: &mut PositionSpeedState<S>, command: S, error: S, speed: S) -> S {
        let mut torque = self.speed_gain.fma(error, s.integral);
        if structure.derivative {
            // Not one kick before the first tick: the filter starts from the first error.
            let known = s.command.equals(s.command);
            s.command = command;
            s.filtered_error = S::select(known, s.filtered_error, error);
            let difference = error - s.filtered_error;
            torque = self.derivative_gain.fma(difference, torque);
            s.filtered_error = self.derivative_decay.fma(difference, s.filtered_error);
        }
        s.torque_ref = torque.clamp_abs(s.torque_limit);
        self.integrate(structure, s, error, torque, error, speed);
        s.torque_ref * self.per_torque_constant
    }

    /// 1 while the speed or the torque reference stands at its limit.
    pub fn limited(&self, s: &PositionSpeedState<S>) -> S {
        S::indicator(self.speed_limit.le(s.speed_ref.abs()) | s.torque_limit.le(s.torque_ref.abs()))
    }

    #[inline(always)]
    fn integrate(&self, structure: &ControlStructure, s: &mut PositionSpeedState<S>, error: S, torque: S, position_error: S, speed: S) {
        let mut change = self.integral_step * error;
        if structure.conditional {
            change = S::select(s.torque_ref.equals(torque), change, S::zero());
        }
        if structure.back_calculation {
            change = change + self.back_step * (s.torque_ref - torque);
        }
        if structure.hold_at_rest {
            let at_rest = speed.equals(S::zero());
            let frozen = at_rest & S::zero().lt(s.rested);
            change = S::select(frozen, S::zero(), change);
            s.rested = S::indicator(at_rest);
        }
        if structure.hold_on_error != ErrorHold::Off {
            let below = position_error.abs().lt(self.threshold);
            let frozen = if structure.hold_on_error == ErrorHold::Below { below } else { !below };
            change = S::select(frozen, S::zero(), change);
        }
        s.integral = s.integral + change;
    }
}

impl<S: Scalar> PositionSpeedState<S> {
    pub fn initial(torque_limit: S) -> Self {
        let zero = S::zero();
        let command = S::splat(f64::NAN);
        Self { integral: zero, filtered_error: zero, rested: zero, speed_ref: zero, torque_ref: zero, torque_limit, command }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: f64 = 1e-3;
    const GAIN: f64 = 3.0;

    fn pid(integral_time: f64, derivative_time: f64) -> (PositionSpeed<f64>, ControlStructure) {
        let mut raw = [0.0; CONTROL.len()];
        for (at, value) in [
            (ControlParameter::Structure, Structure::Pid.index()),
            (ControlParameter::PidGain, GAIN),
            (ControlParameter::PidIntegralTime, integral_time),
            (ControlParameter::PidDerivativeTime, derivative_time),
            (ControlParameter::PidDerivativeFilter, 10.0),
            (ControlParameter::TorqueConstant, 1.0),
            (ControlParameter::CurrentLimit, 100.0),
            (ControlParameter::ConditionalIntegration, Switch::On.index()),
        ] {
            raw[at as usize] = value;
        }
        (PositionSpeed::derive(&raw, TICK, 1.0), ControlStructure::read(&View::new(&raw, &[false; CONTROL.len()])))
    }

    /// Torque references for position errors of one tick after the other.
    fn torques(controller: &(PositionSpeed<f64>, ControlStructure), errors: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut state = PositionSpeedState::initial(controller.0.torque_limit);
        errors.map(|e| controller.0.step(&controller.1, &mut state, e, 0.0, 7.0)).collect()
    }

    #[test]
    fn a_position_pid_integrates_a_held_error() {
        let seen = torques(&pid(0.5, 0.0), std::iter::repeat_n(2.0, 200));
        for (k, torque) in seen.iter().enumerate() {
            let expected = GAIN * 2.0 * (1.0 + k as f64 * TICK / 0.5);
            assert!((torque - expected).abs() < 1e-12 * expected, "{k}: {torque} {expected}");
        }
    }

    #[test]
    fn a_position_pid_derives_a_ramp_and_does_not_kick_at_the_start() {
        let slope = 4.0;
        let seen = torques(&pid(0.0, 0.02), (0..100).map(|k| 1.0 + slope * k as f64 * TICK));
        assert_eq!(seen[0], GAIN);
        // The filter's lag T_d / N has passed 50 times.
        let error = 1.0 + slope * 99.0 * TICK;
        assert!((seen[99] - GAIN * (error + 0.02 * slope)).abs() < 1e-12);
    }

    #[test]
    fn at_its_limit_the_position_pid_integrates_no_further() {
        let seen = torques(&pid(0.1, 0.0), std::iter::repeat_n(50.0, 300).chain(std::iter::repeat_n(1.0, 2)));
        assert_eq!(seen[299], 100.0);
        assert_eq!(seen[300], GAIN);
    }
}
