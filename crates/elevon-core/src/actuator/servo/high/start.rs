//! The state at the start of a run, and after a fault changed parameters.

use super::model::{ExtraState, Model, State};
use super::shorted::discrete;
use crate::actuator::servo::details::Structure;
use crate::actuator::servo::heat::{heated, network};
use crate::actuator::servo::layout::*;
use crate::control::current_dq::CurrentControlState;
use crate::control::position_speed::PositionSpeedState;
use crate::inverter::bridge::BridgeState;
use crate::inverter::carrier::Window;
use crate::inverter::link::DcLinkState;
use crate::motor::star::{MotorParameter, StarState};
use crate::motor::thermal::NetworkState;
use crate::scalar::Scalar;
use crate::three;

/// Signals whose initial value a scenario may set.
pub(crate) const INITIAL: &[&str] = &[
    "motor_position",
    "motor_speed",
    "output_position",
    "output_speed",
    "current_a",
    "current_b",
    "current_c",
    "winding_temperature",
    "surface_temperature",
];

pub(crate) fn start<S: Scalar>(model: &Model<S>, raw: &[S], initial: &[S]) -> State<S> {
    let or = |i: usize, other: S| S::select(initial[i].equals(initial[i]), initial[i], other);
    let zero = S::zero();
    let mut shaft = model.shaft.start([initial[0], initial[1]], [initial[2], initial[3]]);
    let mut star = StarState::initial();
    star.current = three!(|j| or(4 + j, zero));
    let warm = model.extra.network.start_at([initial[7], initial[8]]);
    heat(raw, &mut star, &warm);
    model.shaft.lubricate(&mut shaft, model.extra.network.housing(heated(raw), &warm));
    State {
        star,
        middle: (S::splat(0.5) * model.dt).fma(shaft.motor_speed, shaft.motor_position),
        legs: [-S::one(); 3],
        window: Window::initial(),
        commands: [-S::one(); 3],
        bridge: BridgeState::initial(),
        control: PositionSpeedState::initial(model.control.torque_limit),
        current_ref: zero,
        current_control: CurrentControlState::initial(),
        shaft,
        command_noise: zero,
        current_noise: [zero; 3],
        sensed: model.sensing.start(&shaft),
        current_reading: star.current,
        filtered: [zero; 3],
        transitions: zero,
        voltage: [zero; 3],
        energy: [zero; 5],
        extra: ExtraState {
            network: warm,
            sensed: star.current,
            last_reference: S::splat(f64::NAN),
            weakening: zero,
            derated: model.extra.limits.derated(warm.winding),
            link: DcLinkState::initial(),
            drive_heat: model.extra.drive_heat.start(),
            contacts: discrete(model, &star),
        },
    }
}

pub(crate) fn refresh<S: Scalar>(model: &Model<S>, structure: &Structure, raw: &[S], state: &mut State<S>) {
    heat(raw, &mut state.star, &state.extra.network);
    lubricate(model, structure, state);
    limit(model, structure, state);
    state.window.renew();
    if structure.shorted {
        state.extra.contacts = discrete(model, &state.star);
    }
}

/// Limit of the torque reference at the present temperature and direct current.
#[inline(always)]
pub(crate) fn limit<S: Scalar>(m: &Model<S>, structure: &Structure, s: &mut State<S>) {
    s.control.torque_limit = m.control.torque_limit;
    if structure.limits.moves() {
        let derated = if structure.limits.derates { s.extra.derated } else { S::one() };
        let left = m.extra.limits.left(derated, m.extra.limits.reference(s.extra.weakening));
        s.control.torque_limit = m.control.torque_limit * left;
    }
}

/// Gives the lubricant the housing's temperature.
pub(crate) fn lubricate<S: Scalar>(model: &Model<S>, structure: &Structure, state: &mut State<S>) {
    if structure.shaft.lubricated {
        model.shaft.lubricate(&mut state.shaft, model.extra.network.housing(structure.heat, &state.extra.network));
    }
}

/// Temperature factors: of the network where there is one, else of the given winding temperature.
fn heat<S: Scalar>(raw: &[S], star: &mut StarState<S>, warm: &NetworkState<S>) {
    if !heated(raw) {
        star.heat(Raw(raw).motor(), raw[MotorParameter::WindingTemperature.at()]);
    } else {
        let dt = raw[SolverParameter::Step.at()].lane(0);
        (star.resistance_factor, star.flux_factor) = network(raw, dt).factors(warm);
    }
}
