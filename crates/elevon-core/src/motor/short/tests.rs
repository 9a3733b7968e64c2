//! Contacts: onsets, flows, heat, bits; `phasors` holds them against the circuit that they stand for.

mod phasors;

use super::*;
use crate::inverter::bridge::Circuit as _;
use crate::motor::star::{MotorStructure, MOTOR};

const R: f64 = 2.75;
const L: f64 = 30.5e-3;
const K: f64 = 0.9;
const DT: f64 = 1e-6;
const SPEED: f64 = 50.0;
const POLES: f64 = 4.0;
const KAPPA: f64 = 0.9;
const VOLTS: f64 = 60.0;

/// A contact of a test: kind, phase, turns below it, resistance.
#[derive(Clone, Copy)]
struct Case {
    kind: usize,
    phase: usize,
    turns: f64,
    resistance: f64,
}

struct Rig {
    star: Star<f64>,
    shorts: Shorts<f64>,
    discrete: Discrete<f64>,
    structure: ShortStructure,
}

/// Parameters of the motor, the centre tap and the other contacts.
fn parameters(case: Option<Case>, kappa: f64) -> [Vec<f64>; 3] {
    let mut motor: Vec<f64> = MOTOR.iter().map(|v| v.default.unwrap_or(1.0)).collect();
    let mut tap: Vec<f64> = TAP.iter().map(|v| v.default.unwrap_or(0.0)).collect();
    let mut short: Vec<f64> = SHORT.iter().map(|v| v.default.unwrap_or(0.0)).collect();
    for (parameter, value) in [
        (MotorParameter::WindingResistance, R),
        (MotorParameter::WindingInductance, L),
        (MotorParameter::EmfConstant, K),
        (MotorParameter::PolePairs, POLES),
        (MotorParameter::ShortCoupling, kappa),
    ] {
        motor[parameter as usize] = value;
    }
    short[ShortParameter::ContactCoupling as usize] = kappa;
    if let Some(case) = case {
        match case.kind {
            LOOP => {
                motor[MotorParameter::TurnsA as usize + case.phase] = 1.0 - case.turns;
                motor[MotorParameter::ShortContactResistance as usize] = case.resistance;
            }
            TAPPED => tap[case.phase] = 25.0 / (25.0 + case.resistance),
            PAIR => {
                short[ShortParameter::PhaseShortAb as usize + case.phase] = 1.0 / case.resistance;
                short[ShortParameter::PhaseShortTurns as usize] = case.turns;
            }
            _ => {
                short[ShortParameter::GroundShortA as usize + case.phase] = 1.0 / case.resistance;
                short[ShortParameter::GroundShortTurns as usize] = case.turns;
                short[ShortParameter::GroundPotential as usize] = 0.5;
            }
        }
    }
    [motor, tap, short]
}

impl Rig {
    fn new(case: Option<Case>, kappa: f64) -> Self {
        let [motor, tap, short] = parameters(case, kappa);
        let mut structure = [false; KINDS];
        if let Some(case) = case {
            structure[case.kind] = true;
        }
        let plain = MotorStructure { shorted_loop: true, ..MotorStructure::default() };
        let star = Star::derive(&motor, &plain, DT);
        let shorts = Shorts::derive(&motor, &tap, &short, &star, true, DT);
        let discrete = Discrete::new(&shorts, star.dt_per_inductance, 1.0, 0.0);
        Self { star, shorts, discrete, structure }
    }

    fn network<'a>(&'a self, turns: [f64; 3], contact: &'a Contacts<f64>, emf: [f64; 3], ground: f64) -> Network<'a, f64> {
        let drop = three!(|j| -emf[j] - R * turns[j]);
        Network::new(&self.shorts, &self.discrete, self.structure, turns, contact, drop, ground, [0.0; 3])
    }
}

/// Ampere-turns and contacts after a step.
fn outcome<S: Scalar>(net: &Network<'_, S>, contact: &Contacts<S>, v: [S; 3], neutral: S) -> ([S; 3], Contacts<S>) {
    let mut after = *contact;
    net.renew(v, neutral, &mut after);
    (net.turns(v, neutral), after)
}

const NO_CURRENT: Contacts<f64> = [[0.0; 3]; KINDS];

fn sines(amplitude: f64, angle: f64) -> [f64; 3] {
    three!(|j| amplitude * (angle - std::f64::consts::TAU * j as f64 / 3.0).sin())
}

/// Legs that chop at random, seeded: what a step does is the same whatever they do.
fn chopped(k: usize) -> [f64; 3] {
    three!(|j| {
        let x = ((k / 40 + 100_000 * (j + 1)) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let bits = (x ^ (x >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 63;
        if bits == 0 {
            190.0
        } else {
            -190.0
        }
    })
}

const ALL: [Case; 4] = [
    Case { kind: LOOP, phase: 0, turns: 0.3, resistance: 2.0 },
    Case { kind: TAPPED, phase: 1, turns: 1.0, resistance: 40.0 },
    Case { kind: PAIR, phase: 2, turns: 0.5, resistance: 3.0 },
    Case { kind: GROUND, phase: 1, turns: 0.7, resistance: 20.0 },
];

#[test]
fn a_contact_without_conductance_is_the_healthy_motor() {
    let healthy = Rig::new(None, KAPPA);
    for case in ALL {
        for kappa in [0.0, KAPPA, 1.0] {
            let open = Rig::new(Some(Case { resistance: 1e12, ..case }), kappa);
            let (mut x, mut y, mut size) = (([0.0; 3], NO_CURRENT), ([0.0; 3], NO_CURRENT), 0.0_f64);
            for k in 0..20_000 {
                for (rig, state) in [(&healthy, &mut x), (&open, &mut y)] {
                    let net = rig.network(state.0, &state.1, [0.0; 3], 0.0);
                    *state = outcome(&net, &state.1, chopped(k), net.neutral(chopped(k)));
                }
                size = size.max(x.0[0].abs());
            }
            assert!(size > 0.5);
            for j in 0..3 {
                assert!((x.0[j] - y.0[j]).abs() < 1e-7 * size, "kind {} phase {j}: {} {}", case.kind, x.0[j], y.0[j]);
            }
        }
    }
}

#[test]
fn flows_close_at_every_contact() {
    for case in ALL {
        for resistance in [1e-2, 1.0, 40.0, 1e4] {
            let rig = Rig::new(Some(Case { resistance, ..case }), KAPPA);
            let (mut m, mut c, ground) = ([0.0; 3], NO_CURRENT, -190.0);
            let (mut drawn, mut heat, mut emf_work, mut given) = (0.0, 0.0, 0.0, 0.0);
            for k in 0..50_000 {
                let e = sines(K * SPEED, SPEED * POLES * k as f64 * DT);
                let net = rig.network(m, &c, e, ground);
                let v = chopped(k);
                let neutral = net.neutral(v);
                let (turns, contact) = outcome(&net, &c, v, neutral);
                let x = net.account([m, turns], [&c, &contact], v, neutral, [R; 3], 1.0);
                let power: f64 = (0..3).map(|j| v[j] * x.legs[j]).sum::<f64>() - ground * x.ground;
                drawn += DT * power;
                given += DT * power.abs();
                heat += x.copper + x.contact + x.tap;
                emf_work += (0..3).map(|j| DT * e[j] * 0.5 * (m[j] + turns[j])).sum::<f64>();
                (m, c) = (turns, contact);
            }
            let stored = m.iter().map(|x| 0.5 * L * x * x).sum::<f64>() + rig.shorts.magnetic(&rig.structure, &c);
            let gap = drawn - heat - emf_work - stored;
            assert!(gap.abs() < 2e-4 * given, "kind {} R {resistance}: {gap} of {given}", case.kind);
        }
    }
}

#[test]
fn at_its_onset_the_loop_carries_the_phase_current_and_cleared_it_carries_none() {
    let rig = Rig::new(Some(ALL[0]), KAPPA);
    let m = [4.0, -2.5, -1.5];
    assert_eq!(rig.shorts.loops(&rig.structure, m, &NO_CURRENT), [4.0, 0.0, 0.0]);
    let mut healthy = Rig::new(None, KAPPA);
    healthy.structure = rig.structure;
    let mut burnt = NO_CURRENT;
    burnt[LOOP][0] = 6.0;
    let net = healthy.network(m, &burnt, [0.0; 3], 0.0);
    let (turns, contact) = outcome(&net, &burnt, [0.0; 3], net.neutral([0.0; 3]));
    assert_eq!(contact, NO_CURRENT);
    assert_eq!(healthy.shorts.loops(&healthy.structure, m, &contact), [0.0; 3]);
    assert!((turns[0] + turns[1] + turns[2]).abs() < 1e-12);
}

#[test]
fn the_contact_does_not_follow_the_coppers_temperature() {
    let rig = Rig::new(Some(Case { kind: LOOP, phase: 0, turns: 0.2, resistance: 10.0 }), 1.0);
    for factor in [1.0, 1.4] {
        let discrete = Discrete::new(&rig.shorts, [1e-12; 3], factor, 0.0);
        let net = Network::new(&rig.shorts, &discrete, rig.structure, [0.0; 3], &NO_CURRENT, [0.0; 3], 0.0, [0.0; 3]);
        let (_, contact) = outcome(&net, &NO_CURRENT, [100.0, -50.0, -50.0], 0.0);
        // mu v over R_c and the warm mu N R.
        let expected = 0.2 * 100.0 / (10.0 + factor * 0.2 * 0.8 * R);
        assert!((contact[LOOP][0] - expected).abs() < 1e-12 * expected);
    }
}

#[test]
fn held_legs_have_the_potentials_of_the_elimination() {
    for case in ALL {
        let rig = Rig::new(Some(case), KAPPA);
        let discrete = Discrete::new(&rig.shorts, rig.star.dt_per_inductance, 1.0, 0.3);
        let (mut contact, drop) = (NO_CURRENT, sines(40.0, 0.3));
        contact[case.kind][case.phase] = 0.7;
        let net = Network::new(&rig.shorts, &discrete, rig.structure, [0.4, -0.3, -0.1], &contact, drop, -190.0, [0.0; 3]);
        let (v, neutral) = net.behind([190.0, -190.0, 188.0]);
        let (other, other_neutral) = net.solve([190.0, -190.0, 188.0], [0.3; 3], [true; 3]);
        for j in 0..3 {
            assert!((v[j] - other[j]).abs() < 1e-11, "kind {} leg {j}: {} {}", case.kind, v[j], other[j]);
        }
        assert!((neutral - other_neutral).abs() < 1e-10);
    }
}

#[test]
fn loose_legs_carry_nothing() {
    for case in ALL {
        let rig = Rig::new(Some(case), KAPPA);
        let mut contact = NO_CURRENT;
        contact[case.kind][case.phase] = 0.7;
        for connected in [[true, true, false], [false, true, false], [false, false, false]] {
            let net = rig.network([0.4, -0.3, -0.1], &contact, sines(40.0, 0.3), -190.0);
            let (v, neutral) = net.potentials([190.0, -190.0, 190.0], connected);
            let legs = net.ends(v, neutral);
            for j in 0..3 {
                if connected[j] {
                    assert_eq!(v[j], [190.0, -190.0, 190.0][j]);
                } else {
                    assert!(legs[j].abs() < 1e-10, "kind {} leg {j}: {}", case.kind, legs[j]);
                }
            }
        }
    }
}

/// Twenty steps with loose and held legs, their switches' resistance and accounts: ampere-turns, contacts and heats.
fn stepped<S: Scalar>(raw: &[Vec<S>; 3]) -> Vec<S> {
    let plain = MotorStructure { shorted_loop: true, ..MotorStructure::default() };
    let star = Star::derive(&raw[0], &plain, S::splat(DT));
    let shorts = Shorts::derive(&raw[0], &raw[1], &raw[2], &star, true, S::splat(DT));
    let splat = |x: [f64; 3]| three!(|j| S::splat(x[j]));
    let discrete = Discrete::new(&shorts, star.dt_per_inductance, S::splat(1.1), S::splat(0.2));
    let (mut m, mut c, mut out) = (splat([1.0, -0.4, -0.6]), [[S::splat(0.0); 3]; KINDS], Vec::new());
    for k in 0..20 {
        let drop = splat(sines(40.0, 0.1 * k as f64));
        let ground = S::splat(-190.0);
        let net = Network::new(&shorts, &discrete, [true; KINDS], m, &c, drop, ground, splat([0.0; 3]));
        let connected = three!(|j| S::mask(!(k + j).is_multiple_of(4)));
        let (v, neutral) = net.solve(splat(chopped(40 * k)), splat([0.2; 3]), connected);
        let (turns, contact) = outcome(&net, &c, v, neutral);
        let x = net.account([m, turns], [&c, &contact], v, neutral, splat([R; 3]), S::splat(1.1));
        let behind = net.behind(v).1;
        (m, c) = (turns, contact);
        out.extend([m[0], m[1], m[2], neutral, behind, x.copper, x.contact, x.tap, x.loops, x.ground]);
        out.extend(c.iter().flatten().chain(&x.legs).copied());
    }
    out
}

#[test]
fn lanes_have_the_bits_of_single_runs() {
    type Lanes = crate::scalar::Portable;
    for cases in ALL.chunks_exact(Lanes::LANES) {
        let single: Vec<_> = cases.iter().map(|&case| parameters(Some(case), KAPPA)).collect();
        let packed: [Vec<Lanes>; 3] =
            std::array::from_fn(|g| (0..single[0][g].len()).map(|i| Lanes::from_fn(|l| single[l][g][i])).collect());
        let together = stepped(&packed);
        for (lane, raw) in single.iter().enumerate() {
            for (a, b) in stepped(raw).iter().zip(&together) {
                assert!(a.is_finite());
                assert_eq!(a.to_bits(), b.lane(lane).to_bits());
            }
        }
    }
}
