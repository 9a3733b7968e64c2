//! Three Hall sensors, each high over half an electrical turn, with their edges between the six sectors; speed and
//! count from the edges.

use crate::kept;
use crate::scalar::Scalar;
use crate::three;
use crate::variables;

variables! {
    /// The Hall sensors.
    HallParameter, HALL {
        Offset => "offset", "-", "rad", Between(-1.0, 1.0), Sensor, Some(0.0), "electrical angle by which all sensors are early";
        OffsetA => "offset_a", "-", "rad", Between(-1.0, 1.0), Sensor, Some(0.0), "electrical angle by which sensor a alone is early";
        OffsetB => "offset_b", "-", "rad", Between(-1.0, 1.0), Sensor, Some(0.0), "electrical angle by which sensor b alone is early";
        OffsetC => "offset_c", "-", "rad", Between(-1.0, 1.0), Sensor, Some(0.0), "electrical angle by which sensor c alone is early";
        StuckHighA => "stuck_high_a", "-", "1", Flag, Sensor, Some(0.0), "1: sensor a always reads high";
        StuckHighB => "stuck_high_b", "-", "1", Flag, Sensor, Some(0.0), "1: sensor b always reads high";
        StuckHighC => "stuck_high_c", "-", "1", Flag, Sensor, Some(0.0), "1: sensor c always reads high";
        StuckLowA => "stuck_low_a", "-", "1", Flag, Sensor, Some(0.0), "1: sensor a always reads low";
        StuckLowB => "stuck_low_b", "-", "1", Flag, Sensor, Some(0.0), "1: sensor b always reads low";
        StuckLowC => "stuck_low_c", "-", "1", Flag, Sensor, Some(0.0), "1: sensor c always reads low";
        PowerOff => "power_off", "-", "1", Flag, Sensor, Some(0.0), "1 while the sensors have no power: all read low";
        Timeout => "timeout", "-", "s", Positive, Sensor, None, "without an edge for this long the speed reads zero";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Hall<S> {
    offset: S,
    offsets: [S; 3],
    high: [S; 3],
    low: [S; 3],
    power_off: S,
    timeout: S,
    /// Shaft angle between two edges.
    pub pitch: S,
}

#[derive(Clone, Copy, Debug)]
pub struct HallState<S> {
    pub code: [S; 3],
    /// The last code that a position has: an edge leads from it to the next such code.
    valid: [S; 3],
    last_edge: S,
    /// 1 while `last_edge` is no time of an edge: it passed while the sensors showed no position.
    missed: S,
    speed: S,
    direction: S,
    /// Edges since the start, signed.
    pub count: S,
    /// Invalid codes and jumps of more than a sector since the start.
    pub errors: S,
}

kept!(HallState<f64> as HallState { code, valid, last_edge, missed, speed, direction, count, errors });

const PER_TURN: f64 = 1.0 / std::f64::consts::TAU;

impl<S: Scalar> Hall<S> {
    pub fn derive(raw: &[S], pole_pairs: S) -> Self {
        use HallParameter as P;
        let g = |p: P| raw[p as usize];
        let from = |p: P| three!(|j| raw[p as usize + j]);
        Self {
            offset: g(P::Offset),
            offsets: from(P::OffsetA),
            high: from(P::StuckHighA),
            low: from(P::StuckLowA),
            power_off: g(P::PowerOff),
            timeout: g(P::Timeout),
            pitch: S::splat(std::f64::consts::FRAC_PI_3) / pole_pairs,
        }
    }

    /// What the sensors read (1 high, 0 low) at an electrical angle.
    #[inline(always)]
    pub fn code(&self, angle: S) -> [S; 3] {
        let half = S::splat(0.5);
        let common = angle + self.offset;
        let dead = half.le(self.power_off);
        three!(|j| {
            let turns = (common + self.offsets[j]) * S::splat(PER_TURN) - S::splat(1.0 / 12.0 + j as f64 / 3.0);
            let high = (turns - turns.floor()).lt(half) | half.le(self.high[j]);
            S::select(high & self.low[j].lt(half) & !dead, S::one(), S::zero())
        })
    }

    pub fn start(&self, angle: S) -> HallState<S> {
        let zero = S::zero();
        let code = self.code(angle);
        HallState { code, valid: code, last_edge: S::splat(-1e9), missed: zero, speed: zero, direction: zero, count: zero, errors: zero }
    }

    /// Takes the code after a step of `dt` that ended at time `t` and at `angle`, having advanced by `advance`.
    #[inline(always)]
    pub fn observe(&self, s: &mut HallState<S>, angle: S, advance: S, t: S, dt: S) {
        let code = self.code(angle);
        let same = code[0].equals(s.code[0]) & code[1].equals(s.code[1]) & code[2].equals(s.code[2]);
        if S::any(!same) {
            self.edge(s, code, same, angle, advance, t, dt);
        }
    }

    /// Two codes are vectors 60 degrees apart when one sector follows the other. A code that no position has (all high, all
    /// low) is an error and no edge: what follows it is compared with the last code before it, and an edge that passed
    /// meanwhile tells the direction but not when it passed, so the speed stays as it was until two more have passed.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn edge(&self, s: &mut HallState<S>, code: [S; 3], same: S::Mask, angle: S, advance: S, t: S, dt: S) {
        let zero = S::zero();
        let one = S::one();
        let ((x0, y0), (x1, y1)) = (vector(s.valid), vector(code));
        let valid = S::splat(0.5).lt(x1 * x1 + y1 * y1);
        let blind = (zero.equals(s.code[0] + s.code[1] + s.code[2])) | S::splat(2.5).lt(s.code[0] + s.code[1] + s.code[2]);
        let cosine = x0 * x1 + y0 * y1;
        let returned = valid & S::splat(0.75).lt(cosine);
        let step = !same & valid & S::splat(0.25).lt(cosine) & !returned;
        let direction = (x0 * y1 - y0 * x1).sign();
        // When the edge passed, within the step.
        let place = (angle + self.offset) * S::splat(6.0 * PER_TURN) - S::splat(0.5);
        let beyond = place - place.floor();
        let travelled = S::select(zero.lt(advance), beyond, one - beyond);
        let share = (travelled / (advance.abs() * S::splat(6.0 * PER_TURN)).maximum(S::splat(1e-300))).minimum(one);
        let edge = t - share * dt;
        let since = (edge - s.last_edge).maximum(S::splat(1e-9));
        let steady = direction.equals(s.direction);
        let measured = S::select(steady, direction * self.pitch / since, zero);
        let timed = step & !blind;
        s.speed = S::select(timed & s.missed.lt(S::splat(0.5)), measured, s.speed);
        s.direction = S::select(step, direction, s.direction);
        s.count = s.count + S::select(step, direction, zero);
        s.errors = s.errors + S::select(!same & !step & !returned, one, zero);
        let passed = !same & valid & !returned;
        s.last_edge = S::select(passed, edge, s.last_edge);
        s.missed = S::select(passed, S::select(blind, one, zero), s.missed);
        s.valid = three!(|j| S::select(!same & valid, code[j], s.valid[j]));
        s.code = three!(|j| S::select(same, s.code[j], code[j]));
    }

    /// Speed reported at time `t`: the last interval's, never more than the time since the last edge allows.
    #[inline(always)]
    pub fn speed(&self, s: &HallState<S>, t: S) -> S {
        let since = (t - s.last_edge).maximum(S::splat(1e-9));
        let bounded = s.speed.clamp_abs(self.pitch / since);
        S::select(self.timeout.lt(since), S::zero(), bounded)
    }
}

#[inline(always)]
fn vector<S: Scalar>(code: [S; 3]) -> (S, S) {
    let half = S::splat(0.5);
    (code[0] - half * (code[1] + code[2]), S::splat(0.866_025_403_784_438_6) * (code[1] - code[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 1e-6;

    fn sensors(power_off: f64) -> Hall<f64> {
        let mut raw = [0.0; HallParameter::Timeout as usize + 1];
        raw[HallParameter::Timeout as usize] = 0.1;
        raw[HallParameter::PowerOff as usize] = power_off;
        Hall::derive(&raw, 4.0)
    }

    /// Largest and last speed over 20 ms, without power while `off` says so; the angle is electrical.
    fn course(speed: f64, off: impl Fn(f64) -> bool) -> (f64, f64) {
        let (on, dead) = (sensors(0.0), sensors(1.0));
        let (mut state, mut most) = (on.start(0.1), 0.0_f64);
        for k in 1..20_000 {
            let t = f64::from(k) * DT;
            let hall = if off(t) { &dead } else { &on };
            hall.observe(&mut state, 0.1 + 4.0 * speed * t, 4.0 * speed * DT, t, DT);
            most = most.max(hall.speed(&state, t).abs());
        }
        (most, on.speed(&state, 20e-3))
    }

    #[test]
    fn speed_is_that_of_the_shaft() {
        for speed in [200.0, -200.0, 35.0] {
            let (most, last) = course(speed, |_| false);
            assert!((most - speed.abs()).abs() < 1e-6 * speed.abs(), "{most} {speed}");
            assert!((last - speed).abs() < 1e-6 * speed.abs(), "{last} {speed}");
        }
    }

    /// An interval that begins at the return of the power is no interval between two edges.
    #[test]
    fn a_return_of_the_power_never_shows_more_speed_than_there_is() {
        for speed in [200.0, -200.0, 150.0] {
            for width in [0.2e-3, 0.9e-3, 1.7e-3, 3.1e-3] {
                let (most, last) = course(speed, |t| (t / 4e-3).fract() * 4e-3 < width);
                assert!(most < 1.001 * speed.abs(), "{most} at {speed}, {width} s off");
                assert!(speed * last >= 0.0 && last.abs() < 1.001 * speed.abs(), "{last} at {speed}");
            }
        }
    }
}
