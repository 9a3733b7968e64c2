//! Contacts against the four-part circuit that they stand for, solved in phasors without the ampere-turns.

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

const REST: Contacts<f64> = [[0.0; 3]; KINDS];

fn sines(amplitude: f64, angle: f64) -> [f64; 3] {
    three!(|j| amplitude * (angle - std::f64::consts::TAU * j as f64 / 3.0).sin())
}

/// Complex numbers of the oracle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct C(f64, f64);

impl C {
    fn times(self, o: C) -> C {
        C(self.0 * o.0 - self.1 * o.1, self.0 * o.1 + self.1 * o.0)
    }
    fn over(self, o: C) -> C {
        let n = o.0 * o.0 + o.1 * o.1;
        self.times(C(o.0 / n, -o.1 / n))
    }
    fn less(self, o: C) -> C {
        C(self.0 - o.0, self.1 - o.1)
    }
    fn size(self) -> f64 {
        self.0.hypot(self.1)
    }
}

/// Gauss with pivots: rows hold the right side last.
fn solve(mut rows: Vec<Vec<C>>) -> Vec<C> {
    let n = rows.len();
    for p in 0..n {
        let best = (p..n).max_by(|&x, &y| rows[x][p].size().total_cmp(&rows[y][p].size())).unwrap_or(p);
        rows.swap(p, best);
        for r in 0..n {
            if r != p {
                let factor = rows[r][p].over(rows[p][p]);
                for k in p..=n {
                    rows[r][k] = rows[r][k].less(factor.times(rows[p][k]));
                }
            }
        }
    }
    (0..n).map(|p| rows[p][n].over(rows[p][p])).collect()
}

/// Terminal currents i_j, currents f_j below the contacts, as phasors of sin(w t): the two parts of every phase with
/// their inductances, the contacts as resistors between their ends. Unknowns: i, f, tap potentials u, v_n.
fn oracle(case: Case) -> (Vec<C>, Vec<C>) {
    let w = SPEED * POLES;
    let (zero, one) = (C(0.0, 0.0), C(1.0, 0.0));
    let turned = |j: usize, size: f64| {
        let a = -std::f64::consts::TAU * j as f64 / 3.0;
        C(size * a.cos(), size * a.sin())
    };
    let mu = case.turns;
    let (upper, mutual) = (1.0 - mu, KAPPA * mu * (1.0 - mu) * L);
    let (i, f, u, n) = (|j: usize| j, |j: usize| 3 + j, |j: usize| 6 + j, 9);
    let mut rows = Vec::new();
    let row = |entries: &[(usize, C)], right: C| {
        let mut r = vec![zero; 11];
        for &(k, x) in entries {
            r[k] = C(r[k].0 + x.0, r[k].1 + x.1);
        }
        r[10] = right;
        r
    };
    for j in 0..3 {
        let (v, e) = (turned(j, VOLTS), turned(j, K * SPEED));
        let over = C(upper * R, w * (upper * L - mutual));
        let under = C(mu * R, w * (mu * L - mutual));
        let across = C(0.0, w * mutual);
        rows.push(row(&[(i(j), over), (f(j), across), (u(j), one)], C(v.0 - upper * e.0, v.1 - upper * e.1)));
        rows.push(row(&[(f(j), under), (i(j), across), (u(j), C(-1.0, 0.0)), (n, one)], C(-mu * e.0, -mu * e.1)));
        let g = C(1.0 / case.resistance, 0.0);
        let (minus, back) = (C(-1.0, 0.0), C(-g.0, 0.0));
        let partner = (case.phase + 1) % 3;
        rows.push(match case.kind {
            LOOP if j == case.phase => row(&[(i(j), one), (f(j), minus), (u(j), back), (n, g)], zero),
            GROUND if j == case.phase => row(&[(i(j), one), (f(j), minus), (u(j), back)], zero),
            PAIR if j == case.phase => row(&[(i(j), one), (f(j), minus), (u(j), back), (u(partner), g)], zero),
            PAIR if j == partner => row(&[(i(j), one), (f(j), minus), (u(j), back), (u(case.phase), g)], zero),
            _ => row(&[(i(j), one), (f(j), minus)], zero),
        });
    }
    // Into the neutral: the parts below, and a loop's contact.
    let mut into = vec![(f(0), one), (f(1), one), (f(2), one)];
    if case.kind == LOOP {
        into.extend([(i(case.phase), one), (f(case.phase), C(-1.0, 0.0))]);
    }
    rows.push(row(&into, zero));
    let x = solve(rows);
    (x[..3].to_vec(), x[3..6].to_vec())
}

/// Phasors of the component's currents i and f after its transients.
fn simulated(case: Case) -> (Vec<C>, Vec<C>) {
    let rig = Rig::new(Some(case), KAPPA);
    let w = SPEED * POLES;
    let period = (std::f64::consts::TAU / w / DT).round() as usize;
    // Ten time constants of the slowest current, ground's through the whole star.
    let begin = period * 5;
    let (mut m, mut c) = ([0.0; 3], REST);
    let (mut above, mut below) = (vec![C(0.0, 0.0); 3], vec![C(0.0, 0.0); 3]);
    for k in 0..begin + period {
        // Potentials stand for the middle of the step, EMF and R m for its start.
        let angle = |shift: f64| w * (k as f64 + shift) * DT;
        let net = rig.network(m, &c, sines(K * SPEED, angle(0.5)), 0.0);
        let v = sines(VOLTS, angle(0.5));
        let neutral = net.neutral(v);
        let legs = net.ends(v, neutral);
        (m, c) = outcome(&net, &c, v, neutral);
        if k >= begin {
            let share = 2.0 / period as f64;
            let (sin, cos) = (share * angle(1.0).sin(), share * angle(1.0).cos());
            for j in 0..3 {
                let mut lower = legs[j];
                match case.kind {
                    PAIR if j == (case.phase + 1) % 3 => lower += c[PAIR][case.phase],
                    kind if j == case.phase => lower -= c[kind][j],
                    _ => {}
                }
                above[j] = C(above[j].0 + sin * legs[j], above[j].1 + cos * legs[j]);
                below[j] = C(below[j].0 + sin * lower, below[j].1 + cos * lower);
            }
        }
    }
    (above, below)
}

fn agree(case: Case, limit: f64) {
    let (i, f) = oracle(case);
    let (above, below) = simulated(case);
    let scale = i.iter().chain(&f).map(|x| x.size()).fold(0.0, f64::max);
    for j in 0..3 {
        for (x, y) in [(i[j], above[j]), (f[j], below[j])] {
            let error = x.less(y).size();
            assert!(error < limit * scale, "kind {} R {} phase {j}: {x:?} against {y:?}", case.kind, case.resistance);
        }
    }
}

#[test]
fn shorted_turns_are_the_four_part_circuit() {
    for resistance in [1e-6, 0.1, 1.0, 10.0, 1000.0] {
        agree(Case { kind: LOOP, phase: 0, turns: 0.2, resistance }, 1e-3);
    }
    agree(Case { kind: LOOP, phase: 2, turns: 0.9, resistance: 0.5 }, 1e-3);
}

#[test]
fn phases_in_contact_are_the_four_part_circuit() {
    for resistance in [1e-3, 1.0, 10.0, 100.0, 1e4] {
        agree(Case { kind: PAIR, phase: 1, turns: 0.4, resistance }, 1e-3);
    }
    agree(Case { kind: PAIR, phase: 2, turns: 0.999, resistance: 5.0 }, 1e-3);
}

#[test]
fn a_winding_to_ground_is_the_four_part_circuit() {
    for resistance in [1e-3, 1.0, 10.0, 100.0, 1e4] {
        agree(Case { kind: GROUND, phase: 1, turns: 0.6, resistance }, 1e-3);
    }
    agree(Case { kind: GROUND, phase: 0, turns: 0.999, resistance: 5.0 }, 1e-3);
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
            let (mut x, mut y, mut size) = (([0.0; 3], REST), ([0.0; 3], REST), 0.0_f64);
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
            let (mut m, mut c, ground) = ([0.0; 3], REST, -190.0);
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
    assert_eq!(rig.shorts.loops(&rig.structure, m, &REST), [4.0, 0.0, 0.0]);
    let mut healthy = Rig::new(None, KAPPA);
    healthy.structure = rig.structure;
    let mut burnt = REST;
    burnt[LOOP][0] = 6.0;
    let net = healthy.network(m, &burnt, [0.0; 3], 0.0);
    let (turns, contact) = outcome(&net, &burnt, [0.0; 3], net.neutral([0.0; 3]));
    assert_eq!(contact, REST);
    assert_eq!(healthy.shorts.loops(&healthy.structure, m, &contact), [0.0; 3]);
    assert!((turns[0] + turns[1] + turns[2]).abs() < 1e-12);
}

#[test]
fn the_contact_does_not_follow_the_coppers_temperature() {
    let rig = Rig::new(Some(Case { kind: LOOP, phase: 0, turns: 0.2, resistance: 10.0 }), 1.0);
    for factor in [1.0, 1.4] {
        let discrete = Discrete::new(&rig.shorts, [1e-12; 3], factor, 0.0);
        let net = Network::new(&rig.shorts, &discrete, rig.structure, [0.0; 3], &REST, [0.0; 3], 0.0, [0.0; 3]);
        let (_, contact) = outcome(&net, &REST, [100.0, -50.0, -50.0], 0.0);
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
        let (mut contact, drop) = (REST, sines(40.0, 0.3));
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
        let mut contact = REST;
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
        let held = net.behind(v).1;
        (m, c) = (turns, contact);
        out.extend([m[0], m[1], m[2], neutral, held, x.copper, x.contact, x.tap, x.loops, x.ground]);
        out.extend(c.iter().flatten().chain(&x.legs).copied());
    }
    out
}

#[test]
fn lanes_have_the_bits_of_single_runs() {
    type Lanes = crate::scalar::Portable<4>;
    let single = ALL.map(|case| parameters(Some(case), KAPPA));
    let packed: [Vec<Lanes>; 3] = std::array::from_fn(|g| (0..single[0][g].len()).map(|i| Lanes::from_fn(|l| single[l][g][i])).collect());
    let together = stepped(&packed);
    for (lane, raw) in single.iter().enumerate() {
        for (a, b) in stepped(raw).iter().zip(&together) {
            assert!(a.is_finite());
            assert_eq!(a.to_bits(), b.lane(lane).to_bits());
        }
    }
}
