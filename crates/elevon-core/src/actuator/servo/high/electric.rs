//! Windings and bridge of a step.

use super::mapped::mapped_step;
use super::model::*;
use super::shorted::shorted_step;
use crate::actuator::servo::details::Structure;
use crate::inverter::bridge::{extinguish, BridgeState, Circuit, Connection, Pulses, Windings};
use crate::scalar::{Kernel, Scalar};
use crate::three;

/// Electromagnetic coefficients of the present rotor angle.
#[derive(Clone, Copy)]
pub(crate) struct Coupling<S> {
    /// k_j of the phases.
    pub k: [S; 3],
    /// Sine and cosine of the electrical angle.
    pub turn: [S; 2],
}

#[inline(always)]
pub(crate) fn coupling<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &State<S>, sin: S, cos: S) -> Coupling<S> {
    coupling_at::<S, FULL>(m, structure, s, s.shaft.motor_position, [sin, cos])
}

/// At a motor position other than the state's.
#[inline(always)]
pub(crate) fn coupling_at<S: Scalar, const FULL: bool>(
    m: &Model<S>,
    structure: &Structure,
    s: &State<S>,
    position: S,
    [sin, cos]: [S; 2],
) -> Coupling<S> {
    let flux = structure.thermal.then_some(s.star.flux_factor);
    let k = m.star.coefficients::<FULL>(&structure.motor, Some(&m.extra.pole), position, [sin, cos], flux);
    Coupling { k: m.star.under_load(k, s.star.current), turn: [sin, cos] }
}

#[inline(always)]
pub(crate) fn motor_torque<S: Scalar, const EXTRA: bool>(m: &Model<S>, structure: &Structure, c: &Coupling<S>, current: [S; 3]) -> S {
    let torque = m.star.torque(c.k, current);
    if EXTRA && structure.mapped {
        return torque + m.extra.map.torque(m.extra.map.currents(c.turn, current));
    }
    torque
}

/// What switches the legs during a step.
#[derive(Clone, Copy)]
pub(crate) enum Gates<'a, S: Scalar> {
    /// Commands before it; those of the state act from its begin on.
    At([S; 3]),
    /// Edges within it.
    Within(Pulses<'a, S>),
}

/// What feeds the windings during a step.
pub(crate) struct Fed<'a, S: Scalar> {
    pub half_supply: S,
    pub gates: Gates<'a, S>,
    /// Of the windings, warm.
    pub resistance: [S; 3],
}

/// The legs of a step.
#[inline(always)]
pub(crate) fn connect<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    bridge: &mut BridgeState<S>,
    legs: [S; 3],
    gates: Gates<'_, S>,
    half_supply: S,
    circuit: &impl Circuit<S>,
) -> Connection<S> {
    let parts = &structure.bridge_structure;
    match gates {
        Gates::At(before) => m.bridge.connect(bridge, parts, before, legs, half_supply, circuit, m.dt),
        Gates::Within(pulses) => m.bridge.connect_pulses(bridge, parts, &pulses, half_supply, circuit, m.dt),
    }
}

/// Resistances of the windings, warm.
#[inline(always)]
pub(crate) fn resistance<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &State<S>) -> [S; 3] {
    if FULL && structure.thermal {
        three!(|j| m.star.resistance[j] * s.star.resistance_factor)
    } else {
        m.star.resistance
    }
}

/// New phase currents and the phase-to-neutral voltages of this step.
#[inline(always)]
pub(crate) fn electric_step<S: Scalar, const FULL: bool, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    c: &Coupling<S>,
    half_supply: S,
    old_legs: [S; 3],
) -> ([S; 3], [S; 3]) {
    let resistance = resistance::<S, FULL>(m, structure, s);
    let gates = Gates::At(old_legs);
    if EXTRA && structure.shorted {
        let (turns, voltage) = shorted_step(m, structure, s, c, &Fed { half_supply, gates, resistance });
        return (three!(|j| turns[j]), three!(|j| voltage[j]));
    }
    if EXTRA && structure.mapped {
        return mapped_step(m, structure, s, c, &Fed { half_supply, gates, resistance });
    }
    let speed = s.shaft.motor_speed;
    let i = three!(|j| s.star.current[j]);
    let emf: [S; 3] = three!(|j| c.k[j] * speed);
    let mut terminal = three!(|j| s.legs[j] * half_supply);
    let mut rail = terminal;
    let mut legs = None;
    let drops = |terminal: &[S; 3]| three!(|j| (-resistance[j]).fma(i[j], terminal[j] - emf[j]));
    let neutral;
    if FULL && structure.bridge {
        let windings = Windings { current: i, emf, per_inductance: m.star.weight, resistance, open: m.star.open };
        let connection = connect(m, structure, &mut s.bridge, s.legs, gates, half_supply, &windings);
        terminal = connection.legs.voltage;
        rail = connection.legs.rail;
        let plain = m.star.neutral(drops(&terminal));
        if let Some(v_n) = connection.loose {
            let connected = connection.legs.connected;
            neutral = S::select(connected[0] & connected[1] & connected[2], plain, v_n);
            // A floating phase has its EMF over the neutral.
            terminal = three!(|j| S::select(connected[j], terminal[j], neutral + emf[j]));
            legs = Some(connection.legs);
        } else {
            neutral = plain;
        }
    } else {
        neutral = m.star.neutral(drops(&terminal));
    }
    let voltage: [S; 3] = three!(|j| terminal[j] - neutral);
    let mut current = m.star.currents_after(i, drops(&terminal), neutral);
    if FULL {
        s.voltage = voltage;
        if let Some(legs) = &legs {
            current = extinguish(legs, i, current);
        }
        book::<S, EXTRA>(m, structure, s, [i, current], [rail, terminal], resistance);
    }
    (current, voltage)
}

/// Energies and heat of a step, where they are wanted.
#[inline(always)]
pub(crate) fn book<S: Scalar, const EXTRA: bool>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    [old, new]: [[S; 3]; 2],
    [rail, terminal]: [[S; 3]; 2],
    resistance: [S; 3],
) {
    if structure.accounts {
        account_electric(m, s, old, new, rail, terminal, resistance);
    }
    if EXTRA && structure.heat {
        collect_heat(m, s, old, new, resistance);
    }
}

/// `electric_step` with every detail, as a function of its own: contacts and bridge are the largest code of a step, and a
/// step with located crossings calls them in three places.
pub(crate) struct Detailed<'a, S: Scalar> {
    pub model: &'a Model<S>,
    pub structure: &'a Structure,
    pub state: &'a mut State<S>,
    pub coupling: &'a Coupling<S>,
    pub half_supply: S,
    pub old_legs: [S; 3],
}

impl<S: Scalar> Kernel for Detailed<'_, S> {
    type Output = ([S; 3], [S; 3]);
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model, structure, state, coupling, half_supply, old_legs } = self;
        electric_step::<S, true, true>(model, structure, state, coupling, half_supply, old_legs)
    }
}

/// Energies of a step at its midpoint: products at the start of a step are wrong by tens of percent, since the
/// current ripples at the switching instants.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn account_electric<S: Scalar>(
    m: &Model<S>,
    s: &mut State<S>,
    old: [S; 3],
    new: [S; 3],
    rail: [S; 3],
    terminal: [S; 3],
    resistance: [S; 3],
) {
    let half = S::splat(0.5);
    let middle: [S; 3] = three!(|j| half * (old[j] + new[j]));
    for j in 0..3 {
        s.energy[E_SUPPLY] = s.energy[E_SUPPLY] + m.dt * rail[j] * middle[j];
        s.energy[E_INVERTER] = s.energy[E_INVERTER] + m.dt * (rail[j] - terminal[j]) * middle[j];
        s.energy[E_COPPER] = s.energy[E_COPPER] + m.dt * resistance[j] * middle[j] * middle[j];
    }
}

/// Copper heat of the step for the thermal network, by the same products as the energy account.
#[inline(always)]
fn collect_heat<S: Scalar>(m: &Model<S>, s: &mut State<S>, old: [S; 3], new: [S; 3], resistance: [S; 3]) {
    let half = S::splat(0.5);
    let middle: [S; 3] = three!(|j| half * (old[j] + new[j]));
    let loss: [S; 3] = three!(|j| resistance[j] * middle[j] * middle[j]);
    let windings = &mut s.extra.network.windings;
    *windings = three!(|j| m.dt.fma(loss[j], windings[j]));
    let collected = &mut s.extra.network.collected;
    collected[0] = m.dt.fma(loss[0] + loss[1] + loss[2], collected[0]);
}
