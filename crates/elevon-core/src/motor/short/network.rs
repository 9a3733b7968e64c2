//! One step of windings with contacts, as a network of conductances between terminals, neutral and ground.

use super::discrete::{loose, Discrete};
use super::{Contacts, ShortStructure, Shorts, GROUND, KINDS, LOOP, PAIR, TAPPED};
use crate::inverter::bridge::Circuit;
use crate::scalar::Scalar;
use crate::three;

/// The network of one step.
#[derive(Clone, Copy, Debug)]
pub struct Network<'a, S> {
    shorts: &'a Shorts<S>,
    discrete: &'a Discrete<S>,
    structure: ShortStructure,
    /// Ampere-turns at the end with terminal and neutral at one potential.
    free: [S; 3],
    ground: S,
    inject: [S; 3],
    feed: S,
    /// Of the legs at the step's start.
    legs: [S; 3],
    open: [S; 3],
}

/// Mean currents and heats of a step.
#[derive(Clone, Copy, Debug)]
pub struct Account<S> {
    /// Of the legs; their sum is what ground takes.
    pub legs: [S; 3],
    pub ground: S,
    /// J: all copper, the part of it in shorted turns, contacts in the winding, resistors at the centre tap.
    pub copper: S,
    pub loops: S,
    pub contact: S,
    pub tap: S,
    /// Copper of each phase.
    pub phases: [S; 3],
}

/// A floating leg carries less than this by rounding alone, A.
const NO_CURRENT: f64 = 1e-9;
/// A pivot below this share of its conductance is a potential that nothing determines.
const FLOATING: f64 = 1e-12;

impl<'a, S: Scalar> Network<'a, S> {
    /// `drop` is minus EMF and R m.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        shorts: &'a Shorts<S>,
        discrete: &'a Discrete<S>,
        structure: ShortStructure,
        turns: [S; 3],
        contact: &Contacts<S>,
        drop: [S; 3],
        ground: S,
        open: [S; 3],
    ) -> Self {
        let zero = S::zero();
        let legs = shorts.legs(&structure, turns, contact);
        let free = three!(|j| discrete.per[j].fma(drop[j], turns[j]));
        let mut net = Self {
            shorts,
            discrete,
            structure,
            free,
            ground,
            inject: free,
            feed: free[0] + free[1] + free[2],
            legs: three!(|j| S::select(legs[j].abs().lt(S::splat(NO_CURRENT)), zero, legs[j])),
            open,
        };
        for kind in 0..KINDS {
            if structure[kind] {
                for j in 0..3 {
                    net.inject(kind, j, contact[kind][j]);
                }
            }
        }
        net
    }

    /// Adds what a contact carries without a voltage.
    #[inline(always)]
    fn inject(&mut self, kind: usize, j: usize, before: S) {
        let ratio = self.shorts.contact[kind][j].ratio;
        let mut current = self.discrete.end[1][kind][j] * before;
        if kind == GROUND {
            current = current - self.discrete.end[0][kind][j] * self.ground;
        }
        self.inject[j] = ratio.fma(current, self.inject[j]);
        if kind == PAIR {
            let k = (j + 1) % 3;
            self.inject[k] = (-ratio).fma(current, self.inject[k]);
        } else {
            self.feed = loose(ratio, kind).fma(current, self.feed);
        }
    }

    /// Neutral between terminals of known potential.
    #[inline(always)]
    pub fn neutral(&self, v: [S; 3]) -> S {
        let y = self.discrete.share;
        self.discrete.per_sum.fma(self.feed, y[0].fma(v[0], y[1].fma(v[1], y[2] * v[2])))
    }

    /// Potentials of terminals whose legs are all held, behind the switches' resistance, and of the neutral.
    #[inline(always)]
    pub fn behind(&self, source: [S; 3]) -> ([S; 3], S) {
        let Discrete { held, share, resistance, .. } = self.discrete;
        let e: [S; 3] = three!(|j| (-*resistance).fma((-share[j]).fma(self.feed, self.inject[j]), source[j]));
        let v = three!(|j| held[j][0].fma(e[0], held[j][1].fma(e[1], held[j][2] * e[2])));
        (v, self.neutral(v))
    }

    /// Currents of the legs at the step's end.
    #[inline(always)]
    pub fn ends(&self, v: [S; 3], neutral: S) -> [S; 3] {
        let Discrete { admittance, across, .. } = self.discrete;
        three!(|j| self.inject[j] + (admittance[j][0] * v[0] + admittance[j][1] * v[1] + admittance[j][2] * v[2]) - across[j] * neutral)
    }

    /// Voltage that drives a contact.
    #[inline(always)]
    fn drive(&self, kind: usize, j: usize, phase: [S; 3], neutral: S) -> S {
        let ratio = self.shorts.contact[kind][j].ratio;
        match kind {
            PAIR => ratio * (phase[j] - phase[(j + 1) % 3]),
            GROUND => ratio * phase[j] + (neutral - self.ground),
            _ => ratio * phase[j],
        }
    }

    /// Ampere-turns at the step's end under terminal potentials `v` and neutral.
    #[inline(always)]
    pub fn turns(&self, v: [S; 3], neutral: S) -> [S; 3] {
        three!(|j| self.discrete.per[j].fma(v[j] - neutral, self.free[j]))
    }

    /// The contacts' currents from the step's start to its end. In place: copies of the whole would wait for their parts.
    #[inline(always)]
    pub fn renew(&self, v: [S; 3], neutral: S, contact: &mut Contacts<S>) {
        self.move_on(&self.discrete.end, v, neutral, contact);
    }

    /// From the start to what holds `[conductance, share that stays]`: the step's end, or its means.
    #[inline(always)]
    fn move_on(&self, [conductance, stays]: &[Contacts<S>; 2], v: [S; 3], neutral: S, contact: &mut Contacts<S>) {
        let phase: [S; 3] = three!(|j| v[j] - neutral);
        for kind in 0..KINDS {
            if self.structure[kind] {
                for j in 0..3 {
                    let stays = stays[kind][j] * contact[kind][j];
                    contact[kind][j] = conductance[kind][j].fma(self.drive(kind, j, phase, neutral), stays);
                }
            }
        }
    }

    /// Energies of the step: of contacts with their means over it, of windings with the middle of their ends. Only what
    /// the contacts impose on the windings' sum follows the means, so that the flows close at the neutral; what that
    /// takes from the windings' inductances, of second order in the step, is heat of the contacts.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn account(
        &self,
        [old, new]: [[S; 3]; 2],
        [before, after]: [&Contacts<S>; 2],
        v: [S; 3],
        neutral: S,
        resistance: [S; 3],
        factor: S,
    ) -> Account<S> {
        let half = S::splat(0.5);
        let mut through = *before;
        self.move_on(&self.discrete.mean, v, neutral, &mut through);
        let conducts = self.discrete.per;
        let change = (new[0] - old[0]) + (new[1] - old[1]) + (new[2] - old[2]);
        let per = S::one() / (conducts[0] + conducts[1] + conducts[2]);
        let step = Step { phase: three!(|j| v[j] - neutral), neutral, factor, change, per };
        let mut out = Account {
            legs: old,
            ground: S::zero(),
            copper: S::zero(),
            loops: S::zero(),
            contact: S::zero(),
            tap: S::zero(),
            phases: [S::zero(); 3],
        };
        let mut excess = S::zero();
        for kind in 0..KINDS {
            if self.structure[kind] {
                for j in 0..3 {
                    excess = excess + self.heat(kind, j, [before[kind][j], after[kind][j], through[kind][j]], &step, &mut out);
                }
            }
        }
        let middle: [S; 3] = three!(|j| half * (old[j] + new[j]) + conducts[j] * (per * excess));
        out.legs = self.shorts.legs(&self.structure, middle, &through);
        let dt = self.shorts.dt;
        let copper = three!(|j| dt * resistance[j] * middle[j] * middle[j]);
        out.copper = out.copper + (copper[0] + copper[1] + copper[2]);
        out.phases = three!(|j| out.phases[j] + copper[j]);
        if self.structure[LOOP] {
            let inside = self.shorts.loops(&self.structure, middle, &through);
            for j in 0..3 {
                let turns = self.shorts.contact[LOOP][j].ratio;
                out.loops = out.loops + dt * turns * resistance[j] * inside[j] * inside[j];
            }
        }
        out
    }

    /// Heat of one contact whose current goes from `was` to `is` with this mean; the current that it imposes on the
    /// windings' sum.
    #[inline(always)]
    fn heat(&self, kind: usize, j: usize, [was, is, mean]: [S; 3], step: &Step<S>, out: &mut Account<S>) -> S {
        let (half, dt) = (S::splat(0.5), self.shorts.dt);
        let x = self.shorts.contact[kind][j];
        let imposed = loose(x.ratio, kind) * (half * (was + is) - mean);
        let given = dt * (self.drive(kind, j, step.phase, step.neutral) * mean + imposed * step.per * step.change);
        let heat = given - half * x.inductance * (is * is - was * was);
        let contact = heat * (x.base / (x.base + x.slope * step.factor));
        if kind == TAPPED {
            out.tap = out.tap + heat;
        } else {
            out.contact = out.contact + contact;
            out.copper = out.copper + (heat - contact);
            out.phases[j] = out.phases[j] + (heat - contact);
        }
        if kind == GROUND {
            out.ground = out.ground + mean;
        }
        imposed
    }
}

/// What a step's heat follows from.
struct Step<S> {
    /// Over the neutral.
    phase: [S; 3],
    neutral: S,
    /// Of the copper's resistance.
    factor: S,
    /// Of the windings' sum of currents, and what a unit of imposed current takes from each.
    change: S,
    per: S,
}

impl<S: Scalar> Circuit<S> for Network<'_, S> {
    #[inline(always)]
    fn currents(&self) -> [S; 3] {
        self.legs
    }

    #[inline(always)]
    fn open(&self) -> [S; 3] {
        self.open
    }

    #[inline(always)]
    fn potentials(&self, voltage: [S; 3], connected: [S::Mask; 3]) -> ([S; 3], S) {
        self.solve(voltage, [S::zero(); 3], connected)
    }
}

impl<S: Scalar> Network<'_, S> {
    /// Potentials of the terminals and of the neutral behind legs of voltage and resistance, or without current in loose
    /// ones: a v + r i = a e with a = 1, or a = 0 and r = 1. The neutral is eliminated first, then terminal by terminal.
    #[inline(always)]
    pub fn solve(&self, voltage: [S; 3], resistance: [S; 3], connected: [S::Mask; 3]) -> ([S; 3], S) {
        let (zero, one) = (S::zero(), S::one());
        let Discrete { admittance, across: y, per_sum, share, .. } = self.discrete;
        let held: [S; 3] = three!(|j| S::indicator(connected[j]));
        let r: [S; 3] = three!(|j| S::select(connected[j], resistance[j], one));
        let mut z = three!(|j| three!(|k| r[j] * (admittance[j][k] - y[j] * y[k] * *per_sum)));
        let mut b: [S; 3] = three!(|j| held[j] * voltage[j] - r[j] * (self.inject[j] - share[j] * self.feed));
        let mut lost = S::mask(false);
        let mut v = voltage;
        let mut per = [zero; 3];
        for j in 0..3 {
            z[j][j] = z[j][j] + held[j];
            let fixed = (S::splat(FLOATING) * admittance[j][j]).lt(z[j][j]);
            lost = lost | !fixed;
            per[j] = S::select(fixed, one / S::select(fixed, z[j][j], one), zero);
            for l in j + 1..3 {
                let factor = z[l][j] * per[j];
                b[l] = b[l] - factor * b[j];
                z[l] = three!(|k| z[l][k] - factor * z[j][k]);
            }
        }
        for j in [2, 1, 0] {
            let behind = (j + 1..3).fold(zero, |sum, k| sum + z[j][k] * v[k]);
            v[j] = (b[j] - behind) * per[j];
        }
        // Nothing ties the windings to the link: they float symmetrically between the rails.
        let highest = v[0].maximum(v[1]).maximum(v[2]);
        let lowest = v[0].minimum(v[1]).minimum(v[2]);
        let middle = S::select(lost, S::splat(0.5) * (highest + lowest), zero);
        v = three!(|j| v[j] - middle);
        (v, self.neutral(v))
    }
}
