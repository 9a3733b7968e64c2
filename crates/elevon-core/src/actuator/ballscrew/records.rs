//! The records of the ballscrew actuator: those of a servo in the units of a travelling output, and the screw's own.

use crate::actuator::servo::layout::{self, At as _, AMBIENT, COMMAND, SUPPLY};
use crate::actuator::servo::signals::{self, HighSignal as H, LowSignal as L};
use crate::actuator::{Finding, Port};
use crate::control::position_speed::{ControlParameter as C, CONTROL};
use crate::groups;
use crate::sensor::encoder::{EncoderParameter as E, ENCODER};
use crate::transmission::backlash::{BacklashParameter as P, BACKLASH};
use crate::transmission::friction::{FrictionParameter as F, FRICTION};
use crate::transmission::gear::{GearParameter, LoadParameter as D, StopParameter as T, GEAR, LOAD, STOP};
use crate::transmission::screw::{RatingParameter, ScrewParameter, RATING, SCREW};
use crate::transmission::tooth::{ToothParameter as W, TOOTH};
use crate::transmission::vibration::{VibrationParameter, VIBRATION};
use crate::variable::{extended, relabelled, Relabel, Role, Signal, Variable};

const fn change(index: usize, name: &'static str, unit: &'static str, text: &'static str) -> Relabel {
    Relabel { index, name, unit, text, acts: None }
}
const fn unit(index: usize, unit: &'static str) -> Relabel {
    change(index, "", unit, "")
}

const RAM_GEAR: [Variable; GEAR.len()] = relabelled(GEAR, &[change(GearParameter::Ratio as usize, "", "", "motor speed over screw speed")]);
const RAM_FRICTION: [Variable; FRICTION.len()] = relabelled(FRICTION, &[unit(F::JamPosition as usize, "m")]);
const RAM_BACKLASH: [Variable; BACKLASH.len()] = relabelled(
    BACKLASH,
    &[
        change(P::Total as usize, "", "m", "total backlash between ram and load"),
        unit(P::Extra as usize, "m"),
        change(P::Stiffness as usize, "", "N/m", "contact stiffness between ram and load (elastic model)"),
        change(P::Damping as usize, "", "N s/m", "contact damping between ram and load (elastic model)"),
    ],
);
const RAM_STOP: [Variable; STOP.len()] = relabelled(
    STOP,
    &[unit(T::Upper as usize, "m"), unit(T::Lower as usize, "m"), unit(T::Stiffness as usize, "N/m"), unit(T::Damping as usize, "N s/m")],
);
const RAM_LOAD: [Variable; LOAD.len()] = relabelled(
    LOAD,
    &[
        change(D::Inertia as usize, "mass", "kg", "mass of the load side"),
        change(D::Stiffness as usize, "", "N/m", "spring on the load side, force proportional to the load's position"),
        unit(D::SpringZero as usize, "m"),
        unit(D::Damping as usize, "N s/m"),
        unit(D::Friction as usize, "N"),
        change(D::Constant as usize, "", "N", "constant load on the load side, such as a weight; positive opposes extension"),
    ],
);
const RAM_CONTROL: [Variable; CONTROL.len()] = relabelled(
    CONTROL,
    &[
        unit(C::PositionGain as usize, "rad/(m s)"),
        unit(C::AntiWindupThreshold as usize, "m"),
        unit(C::NoiseDeviation as usize, "m"),
        unit(C::PidGain as usize, "N"),
    ],
);
const RAM_ENCODER: [Variable; ENCODER.len()] = relabelled(
    ENCODER,
    &[
        change(E::Pulses as usize, "", "1/m", "pulses per metre of a linear scale on the load side"),
        change(E::WheelRatio as usize, "encoder.interpolation", "", "interpolation between the scale's pulses"),
        unit(E::Offset as usize, "m"),
    ],
);

const RAM_TOOTH: [Variable; TOOTH.len()] = relabelled(
    TOOTH,
    &[
        change(W::ToothWear as usize, "", "m", "healthy 0; total backlash added where worn flanks slide most, measured at the ram"),
        change(W::ToothChip as usize, "", "m", "healthy 0; total backlash added while the chipped tooth carries, measured at the ram"),
    ],
);

groups! {
    over layout {
        gear: &RAM_GEAR;
        friction: &RAM_FRICTION;
        backlash: &RAM_BACKLASH;
        stop: &RAM_STOP;
        load: &RAM_LOAD;
        control: &RAM_CONTROL;
        encoder: &RAM_ENCODER;
        tooth: &RAM_TOOTH;
    }
    screw: "screw", SCREW, ScrewParameter;
    rating: "rating", RATING, RatingParameter;
    vibration: "vibration", VIBRATION, VibrationParameter;
}

pub const PORTS: &[Port] = &[
    Port {
        name: layout::PORTS[COMMAND].name,
        unit: "m",
        text: "position, speed or torque command (m at the ram, rad/s or N m at the motor)",
        parameter: "",
    },
    Port { name: "brake", unit: "N", text: "resistive force on the load side: opposes motion of either direction", parameter: "" },
    Port { name: "shaft", unit: "N m", text: "signed torque on the motor shaft, positive opposes positive motion", parameter: "" },
    Port { name: "output", unit: "N", text: "signed force on the load side, positive (compressive) opposes extension", parameter: "" },
    layout::PORTS[SUPPLY],
    layout::PORTS[AMBIENT],
];

const fn signal(name: &'static str, unit: &'static str, text: &'static str) -> Signal {
    Signal { name, symbol: "-", unit, text, role: None }
}

const RAM_POSITION: Signal = signal("ram_position", "m", "ram position, on the nut's side of the backlash");
const RAM_SPEED: Signal = signal("ram_speed", "m/s", "ram speed, on the nut's side of the backlash");
const SCREW_TORQUE: Signal = signal("screw_torque", "N m", "force through the nut, referred to the motor shaft without losses");
const EFFICIENCY: Signal = signal("screw_efficiency", "1", "applied efficiency under a load that opposes motion");
const EFFICIENCY_AIDING: Signal = signal("screw_efficiency_aiding", "1", "applied efficiency under a load that aids motion");
const NUT: [Signal; 2] = [
    Signal { role: Some(Role::NutTemperature), ..signal("nut_temperature", "K", "temperature of the nut") },
    signal("heat_nut", "W", "friction heat that stays in the nut, mean of the network's last tick"),
];
const HIGH_SPECIFIC: &[Signal] = &[
    RAM_POSITION,
    RAM_SPEED,
    signal("load_friction_force", "N", "friction and damping of the load side, the brake's force included"),
    SCREW_TORQUE,
    signal("spall_torque", "N m", "torque of balls falling into spalls, positive drives forwards"),
    EFFICIENCY,
    EFFICIENCY_AIDING,
    NUT[0],
    NUT[1],
    Signal {
        role: Some(Role::Vibration),
        ..signal("vibration", "m/s2", "acceleration that the accelerometer on the screw's housing measures")
    },
];
const LOW_SPECIFIC: &[Signal] = &[
    RAM_POSITION,
    RAM_SPEED,
    SCREW_TORQUE,
    EFFICIENCY,
    EFFICIENCY_AIDING,
    signal("circuit_current", "A", "current of the printed L-R circuit, sqrt(3/2) i_q: its I^2 R is the heat of all phases"),
    signal("circuit_voltage", "V", "voltage of the printed L-R circuit, sqrt(3/2) v_q"),
    NUT[0],
    NUT[1],
];

/// The signals of a servo that are others where the output travels: command, position, speed, brake and encoder.
const fn travelling([command, position, speed, brake, encoder]: [usize; 5]) -> [Relabel; 5] {
    [
        change(command, "", "m", "command with its noise (m at the ram, rad/s or N m by the control mode)"),
        change(position, "", "m", "position of the load side"),
        change(speed, "", "m/s", "speed of the load side"),
        change(brake, "brake_force", "N", "force the brake can oppose on the load side"),
        change(encoder, "", "m", "load position the encoder reports"),
    ]
}

const FORCES: &[Relabel] = &[
    change(H::OutputTorque as usize, "load_force", "N", "signed load on the load side, spring included"),
    change(H::TransmissionTorque as usize, "joint_force", "N", "force through the joint between ram and load: what the load cell reports"),
];

pub const HIGH: &[Signal] = &extended::<{ signals::HIGH.len() + HIGH_SPECIFIC.len() }>(
    &extended::<{ signals::HIGH.len() }>(
        signals::HIGH,
        &travelling([
            H::Command as usize,
            H::OutputPosition as usize,
            H::OutputSpeed as usize,
            H::BrakeTorque as usize,
            H::EncoderPosition as usize,
        ]),
        &[],
    ),
    FORCES,
    HIGH_SPECIFIC,
);
pub const LOW: &[Signal] = &extended::<{ signals::LOW.len() + LOW_SPECIFIC.len() }>(
    signals::LOW,
    &travelling([
        L::Command as usize,
        L::OutputPosition as usize,
        L::OutputSpeed as usize,
        L::BrakeTorque as usize,
        L::EncoderPosition as usize,
    ]),
    LOW_SPECIFIC,
);

fn finding(path: &str, value: f64, limit: f64, message: String) -> Finding {
    Finding::error(path, value, limit, message)
}

/// What a screw cannot be.
pub fn check(raw: &[f64]) -> Vec<Finding> {
    let g = |p: ScrewParameter| raw[p.at()];
    let mut out = Vec::new();
    let (ball, pitch) = (g(ScrewParameter::BallDiameter), g(ScrewParameter::PitchDiameter));
    if ball >= pitch {
        out.push(finding(
            "screw.ball_diameter",
            ball,
            pitch,
            format!("screw.ball_diameter: {ball} m is not below screw.pitch_diameter, {pitch} m"),
        ));
    }
    let (eta, aiding) = (g(ScrewParameter::Efficiency), g(ScrewParameter::EfficiencyAiding));
    if aiding > eta {
        out.push(finding(
            "screw.efficiency_aiding",
            aiding,
            eta,
            format!("screw.efficiency_aiding: {aiding} exceeds screw.efficiency, {eta}"),
        ));
    }
    counts(&mut out, raw);
    let ratio = raw[GearParameter::Ratio.at()];
    if ratio <= 0.0 {
        out.push(finding("gear.ratio", ratio, 0.0, format!("gear.ratio: {ratio} must be above 0")));
    }
    out
}

/// No more circuits are blocked than there are.
fn counts(out: &mut Vec<Finding>, raw: &[f64]) {
    let g = |p: ScrewParameter| raw[p.at()];
    let (circuits, blocked) = (g(ScrewParameter::Circuits), g(ScrewParameter::BlockedCircuits));
    if blocked > circuits {
        let message = format!("screw.blocked_circuits: {blocked} of the {circuits} in screw.circuits");
        out.push(finding("screw.blocked_circuits", blocked, circuits, message));
    }
}
