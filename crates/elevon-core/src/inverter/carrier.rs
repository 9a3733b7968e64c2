//! Pulses of a leg behind a triangular carrier, with their edges where they are: within the step.
//!
//! The carrier falls from 1 to -1 in the first half of its period and rises back in the second. A leg is commanded high
//! while its reference m stands at or above it: from 1/2 - (1 + m)/4 to 1/2 + (1 + m)/4 of the period. Between two updates
//! of m the share of a step in which the leg is high follows in closed form, whatever the step. After each edge both
//! switches are off for the dead time, which may reach into further steps.

use crate::scalar::Scalar;
use crate::three;

/// Edges within this share of a step of its bounds fall on them: rounding of the time must neither lose nor double one.
const SLACK: f64 = 1e-6;

/// The carrier over steps of one length.
#[derive(Clone, Copy, Debug)]
pub struct Carrier<S> {
    frequency: S,
    /// Carrier periods in a step, and steps in a carrier period.
    per_step: S,
    steps: S,
}

/// Command of a leg over a step that is shorter than the carrier's period: it has two edges at most. Times are shares of
/// the step; an edge that does not fall into it stands at its end.
#[derive(Clone, Copy, Debug)]
pub struct Pulse<S: Scalar> {
    /// Is the leg high at the begin of the step?
    high: S::Mask,
    first: S,
    second: S,
}

/// Parts of a step in which the upper and the lower switch of a leg are closed; what is left of it both are open.
#[derive(Clone, Copy, Debug)]
pub struct Conduction<S> {
    pub upper: S,
    pub lower: S,
}

impl<S: Scalar> Carrier<S> {
    pub fn derive(frequency: S, dt: S) -> Self {
        let per_step = frequency * dt;
        Self { frequency, per_step, steps: S::one() / per_step }
    }

    /// Commands over the step that begins at `t`, for references held over it. Most short steps have no edge: they are known
    /// by the instant of the next one, in carrier periods, and keep the commands of the last step's end.
    #[inline(always)]
    pub fn pulses(&self, modulation: [S; 3], commands: [S; 3], next: &mut S, t: S) -> [Pulse<S>; 3] {
        let periods = t * self.frequency;
        let end = S::splat(1.0 + SLACK).fma(self.per_step, periods);
        if !S::any((*next).lt(end)) {
            return three!(|j| Pulse::held(commands[j]));
        }
        let phase = periods - periods.floor();
        let found = three!(|j| self.pulse(modulation[j], phase));
        let first = found[0].1.minimum(found[1].1).minimum(found[2].1);
        *next = self.per_step.fma(first, periods);
        three!(|j| found[j].0)
    }

    /// A leg's command, and when its next edge after the step is, in steps.
    #[inline(always)]
    fn pulse(&self, modulation: S, phase: S) -> (Pulse<S>, S) {
        let (zero, one, half, quarter) = (S::zero(), S::one(), S::splat(0.5), S::splat(0.25));
        let width = quarter.fma(modulation, quarter).clamp(zero, half);
        let (rise, fall) = (half - width, half + width);
        let slack = S::splat(SLACK);
        let now = slack.fma(self.per_step, phase);
        let (risen, fallen) = (rise.le(now), fall.le(now));
        let (full, none) = (half.le(width), width.le(zero));
        let high = (risen & !fallen & !none) | full;
        let next = S::select(fallen, one + rise, S::select(risen, fall, rise));
        let after = S::select(fallen, one + fall, S::select(risen, one + rise, fall));
        let steady = full | none;
        let shares = [(next - phase) * self.steps, (after - phase) * self.steps];
        let beyond = [steady | (one - slack).lt(shares[0]), steady | (one - slack).lt(shares[1])];
        // After two edges in a step the next one looks for more.
        let coming = S::select(beyond[0], shares[0], S::select(beyond[1], shares[1], one));
        let first = S::select(beyond[0], one, shares[0]);
        let second = S::select(beyond[1], one, shares[1]);
        (Pulse { high, first, second }, S::select(steady, S::splat(f64::MAX), coming))
    }
}

impl<S: Scalar> Pulse<S> {
    /// Without an edge.
    #[inline(always)]
    fn held(command: S) -> Self {
        Self { high: S::zero().lt(command), first: S::one(), second: S::one() }
    }

    /// Command at the begin and at the end of the step: 1 high, -1 low.
    #[inline(always)]
    pub fn ends(&self) -> [S; 2] {
        let begin = S::select(self.high, S::one(), -S::one());
        let (once, twice) = (self.first.lt(S::one()), self.second.lt(S::one()));
        [begin, S::select(once & !twice, -begin, begin)]
    }

    /// Edges within the step.
    #[inline(always)]
    pub fn edges(&self) -> S {
        S::indicator(self.first.lt(S::one())) + S::indicator(self.second.lt(S::one()))
    }

    /// Share of the step in which the leg is commanded high.
    #[inline(always)]
    pub fn share(&self) -> S {
        let between = self.second - self.first;
        S::select(self.high, S::one() - between, between)
    }

    /// Shares in which each switch conducts, after the dead time that is left over and that of the edges of this step, and
    /// what is left over after it. Dead times in steps; `before` is the command at the end of the last step.
    #[inline(always)]
    pub fn conduction(&self, before: S, left: S, dead: S) -> (Conduction<S>, S) {
        let (zero, one) = (S::zero(), S::one());
        let [begin, _] = self.ends();
        let left = S::select(begin.equals(before), left, dead);
        let between = self.second - self.first;
        let rest = one - self.second;
        // Off in the parts before, between and after the edges.
        let (outer, inner) = (left.minimum(self.first) + dead.minimum(rest), dead.minimum(between));
        let (outside, inside) = (one - between - outer, between - inner);
        let conduction = Conduction { upper: S::select(self.high, outside, inside), lower: S::select(self.high, inside, outside) };
        let last = S::select(self.second.lt(one), rest, one - self.first);
        let after = S::select(self.first.lt(one), dead - last, left - one);
        (conduction, after.maximum(zero))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREQUENCY: f64 = 4000.0;

    /// The carrier as it is drawn.
    fn triangle(t: f64) -> f64 {
        let phase = (t * FREQUENCY).fract();
        4.0 * (phase - 0.5).abs() - 1.0
    }

    /// Share high and edges of a step, and what one switch of the leg conducts, by looking at many instants of each step.
    fn looked_at(m: f64, step: f64, steps: usize, dead: f64) -> Vec<(f64, f64, f64)> {
        let parts = 4000;
        let (mut command, mut since) = (false, f64::INFINITY);
        let mut seen = Vec::new();
        for k in 0..steps {
            let (mut high, mut edges, mut upper) = (0.0, 0.0, 0.0);
            for i in 0..parts {
                let t = (k as f64 + (i as f64 + 0.5) / parts as f64) * step;
                let now = triangle(t) <= m;
                since += step / parts as f64;
                if now != command {
                    edges += 1.0;
                    since = 0.0;
                }
                command = now;
                high += f64::from(u8::from(now)) / parts as f64;
                upper += f64::from(u8::from(now && since >= dead)) / parts as f64;
            }
            seen.push((high, edges, upper));
        }
        seen
    }

    #[test]
    fn shares_edges_and_dead_times_are_those_of_the_drawn_carrier() {
        for step in [1e-6, 5e-6, 12.5e-6, 62.5e-6, 125e-6] {
            for m in [-1.0, -0.93, -0.31, 0.02, 0.6, 0.97, 1.0] {
                for dead in [0.0, 0.4e-6, 3e-6, 20e-6] {
                    let steps = (500e-6 / step).round() as usize;
                    let carrier = Carrier::derive(FREQUENCY, step);
                    let (mut command, mut left, mut next) = (-1.0, 0.0, f64::NEG_INFINITY);
                    let (mut edges, mut drawn) = (0.0, 0.0);
                    for (k, seen) in looked_at(m, step, steps, dead).into_iter().enumerate() {
                        let [pulse, ..] = carrier.pulses([m; 3], [command; 3], &mut next, k as f64 * step);
                        let case = format!("{step} {m} {dead} {k}");
                        assert!((pulse.share() - seen.0).abs() < 2e-3, "{case}: {} {}", pulse.share(), seen.0);
                        let (conduction, after) = pulse.conduction(command, left, dead / step);
                        assert!((conduction.upper - seen.2).abs() < 2e-3, "{case}: {} {}", conduction.upper, seen.2);
                        edges += 0.5 * (pulse.ends()[0] - command).abs() + pulse.edges();
                        drawn += seen.1;
                        // An edge on the bound of two steps may be seen in either.
                        assert!((edges - drawn).abs() < 1.5, "{case}: {edges} {drawn}");
                        command = pulse.ends()[1];
                        left = after;
                    }
                }
            }
        }
    }

    #[test]
    fn the_mean_over_a_period_is_the_reference_at_any_step() {
        for step in [1e-6, 12.5e-6, 25e-6] {
            let carrier = Carrier::derive(FREQUENCY, step);
            for m in [-0.999, -0.4, 0.0, 0.123, 0.8] {
                let steps = (250e-6_f64 / step).round() as usize;
                // After 1000 s, four million periods, an edge is rounded to 1e-9 of one, and m is four times that.
                let (mut commands, mut next, mut sum) = ([-1.0; 3], f64::NEG_INFINITY, 0.0);
                for k in 0..steps {
                    let pulses = carrier.pulses([m; 3], commands, &mut next, (4_000_000 * steps + k) as f64 * step);
                    commands = three!(|j| pulses[j].ends()[1]);
                    sum += pulses[0].share();
                }
                assert!((2.0 * sum / steps as f64 - 1.0 - m).abs() < 1e-8, "{step} {m}: {sum}");
            }
        }
    }
}
