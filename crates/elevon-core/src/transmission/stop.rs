//! End stops. At a rigid one the position is held, and its reaction cancels what pushes outwards, so that the speed stays zero. One
//! with a stiffness is a spring and a damper that push back, never pull: J x'' = net - K (x - X) - C x' while pressed. A step
//! of it is taken in parts short against the swing, each by the implicit midpoint, which keeps the energy of the swing.

use crate::scalar::Scalar;

/// The stops of one coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Stop<S> {
    pub upper: S,
    pub lower: S,
    /// 0: rigid.
    pub stiffness: S,
    pub damping: S,
}

/// Most angle of the swing on a stop in a part of a step, rad, and most parts.
const SWING: f64 = 0.05;
const PARTS: f64 = 4096.0;

impl<S: Scalar> Stop<S> {
    /// The same stops behind a `ratio`.
    pub fn behind(&self, ratio: S) -> Self {
        let square = ratio * ratio;
        Self { upper: self.upper * ratio, lower: self.lower * ratio, stiffness: self.stiffness / square, damping: self.damping / square }
    }

    /// How far a stop is pressed in: positive at the upper one.
    #[inline(always)]
    fn pressed(&self, position: S) -> S {
        position - position.clamp(self.lower, self.upper)
    }

    /// Force of a stop with a stiffness.
    #[inline(always)]
    pub fn force(&self, position: S, speed: S) -> S {
        let zero = S::zero();
        let depth = self.pressed(position);
        let force = self.damping.fma(speed, self.stiffness * depth);
        S::select(zero.lt(depth), force.maximum(zero), S::select(depth.lt(zero), force.minimum(zero), zero))
    }

    /// Position and speed after a step that would end at these without the stops, which may be out of reach.
    #[inline(always)]
    pub fn give_way(&self, position: [S; 2], speed: [S; 2], inertia: S, dt: S) -> (S, S) {
        let zero = S::zero();
        let reached = !self.pressed(position[0]).equals(zero) | !self.pressed(position[1]).equals(zero);
        if !S::any(reached) {
            return (position[1], speed[1]);
        }
        let (at, after) = self.rebound([position[0], speed[0], speed[1]], inertia, dt);
        (S::select(reached, at, position[1]), S::select(reached, after, speed[1]))
    }

    /// A step of `dt` from a position and a speed under what would accelerate the `inertia` to `free` without the stop.
    #[inline(always)]
    fn rebound(&self, [mut position, mut speed, free]: [S; 3], inertia: S, dt: S) -> (S, S) {
        let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
        let swing = (self.stiffness / inertia).sqrt() * dt * S::splat(1.0 / SWING);
        let parts = -((-swing).floor()).clamp(S::splat(-PARTS), S::splat(-1.0));
        let short = dt / parts;
        let gain = (free - speed) / parts;
        let mut k = zero;
        // Lanes that have all their parts wait for the others.
        while S::any(k.lt(parts)) {
            let running = k.lt(parts);
            // The middle of the part without the stop, and how much a force moves it.
            let middle = short.fma(half * (half * gain + speed), position);
            let depth = self.pressed(middle);
            let mean = half.fma(gain, speed);
            let give = half * short / inertia;
            let stiff = half.fma(short * self.stiffness, self.damping);
            let pressing = self.stiffness.fma(depth - half * short * mean, stiff * mean) / give.fma(stiff, one);
            let pushes = S::select(zero.lt(depth), pressing.maximum(zero), S::select(depth.lt(zero), pressing.minimum(zero), zero));
            let force = S::select(running, pushes, zero);
            let after = speed + S::select(running, gain - force * short / inertia, zero);
            position = position + S::select(running, short * half * (speed + after), zero);
            speed = after;
            k = k + one;
        }
        (position, speed)
    }

    /// Would `push` drive outwards from where a stop stands?
    #[inline(always)]
    pub fn outwards(&self, position: S, push: S) -> S::Mask {
        let zero = S::zero();
        (self.upper.le(position) & zero.lt(push)) | (position.le(self.lower) & push.lt(zero))
    }

    /// What of the torque `net` is left to accelerate from `position` at `speed`: nothing at rest at a stop while it pushes
    /// outwards, all of it as soon as it pushes inwards.
    #[inline(always)]
    pub fn react(&self, position: S, speed: S, net: S) -> S {
        let at_rest = speed.equals(S::zero());
        if !S::any(at_rest) {
            return net;
        }
        S::select(at_rest & self.outwards(position, net), S::zero(), net)
    }

    /// Position and speed after a step: what passed a stop is put back to it, at rest (the impact is inelastic).
    #[inline(always)]
    pub fn hold(&self, position: S, speed: S) -> (S, S) {
        let (above, below) = (self.upper.lt(position), position.lt(self.lower));
        if !S::any(above | below) {
            return (position, speed);
        }
        let limited = S::select(above, self.upper, S::select(below, self.lower, position));
        (limited, S::select(above | below, S::zero(), speed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transmission::friction::Friction;

    const STOP: Stop<f64> = Stop { upper: 2.0, lower: -1.0, stiffness: 0.0, damping: 0.0 };

    /// A rotor against the stops by either method; returns position and speed after each step.
    fn run(semi_implicit: bool, position: f64, speed: f64, torque: impl Fn(usize) -> f64, steps: usize) -> Vec<(f64, f64)> {
        let (dt, per_inertia, fixed, moving) = (1e-4, 400.0, 0.4, 0.3_f64);
        let (mut x, mut w, mut all) = (position, speed, Vec::new());
        for i in 0..steps {
            let net = Friction::net_torque(torque(i), 0.0, w.signed(moving), w, fixed);
            let new = Friction::stop_at_reversal(w, w + dt * per_inertia * STOP.react(x, w, net));
            (x, w) = STOP.hold(x + dt * if semi_implicit { new } else { w }, new);
            all.push((x, w));
        }
        all
    }

    #[test]
    fn stays_at_rest_while_pushed_outwards() {
        for semi_implicit in [false, true] {
            let run = run(semi_implicit, 1.999, 3.0, |_| 1.0, 500);
            let arrived = run.iter().position(|s| s.1 == 0.0).unwrap_or(run.len());
            assert!(arrived < 100, "{arrived}");
            assert!(run[arrived..].iter().all(|&s| s == (2.0, 0.0)));
        }
    }

    #[test]
    fn leaves_at_once_when_the_torque_turns_inwards() {
        for (semi_implicit, side) in [(false, 1.0), (true, 1.0), (false, -1.0), (true, -1.0)] {
            let start = if side > 0.0 { 2.0 } else { -1.0 };
            let run = run(semi_implicit, start, 0.0, |i| side * if i < 20 { 1.0 } else { -1.0 }, 24);
            assert_eq!(run[19], (start, 0.0));
            let expected = -side * 1e-4 * 400.0 * (1.0 - 0.4);
            assert!((run[20].1 - expected).abs() < 1e-15, "{} against {expected}", run[20].1);
        }
    }

    #[test]
    fn friction_holds_at_the_stop_as_anywhere() {
        let run = run(false, 2.0, 0.0, |_| -0.399, 10);
        assert!(run.iter().all(|&s| s == (2.0, 0.0)));
    }

    #[test]
    fn a_stop_that_gives_way_swings_and_loses_what_its_damper_takes() {
        // J = 2, K = 800: 20 rad/s; the damper of the second case is 0.3 of the critical one.
        for (damping, dt) in [(0.0, 1e-3), (24.0, 1e-3), (0.0, 5e-2), (24.0, 5e-2)] {
            let stop = Stop { upper: 1.0, lower: -1.0, stiffness: 800.0, damping };
            let (mut x, mut v, mut deepest, mut last) = (0.999_f64, 3.0_f64, 0.0_f64, 0.0);
            for _ in 0..400 {
                if v < 0.0 && x < 1.0 {
                    break;
                }
                last = v;
                (x, v) = stop.give_way([x, x + dt * v], [v, v], 2.0, dt);
                deepest = deepest.max(x - 1.0);
            }
            let (zeta, omega) = (damping / (2.0 * 40.0), 20.0_f64);
            let turn = (1.0 - zeta * zeta).sqrt();
            // The damper lets go where its pull would pass the spring's push: tan(t) = 2 zeta turn / (1 - 2 zeta^2) before the end.
            let ends = std::f64::consts::PI - (2.0 * zeta * turn).atan2(1.0 - 2.0 * zeta * zeta);
            let angle = ends / turn;
            let speed = (-zeta * angle).exp() * ((turn * angle).cos() - zeta / turn * (turn * angle).sin());
            let expected = 3.0 * speed;
            assert!((v / expected - 1.0).abs() < 5e-3, "{damping} {dt}: {v} {expected} {last}");
            if dt < 1e-2 {
                let depth = 3.0 / omega * (-zeta / turn * zeta.acos()).exp();
                assert!((deepest / depth - 1.0).abs() < 5e-3, "{deepest} {depth}");
            }
        }
    }

    #[test]
    fn away_from_the_stops_nothing_changes() {
        assert_eq!(STOP.react(1.9, 0.0, 5.0), 5.0);
        assert_eq!(STOP.react(2.0, 1.0, 5.0), 5.0);
        assert_eq!(STOP.hold(1.9, 7.0), (1.9, 7.0));
    }
}
