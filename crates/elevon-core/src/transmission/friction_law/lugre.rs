//! LuGre's bristles (Canudas de Wit, Olsson, Astrom and Lischinsky 1995):
//!
//! dz/dt = w - sigma_0 |w| z / g(w), friction sigma_0 z + sigma_1 dz/dt (the viscous part stands with the shaft's own).
//!
//! Stiff bristles on a light rotor are faster than any step. The new speed and the new deflection are therefore solved
//! together, implicitly in both:
//!
//! w+ = w + h/J (T - sigma_0 z+ - sigma_1 (z+ - z)/h),  z+ = (z + h w+) / (1 + sigma_0 h |w+| / g).
//!
//! The sign of w+ is that of the speed the bristles as they stand would leave; its size solves a quadratic. So any
//! stiffness runs at any step, steady sliding is exact (z = g/sigma_0), |z| never exceeds g/sigma_0 by sliding, and a stiff
//! bristle tends to exact sticking.

use crate::scalar::Scalar;
use crate::transmission::stop::Stop;

#[derive(Clone, Copy, Debug)]
pub struct Bristle<S> {
    /// sigma_0 and sigma_1.
    pub stiffness: S,
    pub damping: S,
}

/// What the shaft and its bristles move under in a step.
#[derive(Clone, Copy, Debug)]
pub struct Push<S> {
    /// Speed after the step, were there no dry friction.
    pub free: S,
    /// Limit at rest and g(w).
    pub limits: [S; 2],
    pub dt: S,
    /// h / J.
    pub dt_per_inertia: S,
}

/// After the step.
#[derive(Clone, Copy, Debug)]
pub struct Moved<S> {
    pub speed: S,
    pub bristle: S,
    /// Mean dry friction over the step.
    pub dry: S,
}

/// Friction below which there is none: it only keeps divisions finite, N m.
const NONE: f64 = 1e-12;

impl<S: Scalar> Bristle<S> {
    /// Speed and deflection after a step.
    #[inline(always)]
    pub fn advance(&self, push: &Push<S>, bristle: S) -> Moved<S> {
        let (h, k) = (push.dt, push.dt_per_inertia);
        let [fixed, moving] = push.limits;
        // A limit that fell (a released brake) lets go of what the bristles held above it.
        let z = bristle.clamp_abs(fixed / self.stiffness);
        let sticking = push.free - k * self.stiffness * z;
        let c = self.stiffness * h / moving.maximum(S::splat(NONE));
        // c u^2 + b u - |sticking| = 0 for the size u of the new speed.
        let ahead = push.free + k * self.damping * z / h;
        let b = k.fma(self.stiffness.fma(h, self.damping), S::one()) - sticking.signed(c * ahead);
        let root = b.fma(b, S::splat(4.0) * c * sticking.abs()).sqrt();
        let rising = S::zero().le(b);
        let size = S::select(rising, S::splat(2.0) * sticking.abs(), root - b) / S::select(rising, b + root, S::splat(2.0) * c);
        self.moved(push, z, sticking.signed(size))
    }

    /// The same at an end stop: at rest there, what would leave `outwards` stays, and its bristles with it.
    #[inline(always)]
    pub fn advance_at_stop(&self, push: &Push<S>, bristle: S, speed: S, stop: &Stop<S>, position: S) -> Moved<S> {
        let moved = self.advance(push, bristle);
        let stopped = speed.equals(S::zero()) & stop.outwards(position, moved.speed);
        if !S::any(stopped) {
            return moved;
        }
        let sticking = self.moved(push, bristle, S::zero());
        Moved {
            speed: S::select(stopped, sticking.speed, moved.speed),
            bristle: S::select(stopped, sticking.bristle, moved.bristle),
            dry: S::select(stopped, sticking.dry, moved.dry),
        }
    }

    /// Deflection and friction with the new speed given: solved, or zero at a stop.
    #[inline(always)]
    pub fn moved(&self, push: &Push<S>, bristle: S, speed: S) -> Moved<S> {
        let per_limit = self.stiffness / push.limits[1].maximum(S::splat(NONE));
        let next = push.dt.fma(speed, bristle) / (per_limit * push.dt).fma(speed.abs(), S::one());
        let rate = (next - bristle) / push.dt;
        Moved { speed, bristle: next, dry: self.damping.fma(rate, self.stiffness * next) }
    }

    /// Friction at an instant: what the last step ended with.
    #[inline(always)]
    pub fn torque(&self, bristle: S, speed: S, moving: S) -> S {
        let rate = speed - self.stiffness * speed.abs() * bristle / moving.maximum(S::splat(NONE));
        self.damping.fma(rate, self.stiffness * bristle)
    }
}
