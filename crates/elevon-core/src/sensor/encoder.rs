//! Incremental encoder driven through a wheel pair (reference sheet 1.1: 5000 pulses, x4, wheels 22:88).
//!
//! Its edges are read off a sine and a cosine of one period a pulse. Offsets of these signals shift the position by a first, unequal
//! amplitudes and a phase error by a second harmonic of the period: x + T (e_1 sin(z + phi_1) + e_2 sin(2 z + phi_2)), z = 2 pi x/T,
//! is what the counter counts.

use crate::kept;
use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;

variables! {
    /// The encoder on the output side.
    EncoderParameter, ENCODER {
        Pulses => "encoder.pulses", "-", "1", Positive, Sensor, Some(5000.0), "pulses per turn of the encoder";
        Edges => "encoder.edges", "-", "1", Positive, Sensor, Some(4.0), "edges counted per pulse";
        WheelRatio => "encoder.wheel_ratio", "-", "1", Positive, Sensor, Some(4.0), "encoder turns per output turn (88 / 22 teeth)";
        Offset => "encoder.offset", "-", "rad", Any, Sensor, Some(0.0), "offset of the reported output position";
        Gain => "encoder.gain", "-", "1", Any, Sensor, Some(1.0), "gain of the reported output position";
        MissingCounts => "encoder.missing_counts", "-", "1", Unit, Sensor, Some(0.0), "fraction of the counts that are lost, spread evenly over the disc";
        DarkShare => "encoder.dark_share", "-", "1", Unit, Sensor, Some(0.0), "share of the disc in whose sectors no counts come";
        DarkSectors => "encoder.dark_sectors", "-", "1", Count(1.0, 1000.0), Sensor, Some(1.0), "number of dark sectors, equal and evenly spread",
            when(&[Away("sensor.encoder.dark_share", 0.0)]);
        DarkPosition => "encoder.dark_position", "-", "rad", Any, Sensor, Some(0.0), "angle of the disc at the middle of a dark sector",
            when(&[Away("sensor.encoder.dark_share", 0.0)]);
        FirstHarmonic => "encoder.first_harmonic", "e_1", "1", Between(-0.5, 0.5), Sensor, Some(0.0), "healthy 0; interpolation error at the period of the pulses over that period: offsets of the encoder's signals; makers state 0.01 of the period for both harmonics together (ASSUMED typical)";
        FirstPhase => "encoder.first_phase", "phi_1", "rad", Any, Sensor, Some(0.0), "phase of it where the output stands at zero",
            when(&[Away("sensor.encoder.first_harmonic", 0.0)]);
        SecondHarmonic => "encoder.second_harmonic", "e_2", "1", Between(-0.5, 0.5), Sensor, Some(0.0), "healthy 0; interpolation error at half the period of the pulses over that period: unequal amplitudes or a phase error of the encoder's signals";
        SecondPhase => "encoder.second_phase", "phi_2", "rad", Any, Sensor, Some(0.0), "phase of it where the output stands at zero",
            when(&[Away("sensor.encoder.second_harmonic", 0.0)]);
        Dead => "encoder.dead", "-", "1", Flag, Sensor, Some(0.0), "1: no counts come at all";
        Stuck => "encoder.stuck", "-", "1", Flag, Sensor, Some(0.0), "1: the reported position stands still at its last value while the counter goes on";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Encoder<S> {
    per_count: S,
    count: S,
    offset: S,
    /// Periods of the signals per unit of output travel, and size of one.
    per_period: S,
    period: S,
    /// Interpolation error: amplitudes over the period and phases.
    harmonics: [[S; 2]; 2],
    /// Dark sectors per unit of output travel, and where the first lies.
    sectors: S,
    first: S,
    /// Dark share of each sector's pitch, and counts over the pitch.
    share: S,
    pitch: S,
    dead: S,
    stuck: S,
}

/// The counter of an encoder that loses counts. It is incremental: what was lost stays lost, until the disc turns back
/// through where it was.
#[derive(Clone, Copy, Debug)]
pub struct EncoderState<S> {
    output: S,
    counts: S,
    /// Counts that did not come.
    lost: S,
    pub reading: S,
}

kept!(EncoderState<f64> as EncoderState { output, counts, lost, reading });

impl<S: Scalar> Encoder<S> {
    /// `turn` is the output travel over which the pulses are counted: 2 pi rad, or 1 m of a `scale`, whose ratio is not that of wheels
    /// but an interpolation between the pulses.
    pub fn derive(raw: &[S], turn: f64, scale: bool) -> Self {
        use EncoderParameter as P;
        let g = |p: P| raw[p as usize];
        let counts = g(P::Pulses) * g(P::Edges) * g(P::WheelRatio);
        let tau = S::splat(turn);
        let kept = S::one() - g(P::MissingCounts);
        let sectors = g(P::DarkSectors).floor();
        let periods = if scale { g(P::Pulses) } else { g(P::Pulses) * g(P::WheelRatio) };
        Self {
            per_count: counts / tau * kept,
            count: g(P::Gain) * tau / counts,
            offset: g(P::Offset),
            per_period: periods / tau,
            period: tau / periods,
            harmonics: [[g(P::FirstHarmonic), g(P::FirstPhase)], [g(P::SecondHarmonic), g(P::SecondPhase)]],
            sectors: sectors * g(P::WheelRatio) / tau,
            first: sectors * g(P::DarkPosition) * S::splat(1.0 / std::f64::consts::TAU),
            share: g(P::DarkShare),
            pitch: counts / (sectors * g(P::WheelRatio)) * kept,
            dead: g(P::Dead),
            stuck: g(P::Stuck),
        }
    }

    /// Does it ever lose counts, or stand still?
    pub fn loses(view: &View<EncoderParameter>) -> bool {
        view.any_away([EncoderParameter::DarkShare, EncoderParameter::Dead, EncoderParameter::Stuck])
    }

    /// Does its interpolation err?
    pub fn errs(view: &View<EncoderParameter>) -> bool {
        view.any_away([EncoderParameter::FirstHarmonic, EncoderParameter::SecondHarmonic])
    }

    /// The output position that the signals show.
    #[inline(always)]
    pub fn interpolated(&self, output: S) -> S {
        let [[first, phase], [second, other]] = self.harmonics;
        let angle = S::splat(std::f64::consts::TAU) * (output * self.per_period);
        let (sin, _) = (angle + phase).sin_cos();
        let (twice, _) = (angle + angle + other).sin_cos();
        output + self.period * (first * sin + second * twice)
    }

    pub fn start(&self, output: S) -> EncoderState<S> {
        EncoderState { output, counts: (output * self.per_count).floor(), lost: S::zero(), reading: self.read(output) }
    }

    /// The pitch an output position lies in, whether it is dark there, and how much was dark from the zero up to it.
    #[inline(always)]
    fn dark(&self, output: S) -> (S, S::Mask, S) {
        let half = S::splat(0.5) * self.share;
        let place = output * self.sectors - self.first;
        let pitch = place.round();
        let beyond = place - pitch;
        (pitch, beyond.abs().lt(half), pitch * self.share + beyond.clamp_abs(half))
    }

    /// Counts on to the output position, and reports the sum. Exact for steps of any length, since what a movement loses depends on
    /// its ends alone.
    #[inline(always)]
    pub fn advance(&self, output: S, s: &mut EncoderState<S>) {
        let half = S::splat(0.5);
        let ((pitch0, dark0, sum0), (pitch, dark, sum)) = (self.dark(s.output), self.dark(output));
        let none = half.le(self.dead) | (dark0 & dark & pitch0.equals(pitch));
        let moved = (output - s.output) * self.per_count;
        s.lost = s.lost + S::select(none, moved, (sum - sum0) * self.pitch);
        s.output = output;
        s.counts = S::select(none, s.counts, (output * self.per_count - s.lost).floor());
        let now = s.counts * self.count + self.offset;
        s.reading = S::select(half.le(self.stuck), s.reading, now);
    }

    /// Reported output position: whole counts since the output's zero.
    #[inline(always)]
    pub fn read(&self, output: S) -> S {
        (output * self.per_count).floor() * self.count + self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;
    use EncoderParameter as P;

    fn encoder(changed: &[(P, f64)]) -> Encoder<f64> {
        let mut raw: Vec<f64> = ENCODER.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        for &(p, value) in changed {
            raw[p as usize] = value;
        }
        Encoder::derive(&raw, TAU, false)
    }

    /// Reading after moving in small steps through the given output positions.
    fn moved(e: &Encoder<f64>, s: &mut EncoderState<f64>, from: f64, to: f64) -> f64 {
        for i in 0..=10_000 {
            e.advance(from + (to - from) * f64::from(i) * 1e-4, s);
        }
        s.reading
    }

    #[test]
    fn a_whole_disc_shows_what_it_did() {
        let e = encoder(&[]);
        let mut s = e.start(0.0);
        for output in [0.1, 0.77, -0.3] {
            e.advance(output, &mut s);
            assert_eq!(s.reading, e.read(output));
        }
    }

    #[test]
    fn the_interpolation_error_has_two_harmonics_of_the_period() {
        let e = encoder(&[(P::FirstHarmonic, 0.02), (P::FirstPhase, 0.4), (P::SecondHarmonic, 0.01), (P::SecondPhase, -0.7)]);
        let period = TAU / (5000.0 * 4.0);
        for k in 0..40 {
            let output = 0.3 + period * 0.11 * f64::from(k);
            let angle = TAU * output / period;
            let error = period * (0.02 * (angle + 0.4).sin() + 0.01 * (2.0 * angle - 0.7).sin());
            assert!((e.interpolated(output) - output - error).abs() < 1e-12);
        }
        let whole = encoder(&[]);
        assert_eq!(whole.interpolated(0.37), 0.37);
        let mut raw: Vec<f64> = ENCODER.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        raw[P::FirstHarmonic as usize] = 0.02;
        // A scale's period is that of its pulses, whatever their interpolation.
        let shown = Encoder::<f64>::derive(&raw, 1.0, true).interpolated(0.3 / 5000.0);
        assert!((shown * 5000.0 - 0.3 - 0.02 * (0.3 * TAU).sin()).abs() < 1e-12);
    }

    #[test]
    fn a_dark_sector_takes_its_share_of_every_turn_of_the_disc_and_gives_it_back_on_the_way_back() {
        for sectors in [1.0, 3.0] {
            let dark = [(P::DarkShare, 0.1), (P::DarkSectors, sectors), (P::DarkPosition, 0.3 * TAU)];
            let e = encoder(&dark);
            let mut s = e.start(0.0);
            // Half an output turn is two turns of the disc.
            let there = moved(&e, &mut s, 0.0, 0.5 * TAU);
            assert!((there - 0.9 * 0.5 * TAU).abs() < 1e-4, "{there}");
            let mut leaping = e.start(0.0);
            e.advance(0.5 * TAU, &mut leaping);
            assert!((leaping.reading - there).abs() < 1e-4);
            let back = moved(&e, &mut s, 0.5 * TAU, 0.0);
            assert!(back.abs() < 1e-4, "{back}");
        }
    }

    #[test]
    fn inside_a_dark_sector_the_shown_position_stands() {
        let e = encoder(&[(P::DarkShare, 0.2), (P::DarkPosition, 0.5 * TAU)]);
        let mut s = e.start(0.0);
        let before = moved(&e, &mut s, 0.0, 0.45 * TAU / 4.0);
        let inside = moved(&e, &mut s, 0.45 * TAU / 4.0, 0.55 * TAU / 4.0);
        assert!((before - 0.4 * TAU / 4.0).abs() < 1e-4);
        assert_eq!(inside, before);
    }

    #[test]
    fn counts_of_a_dead_encoder_stay_lost_those_of_a_stuck_one_do_not() {
        let free = encoder(&[]);
        for (p, after) in [(P::Dead, 1.0), (P::Stuck, 2.0)] {
            let broken = encoder(&[(p, 1.0)]);
            let mut s = free.start(0.0);
            let at = moved(&free, &mut s, 0.0, 1.0);
            assert_eq!(moved(&broken, &mut s, 1.0, 2.0), at);
            let later = moved(&free, &mut s, 2.0, 2.5) - 0.5;
            assert!((later - after).abs() < 1e-3, "{later}");
        }
    }
}
