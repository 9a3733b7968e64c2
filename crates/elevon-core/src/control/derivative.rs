//! Where the speed controller's derivative action becomes unstable (docs/explanation/theory/derivative.md).
//!
//! K_p T_d of the measured speed acts like an inertia: what counts is rho = K_p T_d / J. The current loop decides how much
//! of it is borne.
//!
//! * Carrier drive: fast against the filter N / T_d, the reference is -rho times the current itself, so that the current
//!   loop runs at 1 + rho times its gain and is stable while (1 + rho) K T_s / L stays below `largest_gain`. Slower filters
//!   and controllers with a tick of their own are judged by the linear loop in its samples (`Carrier::stable`).
//! * Relays: the current follows at once, so that a controller with a tick T sees T(k) = -rho T(k-1), damped by its filter:
//!   rho < 2 / (1 - exp(-N T / T_d)) - 1. What cannot leave the relays' band within a tick does not grow: a controller
//!   that acts at every solver step is stable at any rho.

use super::current_dq::largest_gain;

/// Speed controller and shaft.
#[derive(Clone, Copy, Debug)]
pub struct SpeedLoop {
    /// N m s/rad.
    pub gain: f64,
    pub derivative_time: f64,
    pub filter: f64,
    /// s; a controller without a tick acts at each solver step.
    pub tick: f64,
    pub inertia: f64,
}

/// A carrier drive and its winding.
#[derive(Clone, Copy, Debug)]
pub struct Carrier {
    pub proportional: f64,
    pub integral: f64,
    pub sample: f64,
    /// In samples.
    pub delay: f64,
    pub resistance: f64,
    pub inductance: f64,
}

/// Relays and what they switch.
#[derive(Clone, Copy, Debug)]
pub struct Relays {
    pub half_band: f64,
    /// Largest slope of a phase current, A/s.
    pub slew: f64,
}

/// Parts of a current sample in which the linear loop is followed, and how many samples.
const PARTS: usize = 16;
const SAMPLES: usize = 600;

impl SpeedLoop {
    pub fn ratio(&self) -> f64 {
        self.gain * self.derivative_time / self.inertia
    }

    fn scaled(&self, factor: f64) -> Self {
        Self { gain: self.gain * factor, ..*self }
    }
}

impl Relays {
    /// K_p T_d / J at which the torque reference of a controller with a tick alternates.
    pub fn largest_ratio(&self, speed: &SpeedLoop) -> f64 {
        let decay = -libm::expm1(-speed.filter * speed.tick / speed.derivative_time);
        2.0 / decay - 1.0
    }

    /// Can the current cross the relays' band within a tick of the controller?
    pub fn leaves_band(&self, tick: f64) -> bool {
        self.slew * tick > 2.0 * self.half_band
    }
}

impl Carrier {
    /// Factor on the speed gain at which the loop becomes unstable; above `most` it is not looked for.
    pub fn margin(&self, speed: &SpeedLoop, most: f64) -> f64 {
        let bare = self.proportional * self.sample / self.inductance;
        let plain = speed.tick <= self.sample && (1.0 + most * speed.ratio()) * bare < 0.5 * largest_gain(self.delay);
        if plain || self.stable(&speed.scaled(most)) {
            return most;
        }
        let (mut low, mut high) = (0.0, most);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if self.stable(&speed.scaled(middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// Does a disturbance of the linear loop die out? Current and speed are followed in parts of a current sample; the
    /// winding is exact over a part, the controllers act at their ticks, the duties after their delay. The speed
    /// controller's integral action is slow against all this and left out.
    pub fn stable(&self, speed: &SpeedLoop) -> bool {
        let mut linear = LinearLoop::disturbed(self, speed);
        let mut largest = [0.0_f64; 3];
        for k in 0..PARTS * SAMPLES {
            linear.step(k);
            if !linear.torque.is_finite() {
                return false;
            }
            let third = &mut largest[3 * k / (PARTS * SAMPLES)];
            *third = third.max(linear.torque.abs());
        }
        largest[2] < largest[1]
    }
}

/// Speed and current loop in parts of a current sample; the current in the unit of its torque.
struct LinearLoop<'a> {
    carrier: &'a Carrier,
    speed: &'a SpeedLoop,
    /// Length of a part, s, and parts between the ticks of the speed controller.
    part: f64,
    ticks: usize,
    /// The derivative: its gain, and how much of its filter's rest decays in a tick.
    derivative: f64,
    decay: f64,
    /// The winding over a part: share of the current that is left, current per volt.
    fade: f64,
    volt: f64,
    /// Part of a sample in which the duties are renewed, if not at once.
    update: Option<usize>,
    torque: f64,
    omega: f64,
    filtered: f64,
    reference: f64,
    sum: f64,
    computed: f64,
    acting: f64,
}

impl<'a> LinearLoop<'a> {
    /// At rest but for a speed of one.
    fn disturbed(carrier: &'a Carrier, speed: &'a SpeedLoop) -> Self {
        let part = carrier.sample / PARTS as f64;
        let ticks = ((speed.tick / part).round() as usize).max(1);
        let tick = ticks as f64 * part;
        let decay = -libm::expm1(-speed.filter * tick / speed.derivative_time);
        let turn = -carrier.resistance * part / carrier.inductance;
        let delay = carrier.delay * PARTS as f64;
        Self {
            carrier,
            speed,
            part,
            ticks,
            derivative: speed.gain * speed.derivative_time / tick * decay,
            decay,
            fade: libm::exp(turn),
            volt: -libm::expm1(turn) / carrier.resistance,
            update: (delay >= 0.5).then_some(delay.round() as usize % PARTS),
            torque: 0.0,
            omega: 1.0,
            filtered: 0.0,
            reference: 0.0,
            sum: 0.0,
            computed: 0.0,
            acting: 0.0,
        }
    }

    fn step(&mut self, k: usize) {
        if k.is_multiple_of(self.ticks) {
            let error = -self.omega;
            let difference = error - self.filtered;
            self.reference = self.speed.gain * error + self.derivative * difference;
            self.filtered += self.decay * difference;
        }
        if self.update == Some(k % PARTS) {
            self.acting = self.computed;
        }
        if k.is_multiple_of(PARTS) {
            let error = self.reference - self.torque;
            self.computed = self.carrier.proportional * error + self.sum;
            self.sum += self.carrier.integral * self.carrier.sample * error;
        }
        if self.update.is_none() {
            self.acting = self.computed;
        }
        let after = self.fade * self.torque + self.volt * self.acting;
        self.omega += self.part / self.speed.inertia * 0.5 * (self.torque + after);
        self.torque = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: f64 = 125e-6;
    const INDUCTANCE: f64 = 30.5e-3;

    fn carrier(bandwidth: f64, delay: f64) -> Carrier {
        let (resistance, inductance) = (2.75, INDUCTANCE);
        Carrier { proportional: inductance * bandwidth, integral: resistance * bandwidth, sample: SAMPLE, delay, resistance, inductance }
    }

    fn speed(ratio: f64, filter: f64, tick: f64) -> SpeedLoop {
        let (inertia, derivative_time) = (2.675e-3, 0.01);
        SpeedLoop { gain: ratio * inertia / derivative_time, derivative_time, filter, tick, inertia }
    }

    /// (1 + rho) K T_s / L at the limit.
    fn limit(bandwidth: f64, delay: f64) -> f64 {
        1.0 + carrier(bandwidth, delay).margin(&speed(1.0, 1e5, 0.0), 1000.0)
    }

    #[test]
    fn a_fast_filter_makes_the_derivative_a_gain_of_the_current_loop() {
        for delay in [0.0, 0.5, 1.0] {
            for bandwidth in [300.0, 600.0, 1200.0] {
                let exact = largest_gain(delay) / (bandwidth * SAMPLE);
                let got = limit(bandwidth, delay);
                // The derivative is that of a sixteenth of a sample.
                assert!((got / exact - 1.0).abs() < 0.08, "{delay} {bandwidth}: {got} {exact}");
            }
        }
    }

    #[test]
    fn without_a_derivative_the_current_loop_alone_decides() {
        let stable = |share: f64| carrier(share / SAMPLE, 1.0).stable(&speed(1e-3, 1e5, 0.0));
        assert!(stable(0.9) && !stable(1.05));
    }

    #[test]
    fn behind_relays_a_tick_alternates_at_the_ratio_of_its_filter() {
        let relays = Relays { half_band: 0.5, slew: 8300.0 };
        assert!((relays.largest_ratio(&speed(1.0, 1e5, 1e-3)) - 1.0).abs() < 1e-12);
        // T(k) = (1 - decay (1 + rho)) T(k-1): the limit in closed form against the recurrence.
        let slow = speed(1.0, 10.0, 1e-3);
        let decay = 1.0 - libm::exp(-1.0);
        assert!((decay * (1.0 + relays.largest_ratio(&slow)) - 2.0).abs() < 1e-12);
        assert!(!relays.leaves_band(1e-6) && relays.leaves_band(1e-3));
    }
}
