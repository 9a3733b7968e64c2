//! Phase current sensors: gain, offset, noise, quantisation.

use crate::scalar::Scalar;
use crate::three;
use crate::variable::View;
use crate::variables;

variables! {
    /// The three phase current sensors and the acquisition filter.
    CurrentSensorParameter, CURRENT_SENSOR {
        GainA => "current.gain_a", "-", "1", Any, Sensor, Some(1.0), "gain of the sensor of phase a";
        GainB => "current.gain_b", "-", "1", Any, Sensor, Some(1.0), "gain of the sensor of phase b";
        GainC => "current.gain_c", "-", "1", Any, Sensor, Some(1.0), "gain of the sensor of phase c";
        OffsetA => "current.offset_a", "-", "A", Any, Sensor, Some(0.0), "offset of the sensor of phase a",
            high_only("the offset of one sensor is a ripple of the torque at the electrical frequency");
        OffsetB => "current.offset_b", "-", "A", Any, Sensor, Some(0.0), "offset of the sensor of phase b",
            high_only("the offset of one sensor is a ripple of the torque at the electrical frequency");
        OffsetC => "current.offset_c", "-", "A", Any, Sensor, Some(0.0), "offset of the sensor of phase c",
            high_only("the offset of one sensor is a ripple of the torque at the electrical frequency");
        StuckA => "current.stuck_a", "-", "1", Flag, Sensor, Some(0.0), "1: the sensor of phase a stands still at its last value",
            high_only("its drive controls the equivalent current itself, not three of which one stands still");
        StuckB => "current.stuck_b", "-", "1", Flag, Sensor, Some(0.0), "1: the sensor of phase b stands still at its last value",
            high_only("its drive controls the equivalent current itself, not three of which one stands still");
        StuckC => "current.stuck_c", "-", "1", Flag, Sensor, Some(0.0), "1: the sensor of phase c stands still at its last value",
            high_only("its drive controls the equivalent current itself, not three of which one stands still");
        DeadA => "current.dead_a", "-", "1", Flag, Sensor, Some(0.0), "1: the sensor of phase a reports zero",
            high_only("its drive controls the equivalent current itself, not three of which one is not seen");
        DeadB => "current.dead_b", "-", "1", Flag, Sensor, Some(0.0), "1: the sensor of phase b reports zero",
            high_only("its drive controls the equivalent current itself, not three of which one is not seen");
        DeadC => "current.dead_c", "-", "1", Flag, Sensor, Some(0.0), "1: the sensor of phase c reports zero",
            high_only("its drive controls the equivalent current itself, not three of which one is not seen");
        NoiseDeviation => "current.noise_deviation", "-", "A", NonNegative, Sensor, Some(0.0), "standard deviation of the noise of each sensor",
            high_only("the noise of single phase currents is none of its one");
        NoiseSampleTime => "current.noise_sample_time", "-", "s", Positive, Sensor, Some(5e-5), "the noise is held over this time, which sets its band",
            high_only("the noise of single phase currents is none of its one").when(&[Away("sensor.current.noise_deviation", 0.0)]);
        Bits => "current.bits", "-", "1", Count(0.0, 32.0), Sensor, Some(0.0), "resolution over twice the range; 0: not quantised",
            high_only("single phase currents are quantised, not its one");
        FullScale => "current.full_scale", "-", "A", Positive, Sensor, Some(40.0), "largest current the quantised sensor reports",
            high_only("single phase currents are quantised, not its one").when(&[Away("sensor.current.bits", 0.0)]);
        Bandwidth => "current.bandwidth", "-", "Hz", NonNegative, Sensor, Some(0.0), "first-order filter of the current that the drive controls; 0: none",
            when(&[In(Fidelity::Low, &[Chosen("drive.kind", &["hysteresis"])])]);
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
    stuck: [S; 3],
    dead: [S; 3],
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
            stuck: three!(|j| raw[P::StuckA as usize + j]),
            dead: three!(|j| raw[P::DeadA as usize + j]),
        }
    }

    /// Readings of the three sensors; `noise` has unit deviation, `last` are their previous readings.
    #[inline(always)]
    pub fn measure(&self, current: [S; 3], noise: [S; 3], last: [S; 3]) -> [S; 3] {
        let half = S::splat(0.5);
        let quantised = S::zero().lt(self.resolution);
        three!(|j| {
            let raw = self.gain[j] * current[j] + (self.offset[j] + self.noise_deviation * noise[j]);
            let steps = (raw.clamp_abs(self.full_scale) * self.per_resolution).round();
            let reading = S::select(quantised, steps * self.resolution, raw);
            let live = S::select(half.le(self.dead[j]), S::zero(), reading);
            S::select(half.le(self.stuck[j]), last[j], live)
        })
    }

    /// Does the measured current differ from the true one at all? Then it must be fed back.
    pub fn needed(view: &View<CurrentSensorParameter>) -> bool {
        use CurrentSensorParameter as P;
        view.any_away_among(P::GainA, P::NoiseDeviation) || view.away(P::Bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use CurrentSensorParameter as P;

    #[test]
    fn a_stuck_sensor_holds_a_dead_one_shows_nothing_the_others_read_on() {
        let mut raw: Vec<f64> = CURRENT_SENSOR.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        raw[P::StuckA as usize] = 1.0;
        raw[P::DeadB as usize] = 1.0;
        let reading = CurrentSensor::derive(&raw).measure([3.0, -1.0, -2.0], [0.0; 3], [0.5, 0.6, 0.7]);
        assert_eq!(reading, [0.5, 0.0, -2.0]);
    }
}
