//! Three hysteresis relays on the phase current errors (T2; reference sheet 1.4).

use crate::scalar::Scalar;
use crate::three;

/// New leg commands (+1 high, -1 low): beyond the half band they follow the error's sign, inside it they stay.
#[inline(always)]
pub fn relays<S: Scalar>(half_band: S, legs: [S; 3], error: [S; 3]) -> [S; 3] {
    three!(|j| {
        let lowered = S::select(error[j].lt(-half_band), -S::one(), legs[j]);
        S::select(half_band.lt(error[j]), S::one(), lowered)
    })
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

/// Leg transitions between two sets of commands added to `count`; most steps have none.
#[inline(always)]
pub fn count_transitions<S: Scalar>(count: S, old: [S; 3], new: [S; 3]) -> S {
    let same = old[0].equals(new[0]) & old[1].equals(new[1]) & old[2].equals(new[2]);
    if !S::any(!same) {
        return count;
    }
    let sum = (new[0] - old[0]).abs() + (new[1] - old[1]).abs() + (new[2] - old[2]).abs();
    count + S::splat(0.5) * sum
}
