//! Contacts against the four-part circuit that they stand for, solved in phasors without the ampere-turns.

use super::*;

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
    let (mut m, mut c) = ([0.0; 3], NO_CURRENT);
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
