//! Phase current sensors: gain, offset, noise, quantisation.

use crate::scalar::Scalar;
use crate::three;
use crate::variable::Own;
use crate::variables;

variables! {
    /// The three phase current sensors and the acquisition filter.
    CurrentSensorParameter, CURRENT_SENSOR {
        GainA => "current.gain_a", "-", "1", Any, Sensor, Some(1.0), "gain of the sensor of phase a",
            high_only("its drive controls the equivalent current itself");
        GainB => "current.gain_b", "-", "1", Any, Sensor, Some(1.0), "gain of the sensor of phase b",
            high_only("its drive controls the equivalent current itself");
        GainC => "current.gain_c", "-", "1", Any, Sensor, Some(1.0), "gain of the sensor of phase c",
            high_only("its drive controls the equivalent current itself");
        OffsetA => "current.offset_a", "-", "A", Any, Sensor, Some(0.0), "offset of the sensor of phase a",
            high_only("the offset of one sensor is a ripple of the torque at the electrical frequency");
        OffsetB => "current.offset_b", "-", "A", Any, Sensor, Some(0.0), "offset of the sensor of phase b",
            high_only("the offset of one sensor is a ripple of the torque at the electrical frequency");
        OffsetC => "current.offset_c", "-", "A", Any, Sensor, Some(0.0), "offset of the sensor of phase c",
            high_only("the offset of one sensor is a ripple of the torque at the electrical frequency");
        NoiseDeviation => "current.noise_deviation", "-", "A", NonNegative, Sensor, Some(0.0), "standard deviation of the noise of each sensor",
            high_only("the noise of single phase currents is none of its one");
        NoiseSampleTime => "current.noise_sample_time", "-", "s", Positive, Sensor, Some(5e-5), "the noise is held over this time, which sets its band",
            high_only("the noise of single phase currents is none of its one").when(&[Away("sensor.current.noise_deviation", 0.0)]);
        Bits => "current.bits", "-", "1", Between(0.0, 32.0), Sensor, Some(0.0), "resolution over twice the range; 0: not quantised",
            high_only("single phase currents are quantised, not its one");
        FullScale => "current.full_scale", "-", "A", Positive, Sensor, Some(40.0), "largest current the quantised sensor shows",
            high_only("single phase currents are quantised, not its one").when(&[Away("sensor.current.bits", 0.0)]);
        Bandwidth => "current.bandwidth", "-", "Hz", NonNegative, Sensor, Some(0.0), "first-order filter of the current that the drive controls; 0: none",
            high_only("the drive's own current filter is faster than its step");
        FilterCutoff => "filter_cutoff", "f_c", "Hz", Positive, Sensor, Some(100.0), "cut-off of the first-order filters of the logged d and q quantities";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct CurrentSensor<S> {
    gain: [S; 3],
    offset: [S; 3],
    pub noise_deviation: S,
    resolution: S,
    per_resolution: S,
    full_scale: S,
}

impl<S: Scalar> CurrentSensor<S> {
    pub fn derive(raw: &[S]) -> Self {
        use CurrentSensorParameter as P;
        let g = |p: P| raw[p as usize];
        let bits = g(P::Bits);
        let levels = S::from_fn(|i| libm::exp2(bits.lane(i)));
        let resolution = S::select(S::zero().lt(bits), S::splat(2.0) * g(P::FullScale) / levels, S::zero());
        let quantised = S::zero().lt(resolution);
        Self {
            gain: three!(|j| raw[P::GainA as usize + j]),
            offset: three!(|j| raw[P::OffsetA as usize + j]),
            noise_deviation: g(P::NoiseDeviation),
            resolution,
            per_resolution: S::select(quantised, S::one() / S::select(quantised, resolution, S::one()), S::zero()),
            full_scale: g(P::FullScale),
        }
    }

    /// What the three sensors show; `noise` has unit deviation.
    #[inline(always)]
    pub fn measure(&self, current: [S; 3], noise: [S; 3]) -> [S; 3] {
        let quantised = S::zero().lt(self.resolution);
        three!(|j| {
            let raw = self.gain[j] * current[j] + (self.offset[j] + self.noise_deviation * noise[j]);
            let steps = (raw.clamp_abs(self.full_scale) * self.per_resolution).round();
            S::select(quantised, steps * self.resolution, raw)
        })
    }

    /// Does the measured current differ from the true one at all? Then it must be fed back.
    pub fn needed(own: &Own<CurrentSensorParameter>) -> bool {
        use CurrentSensorParameter as P;
        own.any_away_among(P::GainA, P::NoiseDeviation) || own.away(P::Bits)
    }
}
