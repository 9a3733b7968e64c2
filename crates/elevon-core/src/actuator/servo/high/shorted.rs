//! The electrical part of a step with contacts in or at the windings.

use super::electric::{connect, Coupling, Fed};
use super::model::*;
use crate::actuator::servo::details::Structure;
use crate::inverter::bridge::{BridgeState, Circuit as _, Legs};
use crate::motor::short::{Account, Discrete, Network};
use crate::motor::star::StarState;
use crate::scalar::Scalar;
use crate::three;

/// Terminals, neutral, and the rails the legs draw from.
struct Solved<S> {
    terminal: [S; 3],
    neutral: S,
    rail: [S; 3],
}

/// The network over the step of this model, for the present temperature.
pub(crate) fn discrete<S: Scalar>(m: &Model<S>, star: &StarState<S>) -> Discrete<S> {
    // Where no copper warms the factor is one.
    Discrete::new(&m.extra.shorts, m.star.dt_per_inductance, star.resistance_factor, m.bridge.on_resistance)
}

/// Ampere-turns after the step and phase-to-neutral voltages.
#[inline(always)]
pub(crate) fn shorted_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    c: &Coupling<S>,
    fed: &Fed<'_, S>,
) -> ([S; 3], [S; 3]) {
    let old = three!(|j| s.star.current[j]);
    let drop = three!(|j| (-fed.resistance[j]).fma(old[j], -(c.k[j] * s.shaft.motor_speed)));
    let ground = m.extra.shorts.ground(fed.half_supply);
    let net = Network::new(&m.extra.shorts, &s.extra.contacts, structure.shorts, old, &s.star.contact, drop, ground, m.star.open);
    let x = solve(m, structure, &mut s.bridge, s.legs, &net, fed);
    let new = net.turns(x.terminal, x.neutral);
    if structure.accounts || structure.heat {
        let factor = if structure.thermal { s.star.resistance_factor } else { S::one() };
        let (before, mut after) = (s.star.contact, s.star.contact);
        net.renew(x.terminal, x.neutral, &mut after);
        let account = net.account([old, new], [&before, &after], x.terminal, x.neutral, fed.resistance, factor);
        s.star.contact = after;
        book(m, structure, s, &x, &account, ground);
    } else {
        net.renew(x.terminal, x.neutral, &mut s.star.contact);
    }
    let voltage = three!(|j| x.terminal[j] - x.neutral);
    s.voltage = voltage;
    (new, voltage)
}

#[inline(always)]
fn solve<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    bridge: &mut BridgeState<S>,
    new_legs: [S; 3],
    net: &Network<'_, S>,
    fed: &Fed<'_, S>,
) -> Solved<S> {
    if !structure.bridge {
        let terminal = three!(|j| new_legs[j] * fed.half_supply);
        return Solved { terminal, neutral: net.neutral(terminal), rail: terminal };
    }
    let connection = connect(m, structure, bridge, new_legs, fed.gates, fed.half_supply, net);
    let legs = connection.legs;
    // A switch's resistance acts on the step's end: explicit, it would not stand a contact of less than its own.
    let old = net.currents();
    let resistance = three!(|j| S::select(legs.passive[j], S::zero(), m.bridge.on_resistance));
    let source = three!(|j| resistance[j].fma(old[j], legs.voltage[j]));
    let (terminal, neutral) = net.behind(source);
    let driven = Solved { terminal, neutral, rail: legs.rail };
    let passive = legs.passive[0] | legs.passive[1] | legs.passive[2];
    if !S::any(passive) {
        return driven;
    }
    let loose = released(net, &legs, source, resistance);
    let pick = |x: S, y: S| S::select(passive, x, y);
    Solved {
        terminal: three!(|j| pick(loose.terminal[j], driven.terminal[j])),
        neutral: pick(loose.neutral, driven.neutral),
        rail: three!(|j| pick(loose.rail[j], driven.rail[j])),
    }
}

/// With legs that no switch holds.
#[inline(always)]
fn released<S: Scalar>(net: &Network<'_, S>, legs: &Legs<S>, source: [S; 3], resistance: [S; 3]) -> Solved<S> {
    let (old, connected) = (net.currents(), legs.connected);
    let mut x = net.solve(source, resistance, connected);
    let ends = net.ends(x.0, x.1);
    // A passive leg's current stops at zero: where it would pass, the step is done again with that leg afloat.
    let passed = three!(|j| legs.passive[j] & connected[j] & (old[j] * ends[j]).lt(S::zero()));
    if S::any(passed[0] | passed[1] | passed[2]) {
        x = net.solve(source, resistance, three!(|j| connected[j] & !passed[j]));
    }
    let (terminal, neutral) = x;
    Solved { terminal, neutral, rail: three!(|j| S::select(connected[j], legs.rail[j], terminal[j])) }
}

#[inline(always)]
fn book<S: Scalar>(m: &Model<S>, structure: &Structure, s: &mut State<S>, x: &Solved<S>, account: &Account<S>, ground: S) {
    if structure.accounts {
        let mut drawn = -(ground * account.ground);
        let mut bridge = S::zero();
        for j in 0..3 {
            drawn = x.rail[j].fma(account.legs[j], drawn);
            bridge = (x.rail[j] - x.terminal[j]).fma(account.legs[j], bridge);
        }
        let energy = &mut s.energy;
        energy[E_SUPPLY] = m.dt.fma(drawn, energy[E_SUPPLY]);
        energy[E_INVERTER] = m.dt.fma(bridge, energy[E_INVERTER]);
        energy[E_COPPER] = energy[E_COPPER] + account.copper;
        energy[E_CONTACT] = energy[E_CONTACT] + account.contact;
        energy[E_TAP] = energy[E_TAP] + account.tap;
    }
    if structure.heat {
        let windings = &mut s.extra.network.windings;
        *windings = three!(|j| windings[j] + account.phases[j]);
        let collected = &mut s.extra.network.collected;
        collected[0] = collected[0] + (account.copper - account.loops);
        collected[1] = collected[1] + account.loops;
        collected[2] = collected[2] + account.contact;
    }
}
