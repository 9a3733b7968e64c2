//! The parameters of a servo: the groups of its components, and where each begins.

use crate::actuator::Port;
use crate::control::current_dq::{PwmParameter, PWM};
use crate::control::position_speed::{ControlParameter, CONTROL};
use crate::inverter::bridge::{InverterParameter, INVERTER};
use crate::motor::equivalent::{LowParameter, LOW};
use crate::motor::star::{MotorParameter, MOTOR};
use crate::motor::tap::{TapParameter, TAP};
use crate::motor::thermal::{ThermalParameter, THERMAL};
use crate::motor::unbalance::{UnbalanceParameter, UNBALANCE};
use crate::sensor::current::{CurrentSensorParameter, CURRENT_SENSOR};
use crate::sensor::encoder::{EncoderParameter, ENCODER};
use crate::sensor::resolver::{ResolverParameter, RESOLVER};
use crate::transmission::friction::{FrictionParameter, FRICTION};
use crate::transmission::gear::{GearParameter, LoadParameter, StopParameter, GEAR, LOAD, STOP};
use crate::transmission::play::{PlayParameter, PLAY};
use crate::variable::{offset, Group};
use crate::variables;

variables! {
    /// Which drive feeds the motor.
    DriveParameter, DRIVE {
        Kind => "kind", "-", "1", Choice(&["hysteresis", "pwm", "off"]), Plant, Some(0.0), "three hysteresis relays (the papers' model), a carrier-PWM current controller (the real bench), or no drive: the motor is turned by torques on its shaft alone";
        Commutation => "commutation", "-", "1", Choice(&["sinusoidal", "six_step"]), Controller, Some(0.0), "shape of the phase current references over the electrical angle (hysteresis drive)";
        CommutationSource => "commutation_source", "-", "1", Choice(&["resolver", "separate"]), Controller, Some(0.0), "angle of the references: the resolver's, or a track of its own that a lost resolver does not touch";
        FeedbackLoss => "feedback_loss", "-", "1", Choice(&["run", "stop"]), Controller, Some(0.0), "without resolver power the drive runs on with what it is shown, or opens its bridge until it returns";
    }
}

variables! {
    /// The fixed-step solver.
    SolverParameter, SOLVER {
        Step => "step", "dt", "s", Positive, Solver, Some(1e-6), "solver step of the high fidelity";
        Method => "method", "-", "1", Choice(&["explicit", "semi_implicit"]), Solver, Some(0.0), "explicit Euler (the papers), or semi-implicit: positions move with the new speed";
        FaultGrid => "fault_grid", "-", "s", Positive, Solver, Some(1e-3), "smooth fault profiles are held over this time";
    }
}

pub const fn group(prefix: &'static str, variables: &'static [crate::variable::Variable]) -> Group {
    Group { prefix, variables }
}

pub const GROUPS: &[Group] = &[
    group("motor", MOTOR),
    group("gear", GEAR),
    group("friction", FRICTION),
    group("play", PLAY),
    group("stop", STOP),
    group("load", LOAD),
    group("drive", DRIVE),
    group("inverter", INVERTER),
    group("pwm", PWM),
    group("control", CONTROL),
    group("sensor", CURRENT_SENSOR),
    group("sensor", ENCODER),
    group("sensor", RESOLVER),
    group("low", LOW),
    group("solver", SOLVER),
    group("thermal", THERMAL),
    group("motor", TAP),
    group("motor", UNBALANCE),
];

/// A view of the parameter vector by component.
#[derive(Clone, Copy)]
pub struct Raw<'a, S>(pub &'a [S]);

macro_rules! views {
    ($($name:ident $index:literal $id:ident),*) => {
        impl<'a, S> Raw<'a, S> {
            // Some components are read by single numbers only.
            $(#[allow(dead_code)] pub fn $name(self) -> &'a [S] {
                const AT: usize = offset(GROUPS, $index);
                &self.0[AT..AT + GROUPS[$index].variables.len()]
            })*
        }
        $(impl At for $id {
            fn at(self) -> usize {
                const AT: usize = offset(GROUPS, $index);
                AT + self as usize
            }
        })*
    };
}

/// Index in the whole parameter vector.
pub trait At {
    fn at(self) -> usize;
}

views!(
    motor 0 MotorParameter, gear 1 GearParameter, friction 2 FrictionParameter, play 3 PlayParameter,
    stop 4 StopParameter, load 5 LoadParameter, drive 6 DriveParameter, inverter 7 InverterParameter,
    pwm 8 PwmParameter, control 9 ControlParameter, current_sensor 10 CurrentSensorParameter,
    encoder 11 EncoderParameter, resolver 12 ResolverParameter, low 13 LowParameter, solver 14 SolverParameter,
    thermal 15 ThermalParameter, tap 16 TapParameter, unbalance 17 UnbalanceParameter
);

pub const PORTS: &[Port] = &[
    Port {
        name: "command",
        unit: "rad",
        text: "position, speed or torque command (rad at the user, rad/s or N m at the fast shaft)",
        parameter: "",
    },
    Port { name: "brake", unit: "N m", text: "resistive torque on the fast shaft", parameter: "" },
    Port { name: "shaft", unit: "N m", text: "signed torque on the fast shaft, positive opposes positive motion", parameter: "" },
    Port { name: "user", unit: "N m", text: "signed torque on the user side, positive opposes positive motion", parameter: "" },
    Port { name: "supply", unit: "V", text: "DC link voltage", parameter: "inverter.supply_voltage" },
];

pub const COMMAND: usize = 0;
pub const BRAKE: usize = 1;
pub const SHAFT: usize = 2;
pub const USER: usize = 3;
pub const SUPPLY: usize = 4;
