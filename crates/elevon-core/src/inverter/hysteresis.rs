//! Three hysteresis relays on the phase current errors (T2; reference sheet 1.4).

use crate::scalar::Scalar;
use crate::three;
use crate::variable::View;
use crate::{choices, variables};

choices! {
    RelayCrossing { Sampled "sampled", Located "located" }
}

variables! {
    /// How the relays are looked at.
    RelayParameter, RELAYS {
        RelayCrossing => "relay_crossing", "-", "1", Choice(RelayCrossing::NAMES), Solver, Some(0.0), "sampled: a relay acts at the first step after its threshold was passed (the papers), up to a step late, which prolongs the limit cycle of the three relays; located: at the instant within the step at which the error passes it",
            high_only("it has no relays").when(&[Chosen("drive.kind", &["hysteresis"])]);
    }
}

impl RelayCrossing {
    pub fn located(view: &View<RelayParameter>) -> bool {
        Self::read(view.value(RelayParameter::RelayCrossing)) == Self::Located
    }
}

/// New leg commands (+1 high, -1 low): beyond the half band they follow the error's sign, inside it they stay.
#[inline(always)]
pub fn relays<S: Scalar>(half_band: S, legs: [S; 3], error: [S; 3]) -> [S; 3] {
    three!(|j| {
        let lowered = S::select(error[j].lt(-half_band), -S::one(), legs[j]);
        S::select(half_band.lt(error[j]), S::one(), lowered)
    })
}

/// Share of a step after which the first relay passes its threshold, and which do then: errors at both ends of the step,
/// straight between. `None`: none does. Commands other than +1 and -1 are no relay's.
#[inline(always)]
pub fn crossing<S: Scalar>(half_band: S, legs: [S; 3], start: [S; 3], end: [S; 3]) -> Option<(S, [S::Mask; 3])> {
    let (zero, one) = (S::zero(), S::one());
    let crossed: [S::Mask; 3] = three!(|j| (zero.lt(legs[j]) & end[j].lt(-half_band)) | (legs[j].lt(zero) & half_band.lt(end[j])));
    if !S::any(crossed[0] | crossed[1] | crossed[2]) {
        return None;
    }
    let shares: [S; 3] = three!(|j| {
        let change = S::select(crossed[j], end[j] - start[j], one);
        let share = ((-legs[j] * half_band - start[j]) / change).clamp(zero, one);
        S::select(crossed[j], share, one)
    });
    let first = shares[0].minimum(shares[1]).minimum(shares[2]);
    Some((first, three!(|j| crossed[j] & shares[j].le(first))))
}

/// Squares of the three phases' ripple under relays, summed, over the square of the band that the currents fill: of the limit
/// cycle of three relays with a floating neutral, hardly dependent on voltage and speed (docs/explanation/theory/low-fidelity.md).
const RIPPLE: f64 = 1.2;
/// Overshoot behind a filter of the measured currents, over its time constant and V/L.
const OVERSHOOT: f64 = 0.37;

/// Sum of the squares of the ripple that relays leave beside the phases' mean currents, A^2. `delay` is the time constant of a
/// filter of the measured currents, `slope` the link's voltage over a winding's inductance.
#[inline(always)]
pub fn ripple_square<S: Scalar>(half_band: S, delay: S, slope: S) -> S {
    let filled = S::splat(OVERSHOOT) * delay * slope + half_band;
    S::splat(RIPPLE) * filled * filled
}

/// References of a six-step drive per ampere: 1 on [30, 150), -1 on [210, 330) degrees of each phase angle, else 0,
/// from the sines of the three angles.
#[inline(always)]
pub fn six_step<S: Scalar>(sines: [S; 3]) -> [S; 3] {
    let half = S::splat(0.5);
    three!(|j| {
        let low = S::select(sines[j].lt(-half), -S::one(), S::zero());
        S::select(half.le(sines[j]), S::one(), low)
    })
}

/// Does any leg change?
#[inline(always)]
pub fn transition<S: Scalar>(old: [S; 3], new: [S; 3]) -> bool {
    S::any(!(old[0].equals(new[0]) & old[1].equals(new[1]) & old[2].equals(new[2])))
}

/// Leg transitions between two sets of commands added to `count`.
#[inline(always)]
pub fn count_transitions<S: Scalar>(count: S, old: [S; 3], new: [S; 3]) -> S {
    let sum = (new[0] - old[0]).abs() + (new[1] - old[1]).abs() + (new[2] - old[2]).abs();
    count + S::splat(0.5) * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_relay_to_pass_its_threshold_is_located_on_the_straight_line() {
        let legs = [1.0, -1.0, -1.0];
        assert!(crossing(0.5, legs, [0.0, 0.0, 0.0], [-0.5, 0.5, 0.4]).is_none());
        let (share, which) = crossing(0.5, legs, [-0.4, 0.3, 0.0], [-0.8, 0.7, 0.1]).unwrap_or((0.0, [false; 3]));
        assert!((share - 0.25_f64).abs() < 1e-12);
        assert_eq!(which, [true, false, false]);
        let (share, which) = crossing(0.5, legs, [-0.4, 0.3, 0.0], [-0.5, 0.8, 0.1]).unwrap_or((0.0, [false; 3]));
        assert!((share - 0.4_f64).abs() < 1e-12);
        assert_eq!(which, [false, true, false]);
        // A relay beyond its threshold already acts at once; legs that are off are no relays.
        let (share, _) = crossing(0.5, legs, [-0.6, 0.0, 0.0], [-0.8, 0.0, 0.0]).unwrap_or((1.0, [false; 3]));
        assert_eq!(share, 0.0);
        assert!(crossing(0.5, [0.0; 3], [-0.4; 3], [-0.8; 3]).is_none());
    }

    /// Own integration of three relays on L de/dt = V (leg - mean leg) - v sin(theta - j 2 pi/3), errors in half bands and
    /// times in h L/V, seen through a filter: sum of the squares beside the mean in the rotating frame.
    fn integrated(voltage: f64, turning: f64, filter: f64) -> f64 {
        let (dt, steps) = (0.02, 1_000_000);
        let share = if filter > 0.0 { 1.0 - (-dt / filter).exp() } else { 1.0 };
        let (mut e, mut seen, mut legs) = ([0.0; 3], [0.0; 3], [-1.0; 3]);
        let (mut square, mut q, mut d, mut n) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..steps {
            let angle = turning * dt * f64::from(k);
            let phases: [f64; 3] = std::array::from_fn(|j| angle - std::f64::consts::TAU / 3.0 * j as f64);
            for j in 0..3 {
                seen[j] += share * (e[j] - seen[j]);
            }
            legs = relays(1.0, legs, seen.map(|x: f64| -x));
            if k > steps / 10 {
                for j in 0..3 {
                    square += e[j] * e[j];
                    q += 2.0 / 3.0 * e[j] * phases[j].sin();
                    d -= 2.0 / 3.0 * e[j] * phases[j].cos();
                }
                n += 1.0;
            }
            let mean = (legs[0] + legs[1] + legs[2]) / 3.0;
            for j in 0..3 {
                e[j] += dt * (0.5 * (legs[j] - mean) - voltage * phases[j].sin());
            }
        }
        square / n - 1.5 * (q * q + d * d) / (n * n)
    }

    #[test]
    fn the_ripple_of_three_relays_hardly_depends_on_voltage_and_speed() {
        for voltage in [0.03, 0.1, 0.25] {
            for turning in [0.0016, 0.0064] {
                let found = integrated(voltage, turning, 0.0);
                assert!((found / ripple_square(1.0, 0.0, 1.0) - 1.0).abs() < 0.1, "{voltage} {turning}: {found}");
            }
        }
    }

    #[test]
    fn a_filter_of_the_measured_currents_lets_them_overshoot() {
        for filter in [0.3, 1.0, 2.0, 4.0, 6.4] {
            let found = integrated(0.1, 0.003, filter);
            assert!((found / ripple_square(1.0, filter, 1.0) - 1.0).abs() < 0.1, "{filter}: {found}");
        }
    }
}
