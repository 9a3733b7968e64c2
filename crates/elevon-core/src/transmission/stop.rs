//! End stops: at one the position is held, and its reaction cancels what pushes outwards, so that the speed stays zero.

use crate::scalar::Scalar;

/// The stops of one coordinate.
#[derive(Clone, Copy, Debug)]
pub struct Stop<S> {
    pub upper: S,
    pub lower: S,
}

impl<S: Scalar> Stop<S> {
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

    const STOP: Stop<f64> = Stop { upper: 2.0, lower: -1.0 };

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
    fn away_from_the_stops_nothing_changes() {
        assert_eq!(STOP.react(1.9, 0.0, 5.0), 5.0);
        assert_eq!(STOP.react(2.0, 1.0, 5.0), 5.0);
        assert_eq!(STOP.hold(1.9, 7.0), (1.9, 7.0));
    }
}
