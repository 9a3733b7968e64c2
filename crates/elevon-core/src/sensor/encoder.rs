//! Incremental encoder driven through a wheel pair (reference sheet 1.1: 5000 pulses, x4, wheels 22:88).

use crate::scalar::Scalar;
use crate::variables;

variables! {
    /// The encoder on the user side.
    EncoderParameter, ENCODER {
        Pulses => "encoder.pulses", "-", "1", Positive, Sensor, Some(5000.0), "pulses per turn of the encoder";
        Edges => "encoder.edges", "-", "1", Positive, Sensor, Some(4.0), "edges counted per pulse";
        WheelRatio => "encoder.wheel_ratio", "-", "1", Positive, Sensor, Some(4.0), "encoder turns per user turn (88 / 22 teeth)";
        Offset => "encoder.offset", "-", "rad", Any, Sensor, Some(0.0), "offset of the shown user position";
        Gain => "encoder.gain", "-", "1", Any, Sensor, Some(1.0), "gain of the shown user position";
        MissingCounts => "encoder.missing_counts", "-", "1", Unit, Sensor, Some(0.0), "fraction of the counts that are lost, spread evenly over the disc";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Encoder<S> {
    per_count: S,
    count: S,
    offset: S,
}

impl<S: Scalar> Encoder<S> {
    /// `turn` is the user travel over which the pulses are counted: 2 pi rad, or 1 m of a linear scale.
    pub fn derive(raw: &[S], turn: f64) -> Self {
        use EncoderParameter as P;
        let g = |p: P| raw[p as usize];
        let counts = g(P::Pulses) * g(P::Edges) * g(P::WheelRatio);
        let tau = S::splat(turn);
        let kept = S::one() - g(P::MissingCounts);
        Self { per_count: counts / tau * kept, count: g(P::Gain) * tau / counts, offset: g(P::Offset) }
    }

    /// Shown user position: whole counts since the user's zero.
    #[inline(always)]
    pub fn read(&self, user: S) -> S {
        (user * self.per_count).floor() * self.count + self.offset
    }
}
