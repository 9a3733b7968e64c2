//! Pulses of a leg behind a triangular carrier, with their edges where they are: within the step.
//!
//! The carrier falls from 1 to -1 in the first half of its period and rises back in the second. A leg is commanded high
//! while its reference m stands at or above it: from 1/2 - (1 + m)/4 to 1/2 + (1 + m)/4 of the period. Between two updates
//! of m the share of a step in which the leg is high follows in closed form, whatever the step. After each edge both
//! switches are off for the dead time, which may reach into further steps.

use crate::kept;
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

/// The edges of the legs in one period of the carrier, for references held in it; times in steps from its begin. A leg that
/// is high all the time falls at the period's end, one that is low falls as it rises.
#[derive(Clone, Copy, Debug)]
pub struct Window<S> {
    /// The period, counted from the start.
    begin: S,
    /// A step that ends later needs more than this window: minus infinity where the references have changed.
    last: S,
    rise: [S; 3],
    fall: [S; 3],
    /// 1; 0 where the drive has no say and no leg any command.
    driven: S,
    /// Edges until the window's end since the start.
    edges: S,
}

kept!(Window<f64> as Window { begin, last, rise, fall, driven, edges });

/// What a step needs of its window.
#[derive(Clone, Copy, Debug)]
pub struct Span<S: Scalar> {
    /// Begin of the step.
    begin: S,
    /// The steps that reach into the next period, where any does.
    over: Option<S::Mask>,
}

/// Command of a leg over a step that is shorter than the carrier's period: it has two edges at most. Times are shares of
/// the step; an edge that does not fall into it stands at its end.
#[derive(Clone, Copy, Debug)]
pub struct Pulse<S: Scalar> {
    /// Is the leg high at the begin of the step?
    high: S::Mask,
    first: S,
    second: S,
    /// Share of the step in which the leg is commanded high.
    pub share: S,
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

    /// The step that begins at `t`. The window is found again where the references, or whether the legs are `driven` by
    /// them, have changed since the last step, and moves on at the end of its period.
    #[inline(always)]
    pub fn span(&self, window: &mut Window<S>, modulation: [S; 3], driven: S, t: S) -> Span<S> {
        let one = S::one();
        let periods = t * self.frequency;
        let begin = (periods - window.begin) * self.steps;
        if !S::any(window.last.lt(begin + one)) {
            return Span { begin, over: None };
        }
        self.look(window, modulation, driven, periods);
        let begin = (periods - window.begin) * self.steps;
        let over = window.last.lt(begin + one);
        if !S::any(over) {
            return Span { begin, over: None };
        }
        // The next step finds the next period.
        window.turn(over);
        Span { begin, over: Some(over) }
    }

    /// The window in which a step begins.
    #[inline(always)]
    fn look(&self, window: &mut Window<S>, modulation: [S; 3], driven: S, periods: S) {
        let (zero, half, quarter, slack) = (S::zero(), S::splat(0.5), S::splat(0.25), S::splat(SLACK));
        let stale = window.last.lt(zero);
        let passed = window.begin.le(slack.fma(self.per_step, periods) - S::one());
        if S::any(passed & !stale) {
            window.turn(passed & !stale);
        }
        if !S::any(stale) {
            return;
        }
        let old = (periods - window.begin) * self.steps;
        let (ahead, before) = (window.ahead(old - slack), window.commands(old - slack));
        let width = three!(|j| quarter.fma(modulation[j], quarter).clamp(zero, half));
        let mut new = Window {
            begin: slack.fma(self.per_step, periods).floor(),
            last: self.steps + slack,
            rise: three!(|j| (half - width[j]) * self.steps),
            fall: three!(|j| (half + width[j]) * self.steps),
            driven,
            edges: window.edges - ahead,
        };
        let now = slack.fma(S::one(), (periods - new.begin) * self.steps);
        let after = new.commands(now);
        let jumps = (after[0] - before[0]).abs() + (after[1] - before[1]).abs() + (after[2] - before[2]).abs();
        new.edges = half.fma(jumps, new.edges) + new.ahead(now);
        window.put(stale, &new);
    }

    /// Share of a step in which a leg is commanded high.
    #[inline(always)]
    pub fn share(&self, window: &Window<S>, leg: usize, span: &Span<S>) -> S {
        let end = span.begin + S::one();
        let share = window.high(leg, end);
        match span.over {
            None => share,
            Some(over) => share + S::select(over, window.high(leg, end - self.steps), S::zero()),
        }
    }

    /// Command of a leg over a step.
    #[inline(always)]
    pub fn pulse(&self, window: &Window<S>, leg: usize, span: &Span<S>) -> Pulse<S> {
        let (one, slack) = (S::one(), S::splat(SLACK));
        let [rise, fall] = [window.rise[leg] - span.begin, window.fall[leg] - span.begin];
        let (risen, fallen) = (rise.le(slack), fall.le(slack));
        let next = S::select(fallen, rise + self.steps, S::select(risen, fall, rise));
        let after = S::select(fallen, fall + self.steps, S::select(risen, rise + self.steps, fall));
        let steady = !window.switches(leg);
        let beyond = [steady | (one - slack).lt(next), steady | (one - slack).lt(after)];
        Pulse {
            high: risen & !fallen,
            first: S::select(beyond[0], one, next),
            second: S::select(beyond[1], one, after),
            share: self.share(window, leg, span),
        }
    }

    /// Edges of all legs since the start, at the instant `t`.
    #[inline(always)]
    pub fn edges(&self, window: &Window<S>, t: S) -> S {
        window.edges - window.ahead((t * self.frequency - window.begin).fma(self.steps, -S::splat(SLACK)))
    }
}

impl<S: Scalar> Window<S> {
    /// All legs low.
    pub fn initial() -> Self {
        let zero = S::zero();
        Self { begin: zero, last: -S::splat(f64::INFINITY), rise: [zero; 3], fall: [zero; 3], driven: S::one(), edges: zero }
    }

    /// The references have changed.
    #[inline(always)]
    pub fn renew(&mut self) {
        self.last = -S::splat(f64::INFINITY);
    }

    /// Share of a step ending at `end` in which a leg is high in this period.
    #[inline(always)]
    fn high(&self, leg: usize, end: S) -> S {
        (end - self.rise[leg]).clamp(S::zero(), S::one()) - (end - self.fall[leg]).clamp(S::zero(), S::one())
    }

    /// Does a leg switch at all?
    #[inline(always)]
    fn switches(&self, leg: usize) -> S::Mask {
        S::zero().lt(self.rise[leg]) & self.rise[leg].lt(self.fall[leg])
    }

    /// Edges of the legs after `at`.
    #[inline(always)]
    fn ahead(&self, at: S) -> S {
        let ahead: [S; 3] = three!(|j| {
            let [rise, fall] = [at.lt(self.rise[j]), at.lt(self.fall[j])];
            S::select(self.switches(j), S::indicator(rise) + S::indicator(fall), S::zero())
        });
        self.driven * (ahead[0] + ahead[1] + ahead[2])
    }

    /// Commands of the legs at `at`: 1 high, -1 low, 0 none.
    #[inline(always)]
    fn commands(&self, at: S) -> [S; 3] {
        three!(|j| self.driven * S::select(self.rise[j].le(at) & at.lt(self.fall[j]), S::one(), -S::one()))
    }

    /// On to the next period, in some lanes.
    #[inline(always)]
    fn turn(&mut self, lanes: S::Mask) {
        let edges = S::splat(2.0) * (S::indicator(self.switches(0)) + S::indicator(self.switches(1)) + S::indicator(self.switches(2)));
        self.begin = S::select(lanes, self.begin + S::one(), self.begin);
        self.edges = S::select(lanes, self.driven.fma(edges, self.edges), self.edges);
    }

    /// Another window, in some lanes.
    #[inline(always)]
    fn put(&mut self, lanes: S::Mask, new: &Self) {
        self.begin = S::select(lanes, new.begin, self.begin);
        self.last = S::select(lanes, new.last, self.last);
        self.rise = three!(|j| S::select(lanes, new.rise[j], self.rise[j]));
        self.fall = three!(|j| S::select(lanes, new.fall[j], self.fall[j]));
        self.driven = S::select(lanes, new.driven, self.driven);
        self.edges = S::select(lanes, new.edges, self.edges);
    }
}

impl<S: Scalar> Pulse<S> {
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
        let (upper, lower) = (S::select(self.high, outer, inner), S::select(self.high, inner, outer));
        let conduction = Conduction { upper: self.share - upper, lower: one - self.share - lower };
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
                    let (mut command, mut left, mut window) = (-1.0, 0.0, Window::initial());
                    let (mut edges, mut drawn) = (0.0, 0.0);
                    for (k, seen) in looked_at(m, step, steps, dead).into_iter().enumerate() {
                        let span = carrier.span(&mut window, [m; 3], 1.0, k as f64 * step);
                        let pulse = carrier.pulse(&window, 0, &span);
                        let case = format!("{step} {m} {dead} {k}");
                        assert!((pulse.share - seen.0).abs() < 2e-3, "{case}: {} {}", pulse.share, seen.0);
                        let (conduction, after) = pulse.conduction(command, left, dead / step);
                        assert!((conduction.upper - seen.2).abs() < 2e-3, "{case}: {} {}", conduction.upper, seen.2);
                        edges += 0.5 * (pulse.ends()[0] - command).abs() + pulse.edges();
                        drawn += seen.1;
                        // An edge on the bound of two steps may be seen in either.
                        assert!((edges - drawn).abs() < 1.5, "{case}: {edges} {drawn}");
                        let counted = carrier.edges(&window, (k + 1) as f64 * step);
                        assert_eq!(counted, 3.0 * edges, "{case}");
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
                let (mut window, mut sum) = (Window::initial(), 0.0);
                for k in 0..steps {
                    let span = carrier.span(&mut window, [m; 3], 1.0, (4_000_000 * steps + k) as f64 * step);
                    sum += carrier.share(&window, 0, &span);
                }
                assert!((2.0 * sum / steps as f64 - 1.0 - m).abs() < 1e-8, "{step} {m}: {sum}");
            }
        }
    }
}
