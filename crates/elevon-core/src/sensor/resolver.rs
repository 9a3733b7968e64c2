//! Motor resolver: commutation angle, motor position and, through its converter, motor speed (N 4.5).
//!
//! The converter reports atan2(y, x) of its channels y = a sin(theta) + o_s, x = b cos(theta + delta) + o_c. Channel mismatch and
//! shorted turns lower an amplitude, an open winding leaves a residue; delta is the quadrature error of windings that do not stand
//! at a right angle, o_s and o_c are offsets of the demodulated channels. To first order the angle errs by
//! (a - b)/2 sin(2 theta) + delta/2 (1 - cos(2 theta)) + o_s cos(theta) - o_c sin(theta). The converter divides the channels, so
//! that a weaker excitation turns no angle (and weighs the offsets more). Without power, or with too little signal, it reports a
//! shaft at rest: the last angle or zero, no speed.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::{choices, kept, variables};

choices! {
    /// What a converter reports without power.
    LossShows { Held "held", Zero "zero" }
}

variables! {
    /// The resolver on the motor shaft.
    ResolverParameter, RESOLVER {
        Mismatch => "resolver.mismatch", "-", "1", Between(0.0, 0.99), Sensor, Some(0.0), "amplitude lost by the sine channel";
        Offset => "resolver.offset", "-", "rad", Any, Sensor, Some(0.0), "offset of the reported motor angle";
        Gain => "resolver.gain", "-", "1", Any, Sensor, Some(1.0), "gain of the reported motor position and speed (not of the commutation angle)";
        PowerOff => "resolver.power_off", "-", "1", Flag, Sensor, Some(0.0), "1 while the resolver has no power";
        LossShows => "resolver.loss_shows", "-", "1", Choice(LossShows::NAMES), Sensor, Some(0.0), "what the converter reports without power",
            when(&[Either(&[
                Away("sensor.resolver.power_off", 0.0), Away("sensor.resolver.excitation_short", 0.0), Away("sensor.resolver.sine_open", 0.0),
                Away("sensor.resolver.cosine_open", 0.0), Away("sensor.resolver.sine_short", 0.0), Away("sensor.resolver.cosine_short", 0.0),
            ])]);
        SineShort => "resolver.sine_short", "-", "1", Between(0.0, 0.99), Sensor, Some(0.0), "fraction of the turns of the sine winding shorted";
        CosineShort => "resolver.cosine_short", "-", "1", Between(0.0, 0.99), Sensor, Some(0.0), "fraction of the turns of the cosine winding shorted";
        ExcitationShort => "resolver.excitation_short", "-", "1", Between(0.0, 0.99), Sensor, Some(0.0), "fraction of the excitation lost by shorted turns: both channels weaken, the angle stays until too little is left";
        SineOpen => "resolver.sine_open", "-", "1", Flag, Sensor, Some(0.0), "1: the sine winding is interrupted",
            high_only("the reported angle leaps by half a turn in a small part of its step");
        CosineOpen => "resolver.cosine_open", "-", "1", Flag, Sensor, Some(0.0), "1: the cosine winding is interrupted",
            high_only("the reported angle leaps by half a turn in a small part of its step");
        OpenResidue => "resolver.open_residue", "-", "1", Between(1e-6, 0.5), Sensor, Some(1e-3), "amplitude left in the channel of an open winding by stray coupling; ASSUMED: 0.1 %, a capacitive path of the cable",
            high_only("the reported angle leaps by half a turn in a small part of its step").when(&[Either(&[Away("sensor.resolver.sine_open", 0.0), Away("sensor.resolver.cosine_open", 0.0)])]);
        LeastSignal => "resolver.least_signal", "-", "1", Unit, Sensor, Some(0.7), "amplitude of the stronger channel below which the converter has no signal; ASSUMED: where common converters report the loss",
            when(&[Either(&[
                Away("sensor.resolver.excitation_short", 0.0), Away("sensor.resolver.sine_open", 0.0), Away("sensor.resolver.cosine_open", 0.0),
                Away("sensor.resolver.sine_short", 0.0), Away("sensor.resolver.cosine_short", 0.0),
            ])]);
        TrackingLimit => "resolver.tracking_limit", "-", "rad/s", Positive, Sensor, Some(6_283.185_307_179_586), "largest speed the converter reports; ASSUMED: 1000 turns/s, a common converter of 12 bits",
            when(&[Either(&[
                Away("sensor.resolver.mismatch", 0.0), Away("sensor.resolver.sine_open", 0.0), Away("sensor.resolver.cosine_open", 0.0),
                Away("sensor.resolver.sine_short", 0.0), Away("sensor.resolver.cosine_short", 0.0), Away("sensor.resolver.quadrature", 0.0),
                Away("sensor.resolver.sine_offset", 0.0), Away("sensor.resolver.cosine_offset", 0.0),
            ])]);
        Quadrature => "resolver.quadrature", "delta", "rad", Between(-0.3, 0.3), Sensor, Some(0.0), "healthy 0; angle by which the cosine winding deviates from its right angle to the sine winding: the reported angle errs by half of it in the mean and at twice the shaft frequency";
        SineOffset => "resolver.sine_offset", "o_s", "1", Between(-0.2, 0.2), Sensor, Some(0.0), "healthy 0; offset of the demodulated sine channel over its healthy amplitude: the reported angle errs once a turn of the shaft";
        CosineOffset => "resolver.cosine_offset", "o_c", "1", Between(-0.2, 0.2), Sensor, Some(0.0), "healthy 0; offset of the demodulated cosine channel over its healthy amplitude: the reported angle errs once a turn of the shaft";
        Stuck => "resolver.stuck", "-", "1", Flag, Sensor, Some(0.0), "1: the converter's reading stands still at its last value, angle and speed";
        NoiseDeviation => "resolver.noise_deviation", "-", "rad", NonNegative, Sensor, Some(0.0), "standard deviation of the noise of the reported motor angle",
            high_only("its step is longer than the noise's band");
        SpeedNoiseDeviation => "resolver.speed_noise_deviation", "-", "rad/s", NonNegative, Sensor, Some(0.0), "standard deviation of the noise of the reported motor speed",
            high_only("its step is longer than the noise's band");
        NoiseSampleTime => "resolver.noise_sample_time", "-", "s", Positive, Sensor, Some(2.5e-4), "both noises are held over this time, which sets their band",
            high_only("its step is longer than the noise's band")
                .when(&[Either(&[Away("sensor.resolver.noise_deviation", 0.0), Away("sensor.resolver.speed_noise_deviation", 0.0)])]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Resolver<S> {
    /// Difference of the channels' amplitudes, sine less cosine.
    gain_less: S,
    sine: S,
    cosine: S,
    /// Of the channels, sine and cosine, over the present excitation.
    offsets: [S; 2],
    /// 1 - cos, sine and cosine of the quadrature error.
    skew: [S; 3],
    /// Of the excitation; none without power.
    amplitude: S,
    offset: S,
    gain: S,
    /// 1 without power or signal.
    pub off: S,
    zero_when_off: S,
    stuck: S,
    tracking_limit: S,
    noise_deviation: S,
    speed_noise_deviation: S,
}

/// The last reading with power on.
#[derive(Clone, Copy, Debug)]
pub struct ResolverState<S> {
    pub angle: S,
    pub speed: S,
}

kept!(ResolverState<f64> as ResolverState { angle, speed });

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
        let (half, one) = (S::splat(0.5), S::one());
        let open = one - g(P::OpenResidue);
        let mismatch = g(P::Mismatch);
        let sine_lost = S::select(half.le(g(P::SineOpen)), open, mismatch + g(P::SineShort) * (one - mismatch));
        let cosine_lost = S::select(half.le(g(P::CosineOpen)), open, g(P::CosineShort));
        let (sine, cosine) = (one - sine_lost, one - cosine_lost);
        let signal = (one - g(P::ExcitationShort)) * sine.maximum(cosine);
        let off = half.le(g(P::PowerOff)) | signal.lt(g(P::LeastSignal));
        let (skew_sin, skew_cos) = g(P::Quadrature).sin_cos();
        Self {
            gain_less: cosine_lost - sine_lost,
            sine,
            cosine,
            offsets: [P::SineOffset, P::CosineOffset].map(|p| g(p) / (one - g(P::ExcitationShort))),
            skew: [one - skew_cos, skew_sin, skew_cos],
            amplitude: S::select(half.le(g(P::PowerOff)), S::zero(), one - g(P::ExcitationShort)),
            offset: g(P::Offset),
            gain: g(P::Gain),
            off: S::indicator(off),
            stuck: g(P::Stuck),
            tracking_limit: g(P::TrackingLimit),
            noise_deviation: g(P::NoiseDeviation),
            speed_noise_deviation: g(P::SpeedNoiseDeviation),
            zero_when_off: S::indicator(S::mask(LossShows::read(g(P::LossShows)) == LossShows::Zero)),
        }
    }

    /// With both windings whole: the angle with an open one changes within a step of the reduced-order model.
    pub fn without_leaps(raw: &[S]) -> Self {
        let mut intact = [S::zero(); RESOLVER.len()];
        intact.copy_from_slice(&raw[..RESOLVER.len()]);
        intact[ResolverParameter::SineOpen as usize] = S::zero();
        intact[ResolverParameter::CosineOpen as usize] = S::zero();
        Self::derive(&intact)
    }

    /// Does its reading ever stand still?
    pub fn stands(view: &View<ResolverParameter>) -> bool {
        use ResolverParameter as P;
        view.any_away([P::PowerOff, P::Stuck, P::ExcitationShort])
    }

    /// Can it report another angle than the shaft's?
    pub fn needed(view: &View<ResolverParameter>) -> bool {
        use ResolverParameter as P;
        view.any_away([P::Mismatch, P::Offset, P::Gain, P::PowerOff, P::Stuck, P::Quadrature, P::SineOffset, P::CosineOffset])
            || Self::signal_fails(view)
    }

    /// Is there noise?
    pub fn noisy(view: &View<ResolverParameter>) -> bool {
        view.any_away([ResolverParameter::NoiseDeviation, ResolverParameter::SpeedNoiseDeviation])
    }

    /// Is a winding ever shorted or open?
    fn signal_fails(view: &View<ResolverParameter>) -> bool {
        view.any_away_among(ResolverParameter::SineShort, ResolverParameter::CosineOpen)
    }

    /// Can it repeat an earlier reading?
    pub fn remembers(view: &View<ResolverParameter>) -> bool {
        view.away(ResolverParameter::Stuck) || Self::lost(view)
    }

    /// Is it ever without power or signal?
    pub fn lost(view: &View<ResolverParameter>) -> bool {
        view.away(ResolverParameter::PowerOff) || Self::signal_fails(view)
    }

    /// Adds noise of unit deviation to a reading, unless that is frozen.
    #[inline(always)]
    pub fn disturbed(&self, reading: Reading<S>, noise: [S; 2]) -> Reading<S> {
        let half = S::splat(0.5);
        let live = S::one() - S::indicator(half.le(self.off) | half.le(self.stuck));
        let angle = live * self.noise_deviation * noise[0];
        let speed = live * self.speed_noise_deviation * noise[1];
        Reading {
            angle: reading.angle + angle,
            position: self.gain.fma(angle, reading.position),
            speed: self.gain.fma(speed, reading.speed),
        }
    }

    /// Size of the two channels' signal at angle `theta` over the healthy one; none without power.
    #[inline(always)]
    pub fn signal(&self, theta: S) -> S {
        let (sin, cos) = theta.sin_cos();
        let (sine, cosine) = (self.sine * sin + self.offsets[0], self.cosine * cos + self.displaced(sin, cos));
        self.amplitude * (sine * sine + cosine * cosine).sqrt()
    }

    /// How far offsets and quadrature error move the channels' ellipse at most, and the amplitude of the weaker one: the ellipse
    /// holds its centre while the first is less.
    pub fn eccentricity(&self) -> (S, S) {
        let [sine, cosine] = self.offsets;
        let skewed = self.cosine * (self.skew[0] + S::splat(0.5) * self.skew[1].abs());
        ((sine * sine + cosine * cosine).sqrt() + skewed, self.sine.minimum(self.cosine))
    }

    /// What quadrature error and offset add to the cosine channel.
    #[inline(always)]
    fn displaced(&self, sin: S, cos: S) -> S {
        self.offsets[1] - self.cosine * (cos * self.skew[0] + sin * self.skew[1])
    }

    /// Has any channel an offset, or an axis of its own?
    #[inline(always)]
    fn displaced_ever(&self) -> S::Mask {
        let zero = S::zero();
        !(self.offsets[0].equals(zero) & self.offsets[1].equals(zero) & self.skew[1].equals(zero))
    }

    /// Bound of the first-order error of the angle, rad, and the relative error of position and speed.
    pub fn errors(&self) -> S {
        let [sine, cosine] = self.offsets;
        let turned = S::splat(0.5) * self.gain_less.abs() + self.skew[1].abs() + sine.abs() + cosine.abs() + self.offset.abs();
        turned.maximum((self.gain - S::one()).abs())
    }

    /// Change of the reported speed over that of the shaft's: none without power or while it stands still.
    #[inline(always)]
    pub fn follows(&self) -> S {
        let half = S::splat(0.5);
        S::select(half.le(self.off) | half.le(self.stuck), S::zero(), self.gain)
    }

    /// Reading at angle `theta`, speed `omega`; `memory` is the last one with power on.
    #[inline(always)]
    pub fn read(&self, theta: S, omega: S, memory: &mut ResolverState<S>) -> Reading<S> {
        let half = S::splat(0.5);
        let (off, stuck) = (half.le(self.off), half.le(self.stuck));
        let (sin, cos) = theta.sin_cos();
        // atan2(a s + p, b c + q) = theta + atan2((a - b) s c + p c - q s, b c^2 + a s^2 + p s + q c): unwrapped, and exact.
        let (ss, cc) = (sin * sin, cos * cos);
        let mut across = self.gain_less * sin * cos;
        let mut along = self.cosine * cc + self.sine * ss;
        // Its derivative is omega (x dy - y dx) / (x^2 + y^2): the converter tracks what it reports.
        let mut turned = self.sine * self.cosine;
        let mut size = self.cosine * self.cosine * cc + self.sine * self.sine * ss;
        // Alike channels change no bit.
        let mut alike = self.gain_less.equals(S::zero());
        if !S::FORMS || S::any(self.displaced_ever()) {
            let (p, q) = (self.offsets[0], self.displaced(sin, cos));
            across = across + (p * cos - q * sin);
            along = along + (p * sin + q * cos);
            alike = alike & p.equals(S::zero()) & q.equals(S::zero());
            let [_, skew_sin, skew_cos] = self.skew;
            let added = self.offsets[1] * self.sine * cos + p * self.cosine * (sin * skew_cos + cos * skew_sin);
            turned = turned * skew_cos + added;
            let two = S::splat(2.0);
            size = size + (q * (two * self.cosine * cos + q) + p * (two * self.sine * sin + p));
        }
        let reading = theta + S::atan2_right(across, along) + self.offset;
        let rate = S::anchor(alike, S::one(), turned / size);
        let turning = S::select(off, S::zero(), (omega * rate).clamp_abs(self.tracking_limit));
        if !S::any(off | stuck) {
            *memory = ResolverState { angle: reading, speed: turning };
            return Reading { angle: reading, position: self.gain * reading, speed: self.gain * turning };
        }
        memory.angle = S::select(off | stuck, memory.angle, reading);
        memory.speed = S::select(stuck, memory.speed, turning);
        let lost = S::select(half.lt(self.zero_when_off), S::zero(), memory.angle);
        let angle = S::select(off & !stuck, lost, memory.angle);
        Reading { angle, position: self.gain * angle, speed: self.gain * memory.speed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};
    use ResolverParameter as P;

    fn resolver(changed: &[(P, f64)]) -> Resolver<f64> {
        let mut raw: Vec<f64> = RESOLVER.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        for &(p, value) in changed {
            raw[p as usize] = value;
        }
        Resolver::derive(&raw)
    }

    fn fresh() -> ResolverState<f64> {
        ResolverState { angle: 0.0, speed: 0.0 }
    }

    #[test]
    fn a_shorted_winding_shows_the_angle_of_the_weaker_channel() {
        for (p, a, b) in [(P::SineShort, 0.6, 1.0), (P::CosineShort, 1.0, 0.6)] {
            let r = resolver(&[(p, 0.4)]);
            for theta in [-1.4_f64, -0.3, 0.2, 0.9, 1.5] {
                let reading = r.read(theta, 2.0, &mut fresh());
                assert!((reading.angle - (a * theta.sin()).atan2(b * theta.cos())).abs() < 1e-13);
                let ahead = r.read(theta + 1e-6, 2.0, &mut fresh()).angle - r.read(theta - 1e-6, 2.0, &mut fresh()).angle;
                assert!((reading.speed - ahead / 1e-6).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn offsets_and_quadrature_show_the_angle_of_the_channels_and_their_harmonics() {
        let shown = [(P::SineOffset, 0.02), (P::CosineOffset, -0.03), (P::Quadrature, 0.01), (P::Mismatch, 0.1)];
        let r = resolver(&shown);
        for k in -20..20 {
            let theta = 0.31 * f64::from(k);
            let reading = r.read(theta, 2.0, &mut fresh());
            let channels = (0.9 * theta.sin() + 0.02).atan2((theta + 0.01).cos() - 0.03);
            assert!(libm::remainder(reading.angle - channels, 2.0 * PI).abs() < 1e-13, "{theta}");
            let ahead = r.read(theta + 1e-6, 2.0, &mut fresh()).angle - r.read(theta - 1e-6, 2.0, &mut fresh()).angle;
            assert!((reading.speed - ahead / 1e-6).abs() < 1e-7);
            let size = (0.9 * theta.sin() + 0.02).hypot((theta + 0.01).cos() - 0.03);
            assert!((r.signal(theta) - size).abs() < 1e-15);
        }
        // To first order, each alone; what is left is of second order.
        for (p, value) in [(P::SineOffset, 1e-4), (P::CosineOffset, 1e-4), (P::Quadrature, 1e-4)] {
            for theta in [-2.0_f64, 0.4, 1.3] {
                let error = resolver(&[(p, value)]).read(theta, 1.0, &mut fresh()).angle - theta;
                let first = match p {
                    P::SineOffset => theta.cos(),
                    P::CosineOffset => -theta.sin(),
                    _ => 0.5 * (1.0 - (2.0 * theta).cos()),
                };
                assert!((error - value * first).abs() < 2e-8);
            }
        }
    }

    #[test]
    fn a_weaker_excitation_weighs_the_offsets_more() {
        let weak = [(P::ExcitationShort, 0.2), (P::SineOffset, 0.02)];
        let error = resolver(&weak).read(0.0, 1.0, &mut fresh()).angle;
        assert!((error - 0.025_f64.atan()).abs() < 1e-14);
    }

    #[test]
    fn an_open_sine_winding_shows_multiples_of_half_a_turn() {
        let r = resolver(&[(P::SineOpen, 1.0)]);
        for (theta, reading) in [(0.4, 0.0), (1.2, 0.0), (2.0, PI), (4.0, PI), (5.0, 2.0 * PI), (-2.0, -PI)] {
            assert!((r.read(theta, 1.0, &mut fresh()).angle - reading).abs() < 0.01, "{theta}");
        }
        let crossing = r.read(FRAC_PI_2, 100.0, &mut fresh());
        assert_eq!(crossing.speed, 6_283.185_307_179_586);
    }

    #[test]
    fn a_weaker_excitation_turns_no_angle_until_the_signal_is_lost() {
        let mut memory = fresh();
        let weak = resolver(&[(P::ExcitationShort, 0.29)]).read(1.0, 3.0, &mut memory);
        assert_eq!((weak.angle, weak.speed), (1.0, 3.0));
        let lost = resolver(&[(P::ExcitationShort, 0.31)]).read(2.0, 3.0, &mut memory);
        assert_eq!((lost.angle, lost.speed), (1.0, 0.0));
        let both = resolver(&[(P::SineOpen, 1.0), (P::CosineOpen, 1.0)]).read(2.0, 3.0, &mut memory);
        assert_eq!((both.angle, both.speed), (1.0, 0.0));
    }

    #[test]
    fn a_stuck_reading_holds_and_comes_back_true() {
        let (free, stuck) = (resolver(&[]), resolver(&[(P::Stuck, 1.0)]));
        let mut memory = fresh();
        free.read(1.0, 3.0, &mut memory);
        let reading = stuck.read(5.0, 7.0, &mut memory);
        assert_eq!((reading.angle, reading.speed), (1.0, 3.0));
        let again = free.read(6.0, 8.0, &mut memory);
        assert_eq!((again.angle, again.speed), (6.0, 8.0));
    }

    #[test]
    fn noise_is_added_to_a_live_reading() {
        let noise = [(P::NoiseDeviation, 1e-3), (P::SpeedNoiseDeviation, 0.5)];
        let reading = resolver(&noise).disturbed(Reading { angle: 0.3, position: 0.4, speed: 3.0 }, [2.0, -1.0]);
        assert!((reading.angle - 0.302).abs() < 1e-15 && (reading.position - 0.402).abs() < 1e-15);
        assert_eq!(reading.speed, 2.5);
        for memory in [P::PowerOff, P::Stuck] {
            let reading =
                resolver(&[noise[0], noise[1], (memory, 1.0)]).disturbed(Reading { angle: 0.3, position: 0.4, speed: 0.0 }, [2.0, -1.0]);
            assert_eq!((reading.angle, reading.position, reading.speed), (0.3, 0.4, 0.0));
        }
    }
}
