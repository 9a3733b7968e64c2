//! Rigid flanks under a load (docs/explanation/theory/rotary.md, "Backlash under load"): where a force or friction acts on the output,
//! motor and output move as one while a flank carries, each by itself while they cross the backlash.

use super::loads::Loads;
use super::{Shaft, ShaftDetails, ShaftState};
use crate::actuator::servo::advance::Instant;
use crate::kept;
use crate::scalar::Scalar;

/// Keeps a massless, undamped output's speed a number.
const MASSLESS: f64 = 1e-30;
/// Share of half the backlash from which on a flank of the plain operator counts as reached.
const REACHED: f64 = 1.0 - 1e-9;

/// Which flank of the backlash carries.
#[derive(Clone, Copy, Debug)]
pub struct Flank<S> {
    /// 1: the motor is ahead, -1: the output is, 0: none carries.
    pub side: S,
    /// Force that presses the flanks together, as the last step left it; not above zero: it may have gone.
    pressed: S,
    /// 1 once a force or friction has acted on the output; before, the output stays where the motor left it.
    acting: S,
}

kept!(Flank<f64> as Flank { side, pressed, acting });

/// Output after a step by itself.
struct Free<S> {
    speed: S,
    /// Its momentum, and the inertia that this momentum moves: mass, and damping and spring over the step.
    momentum: S,
    inertia: S,
}

impl<S: Scalar> Flank<S> {
    /// Has nothing acted on the output so far?
    #[inline(always)]
    pub(super) fn idle(&self) -> S::Mask {
        self.acting.equals(S::zero())
    }

    /// Flank at which a `lag` of the output stands.
    pub(super) fn at(lag: S, half: S) -> Self {
        let zero = S::zero();
        Self { side: S::select(half.le(lag.abs()), lag.signed(S::one()), zero), pressed: zero, acting: zero }
    }
}

impl<S: Scalar> Shaft<S> {
    /// Do motor and output move as one?
    #[inline(always)]
    pub(super) fn joined(&self, s: &ShaftState<S>) -> S::Mask {
        !s.flank.side.equals(S::zero()) | s.flank.idle()
    }

    /// Inertia of what moves with the motor.
    #[inline(always)]
    pub(in crate::actuator::servo) fn moving_inertia(&self, d: &ShaftDetails, s: &ShaftState<S>) -> S {
        if d.flanks {
            S::select(self.joined(s), self.inertia, self.rotor_inertia)
        } else {
            self.inertia
        }
    }

    #[inline(always)]
    pub(super) fn half_backlash(&self, d: &ShaftDetails, position: S) -> S {
        if d.train.teeth {
            self.backlash.half + self.train.lag(position)
        } else {
            self.backlash.half
        }
    }

    /// Whether the flank that carried still does over the coming step: it lets go where motor and output, each by itself,
    /// would part.
    #[inline(always)]
    pub(in crate::actuator::servo) fn hold_flank<const EXTRA: bool>(
        &self,
        d: &ShaftDetails,
        x: &Instant<S>,
        s: &mut ShaftState<S>,
        torque: S,
    ) {
        let (zero, one) = (S::zero(), S::one());
        let force = self.output_torque(d, x, s);
        let friction = if EXTRA && d.load_side { self.load_side_friction(d, x) } else { zero };
        s.flank.acting = S::select(force.equals(zero) & friction.equals(zero), s.flank.acting, one);
        let side = s.flank.side;
        let half = self.half_backlash(d, s.motor_position);
        let doubtful = !side.equals(zero) & s.flank.pressed.le(zero) & zero.lt(s.flank.acting) & zero.lt(half);
        if !S::any(doubtful) {
            return;
        }
        let mut alone = *s;
        alone.flank = Flank { side: zero, acting: one, ..s.flank };
        let loads = self.loads::<true, EXTRA>(d, x, &alone, torque);
        let motor = self.acceleration::<true, EXTRA>(d, &alone, &loads, torque, S::one() / self.rotor_inertia) * self.gear.per_ratio;
        let speed = s.motor_speed * self.gear.per_ratio;
        let output = (self.free_output(d, speed, force, friction).speed - speed) / self.dt;
        let parts = ((motor - output) * side).lt(zero);
        s.flank.side = S::select(doubtful & parts, zero, side);
        if d.compliant {
            // What lets go is no longer wound up.
            let slack = s.motor_position * self.gear.per_ratio - side * half;
            s.output_position = S::select(doubtful & parts, slack, s.output_position);
        }
    }

    /// Place of an output on a flank at `slack`, wound up by what acts on it: x = slack - c (T + K_s (x - x_0)).
    #[inline(always)]
    fn wound(&self, d: &ShaftDetails, x: &Instant<S>, slack: S) -> S {
        if !d.compliant {
            return slack;
        }
        let load = if d.weight { x.output + self.gear.constant } else { x.output };
        let at_zero = load - self.gear.stiffness * self.gear.spring_zero;
        (slack - self.compliance * at_zero) / self.compliance.fma(self.gear.stiffness, S::one())
    }

    /// A step of the output by itself: damping, spring and dry friction are implicit, so that any inertia runs.
    #[inline(always)]
    fn free_output(&self, d: &ShaftDetails, speed: S, force: S, friction: S) -> Free<S> {
        let pushed = self.output_inertia * speed - self.dt * force;
        let momentum = pushed - pushed.clamp_abs(self.dt * friction);
        let damping = if d.load_side { self.load_damping } else { S::zero() };
        let inertia = self.output_inertia + self.dt * (damping + self.dt * self.gear.stiffness);
        Free { speed: momentum / inertia.maximum(S::splat(MASSLESS)), momentum, inertia }
    }

    /// Output and flank after a step that brought the motor from `old` to its position and speed in `s`.
    #[inline(always)]
    pub(super) fn output_at_flank<const EXTRA: bool>(
        &self,
        d: &ShaftDetails,
        x: &Instant<S>,
        s: &mut ShaftState<S>,
        loads: &Loads<S>,
        old: S,
    ) {
        let per_ratio = self.gear.per_ratio;
        let (joined, before) = (self.joined(s), *s);
        let friction = if EXTRA && d.load_side { self.load_side_friction(d, x) } else { S::zero() };
        let (driver, half) = (s.motor_position * per_ratio, self.half_backlash(d, s.motor_position));
        self.follow_joined(d, x, s, [driver, half]);
        if S::any(joined) {
            self.press(d, s, loads.output_torque, friction, [old, before.motor_speed].map(|speed| speed * per_ratio));
        }
        if !S::any(!joined) {
            return;
        }
        let mut apart = before;
        self.cross(d, &mut apart, [loads.output_torque, friction, x.brake], [driver, half]);
        let pick = |a: S, b: S| S::select(joined, a, b);
        s.motor_speed = pick(s.motor_speed, apart.motor_speed);
        s.output_position = pick(s.output_position, apart.output_position);
        s.output_speed = pick(s.output_speed, apart.output_speed);
        s.flank.side = pick(s.flank.side, apart.flank.side);
        s.flank.pressed = pick(s.flank.pressed, apart.flank.pressed);
        s.work.load = pick(s.work.load, apart.work.load);
        s.work.friction = pick(s.work.friction, apart.work.friction);
        s.work.brake = pick(s.work.brake, apart.work.brake);
        s.work.impact = pick(s.work.impact, apart.work.impact);
    }

    /// The output on the flank that carries; before anything has acted on it, as the plain operator leaves it.
    #[inline(always)]
    fn follow_joined(&self, d: &ShaftDetails, x: &Instant<S>, s: &mut ShaftState<S>, [driver, half]: [S; 2]) {
        let (zero, one) = (S::zero(), S::one());
        let idle = s.flank.idle();
        let left = s.output_position.clamp(driver - half, driver + half);
        let lag = driver - left;
        let moves = (half * S::splat(REACHED)).le(lag.abs()) & zero.le(lag * s.motor_speed);
        let side = S::select(moves, lag.signed(one), zero);
        let speed = s.motor_speed * self.gear.per_ratio;
        s.output_position = S::select(idle, left, self.wound(d, x, driver - s.flank.side * half));
        s.output_speed = S::select(idle & !moves, zero, speed);
        s.flank.side = S::select(idle, side, s.flank.side);
    }

    /// Force on the flank that a joined step has needed: what the output took, at rest the least it may have been.
    #[inline(always)]
    fn press(&self, d: &ShaftDetails, s: &mut ShaftState<S>, force: S, friction: S, [old, new]: [S; 2]) {
        let zero = S::zero();
        let side = s.flank.side;
        let middle = old + new;
        let dry = S::select(middle.equals(zero), -(side * friction), middle.signed(friction));
        let damping = if d.load_side { self.load_damping * old } else { zero };
        let carried = force + dry + damping + self.output_inertia * ((new - old) / self.dt);
        s.flank.pressed = carried * side;
    }

    /// Motor and output apart for a step, or for as much of it as they take to meet: they meet inelastically.
    #[inline(always)]
    fn cross(&self, d: &ShaftDetails, s: &mut ShaftState<S>, [force, friction, brake]: [S; 3], [driver, half]: [S; 2]) {
        let (zero, one) = (S::zero(), S::one());
        let (per_ratio, old) = (self.gear.per_ratio, s.output_speed);
        let free = self.free_output(d, old, force, friction);
        // The mean of both speeds is exact for a constant force; a massless output moves with the new one.
        let mean = if d.middle { S::splat(0.5) * (old + free.speed) } else { free.speed };
        let moved = self.dt.fma(mean, s.output_position);
        let lag = driver - moved;
        let reached = moved.clamp(driver - half, driver + half);
        let approach = lag.signed(s.motor_speed * per_ratio - free.speed);
        let meets = half.le(lag.abs()) & zero.le(approach);
        let side = S::select(meets, lag.signed(one), zero);
        let inertia = free.inertia.fma(per_ratio * per_ratio, self.rotor_inertia);
        let merged = free.momentum.fma(per_ratio, self.rotor_inertia * s.motor_speed) / inertia;
        let motor = S::select(meets, merged, s.motor_speed);
        let output = S::select(meets, merged * per_ratio, free.speed);
        if d.accounts {
            let mean = S::select(meets, (reached - s.output_position) / self.dt, S::splat(0.5) * (old + free.speed));
            self.account_crossing(d, s, [force, friction, brake], mean);
            let lost = self.kinetic_of(s.motor_speed, old) - self.kinetic_of(motor, output) - self.taken(d, [force, friction], mean);
            s.work.impact = s.work.impact + S::select(meets, lost, zero);
        }
        s.motor_speed = motor;
        s.output_speed = output;
        s.output_position = reached;
        s.flank.side = side;
        s.flank.pressed = zero;
    }

    /// Energy of motor and output at their speeds.
    #[inline(always)]
    pub(super) fn kinetic_of(&self, motor: S, output: S) -> S {
        S::splat(0.5) * (self.rotor_inertia * motor * motor + self.output_inertia * output * output)
    }

    /// Energy that load, friction and damping take from an output that crosses for a step at a mean speed.
    #[inline(always)]
    fn taken(&self, d: &ShaftDetails, [force, friction]: [S; 2], mean: S) -> S {
        let damping = if d.load_side { self.load_damping * mean } else { S::zero() };
        self.dt * (force + mean.signed(friction) + damping) * mean
    }

    /// The shares of what is taken.
    #[inline(always)]
    fn account_crossing(&self, d: &ShaftDetails, s: &mut ShaftState<S>, [force, friction, brake]: [S; 3], mean: S) {
        let braked = if d.linear { self.dt * brake * mean.abs() } else { S::zero() };
        s.work.load = s.work.load + self.dt * force * mean;
        s.work.brake = s.work.brake + braked;
        s.work.friction = s.work.friction + self.taken(d, [S::zero(), friction], mean) - braked;
    }
}
