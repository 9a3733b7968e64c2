//! What of the network of windings with contacts changes with parameters and temperature alone.

use super::{Contacts, Shorts, GROUND, KINDS, PAIR};
use crate::kept;
use crate::scalar::Scalar;
use crate::three;

/// What a step makes of the network whatever its currents are: it changes with parameters and temperature alone, so it is
/// made where they change and the step only multiplies.
///
/// The step's end as a function of the potentials that stand during it: i_j = inject_j + sum_k own_jk v_k - across_j v_n,
/// and for the neutral 0 = feed + sum_k across_k v_k - v_n / per_sum.
#[derive(Clone, Copy, Debug)]
pub struct Discrete<S> {
    /// Contact currents at the step's end and their means over it: a conductance, and what stays of the current.
    pub(super) end: [Contacts<S>; 2],
    pub(super) mean: [Contacts<S>; 2],
    /// dt / L.
    pub(super) per: [S; 3],
    pub(super) admittance: [[S; 3]; 3],
    pub(super) across: [S; 3],
    pub(super) per_sum: S,
    /// What the legs draw of a current fed to the neutral.
    pub(super) share: [S; 3],
    /// Resistance of the switches, and terminal potentials per potential behind it with all legs held.
    pub(super) resistance: S,
    pub(super) held: [[S; 3]; 3],
}

kept!(Discrete<f64> as Discrete { end, mean, per, admittance, across, per_sum, share, resistance, held });

impl<S: Scalar> Discrete<S> {
    /// Over a step with `per` = dt / L of the phases; `factor` is what temperature makes of the copper's resistance,
    /// `resistance` that of the switches.
    pub fn new(shorts: &Shorts<S>, per: [S; 3], factor: S, resistance: S) -> Self {
        let zero = S::zero();
        let nothing = [[[zero; 3]; KINDS]; 2];
        let diagonal = |x: [S; 3]| [[x[0], zero, zero], [zero, x[1], zero], [zero, zero, x[2]]];
        let mut new = Self {
            end: nothing,
            mean: nothing,
            per,
            admittance: diagonal(per),
            across: per,
            per_sum: per[0] + per[1] + per[2],
            share: per,
            resistance,
            held: diagonal([S::one(); 3]),
        };
        for kind in 0..KINDS {
            for j in 0..3 {
                new.join(shorts, kind, j, factor);
            }
        }
        new.per_sum = S::one() / new.per_sum;
        let y = new.across;
        new.share = three!(|j| y[j] * new.per_sum);
        let drawn = |j: usize, k: usize| resistance * (new.admittance[j][k] - y[j] * new.share[k]);
        new.held = inverse(three!(|j| three!(|k| new.held[j][k] + drawn(j, k))));
        new
    }

    /// Adds a contact. Lambda dc/dt + R c = w over the step by the Pade form (1, 2) of exp(-R dt/Lambda): third order where
    /// the contact is slow, at once in its end state where it is fast.
    fn join(&mut self, shorts: &Shorts<S>, kind: usize, j: usize, factor: S) {
        let x = shorts.contact[kind][j];
        let sixth = S::splat(1.0 / 6.0);
        let (r, l) = (x.slope.fma(factor, x.base), x.leak);
        let per = S::one() / (l * l + S::splat(2.0 / 3.0) * (r * l) + sixth * (r * r));
        let g = x.weight * (sixth.fma(r, l) * per);
        self.end[0][kind][j] = g;
        self.end[1][kind][j] = l * S::splat(-1.0 / 3.0).fma(r, l) * per;
        self.mean[0][kind][j] = x.weight * (sixth.fma(r, S::splat(0.5) * l) * per);
        self.mean[1][kind][j] = l * sixth.fma(r, l) * per;
        let squared = x.ratio * x.ratio * g;
        self.admittance[j][j] = self.admittance[j][j] + squared;
        if kind == PAIR {
            let k = (j + 1) % 3;
            self.admittance[k][k] = self.admittance[k][k] + squared;
            self.admittance[j][k] = self.admittance[j][k] - squared;
            self.admittance[k][j] = self.admittance[k][j] - squared;
        } else {
            let loose = loose(x.ratio, kind);
            self.across[j] = self.across[j] + x.ratio * g * loose;
            self.per_sum = self.per_sum + loose * loose * g;
        }
    }
}

/// How much of a contact's current is missing at the neutral.
#[inline(always)]
pub(super) fn loose<S: Scalar>(ratio: S, kind: usize) -> S {
    match kind {
        PAIR => S::zero(),
        GROUND => ratio - S::one(),
        _ => ratio,
    }
}

/// By its minors.
fn inverse<S: Scalar>(z: [[S; 3]; 3]) -> [[S; 3]; 3] {
    let minor = |j: usize, k: usize| {
        let (a, b, c, d) = ((j + 1) % 3, (j + 2) % 3, (k + 1) % 3, (k + 2) % 3);
        z[a][c] * z[b][d] - z[a][d] * z[b][c]
    };
    let determinant = z[0][0] * minor(0, 0) + z[0][1] * minor(0, 1) + z[0][2] * minor(0, 2);
    three!(|j| three!(|k| minor(k, j) / determinant))
}
