//! One step behind relays that act at the instant of their crossing (`crossing`). What lies between two crossings is smooth,
//! and so the rest of the step is of second order, as behind a carrier: EMF and torque at the middle of the step, the
//! resistance on the currents' mean.

use super::carrier::middle;
use super::crossing::{turned, Seen, Switched};
use super::electric::{coupling_at, motor_torque};
use super::model::{Model, State};
use super::step::{acquire, lose_switching, measure, move_on, park, sense, Feed};
use super::Behind;
use crate::actuator::servo::advance::Instant;
use crate::actuator::servo::details::Structure;
use crate::inverter::hysteresis::{count_transitions, relays, six_step, transition};
use crate::scalar::{three_phase, Scalar};
use crate::three;

/// The legs that the relays set at the begin of a step, where a reference has jumped.
#[inline(always)]
fn set_legs<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, s: &mut State<S>, error: [S; 3], supply: S) -> [S; 3] {
    let old = three!(|j| s.legs[j]);
    let mut legs = relays(m.half_band, old, error);
    if FULL && structure.stops {
        let lost = m.sensing.lost();
        legs = three!(|j| S::select(lost, S::zero(), legs[j]));
    }
    if transition(old, legs) {
        s.transitions = count_transitions(s.transitions, old, legs);
        s.legs = legs;
    }
    if FULL && structure.switching {
        lose_switching(m, s, supply, old, s.legs);
    }
    old
}

#[inline(always)]
fn step<S: Scalar, const FULL: bool>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
    // Sensors and control electronics.
    let reading = sense::<S, FULL, FULL>(m, structure, x, s);
    let measured = measure::<S, FULL, FULL>(m, structure, s);
    let speed = s.shaft.motor_speed;
    let half = S::splat(0.5);
    let position = middle(m, s);
    let (sin, cos) = m.star.electrical_angle(position).sin_cos();
    // The begin lies a small angle before the middle.
    let back = m.star.pole_pairs * (s.shaft.motor_position - position);
    let along = S::splat(-0.5).fma(back * back, S::one());
    let (mut sin_c, mut cos_c) = (back.fma(cos, along * sin), (-back).fma(sin, along * cos));
    let mut rate = speed;
    if FULL && structure.sensing.distorts() && structure.sensing.commutated {
        (sin_c, cos_c) = m.star.electrical_angle(reading.angle).sin_cos();
        rate = reading.speed;
    }
    let (sines, cosines) = three_phase(sin_c, cos_c);

    // Power electronics.
    let feed = Feed::begin::<FULL>(m, structure, x, s);
    let shape = if FULL && structure.six_step { six_step(sines) } else { sines };
    let error: [S; 3] = three!(|j| s.current_ref * shape[j] - measured[j]);
    let old_legs = set_legs::<S, FULL>(m, structure, s, error, feed.supply);

    // Motor electromagnetics.
    let coupling = coupling_at::<S, FULL>(m, structure, s, position, [sin, cos]);
    let circuit = Switched { model: m, structure, coupling: &coupling, half_supply: half * feed.supply };
    let seen = Seen { error, shape: turned::<S, FULL>(m, structure, [sines, cosines], rate) };
    let wound = circuit.step::<FULL>(s, old_legs, &seen);
    let torque = motor_torque::<S, FULL>(m, structure, &coupling, wound.mean);
    feed.end::<FULL>(m, structure, s);
    if structure.acquisition {
        let (v_q, _) = park(wound.voltage, sines, cosines);
        acquire(m, s, park(measured, sines, cosines), v_q);
    }

    // Motor and transmission dynamics.
    move_on::<S, FULL, FULL>(m, structure, x, s, (torque, wound.current));
}

/// Behind relays that act at the instant of their crossing.
pub(super) struct ByLocatedRelays<const FULL: bool>;

impl<const FULL: bool> Behind for ByLocatedRelays<FULL> {
    const FULL: bool = FULL;
    #[inline(always)]
    fn step<S: Scalar>(m: &Model<S>, structure: &Structure, x: &Instant<S>, s: &mut State<S>) {
        step::<S, FULL>(m, structure, x, s);
    }
}
