//! Volt-seconds of dead time, and what a switch below one half is.

use super::*;

const HALF: f64 = 190.0;
const DROP: f64 = 1.5;
const STEP: f64 = 1e-6;

fn bridge(dead_time: f64) -> Bridge<f64> {
    let mut raw = vec![0.0; INVERTER.len()];
    raw[InverterParameter::DeadTime as usize] = dead_time;
    raw[InverterParameter::DiodeDrop as usize] = DROP;
    Bridge::derive(&raw)
}

fn windings(current: f64) -> Windings<f64> {
    let current = [current, -0.5 * current, -0.5 * current];
    Windings { current, emf: [0.0; 3], per_inductance: [30.0; 3], resistance: [1.0; 3], open: [0.0; 3] }
}

/// Volt-seconds of leg a over `steps` steps that begin with its command changing to `new`.
fn volt_seconds(dead_time: f64, new: f64, current: f64, steps: usize) -> f64 {
    let bridge = bridge(dead_time);
    let mut state = BridgeState::initial();
    let (mut old, legs) = ([-new, -1.0, -1.0], [new, -1.0, -1.0]);
    let mut sum = 0.0;
    for _ in 0..steps {
        let c = bridge.connect(&mut state, &BridgeStructure::default(), old, legs, HALF, &windings(current), STEP);
        sum += c.legs.voltage[0] * STEP;
        old = legs;
    }
    sum
}

#[test]
fn a_switch_below_one_half_is_a_healthy_one() {
    for switch in [InverterParameter::OpenAHigh, InverterParameter::ShortedCLow] {
        for (value, acts) in [(0.0, false), (0.499, false), (0.5, true), (1.0, true)] {
            let (mut raw, touched) = (vec![0.0; INVERTER.len()], vec![false; INVERTER.len()]);
            raw[InverterParameter::SupplyScale as usize] = 1.0;
            raw[switch as usize] = value;
            let view = View::new(&raw, &touched);
            assert_eq!(BridgeStructure::read(&view, false).switch_faults, acts, "{switch:?} {value}");
            assert_eq!(BridgeStructure::gateless(&view).trips, acts && switch == InverterParameter::ShortedCLow);
        }
    }
}

#[test]
fn dead_time_has_its_volt_seconds_at_any_length() {
    for dead_time in [0.0, 0.2e-6, 0.5e-6, 0.7e-6, 1e-6, 2e-6, 2.5e-6, 4.3e-6] {
        for (new, current) in [(1.0, 3.0), (1.0, -3.0), (-1.0, 3.0), (-1.0, -3.0)] {
            let diode = if current > 0.0 { -HALF - DROP } else { HALF + DROP };
            let exact = dead_time * diode + (8.0 * STEP - dead_time) * new * HALF;
            let got = volt_seconds(dead_time, new, current, 8);
            assert!((got - exact).abs() < 1e-12, "{dead_time} {new} {current}: {got} {exact}");
        }
    }
}

#[test]
fn a_transition_split_within_a_step_begins_its_dead_time_there() {
    let bridge = bridge(0.5e-6);
    let mut state = BridgeState::initial();
    let structure = BridgeStructure::default();
    let (low, high) = ([-1.0; 3], [1.0, -1.0, -1.0]);
    let mut part = |old, new, dt| {
        let c = bridge.connect(&mut state, &structure, old, new, HALF, &windings(3.0), dt);
        c.legs.voltage[0] * dt
    };
    let sum = part(low, low, 0.7e-6) + part(low, high, 0.3e-6) + part(high, high, STEP);
    let exact = -0.7e-6 * HALF - 0.5e-6 * (HALF + DROP) + 0.8e-6 * HALF;
    assert!((sum - exact).abs() < 1e-12, "{sum} {exact}");
}
