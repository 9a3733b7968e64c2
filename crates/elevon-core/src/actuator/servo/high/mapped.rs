//! The electrical part of a step of a salient or saturating motor (`motor::flux_map`).
//!
//! The linkages' slopes and the EMF are those of the currents at the middle of the step, which a first pass expects.

use super::electric::{book, connect, Coupling, Fed};
use super::model::{Model, State};
use crate::actuator::servo::details::Structure;
use crate::inverter::bridge::{extinguish, Circuit};
use crate::motor::flux_map::MappedPhases;
use crate::scalar::Scalar;
use crate::three;

/// The windings at the bridge.
struct MappedWindings<'a, S> {
    phases: &'a MappedPhases<S>,
    current: [S; 3],
    /// EMFs and drops of the resistance.
    held: [S; 3],
    open: [S; 3],
}

impl<S: Scalar> Circuit<S> for MappedWindings<'_, S> {
    #[inline(always)]
    fn currents(&self) -> [S; 3] {
        self.current
    }

    #[inline(always)]
    fn open(&self) -> [S; 3] {
        self.open
    }

    /// A terminal that floats has the potential at which its current does not change.
    #[inline(always)]
    fn potentials(&self, voltage: [S; 3], connected: [S::Mask; 3]) -> ([S; 3], S) {
        let (zero, one, held) = (S::zero(), S::one(), &self.held);
        let joined: [S; 3] = three!(|j| S::select(connected[j], one, zero));
        let count = joined[0] + joined[1] + joined[2];
        let pushing: [S; 3] = three!(|j| joined[j] * (voltage[j] - held[j]));
        // One leg alone carries nothing: every phase has its EMF over the neutral; without any the EMFs float amid the rails.
        let highest = held[0].maximum(held[1]).maximum(held[2]);
        let lowest = held[0].minimum(held[1]).minimum(held[2]);
        let alone = S::select(count.equals(zero), S::splat(-0.5) * (highest + lowest), pushing[0] + pushing[1] + pushing[2]);
        let two = S::splat(1.5).lt(count);
        let terminal = three!(|j| {
            let others =
                self.phases.reach(j, (j + 1) % 3) * pushing[(j + 1) % 3] + self.phases.reach(j, (j + 2) % 3) * pushing[(j + 2) % 3];
            let level = S::select(two, -(others / self.phases.reach(j, j)), alone);
            S::select(connected[j], voltage[j], held[j] + level)
        });
        (terminal, neutral(terminal, *held))
    }
}

/// Potential of the neutral: neither linkages nor currents have a part that all phases share.
#[inline(always)]
fn neutral<S: Scalar>(terminal: [S; 3], held: [S; 3]) -> S {
    S::splat(1.0 / 3.0) * ((terminal[0] - held[0]) + (terminal[1] - held[1]) + (terminal[2] - held[2]))
}

/// Phase currents after the step and phase-to-neutral voltages.
#[inline(always)]
pub(crate) fn mapped_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    c: &Coupling<S>,
    fed: &Fed<'_, S>,
) -> ([S; 3], [S; 3]) {
    let (speed, half) = (s.shaft.motor_speed, S::splat(0.5));
    let old = three!(|j| s.star.current[j]);
    let map = &m.extra.map;
    let held =
        |phases: &MappedPhases<S>, i: [S; 3]| -> [S; 3] { three!(|j| fed.resistance[j].fma(i[j], (c.k[j] + phases.emf[j]) * speed)) };
    let phases = map.phases(c.turn, old);
    let before = held(&phases, old);
    let mut terminal: [S; 3] = three!(|j| s.legs[j] * fed.half_supply);
    let mut rail = terminal;
    let mut legs = None;
    if structure.bridge {
        let windings = MappedWindings { phases: &phases, current: old, held: before, open: m.star.open };
        let connection = connect(m, structure, &mut s.bridge, s.legs, fed.gates, fed.half_supply, &windings);
        (terminal, rail) = (connection.legs.voltage, connection.legs.rail);
        if connection.loose.is_some() {
            terminal = windings.potentials(terminal, connection.legs.connected).0;
            legs = Some(connection.legs);
        }
    }
    let first = phases.rise(three!(|j| terminal[j] - before[j]));
    let middle: [S; 3] = three!(|j| (half * m.dt).fma(first[j], old[j]));
    let phases = map.phases(c.turn, middle);
    let amid = held(&phases, middle);
    let rise = phases.rise(three!(|j| terminal[j] - amid[j]));
    let mut current: [S; 3] = three!(|j| m.dt.fma(rise[j], old[j]));
    if let Some(legs) = &legs {
        current = extinguish(legs, old, current);
    }
    let level = neutral(terminal, amid);
    let voltage = three!(|j| terminal[j] - level);
    s.voltage = voltage;
    book::<S, true>(m, structure, s, [old, current], [rail, terminal], fed.resistance);
    (current, voltage)
}
