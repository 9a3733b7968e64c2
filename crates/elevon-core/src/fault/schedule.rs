//! Faults compiled to parameter writes: edges exact to a step, smooth profiles held on a grid. The label of a
//! sample is what acts then, in the unit of the catalogue: whole numbers of what is counted, 0 or 1 of a switch.

use super::{Op, Profile};
use crate::kept::{Kept, Store};
use crate::scalar::Scalar;
use crate::time::{step_at, Steps};

/// One parameter that a fault changes.
#[derive(Clone, Copy, Debug)]
pub struct Write {
    pub index: usize,
    pub op: Op,
}

/// A fault of one run, resolved to parameter indices.
#[derive(Clone, Debug)]
pub struct FaultSpec {
    pub severity: f64,
    pub profile: Profile,
    pub writes: Vec<Write>,
    /// Parameters the attributes set, whatever the severity.
    pub settings: Vec<(usize, f64)>,
    /// Period of a pulsed fault, s.
    pub period: f64,
}

impl FaultSpec {
    /// Parameters that differ from healthy at some time of a run of steps `dt`; none when nothing acts of the severity, as
    /// of a switch below one half or a pulse below half a step.
    pub fn touched(&self, dt: f64) -> impl Iterator<Item = usize> + '_ {
        let acts = move |op: Op| op.acting(self.severity) != 0.0 && !(op == Op::Pulse && self.vanishes(self.severity, dt));
        self.writes.iter().filter(move |w| acts(w.op)).map(|w| w.index)
    }

    /// Is a pulse of this duty shorter than half a step?
    fn vanishes(&self, duty: f64, dt: f64) -> bool {
        duty * self.period < 0.5 * dt
    }

    /// Parameters that the fault or its attributes move at some time; none when the severity is zero.
    pub fn moved(&self) -> impl Iterator<Item = usize> + '_ {
        let live = self.severity != 0.0;
        self.touched(0.0).chain(self.settings.iter().filter(move |_| live).map(|s| s.0))
    }

    /// Held (label, profile factor, pulse state) at step `k` and the step of the next change.
    fn at(&self, k: Steps, dt: f64, grid: Steps) -> (ProfileValue, Steps) {
        let t = (k as f64 + 0.5) * dt;
        let (factor, until) = self.profile.factor(t);
        let smooth = until <= t;
        let mut next = if smooth { (k / grid + 1) * grid } else { step_at(until, dt).max(k + 1) };
        let given = factor * self.severity;
        let mut label = self.writes.first().map_or(given, |w| w.op.acting(given));
        let mut pulse = false;
        if self.writes.iter().any(|w| w.op == Op::Pulse) && self.vanishes(label, dt) {
            label = 0.0;
        } else if self.writes.iter().any(|w| w.op == Op::Pulse) {
            let origin = (t / self.period).floor() * self.period;
            let off = origin + label * self.period;
            pulse = t < off;
            let edge = if pulse { off } else { origin + self.period };
            next = next.min(step_at(edge, dt).max(k + 1));
        }
        (ProfileValue { label, factor, pulse }, next)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct ProfileValue {
    label: f64,
    factor: f64,
    pulse: bool,
}

/// The faults of the lanes of a block.
#[derive(Clone, Debug)]
pub struct FaultLanes {
    faults: Vec<Vec<FaultSpec>>,
    values: Vec<Vec<ProfileValue>>,
    next: Vec<Steps>,
    soonest: Steps,
    grid: Steps,
}

impl FaultLanes {
    pub fn new(faults: Vec<Vec<FaultSpec>>, grid: Steps) -> Self {
        let values = faults.iter().map(|f| vec![ProfileValue::default(); f.len()]).collect();
        let next: Vec<Steps> = faults.iter().map(|f| if f.is_empty() { Steps::MAX } else { 0 }).collect();
        let soonest = next.iter().copied().min().unwrap_or(Steps::MAX);
        Self { faults, values, next, soonest, grid: grid.max(1) }
    }

    pub fn next(&self) -> Steps {
        self.soonest
    }

    /// The label of a fault of a lane; 0 where the lane has no such fault.
    pub fn label(&self, lane: usize, fault: usize) -> f64 {
        self.values[lane].get(fault).map_or(0.0, |value| value.label)
    }

    pub fn severity(&self, lane: usize, fault: usize) -> f64 {
        self.faults[lane][fault].severity
    }

    /// Puts a fault in the place of another of a lane, or behind the last; it acts at the next renewal.
    pub fn replace(&mut self, lane: usize, fault: usize, spec: FaultSpec) {
        if fault < self.faults[lane].len() {
            self.faults[lane][fault] = spec;
        } else {
            self.faults[lane].push(spec);
            self.values[lane].push(ProfileValue::default());
        }
        (self.next[lane], self.soonest) = (0, 0);
    }

    /// Gives a fault of a lane another severity; it acts at the next renewal.
    pub fn set_severity(&mut self, lane: usize, fault: usize, severity: f64) {
        self.faults[lane][fault].severity = severity;
        (self.next[lane], self.soonest) = (0, 0);
    }

    /// Severities of a lane and what acts of them now, as a store has them.
    pub fn keep(&mut self, lane: usize, store: &mut Store) {
        for (fault, value) in self.faults[lane].iter_mut().zip(&mut self.values[lane]) {
            fault.severity.keep(store);
            value.label.keep(store);
            value.factor.keep(store);
            value.pulse.keep(store);
        }
        self.next[lane].keep(store);
        self.soonest = self.next.iter().copied().min().unwrap_or(Steps::MAX);
    }

    pub fn count(&self, lane: usize) -> usize {
        self.faults[lane].len()
    }

    /// Renews the lanes whose next change is step `k`.
    pub fn renew(&mut self, k: Steps, dt: f64) {
        for lane in 0..self.faults.len() {
            if self.next[lane] > k {
                continue;
            }
            let mut next = Steps::MAX;
            for (value, fault) in self.values[lane].iter_mut().zip(&self.faults[lane]) {
                let (now, change) = fault.at(k, dt, self.grid);
                *value = now;
                next = next.min(change);
            }
            self.next[lane] = next;
        }
        self.soonest = self.next.iter().copied().min().unwrap_or(Steps::MAX);
    }

    /// Writes the held severities of lanes `first..` into a copy of the healthy parameters. `severity(lane,
    /// fault)` is the severity as a scalar, so that a dual number can carry its derivative; only with such `slopes` a fault of
    /// severity zero has its settings, so that many that do not act may stand side by side.
    pub fn apply<S: Scalar>(&self, first: usize, raw: &mut [S], slopes: bool, severity: &dyn Fn(usize, usize) -> S) {
        let numbers = S::from_fn(|i| i as f64);
        for i in 0..S::LANES {
            let lane = first + i;
            let mine = numbers.equals(S::splat(i as f64));
            for (j, fault) in self.faults[lane].iter().enumerate() {
                let settings = if !slopes && fault.severity == 0.0 { &[][..] } else { &fault.settings };
                for &(index, value) in settings {
                    raw[index] = S::select(mine, S::splat(value), raw[index]);
                }
                let value = self.values[lane][j];
                let s = severity(lane, j) * S::splat(value.factor);
                for write in &fault.writes {
                    let changed = changed(raw[write.index], s, write.op, value);
                    raw[write.index] = S::select(mine, changed, raw[write.index]);
                }
            }
        }
    }
}

/// Parameters with every fault at its whole severity.
pub fn whole(raw: &[f64], faults: &[FaultSpec]) -> Vec<f64> {
    let mut all = raw.to_vec();
    make_whole(&mut all, faults);
    all
}

/// Brings healthy parameters to every fault's whole severity.
pub fn make_whole<'a>(all: &mut [f64], faults: impl IntoIterator<Item = &'a FaultSpec>) {
    for fault in faults {
        for &(index, value) in &fault.settings {
            all[index] = value;
        }
        // What is counted is checked as given: half a thing is refused, not rounded.
        let acting = |op: Op| if op == Op::AddWhole { fault.severity } else { op.acting(fault.severity) };
        let label = fault.writes.first().map_or(fault.severity, |w| acting(w.op));
        let value = ProfileValue { label, factor: 1.0, pulse: fault.severity > 0.0 };
        for write in &fault.writes {
            all[write.index] = changed(all[write.index], fault.severity, write.op, value);
        }
    }
}

fn changed<S: Scalar>(x: S, s: S, op: Op, value: ProfileValue) -> S {
    match op {
        Op::Lose => x * (S::one() - s),
        Op::Grow => x * (S::one() + s),
        Op::Add => x + s,
        Op::AddWhole => x + S::splat(value.label),
        Op::Set if value.label == 0.0 => x,
        Op::Set => S::one(),
        Op::Pulse if value.pulse => S::one(),
        Op::Pulse => x,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(op: Op, severity: f64, profile: Profile, period: f64) -> FaultSpec {
        FaultSpec { severity, profile, writes: vec![Write { index: 0, op }], settings: Vec::new(), period }
    }

    /// Parameter and label at a time.
    fn acting(fault: FaultSpec, healthy: f64, t: f64) -> (f64, f64) {
        let dt = 1e-3;
        let mut lanes = FaultLanes::new(vec![vec![fault.clone()]], 1);
        lanes.renew((t / dt) as Steps, dt);
        let mut raw = [healthy];
        lanes.apply::<f64>(0, &mut raw, false, &|_, _| fault.severity);
        (raw[0], lanes.label(0, 0))
    }

    #[test]
    fn labels_are_what_acts() {
        let ramp = Profile::Ramp { start: 0.0, end: 1.0 };
        for (t, circuits) in [(0.1, 0.0), (0.4, 1.0), (0.7, 2.0), (1.5, 3.0)] {
            assert_eq!(acting(fault(Op::AddWhole, 3.0, ramp.clone(), 0.0), 0.0, t), (circuits, circuits));
        }
        for (t, closed) in [(0.0, 0.0), (0.49, 0.0), (0.501, 1.0), (2.0, 1.0)] {
            assert_eq!(acting(fault(Op::Set, 1.0, ramp.clone(), 0.0), 0.0, t), (closed, closed));
        }
        assert_eq!(acting(fault(Op::Set, 0.3, Profile::Constant, 0.0), 0.0, 1.0), (0.0, 0.0));
        assert_eq!(acting(fault(Op::Lose, 0.5, ramp, 0.0), 1.0, 2.0), (0.5, 0.5));
    }

    #[test]
    fn what_does_not_act_touches_nothing() {
        let touched = |op, severity| fault(op, severity, Profile::Constant, 0.1).touched(1e-3).count();
        for (op, below, from) in [(Op::Set, 0.499, 0.5), (Op::AddWhole, 0.9, 1.0), (Op::Lose, 0.0, 1e-9), (Op::Pulse, 4e-3, 6e-3)] {
            assert_eq!((touched(op, below), touched(op, from)), (0, 1), "{op:?}");
        }
    }

    #[test]
    fn a_pulse_shorter_than_half_a_step_is_none() {
        assert_eq!(acting(fault(Op::Pulse, 4e-3, Profile::Constant, 0.1), 0.0, 0.0), (0.0, 0.0));
        assert_eq!(acting(fault(Op::Pulse, 2e-2, Profile::Constant, 0.1), 0.0, 0.0), (1.0, 2e-2));
        assert_eq!(acting(fault(Op::Pulse, 2e-2, Profile::Constant, 0.1), 0.0, 0.05), (0.0, 2e-2));
    }
}
