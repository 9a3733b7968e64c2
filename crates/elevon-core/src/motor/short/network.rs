//! One step of windings with contacts, as a network of conductances between terminals, neutral and ground.

use super::{Contacts, ShortStructure, Shorts, GROUND, KINDS, LOOP, PAIR, TAPPED};
use crate::inverter::bridge::Circuit;
use crate::scalar::Scalar;
use crate::three;

/// The step's end as a function of the potentials that stand during it:
/// i_j = inject_j + sum_k own_jk v_k - across_j v_n, and for the neutral 0 = feed + sum_k across_k v_k - sum v_n.
#[derive(Clone, Copy, Debug)]
pub struct Network<'a, S> {
    shorts: &'a Shorts<S>,
    structure: ShortStructure,
    /// Contact currents at the step's end and their means over it: a conductance, and the current without a voltage.
    end: [Contacts<S>; 2],
    mean: [Contacts<S>; 2],
    /// Ampere-turns at the end with terminal and neutral at one potential.
    free: [S; 3],
    /// dt / L.
    per: [S; 3],
    ground: S,
    own: [[S; 3]; 3],
    across: [S; 3],
    inject: [S; 3],
    feed: S,
    per_sum: S,
    /// Of the legs at the step's start.
    legs: [S; 3],
    open: [S; 3],
}

/// What a step leaves.
#[derive(Clone, Copy, Debug)]
pub struct Outcome<S> {
    pub turns: [S; 3],
    pub contact: Contacts<S>,
    /// Means over the step.
    through: Contacts<S>,
    pub legs: [S; 3],
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
}

/// A floating leg carries less than this by rounding alone, A.
const NO_CURRENT: f64 = 1e-9;
/// A pivot below this share of its conductance is a potential that nothing determines.
const FLOATING: f64 = 1e-12;

impl<'a, S: Scalar> Network<'a, S> {
    /// `drop` is minus EMF and R m; `factor` is what temperature makes of the copper's resistance.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        shorts: &'a Shorts<S>,
        structure: ShortStructure,
        per: [S; 3],
        turns: [S; 3],
        contact: &Contacts<S>,
        drop: [S; 3],
        factor: S,
        ground: S,
        open: [S; 3],
    ) -> Self {
        let zero = S::zero();
        let legs = shorts.legs(&structure, turns, contact);
        let free = three!(|j| per[j].fma(drop[j], turns[j]));
        let mut net = Self {
            shorts,
            structure,
            end: [[[zero; 3]; KINDS]; 2],
            mean: [[[zero; 3]; KINDS]; 2],
            free,
            per,
            ground,
            own: [[per[0], zero, zero], [zero, per[1], zero], [zero, zero, per[2]]],
            across: per,
            inject: free,
            feed: free[0] + free[1] + free[2],
            per_sum: per[0] + per[1] + per[2],
            legs: three!(|j| S::select(legs[j].abs().lt(S::splat(NO_CURRENT)), zero, legs[j])),
            open,
        };
        for kind in 0..KINDS {
            if structure[kind] {
                for j in 0..3 {
                    net.join(kind, j, contact[kind][j], factor);
                }
            }
        }
        net.per_sum = S::one() / net.per_sum;
        net
    }

    /// Adds a contact that carries `current`. Lambda dc/dt + R c = w over the step by the Pade form (1, 2) of exp(-R dt/Lambda):
    /// third order where the contact is slow, at once in its end state where it is fast.
    #[inline(always)]
    fn join(&mut self, kind: usize, j: usize, current: S, factor: S) {
        let x = self.shorts.contact[kind][j];
        let sixth = S::splat(1.0 / 6.0);
        let (r, l) = (x.slope.fma(factor, x.base), x.leak);
        let per = S::one() / (l * l + S::splat(2.0 / 3.0) * (r * l) + sixth * (r * r));
        let g = x.weight * (sixth.fma(r, l) * per);
        let held = l * S::splat(-1.0 / 3.0).fma(r, l) * per * current;
        self.end[0][kind][j] = g;
        self.end[1][kind][j] = held;
        self.mean[0][kind][j] = x.weight * (sixth.fma(r, S::splat(0.5) * l) * per);
        self.mean[1][kind][j] = l * sixth.fma(r, l) * per * current;
        let mut zero_volt = held;
        let loose = self.loose(kind, j);
        if kind == GROUND {
            zero_volt = zero_volt - g * self.ground;
        }
        let (through, squared) = (x.ratio * g, x.ratio * x.ratio * g);
        self.own[j][j] = self.own[j][j] + squared;
        self.inject[j] = self.inject[j] + x.ratio * zero_volt;
        if kind == PAIR {
            let k = (j + 1) % 3;
            self.own[k][k] = self.own[k][k] + squared;
            self.own[j][k] = self.own[j][k] - squared;
            self.own[k][j] = self.own[k][j] - squared;
            self.inject[k] = self.inject[k] - x.ratio * zero_volt;
        } else {
            self.across[j] = self.across[j] + through * loose;
            self.feed = self.feed + loose * zero_volt;
            self.per_sum = self.per_sum + loose * loose * g;
        }
    }

    /// Neutral of legs that all hold their terminals.
    #[inline(always)]
    pub fn neutral(&self, v: [S; 3]) -> S {
        let y = self.across;
        self.per_sum * (self.feed + y[0] * v[0] + y[1] * v[1] + y[2] * v[2])
    }

    /// How much of a contact's current is missing at the neutral.
    #[inline(always)]
    fn loose(&self, kind: usize, j: usize) -> S {
        let ratio = self.shorts.contact[kind][j].ratio;
        match kind {
            PAIR => S::zero(),
            GROUND => ratio - S::one(),
            _ => ratio,
        }
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

    /// The step's end under terminal potentials `v` and neutral.
    #[inline(always)]
    pub fn outcome(&self, v: [S; 3], neutral: S) -> Outcome<S> {
        let phase: [S; 3] = three!(|j| v[j] - neutral);
        let turns = three!(|j| self.per[j].fma(phase[j], self.free[j]));
        let (mut contact, mut through) = (self.end[1], self.mean[1]);
        for kind in 0..KINDS {
            if self.structure[kind] {
                for j in 0..3 {
                    let w = self.drive(kind, j, phase, neutral);
                    contact[kind][j] = self.end[0][kind][j].fma(w, contact[kind][j]);
                    through[kind][j] = self.mean[0][kind][j].fma(w, through[kind][j]);
                }
            }
        }
        Outcome { turns, contact, through, legs: self.shorts.legs(&self.structure, turns, &contact) }
    }

    /// Energies of the step: of contacts with their means over it, of windings with the middle of their ends. Only what
    /// the contacts impose on the windings' sum follows the means, so that the flows close at the neutral; what that
    /// takes from the windings' inductances, of second order in the step, is heat of the contacts.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn account(
        &self,
        old: [S; 3],
        before: &Contacts<S>,
        new: &Outcome<S>,
        v: [S; 3],
        neutral: S,
        resistance: [S; 3],
        factor: S,
    ) -> Account<S> {
        let half = S::splat(0.5);
        let dt = self.shorts.dt;
        let phase: [S; 3] = three!(|j| v[j] - neutral);
        let change = (new.turns[0] - old[0]) + (new.turns[1] - old[1]) + (new.turns[2] - old[2]);
        let per = S::one() / (self.per[0] + self.per[1] + self.per[2]);
        let mut out = Account { legs: old, ground: S::zero(), copper: S::zero(), loops: S::zero(), contact: S::zero(), tap: S::zero() };
        let mut excess = S::zero();
        for kind in 0..KINDS {
            if self.structure[kind] {
                for j in 0..3 {
                    let (c, was, mean) = (new.contact[kind][j], before[kind][j], new.through[kind][j]);
                    let x = self.shorts.contact[kind][j];
                    let imposed = self.loose(kind, j) * (half * (was + c) - mean);
                    excess = excess + imposed;
                    let given = dt * (self.drive(kind, j, phase, neutral) * mean + imposed * per * change);
                    let heat = given - half * x.inductance * (c * c - was * was);
                    let contact = heat * (x.base / (x.base + x.slope * factor));
                    if kind == TAPPED {
                        out.tap = out.tap + heat;
                    } else {
                        out.contact = out.contact + contact;
                        out.copper = out.copper + (heat - contact);
                    }
                    if kind == GROUND {
                        out.ground = out.ground + mean;
                    }
                }
            }
        }
        let middle: [S; 3] = three!(|j| half * (old[j] + new.turns[j]) + self.per[j] * (per * excess));
        out.legs = self.shorts.legs(&self.structure, middle, &new.through);
        let copper = three!(|j| dt * resistance[j] * middle[j] * middle[j]);
        out.copper = out.copper + (copper[0] + copper[1] + copper[2]);
        if self.structure[LOOP] {
            let inside = self.shorts.loops(&self.structure, middle, &new.through);
            for j in 0..3 {
                let turns = self.shorts.contact[LOOP][j].ratio;
                out.loops = out.loops + dt * turns * resistance[j] * inside[j] * inside[j];
            }
        }
        out
    }
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
        let y = self.across;
        let held: [S; 3] = three!(|j| S::indicator(connected[j]));
        let r: [S; 3] = three!(|j| S::select(connected[j], resistance[j], one));
        let mut z = three!(|j| three!(|k| r[j] * (self.own[j][k] - y[j] * y[k] * self.per_sum)));
        let mut b: [S; 3] = three!(|j| held[j] * voltage[j] - r[j] * (self.inject[j] - y[j] * self.feed * self.per_sum));
        let mut lost = S::mask(false);
        let mut v = voltage;
        let mut per = [zero; 3];
        for j in 0..3 {
            z[j][j] = z[j][j] + held[j];
            let fixed = (S::splat(FLOATING) * self.own[j][j]).lt(z[j][j]);
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
