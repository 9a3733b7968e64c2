//! What the relays leave between the current and its reference, for the one phase and for the three windings
//! (docs/explanation/theory/low-fidelity.md, "Two drives", "The speed derivative as inertia").

use super::model::{DrivenState, Model, Phase, State};
use super::structure::Structure;
use super::windings::{settled, Part};
use crate::actuator::servo::shaft::Loads;
use crate::inverter::hysteresis::six_step;
use crate::motor::equivalent::quadrature;
use crate::scalar::{three_phase, Scalar};
use crate::three;

/// Fall of the mean error with the voltage that the phase needs, over the link's: measured in the switching model.
const FALL: f64 = 11.0;
/// Rounds in which the legs see what the others do.
const ROUNDS: usize = 3;

/// Mean error of a current before its relay acts. A link far above what the phase needs lets it coast slowly to the edge;
/// nearer to it the three relays follow each other within their bands, about the reference: b/(1 + y + y^2/2 + y^3/6) with
/// y = n/V, in one division.
#[inline(always)]
pub(super) fn mean_error<S: Scalar>(m: &Model<S>, s: &State<S>, p: &Phase<S>, supply: S) -> S {
    let emf = S::splat(2.0 / 3.0) * p.torque_constant * s.shaft.motor_speed;
    let needed = S::splat(FALL) * p.circuit.resistance.fma(s.current, emf).abs();
    let (square, cube) = (S::splat(0.5) * needed * needed, S::splat(1.0 / 6.0) * needed * needed * needed);
    let falls = supply.fma(supply.fma(supply + needed, square), cube);
    let there = S::zero().lt(supply);
    let left = m.drive.band * (supply * supply * supply) / S::select(there, falls, S::one());
    S::select(there, left, m.drive.band)
}

/// The shaft as it is pushed. No closure: one is compiled by itself, without the vector instructions of its caller.
struct Pushed<'a, S, const FULL: bool, const EXTRA: bool> {
    m: &'a Model<S>,
    structure: &'a Structure,
    s: &'a State<S>,
    loads: &'a Loads<S>,
}

impl<S: Scalar, const FULL: bool, const EXTRA: bool> Pushed<'_, S, FULL, EXTRA> {
    /// Acceleration by a torque, with one over an inertia.
    #[inline(always)]
    fn torque(&self, torque: S, per_inertia: S) -> S {
        self.m.shaft.acceleration::<FULL, EXTRA>(&self.structure.shaft, &self.s.shaft, self.loads, torque, per_inertia)
    }
}

/// What the controller demands but for its derivative, the derivative as inertia, 1/(J + eta D) and 1/J of what moves.
pub(super) struct TorqueDemand<S> {
    pub torque: S,
    pub inertia: S,
    pub per_inertia: S,
    pub per_shaft: S,
}

/// Acceleration under the torque that the relays leave anywhere within `band` of a current reference that contains the
/// acceleration: T_ref = A - D a, J a = clamp(T_drift, eta T_ref +- b) - L. Monotone and piecewise linear in a.
#[inline(always)]
pub(super) fn within_band<S: Scalar, const FULL: bool, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    s: &State<S>,
    p: &Phase<S>,
    demand: &TorqueDemand<S>,
    band: S,
    loads: &Loads<S>,
) -> S {
    let by = Pushed::<S, FULL, EXTRA> { m, structure, s, loads };
    let emf = S::splat(2.0 / 3.0) * p.torque_constant * s.shaft.motor_speed;
    let drift = p.torque_constant * p.circuit.current(s.current, -emf);
    let band = p.torque_constant * band;
    let coasting = by.torque(drift, demand.per_shaft);
    let gap = drift - p.efficacy * (demand.torque - demand.inertia * coasting);
    let push = gap.signed(band);
    let mut edge = by.torque(p.efficacy.fma(demand.torque, push), demand.per_inertia);
    let reference = demand.torque - demand.inertia * edge;
    let limited = s.torque_limit.lt(reference.abs());
    if S::any(limited) {
        let limit = by.torque(p.efficacy.fma(reference.clamp_abs(s.torque_limit), push), demand.per_shaft);
        edge = S::select(limited, limit, edge);
    }
    S::select(gap.abs().le(band), coasting, edge)
}

/// Cosine of the angle by which the references stand apart from the rotor, none beyond a quarter turn: what is left there of
/// the mean errors.
#[inline(always)]
pub(super) fn aligned<S: Scalar>(m: &Model<S>, structure: &Structure, position: S, sines: [S; 3]) -> S {
    if !structure.misled {
        return S::one();
    }
    let (sin, cos) = m.star.electrical_angle(position).sin_cos();
    quadrature(three_phase(sin, cos).0, sines).maximum(S::zero())
}

/// Mean legs of the relays: each gives what brings its phase to the edge of its mean band, within the rails, on the side to
/// which the current decays between the pushes. An error that all phases share, as of unlike sensors, stays up to that mean
/// error; what is left of it drives the legs to one rail. With an interrupted phase the edges are those of a backlash: a leg keeps
/// its voltage until the error has left the
/// mean band.
pub(super) struct Relays<S> {
    gain: [S; 3],
    weight: [S; 3],
    edge: S,
    backlash: S,
    shared: S,
    six_step: bool,
}

impl<S: Scalar> Relays<S> {
    #[inline(always)]
    pub(super) fn of(m: &Model<S>, structure: &Structure, band: S) -> Self {
        let (zero, open) = (S::zero(), &m.star.open);
        let open = S::splat(0.5).le(open[0].maximum(open[1]).maximum(open[2]));
        // Square waves of the three edges have 4/pi of them as their quadrature component. Blocks by an angle that is not the
        // shaft's, and references that stand apart from the rotor, leave no error in the mean.
        let exact = structure.turned || (structure.six_step && structure.misled);
        let edge = if exact { zero } else { S::splat(std::f64::consts::FRAC_PI_4) * band };
        let kept = if exact { zero } else { band };
        Self {
            gain: m.drive.gain,
            weight: m.drive.weight,
            edge: S::select(open, zero, edge),
            backlash: S::select(open, kept, zero),
            shared: S::select(open, zero, band),
            six_step: structure.six_step,
        }
    }

    /// Share of a current error that all phases have, by what their sensors report of the star.
    #[inline(always)]
    fn common(&self, errors: [S; 3]) -> S {
        let weight = &self.weight;
        let sum = weight[0] + weight[1] + weight[2];
        let total = weight[0] * errors[0] + weight[1] * errors[1] + weight[2] * errors[2];
        total / S::select(sum.equals(S::zero()), S::one(), sum)
    }

    /// Currents to which the phases are brought: the star has no error that all share.
    #[inline(always)]
    fn aims(&self, part: &Part<S>, wanted: S) -> [S; 3] {
        let reference = if self.six_step { six_step(part.sines) } else { part.sines };
        let wanted: [S; 3] = three!(|j| wanted * reference[j]);
        let edges: [S; 3] = three!(|j| part.drift[j].clamp_abs(self.edge));
        let left = self.common(edges) - self.common(wanted).clamp_abs(self.shared);
        three!(|j| wanted[j] - edges[j] + left)
    }

    #[inline(always)]
    pub(super) fn step(&self, part: &Part<S>, memory: &mut DrivenState<S>, wanted: S) -> [S; 3] {
        let (zero, one) = (S::zero(), S::one());
        let aims = self.aims(part, wanted);
        let mut after = settled(part, memory.legs);
        for _ in 0..ROUNDS {
            for j in 0..3 {
                let others = part.per_volt[(j + 1) % 3] + part.per_volt[(j + 2) % 3];
                let total = part.per_volt[j] + others;
                // Per volt of this leg, the neutral following.
                let reach = part.per_volt[j] * others / S::select(total.equals(zero), one, total) * self.gain[j];
                let error = aims[j] - self.gain[j] * after[j];
                let none = reach.equals(zero);
                let beyond = error - error.clamp_abs(self.backlash);
                let change = S::select(none, zero, beyond / S::select(none, one, reach));
                memory.legs[j] = (memory.legs[j] + change).clamp_abs(part.half_supply);
                after = settled(part, memory.legs);
            }
        }
        after
    }
}

#[cfg(test)]
mod tests {
    use super::super::windings::tests::part;
    use super::*;

    #[test]
    fn the_emf_holds_every_current_at_the_edge_of_its_band() {
        let relays = Relays { gain: [1.0; 3], weight: [1.0; 3], edge: 0.1, backlash: 0.0, shared: 0.0, six_step: false };
        let (mut i, mut memory, wanted) = ([0.0; 3], DrivenState::initial(), 3.0);
        let turns = 400;
        let (mut mean, mut worst) = (0.0, 0.0_f64);
        for k in 0..2 * turns {
            let mut x = part(i, [false; 3], std::f64::consts::TAU * f64::from(k) / f64::from(turns));
            x.drift = three!(|j| 50.0 * x.sines[j]);
            i = relays.step(&x, &mut memory, wanted);
            if k >= turns {
                mean += quadrature(i, x.sines) / f64::from(turns);
                worst = (0..3).map(|j| (wanted * x.sines[j] - i[j]).abs()).fold(worst, f64::max);
            }
        }
        // The star has no common error: a square wave less a third of itself at three times the frequency.
        assert!((mean - (wanted - 0.1 * 4.0 / std::f64::consts::PI)).abs() < 0.02, "{mean}");
        assert!(worst < 0.15, "{worst}");
    }

    #[test]
    fn unlike_sensors_leave_all_phases_one_error() {
        let relays = Relays { gain: [0.5, 1.0, 1.0], weight: [2.0, 1.0, 1.0], edge: 0.0, backlash: 0.0, shared: 0.3, six_step: false };
        let (mut i, mut memory) = ([0.0; 3], DrivenState::initial());
        for _ in 0..50 {
            i = relays.step(&part(i, [false; 3], 1.2), &mut memory, 1.0);
        }
        // 2 (s_a - e) + (s_b - e) + (s_c - e) = 0 with s_a + s_b + s_c = 0.
        let sines = part(i, [false; 3], 1.2).sines;
        for j in 0..3 {
            let error = sines[j] - relays.gain[j] * i[j];
            assert!((error - 0.25 * sines[0]).abs() < 1e-6, "{error} {i:?}");
        }
    }

    #[test]
    fn a_leg_in_its_backlash_keeps_its_voltage() {
        let relays = Relays { gain: [1.0; 3], weight: [1.0; 3], edge: 0.0, backlash: 0.5, shared: 0.0, six_step: false };
        let mut memory = DrivenState::initial();
        relays.step(&part([0.0; 3], [false, false, true], 0.3), &mut memory, 0.4);
        assert_eq!(memory.legs, [0.0; 3]);
    }

    #[test]
    fn relays_out_of_reach_are_six_step() {
        let relays = Relays { gain: [1.0; 3], weight: [1.0; 3], edge: 0.1, backlash: 0.0, shared: 0.0, six_step: false };
        let mut memory = DrivenState::initial();
        let x = part([0.0; 3], [false; 3], 0.3);
        relays.step(&x, &mut memory, 1e3);
        for j in 0..3 {
            assert_eq!(memory.legs[j], 24.0 * x.sines[j].signum());
        }
    }

    #[test]
    fn relays_of_an_open_phase_carry_half_the_difference_of_the_references() {
        let relays = Relays { gain: [1.0; 3], weight: [1.0; 3], edge: 0.0, backlash: 0.0, shared: 0.0, six_step: false };
        let (mut i, mut memory) = ([0.0; 3], DrivenState::initial());
        // Between the two references: whose leg has voltage left decides.
        let x = |i| part(i, [false, false, true], 0.5 * std::f64::consts::PI - std::f64::consts::PI / 3.0);
        for _ in 0..200 {
            i = relays.step(&x(i), &mut memory, 3.0);
        }
        let sines = x(i).sines;
        assert!(i[0] >= 3.0 * sines[0].min(-sines[1]) - 1e-9 && i[0] <= 3.0 * sines[0].max(-sines[1]) + 1e-9, "{i:?} {sines:?}");
        assert_eq!((i[2], i[1]), (0.0, -i[0]));
    }
}
