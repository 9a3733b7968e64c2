//! Closed forms of the friction laws.

use super::*;
use crate::transmission::friction::Friction;

const FIXED: f64 = 0.4;
const MOVING: f64 = 0.3;

/// Parameters of a law with some changed.
fn raw(changes: &[(FrictionLawParameter, f64)]) -> Vec<f64> {
    let mut raw: Vec<f64> = FRICTION_LAW.iter().map(|v| v.default.unwrap_or(0.0)).collect();
    for &(p, x) in changes {
        raw[p as usize] = x;
    }
    raw
}

fn law(changes: &[(FrictionLawParameter, f64)]) -> Law<f64> {
    Law::derive(&raw(changes), 1.0)
}

fn at(law: &Law<f64>, kind: FrictionLaw, speed: f64, torque: f64, load: f64) -> [f64; 2] {
    law.limits(kind, [FIXED, MOVING], speed, torque, load)
}

fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b} within {tolerance}");
}

use FrictionLawParameter as P;

#[test]
fn every_default_is_in_its_range() {
    for v in FRICTION_LAW {
        assert!(v.default.is_some_and(|x| v.range.contains(x)), "{}", v.path);
    }
}

#[test]
fn a_vanishing_stribeck_speed_is_borello() {
    let law = law(&[(P::StribeckSpeed, 1e-9)]);
    for speed in [-50.0, -1e-3, 1e-3, 50.0] {
        assert_eq!(at(&law, FrictionLaw::Stribeck, speed, 0.0, 0.0), [FIXED, MOVING]);
    }
}

#[test]
fn stribeck_falls_to_one_over_e_at_its_speed() {
    for (exponent, speed) in [(2.0, 0.7), (1.0, 0.7), (1.35, 0.7)] {
        let law = law(&[(P::StribeckSpeed, speed), (P::StribeckExponent, exponent)]);
        let [fixed, moving] = at(&law, FrictionLaw::Stribeck, -speed, 0.0, 0.0);
        assert_eq!(fixed, FIXED);
        close(moving, MOVING + (FIXED - MOVING) * (-1.0_f64).exp(), 1e-15);
        close(at(&law, FrictionLaw::Stribeck, 0.0, 0.0, 0.0)[1], FIXED, 1e-15);
    }
}

/// With a viscous part C w the total friction is least where (F_s - F_d) 2 w / v_s^2 exp(-(w/v_s)^2) = C.
#[test]
fn stribeck_has_its_minimum_where_the_slopes_balance() {
    let (v_s, c) = (2.0, 0.005);
    let law = law(&[(P::StribeckSpeed, v_s)]);
    let total = |w: f64| at(&law, FrictionLaw::Stribeck, w, 0.0, 0.0)[1] + c * w;
    let slope = |w: f64| (FIXED - MOVING) * 2.0 * w / (v_s * v_s) * (-(w / v_s) * (w / v_s)).exp() - c;
    let (mut low, mut high) = (v_s, 20.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let least = 0.5 * (low + high);
    assert!(total(least) < total(least - 0.05) && total(least) < total(least + 0.05));
    assert!(least > v_s && least < 3.0 * v_s);
}

#[test]
fn without_its_terms_the_load_dependent_law_is_stribeck() {
    let none = [P::LoadMotor, P::LoadExternal, P::LoadMotorStribeck, P::LoadExternalStribeck].map(|p| (p, 0.0));
    let law = law(&none);
    for speed in [0.0, 0.3, -3.0] {
        let plain = at(&law, FrictionLaw::Stribeck, speed, 0.0, 0.0);
        let loaded = at(&law, FrictionLaw::LoadDependent, speed, 1.2, -0.7);
        close(loaded[0], plain[0], 0.0);
        close(loaded[1], plain[1], 1e-15);
    }
}

/// One coefficient for both torques: K |T + L| (m3), doubled under a load that opposes, none under one that aids as much.
#[test]
fn one_coefficient_acts_on_the_torque_through_the_gear() {
    let k = 0.1;
    let law = law(&[(P::LoadMotor, k), (P::LoadExternal, k), (P::LoadMotorStribeck, 0.0), (P::LoadExternalStribeck, 0.0)]);
    let fast = 1e3;
    for (torque, load) in [(1.0, 1.0), (1.0, -1.0), (-0.5, 1.5), (2.0, 0.0)] {
        let [_, moving] = at(&law, FrictionLaw::LoadDependent, fast, torque, load);
        close(moving, MOVING + k * (torque + load).abs(), 1e-15);
    }
}

/// Directional (m5): the same pair of torques costs more in the direction of the larger coefficient; signs turn together.
#[test]
fn the_directional_form_tells_motor_from_load() {
    let law = law(&[(P::LoadMotor, 0.05), (P::LoadExternal, 0.2), (P::LoadMotorStribeck, 0.02), (P::LoadExternalStribeck, 0.04)]);
    let friction = |t: f64, l: f64, w: f64| at(&law, FrictionLaw::LoadDependent, w, t, l)[1];
    close(friction(1.0, 0.5, 1e3), MOVING + 0.05 + 0.1, 1e-15);
    close(friction(0.5, 1.0, 1e3), MOVING + 0.025 + 0.2, 1e-15);
    close(friction(-1.0, -0.5, -1e3), friction(1.0, 0.5, 1e3), 0.0);
    close(friction(1.0, -0.5, 1e3), MOVING + 0.05, 1e-15);
    let [fixed, _] = at(&law, FrictionLaw::LoadDependent, 0.0, 1.0, 0.5);
    close(fixed, FIXED + 0.15 + 0.02 + 0.02, 1e-15);
}

/// Quadratic (m6): the load's square where the motor wins, the motor's where the load wins, none where both push in one direction.
#[test]
fn the_quadratic_terms_follow_who_drives() {
    let none = [P::LoadMotor, P::LoadExternal, P::LoadMotorStribeck, P::LoadExternalStribeck].map(|p| (p, 0.0));
    let mut changes = none.to_vec();
    changes.extend([(P::LoadMotorQuadratic, 0.3), (P::LoadExternalQuadratic, 0.7)]);
    let law = law(&changes);
    let fixed = |t: f64, l: f64| at(&law, FrictionLaw::LoadDependent, 0.0, t, l)[0] - FIXED;
    close(fixed(2.0, 1.0), 0.7, 1e-15);
    close(fixed(1.0, 2.0), 0.3, 1e-15);
    close(fixed(-2.0, -1.0), 0.7, 1e-15);
    close(fixed(2.0, -1.0), 0.0, 0.0);
}

/// A fault's growth of the dry friction grows every term under load.
#[test]
fn growth_scales_the_terms_under_load() {
    let scaled = Law::derive(&raw(&[]), 3.0);
    let plain = Law::derive(&raw(&[]), 1.0);
    let grown = scaled.limits(FrictionLaw::LoadDependent, [3.0 * FIXED, 3.0 * MOVING], 0.2, 1.0, 0.4);
    let healthy = plain.limits(FrictionLaw::LoadDependent, [FIXED, MOVING], 0.2, 1.0, 0.4);
    for (g, h) in grown.into_iter().zip(healthy) {
        close(g, 3.0 * h, 1e-14);
    }
}

/// Sticks at 0.99 of the limit and moves at 1.01, under every law without bristles.
#[test]
fn sticks_below_its_limit_and_moves_above() {
    let law = law(&[]);
    let load = 0.2;
    for kind in [FrictionLaw::Borello, FrictionLaw::Stribeck, FrictionLaw::LoadDependent] {
        // T - L = limit(T, L) by iteration: the limit may depend on T.
        let mut torque = load + FIXED;
        for _ in 0..200 {
            torque = load + at(&law, kind, 0.0, torque, load)[0];
        }
        for (share, moves) in [(0.99, false), (1.01, true)] {
            let t = load + share * (torque - load);
            let [fixed, moving] = at(&law, kind, 0.0, t, load);
            let net = Friction::net_torque(t, load, load + moving, 0.0, fixed);
            assert_eq!(net != 0.0, moves, "{kind:?} at {share}");
        }
    }
}

const INERTIA: f64 = 2.675e-3;

/// A rotor under `torque(t)` on LuGre's friction alone for `steps` of `h`: speed, deflection, angle, work of friction.
fn run(law: &Law<f64>, h: f64, steps: usize, start: f64, torque: impl Fn(f64) -> f64) -> [f64; 4] {
    let (mut speed, mut z, mut angle, mut work) = (start, 0.0, 0.0, 0.0);
    for i in 0..steps {
        let limits = at(law, FrictionLaw::LuGre, speed, 0.0, 0.0);
        let push = Push { free: speed + h / INERTIA * torque(i as f64 * h), limits, dt: h, dt_per_inertia: h / INERTIA };
        let moved = law.bristle.advance(&push, z);
        work += h * moved.dry * 0.5 * (speed + moved.speed);
        (speed, z) = (moved.speed, moved.bristle);
        angle += h * speed;
    }
    [speed, z, angle, work]
}

/// Below the static limit the shaft creeps to T / sigma_0 and stays; above it slides.
#[test]
fn lugre_holds_up_to_the_static_limit_with_its_stiffness() {
    for (stiffness, h) in [(100.0, 1e-6), (1e4, 1e-6), (100.0, 5e-4), (1e6, 5e-4)] {
        let law = law(&[(P::BristleStiffness, stiffness)]);
        let ramp = |share: f64| move |t: f64| FIXED * share * (t / 0.2).min(1.0);
        let steps = (0.5 / h) as usize;
        let [speed, z, angle, _] = run(&law, h, steps, 0.0, ramp(0.95));
        assert!(speed.abs() < 1e-4, "{stiffness} at {h}: {speed}");
        close(z * stiffness, 0.95 * FIXED, 1e-3 * FIXED);
        // The bristles yield a little as they move: z lags the angle, never leads it.
        assert!(angle >= z * (1.0 - 1e-9), "{angle} against {z}");
        let [speed, ..] = run(&law, h, steps, 0.0, ramp(1.05));
        assert!(speed > 1.0, "{stiffness} at {h}: {speed}");
    }
}

/// For small torques the deflection is elastic: sigma_0 = dT/dtheta.
#[test]
fn lugre_is_a_spring_before_it_slides() {
    let law = law(&[]);
    let small = 0.02 * FIXED;
    let [_, z, angle, _] = run(&law, 1e-5, 50_000, 0.0, |t| small * (t / 0.2).min(1.0));
    close(z, small / 100.0, 1e-3 * small / 100.0);
    close(angle, small / 100.0, 0.03 * small / 100.0);
}

/// Steady sliding: exactly g(w), at any stiffness and step.
#[test]
fn lugre_slides_with_stribecks_friction() {
    for (stiffness, h) in [(100.0, 1e-6), (1e5, 5e-4)] {
        let law = law(&[(P::BristleStiffness, stiffness), (P::StribeckSpeed, 2.0)]);
        for speed in [0.5, 3.0, -40.0] {
            let limits = at(&law, FrictionLaw::LuGre, speed, 0.0, 0.0);
            let push = Push { free: speed, limits, dt: h, dt_per_inertia: h / INERTIA };
            let mut moved = Moved { speed, bristle: 0.0, dry: 0.0 };
            for _ in 0..200_000 {
                moved = law.bristle.moved(&push, moved.bristle, speed);
            }
            close(moved.dry, speed.signum() * limits[1], 1e-9);
            close(law.bristle.torque(moved.bristle, speed, limits[1]), moved.dry, 1e-9);
        }
    }
}

/// The kinetic energy that is lost is the work of the friction, to rounding; and it is spent, not gained.
#[test]
fn lugre_energy_closes() {
    for (stiffness, h) in [(100.0, 1e-6), (1e6, 5e-4)] {
        let law = law(&[(P::BristleStiffness, stiffness)]);
        let start = 5.0;
        let [speed, z, _, work] = run(&law, h, (0.2 / h) as usize, start, |_| 0.0);
        close(0.5 * INERTIA * (start * start - speed * speed), work, 1e-12);
        assert!(work > 0.5 * stiffness * z * z && speed.abs() < 0.5, "{speed}");
    }
}

/// A small closed cycle of torque leaves a loop: what it costs is lost, and none of it is negative.
#[test]
fn lugre_hysteresis_is_closed_and_passive() {
    let law = law(&[]);
    let swing = |t: f64| 0.8 * FIXED * (2.0 * std::f64::consts::PI * t).sin();
    let mut last = 0.0;
    for cycles in [1, 2, 3] {
        let [speed, z, _, work] = run(&law, 1e-5, cycles * 100_000, 0.0, swing);
        let lost = work - 0.5 * 100.0 * z * z - 0.5 * INERTIA * speed * speed;
        assert!(lost > last, "cycle {cycles}: {lost} after {last}");
        last = lost;
    }
}

/// Tends to Borello's rotor as the bristles stiffen: sliding down from a speed takes the closed-form time.
#[test]
fn stiff_bristles_are_coulomb() {
    let law = law(&[(P::BristleStiffness, 1e8), (P::BristleDamping, 0.0), (P::StribeckSpeed, 1e-6)]);
    let (start, h) = (10.0, 1e-5);
    let time = start * INERTIA / MOVING;
    let [half, ..] = run(&law, h, (0.5 * time / h) as usize, start, |_| 0.0);
    close(half, 0.5 * start, 0.01);
    let [end, ..] = run(&law, h, (1.2 * time / h) as usize, start, |_| 0.0);
    close(end, 0.0, 1e-3);
}

/// The implicit step stays bounded whatever the stiffness and the step.
#[test]
fn any_stiffness_runs_at_any_step() {
    for stiffness in [1.0, 1e3, 1e6, 1e9] {
        for damping in [0.0, 0.5, 100.0] {
            for h in [1e-7, 1e-6, 1e-4, 5e-4, 1e-2] {
                let law = law(&[(P::BristleStiffness, stiffness), (P::BristleDamping, damping)]);
                let [speed, z, _, work] = run(&law, h, 4000, 0.0, |t| 0.6 * (700.0 * t).sin());
                assert!(speed.abs() < 5.0 + 0.6 * h / INERTIA, "{stiffness} {damping} {h}: {speed}");
                assert!(z.abs() <= FIXED / stiffness * (1.0 + 1e-9), "{stiffness} {damping} {h}: {z}");
                assert!(work.is_finite());
            }
        }
    }
}

/// A lane among others has the bits of a run alone, whatever its neighbours do.
#[test]
fn lanes_have_the_bits_of_single_runs() {
    lanes_are_single_runs(0, [0.0, -3.7]);
    lanes_are_single_runs(2, [1e-9, 250.0]);
}

fn lanes_are_single_runs(first: usize, speeds: [f64; 2]) {
    use crate::scalar::{Portable, Scalar};
    type Lanes = Portable;
    let each = |i: usize, p: P| match p {
        P::StribeckExponent => 1.0 + 0.35 * (first + i) as f64,
        P::BristleStiffness => 100.0 * 30.0_f64.powi((first + i) as i32),
        p => FRICTION_LAW[p as usize].default.unwrap_or(0.0) * (1.0 + 0.1 * (first + i) as f64),
    };
    let all = [
        P::Law,
        P::StribeckSpeed,
        P::StribeckExponent,
        P::BristleStiffness,
        P::BristleDamping,
        P::LoadMotor,
        P::LoadExternal,
        P::LoadMotorStribeck,
        P::LoadExternalStribeck,
        P::LoadMotorQuadratic,
        P::LoadExternalQuadratic,
    ];
    let raw: Vec<Lanes> = all.iter().map(|&p| Lanes::from_fn(|i| each(i, p))).collect();
    let together = Law::derive(&raw, Lanes::one());
    let given = [FIXED, MOVING].map(Lanes::splat);
    let (torque, load) = (Lanes::from_fn(|i| 0.3 - 0.2 * i as f64), Lanes::from_fn(|i| 0.1 * i as f64));
    let speed = Lanes::from_fn(|i| speeds[i]);
    for kind in [FrictionLaw::Borello, FrictionLaw::Stribeck, FrictionLaw::LuGre, FrictionLaw::LoadDependent] {
        let limits = together.limits(kind, given, speed, torque, load);
        let push = Push { free: speed + torque, limits, dt: Lanes::splat(1e-6), dt_per_inertia: Lanes::splat(4e-4) };
        let moved = together.bristle.advance(&push, Lanes::splat(1e-4));
        for (i, &speed) in speeds.iter().enumerate() {
            let alone = Law::derive(&all.map(|p| each(i, p)), 1.0);
            let limits_alone = alone.limits(kind, [FIXED, MOVING], speed, torque.lane(i), load.lane(i));
            let push = Push { free: speed + torque.lane(i), limits: limits_alone, dt: 1e-6, dt_per_inertia: 4e-4 };
            let moved_alone = alone.bristle.advance(&push, 1e-4);
            assert_eq!(limits.map(|x| x.lane(i)), limits_alone, "{kind:?}");
            assert_eq!(
                [moved.speed, moved.bristle, moved.dry].map(|x| x.lane(i)),
                [moved_alone.speed, moved_alone.bristle, moved_alone.dry]
            );
        }
    }
}

/// The reduced-order model's sensitivities go through the laws: slopes are finite and those of differences.
#[test]
fn slopes_are_exact() {
    use crate::scalar::{Dual, Scalar};
    type Slope = Dual<f64>;
    for kind in [FrictionLaw::Stribeck, FrictionLaw::LuGre, FrictionLaw::LoadDependent] {
        for p in [P::StribeckSpeed, P::StribeckExponent, P::LoadMotor, P::LoadExternalStribeck] {
            let values = raw(&[(P::StribeckSpeed, 2.0)]);
            let seeded: Vec<Slope> =
                values.iter().enumerate().map(|(i, &x)| if i == p as usize { Slope::variable(x, 0) } else { Slope::splat(x) }).collect();
            let limits = |l: &Law<Slope>, w: f64| {
                l.limits(kind, [FIXED, MOVING].map(Slope::splat), Slope::splat(w), Slope::splat(0.7), Slope::splat(0.2))[1]
            };
            let plain = |h: f64| {
                let mut moved = values.clone();
                moved[p as usize] += h;
                Law::derive(&moved, 1.0).limits(kind, [FIXED, MOVING], 1.3, 0.7, 0.2)[1]
            };
            let slope = limits(&Law::derive(&seeded, Slope::one()), 1.3).slope;
            let expected = (plain(1e-6) - plain(-1e-6)) / 2e-6;
            close(slope, expected, 1e-8);
            assert!(limits(&Law::derive(&seeded, Slope::one()), 0.0).finite(), "{kind:?} {p:?}");
        }
    }
}
