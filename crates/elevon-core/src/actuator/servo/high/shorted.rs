//! The electrical part of a step with contacts in or at the windings.

use super::electric::{Coupling, Fed};
use super::model::*;
use crate::actuator::servo::details::Structure;
use crate::inverter::bridge::{Circuit as _, Legs};
use crate::motor::short::{Account, Network, Outcome};
use crate::scalar::Scalar;
use crate::three;

/// Terminals, neutral and the step's end; the legs where a detailed bridge holds them.
struct Solved<S: Scalar> {
    terminal: [S; 3],
    neutral: S,
    rail: [S; 3],
    outcome: Outcome<S>,
}

/// Ampere-turns after the step and phase-to-neutral voltages.
#[inline(always)]
pub(crate) fn shorted_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    s: &mut State<S>,
    c: &Coupling<S>,
    fed: &Fed<S>,
) -> ([S; 3], [S; 3]) {
    let factor = if structure.thermal { s.star.resistance_factor } else { S::one() };
    let old = s.star.current;
    let drop = three!(|j| -(c.k[j] * s.shaft.motor_speed) - fed.resistance[j] * old[j]);
    let ground = m.extra.shorts.ground(fed.half_supply);
    let per = m.star.dt_per_inductance;
    let before = s.star.contact;
    let net = Network::new(&m.extra.shorts, structure.shorts, per, old, &before, drop, factor, ground, m.star.open);
    let x = solve(m, structure, s, &net, fed);
    if structure.accounts || structure.heat {
        let account = net.account(old, &before, &x.outcome, x.terminal, x.neutral, fed.resistance, factor);
        book(m, structure, s, &x, &account, ground);
    }
    s.star.contact = x.outcome.contact;
    s.voltage = three!(|j| x.terminal[j] - x.neutral);
    (x.outcome.turns, s.voltage)
}

#[inline(always)]
fn solve<S: Scalar>(m: &Model<S>, structure: &Structure, s: &mut State<S>, net: &Network<'_, S>, fed: &Fed<S>) -> Solved<S> {
    if !structure.bridge {
        let terminal = three!(|j| s.legs[j] * fed.half_supply);
        let neutral = net.neutral(terminal);
        return Solved { terminal, neutral, rail: terminal, outcome: net.outcome(terminal, neutral) };
    }
    let legs = m.bridge.connect(&mut s.bridge, &structure.bridge_structure, fed.old_legs, s.legs, fed.half_supply, net, m.dt).legs;
    // A switch's resistance acts on the step's end: explicit, it would not stand a contact of less than its own.
    let old = net.currents();
    let resistance = three!(|j| S::select(legs.passive[j], S::zero(), m.bridge.on_resistance));
    let source = three!(|j| resistance[j].fma(old[j], legs.voltage[j]));
    let connected = legs.connected;
    let mut x = behind(net, &legs, source, resistance, connected);
    // A passive leg's current stops at zero: where it would pass, the step is done again with that leg afloat.
    let passed = three!(|j| legs.passive[j] & connected[j] & (old[j] * x.outcome.legs[j]).lt(S::zero()));
    if S::any(passed[0] | passed[1] | passed[2]) {
        x = behind(net, &legs, source, resistance, three!(|j| connected[j] & !passed[j]));
    }
    x
}

#[inline(always)]
fn behind<S: Scalar>(net: &Network<'_, S>, legs: &Legs<S>, source: [S; 3], resistance: [S; 3], connected: [S::Mask; 3]) -> Solved<S> {
    let (terminal, neutral) = net.solve(source, resistance, connected);
    let rail = three!(|j| S::select(legs.connected[j], legs.rail[j], terminal[j]));
    Solved { terminal, neutral, rail, outcome: net.outcome(terminal, neutral) }
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
        let collected = &mut s.extra.network.collected;
        collected[0] = collected[0] + (account.copper - account.loops);
        collected[1] = collected[1] + account.loops;
        collected[2] = collected[2] + account.contact;
    }
}
