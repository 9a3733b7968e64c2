//! The three windings over a part of a step in which EMFs and voltages are held: exact, whatever the step.

use super::model::Model;
use crate::scalar::Scalar;
use crate::three;

/// Electrical angle over which EMFs are held, rad, and most parts of a step: beyond, a step is more than four turns.
const LONGEST_TURN: f64 = 0.1;
const MOST: f64 = 256.0;

/// Parts of a step in which EMFs are held.
#[inline(always)]
pub(super) fn parts<S: Scalar>(m: &Model<S>, speed: S) -> S {
    let turned = (m.star.pole_pairs * speed * m.dt).abs();
    -((turned * S::splat(-1.0 / LONGEST_TURN)).floor()).clamp(S::splat(-MOST), S::splat(-1.0))
}

/// (1 - exp(-R dt / L)) / R of each winding: its current per volt held over `dt`.
#[inline(always)]
pub(super) fn per_winding<S: Scalar>(m: &Model<S>, resistance: [S; 3], dt: S) -> [S; 3] {
    three!(|j| (S::one() - (-(dt * resistance[j] / m.inductance[j])).exp()) / resistance[j])
}

/// One part of a step: what the drive sees, and the windings without its voltage.
pub(super) struct Part<S> {
    pub(super) dt: S,
    pub(super) half_supply: S,
    /// Current at the end with all legs at zero, but for the neutral.
    pub(super) free: [S; 3],
    /// Current per volt held over the part; none of an interrupted phase.
    pub(super) per_volt: [S; 3],
    /// How far each current would decay between the rails' pushes: to what its EMF drives.
    pub(super) drift: [S; 3],
    pub(super) sines: [S; 3],
    pub(super) cosines: [S; 3],
    /// Speed that the drive believes.
    pub(super) speed: S,
}

/// The star over a part under leg voltages.
struct Settled<S: Scalar> {
    /// Currents but for the neutral.
    raised: [S; 3],
    /// 1 for a phase that is not interrupted.
    closed: [S; 3],
    /// One closed phase alone carries nothing.
    alone: S::Mask,
    /// Voltage that keeps the sum of the currents at zero.
    neutral: S,
}

impl<S: Scalar> Settled<S> {
    #[inline(always)]
    fn of(part: &Part<S>, legs: [S; 3]) -> Self {
        let (zero, one) = (S::zero(), S::one());
        let g = part.per_volt;
        let total = g[0] + g[1] + g[2];
        let raised: [S; 3] = three!(|j| g[j].fma(legs[j], part.free[j]));
        let closed: [S; 3] = three!(|j| S::select(g[j].equals(zero), zero, one));
        let neutral = (closed[0] * raised[0] + closed[1] * raised[1] + closed[2] * raised[2]) / S::select(total.equals(zero), one, total);
        let alone = (closed[0] + closed[1] + closed[2]).lt(S::splat(1.5));
        Self { raised, closed, alone, neutral }
    }
}

/// Currents after a part under leg voltages.
#[inline(always)]
pub(super) fn settled<S: Scalar>(part: &Part<S>, legs: [S; 3]) -> [S; 3] {
    let x = Settled::of(part, legs);
    let g = part.per_volt;
    three!(|j| S::select(x.alone, S::zero(), x.closed[j] * (x.raised[j] - g[j] * x.neutral)))
}

/// Voltages of the phases over a part, to the neutral where one is interrupted, which has its EMF.
#[inline(always)]
pub(super) fn phase_voltages<S: Scalar>(part: &Part<S>, legs: [S; 3], emf: [S; 3]) -> [S; 3] {
    let x = Settled::of(part, legs);
    let whole = (x.closed[0] + x.closed[1] + x.closed[2]).equals(S::splat(3.0));
    three!(|j| {
        let loose = S::select(x.alone | x.closed[j].equals(S::zero()), emf[j], legs[j] - x.neutral);
        S::select(whole, legs[j], loose)
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::scalar::three_phase;

    pub const R: f64 = 2.0;
    pub const L: f64 = 1e-2;
    pub const DT: f64 = 5e-5;

    /// A part of the star at rest with the currents `i`, phases interrupted where `open`.
    pub fn part(i: [f64; 3], open: [bool; 3], angle: f64) -> Part<f64> {
        let gain = (1.0 - (-DT * R / L).exp()) / R;
        let per_volt = open.map(|gone| if gone { 0.0 } else { gain });
        let (sines, cosines) = three_phase(angle.sin(), angle.cos());
        Part {
            dt: DT,
            half_supply: 24.0,
            free: three!(|j| i[j] - per_volt[j] * R * i[j]),
            per_volt,
            drift: [0.0; 3],
            sines,
            cosines,
            speed: 0.0,
        }
    }
}
