//! Contacts of a star's windings: shorted turns, resistors to the centre tap, phase to phase, turn to ground.
//!
//! A contact divides a phase into a part mu next to the neutral and the rest N = 1 - mu. With the current i at the
//! terminal, f in the part and c = i - f in the contact, the flux linkages of the two parts are (N L - M) i + M f and
//! M i + (mu L - M) f, M = kappa N mu L: with f = i every turn of the winding links the same flux, whatever kappa, so
//! that the contact without current is the healthy phase exactly. Written with the ampere-turns m = N i + mu f
//! = i - mu c the four equations come apart:
//!
//! ```text
//! v - v_n = R m + L dm/dt + k omega                       the healthy winding; torque k m
//! u - v_n = mu (v - v_n) - mu N R c - (1 - kappa) mu N L dc/dt    the open tap and what is in series with it
//! ```
//!
//! Each contact is then one resistive-inductive branch between taps, neutral and ground. Its current is the fast state
//! (an ohm and a microhenry, or 1e12 ohm and nothing): it moves implicitly, together with the neutral, which alone
//! couples the branches. So any resistance runs at any step: without limit it is the healthy motor, at zero the dead short.
//! Contacts that share a phase see each other through the terminals only.

mod discrete;
mod network;
mod parameters;
#[cfg(test)]
mod tests;

pub use discrete::Discrete;
pub use network::{Account, Network};
pub use parameters::{ShortParameter, TapParameter, SHORT, TAP};

use super::star::{MotorParameter, ShortModel, Star};
use crate::scalar::Scalar;
use crate::three;
use crate::variable::View;

/// Kinds of contact: shorted turns of a phase, resistor from a terminal to the centre tap, between phases j and j + 1,
/// from a phase to ground.
pub const LOOP: usize = 0;
pub const TAPPED: usize = 1;
pub const PAIR: usize = 2;
pub const GROUND: usize = 3;
pub(super) const KINDS: usize = 4;

/// Currents of all contacts, by kind and phase.
pub type Contacts<S> = [[S; 3]; KINDS];

/// Which kinds of contact a run can meet; equal over a lane block.
pub type ShortStructure = [bool; KINDS];

/// Which kinds of contact a run meets. Turns are shorted in loops, or only missing.
pub fn kinds(motor: &View<MotorParameter>, tap: &View<TapParameter>, short: &View<ShortParameter>) -> ShortStructure {
    use MotorParameter as M;
    use ShortParameter as P;
    let loops = ShortModel::read(motor.value(M::ShortModel)) == ShortModel::Loop;
    [
        loops && motor.any_away([M::TurnsA, M::TurnsB, M::TurnsC]),
        tap.any_away([TapParameter::TapLevelA, TapParameter::TapLevelB, TapParameter::TapLevelC]),
        short.any_away([P::PhaseShortAb, P::PhaseShortBc, P::PhaseShortCa]),
        short.any_away([P::GroundShortA, P::GroundShortB, P::GroundShortC]),
    ]
}

/// One contact of resistance (base + slope t) / weight, t the copper's factor: a conductance may be nothing, a resistance, too.
#[derive(Clone, Copy, Debug)]
struct Contact<S> {
    /// Fraction mu of the turns between the neutral and the contact.
    ratio: S,
    weight: S,
    base: S,
    slope: S,
    /// weight Lambda / dt.
    leak: S,
    /// Leakage inductance Lambda in series with the contact.
    inductance: S,
}

/// Where a contact sits and what is in series with it.
#[derive(Clone, Copy)]
struct Seat<S> {
    ratio: S,
    copper: S,
    inductance: S,
}

impl<S: Scalar> Seat<S> {
    /// A contact of conductance `g`.
    fn conducting(self, g: S, dt: S) -> Contact<S> {
        let Seat { ratio, copper, inductance } = self;
        Contact { ratio, weight: g, base: S::one(), slope: g * copper, leak: g * inductance / dt, inductance }
    }

    /// A contact of resistance `r` across the turns; no turns, no contact.
    fn resisting(self, r: S, dt: S) -> Contact<S> {
        let Seat { ratio, copper, inductance } = self;
        let present = S::zero().lt(ratio);
        let (one, zero) = (S::one(), S::zero());
        Contact {
            ratio,
            weight: S::select(present, one, zero),
            base: S::select(present, r, one),
            slope: copper,
            leak: inductance / dt,
            inductance,
        }
    }
}

/// Constants of all contacts of a star.
#[derive(Clone, Copy, Debug)]
pub struct Shorts<S> {
    contact: [[Contact<S>; 3]; KINDS],
    dt: S,
    /// Ground against the middle of the link, in half links.
    ground: S,
}

impl<S: Scalar> Shorts<S> {
    /// `loops`: lost turns are shorted ones with a current of their own, and the star's windings are whole.
    pub fn derive(motor: &[S], tap: &[S], short: &[S], star: &Star<S>, loops: bool, dt: S) -> Self {
        use MotorParameter as M;
        use ShortParameter as P;
        let (one, zero) = (S::one(), S::zero());
        let resistance = star.resistance;
        let inductance: [S; 3] = three!(|j| one / star.per_inductance[j]);
        let (in_loop, in_contact) = (one - motor[M::ShortCoupling as usize], one - short[P::ContactCoupling as usize]);
        let seat = |ratio: S, leaking: S, r: S, l: S| {
            let parts = ratio * (one - ratio);
            Seat { ratio, copper: parts * r, inductance: parts * leaking * l }
        };
        let shorted: [S; 3] = three!(|j| if loops { one - motor[M::TurnsA as usize + j] } else { zero });
        let reference = tap[TapParameter::TapReference as usize];
        let (at_pair, at_ground) = (short[P::PhaseShortTurns as usize], short[P::GroundShortTurns as usize]);
        let contact_resistance = motor[M::ShortContactResistance as usize];
        Self {
            contact: [
                three!(|j| seat(shorted[j], in_loop, resistance[j], inductance[j]).resisting(contact_resistance, dt)),
                three!(|j| {
                    let level = tap[TapParameter::TapLevelA as usize + j];
                    Seat { ratio: one, copper: zero, inductance: zero }.conducting(level / (reference * (one - level)), dt)
                }),
                three!(|j| {
                    let k = (j + 1) % 3;
                    seat(at_pair, in_contact, resistance[j] + resistance[k], inductance[j] + inductance[k])
                        .conducting(short[P::PhaseShortAb as usize + j], dt)
                }),
                three!(|j| seat(at_ground, in_contact, resistance[j], inductance[j]).conducting(short[P::GroundShortA as usize + j], dt)),
            ],
            dt,
            ground: short[P::GroundPotential as usize] + short[P::GroundPotential as usize] - one,
        }
    }

    /// The same over a share of a step.
    #[inline(always)]
    pub fn over(&self, share: S) -> Self {
        let per = S::one() / share;
        let mut all = *self;
        for contact in all.contact.iter_mut().flatten() {
            contact.leak = contact.leak * per;
        }
        all.dt = share * self.dt;
        all
    }

    /// Currents at the terminals of windings with the ampere-turns `m` and contacts of the given kinds.
    #[inline(always)]
    fn terminals(&self, structure: &ShortStructure, kinds: &[usize], m: [S; 3], c: &Contacts<S>) -> [S; 3] {
        let mut current = m;
        for &kind in kinds {
            if !structure[kind] {
                continue;
            }
            for j in 0..3 {
                let through = self.contact[kind][j].ratio * c[kind][j];
                current[j] = current[j] + through;
                if kind == PAIR {
                    current[(j + 1) % 3] = current[(j + 1) % 3] - through;
                }
            }
        }
        current
    }

    /// Currents of the motor's phases at its terminals.
    #[inline(always)]
    pub fn phases(&self, structure: &ShortStructure, m: [S; 3], c: &Contacts<S>) -> [S; 3] {
        self.terminals(structure, &[LOOP, PAIR, GROUND], m, c)
    }

    /// Currents of the bridge's legs: those of the phases and of resistors at the centre tap.
    #[inline(always)]
    pub fn legs(&self, structure: &ShortStructure, m: [S; 3], c: &Contacts<S>) -> [S; 3] {
        self.terminals(structure, &[LOOP, TAPPED, PAIR, GROUND], m, c)
    }

    /// Currents in the shorted turns; none where no turns are shorted.
    #[inline(always)]
    pub fn loops(&self, structure: &ShortStructure, m: [S; 3], c: &Contacts<S>) -> [S; 3] {
        let current = self.phases(structure, m, c);
        three!(|j| {
            let present = S::zero().lt(self.contact[LOOP][j].ratio);
            S::select(present, current[j] - c[LOOP][j], S::zero())
        })
    }

    /// Share of each phase's turns that is shorted in a loop of its own.
    #[inline(always)]
    pub fn looped(&self) -> [S; 3] {
        three!(|j| self.contact[LOOP][j].ratio)
    }

    /// Energy in the leakage between the parts of the windings, J.
    #[inline(always)]
    pub fn magnetic(&self, structure: &ShortStructure, c: &Contacts<S>) -> S {
        let mut sum = S::zero();
        for kind in [LOOP, PAIR, GROUND] {
            if structure[kind] {
                for j in 0..3 {
                    sum = sum + S::splat(0.5) * self.contact[kind][j].inductance * c[kind][j] * c[kind][j];
                }
            }
        }
        sum
    }

    /// Potential of ground against the middle of a link of two times `half_supply`.
    #[inline(always)]
    pub fn ground(&self, half_supply: S) -> S {
        self.ground * half_supply
    }
}
