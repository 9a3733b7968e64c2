//! Motor resolver: commutation angle, motor position and, through its converter, motor speed (N 4.5).
//!
//! Channel mismatch scales the sine channel: the shown angle is atan2(g sin, cos). While its power is off the
//! converter shows a shaft at rest: the held angle or zero, and no speed.

use crate::scalar::Scalar;
use crate::variable::Own;
use crate::{choices, variables};

choices! {
    /// What a converter shows without power.
    LossShows { Held "held", Zero "zero" }
}

variables! {
    /// The resolver on the motor shaft.
    ResolverParameter, RESOLVER {
        Mismatch => "resolver.mismatch", "-", "1", Between(0.0, 0.99), Sensor, Some(0.0), "amplitude lost by the sine channel";
        Offset => "resolver.offset", "-", "rad", Any, Sensor, Some(0.0), "offset of the shown motor angle";
        Gain => "resolver.gain", "-", "1", Any, Sensor, Some(1.0), "gain of the shown motor position and speed (not of the commutation angle)";
        PowerOff => "resolver.power_off", "-", "1", Unit, Sensor, Some(0.0), "1 while the resolver has no power";
        LossShows => "resolver.loss_shows", "-", "1", Choice(LossShows::NAMES), Sensor, Some(0.0), "what the converter shows without power",
            when(&[Away("sensor.resolver.power_off", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Resolver<S> {
    gain_less: S,
    channel: S,
    offset: S,
    gain: S,
    power_off: S,
    zero_when_off: S,
}

#[derive(Clone, Copy, Debug)]
pub struct Reading<S> {
    /// Motor angle for commutation, unwrapped.
    pub angle: S,
    pub position: S,
    pub speed: S,
}

impl<S: Scalar> Resolver<S> {
    pub fn derive(raw: &[S]) -> Self {
        use ResolverParameter as P;
        let g = |p: P| raw[p as usize];
        let channel = S::one() - g(P::Mismatch);
        Self {
            gain_less: -g(P::Mismatch),
            channel,
            offset: g(P::Offset),
            gain: g(P::Gain),
            power_off: g(P::PowerOff),
            zero_when_off: S::indicator(S::mask(LossShows::read(g(P::LossShows)) == LossShows::Zero)),
        }
    }

    /// Does it ever show another angle than the shaft's?
    pub fn needed(own: &Own<ResolverParameter>) -> bool {
        use ResolverParameter as P;
        own.any_away([P::Mismatch, P::Offset, P::Gain, P::PowerOff])
    }

    /// Reading at angle `theta`, speed `omega`; `held` is the last angle shown with power on.
    #[inline(always)]
    pub fn read(&self, theta: S, omega: S, held: &mut S) -> Reading<S> {
        let off = S::splat(0.5).lt(self.power_off);
        let (sin, cos) = theta.sin_cos();
        // atan2(g s, c) = theta + atan2((g - 1) s c, c^2 + g s^2): unwrapped, and exact.
        let (ss, cc) = (sin * sin, cos * cos);
        let error = S::atan2_right(self.gain_less * sin * cos, cc + self.channel * ss);
        // d/dt atan2(g s, c) = omega g / (c^2 + g^2 s^2): the converter tracks what it shows.
        let rate = self.channel / (cc + self.channel * self.channel * ss);
        let shown = theta + error + self.offset;
        *held = S::select(off, *held, shown);
        let lost = S::select(S::splat(0.5).lt(self.zero_when_off), S::zero(), *held);
        let angle = S::select(off, lost, shown);
        let speed = S::select(off, S::zero(), omega * rate);
        Reading { angle, position: self.gain * angle, speed: self.gain * speed }
    }
}
