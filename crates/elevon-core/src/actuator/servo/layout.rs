//! The parameters of a servo: the groups of its components, and where each begins.

use crate::actuator::Port;
use crate::control::current_dq::{PwmParameter, PWM};
use crate::control::limits::{LimitParameter, LIMITS};
use crate::control::position_speed::{ControlParameter, CONTROL};
use crate::inverter::bridge::{InverterParameter, INVERTER};
use crate::inverter::hysteresis::{RelayParameter, RELAYS};
use crate::inverter::link::{LinkParameter, LINK};
use crate::inverter::losses::{DriveHeatParameter, SwitchingParameter, DRIVE_HEAT, SWITCHING};
use crate::motor::cogging::{CoggingParameter, COGGING};
use crate::motor::equivalent::{LowParameter, LOW};
use crate::motor::flux_map::{FluxMapParameter, FLUX_MAP};
use crate::motor::iron_loss::{IronLossParameter, IRON_LOSS};
use crate::motor::magnetic_pull::{MagneticPullParameter, MAGNETIC_PULL};
use crate::motor::pole::{PoleParameter, POLE};
use crate::motor::rub::{RubParameter, RUB};
use crate::motor::short::{ShortParameter, TapParameter, SHORT, TAP};
use crate::motor::star::{MotorParameter, MOTOR};
use crate::motor::thermal::{ThermalParameter, THERMAL};
use crate::motor::unbalance::{UnbalanceParameter, UNBALANCE};
use crate::sensor::current::{CurrentSensorParameter, CURRENT_SENSOR};
use crate::sensor::encoder::{EncoderParameter, ENCODER};
use crate::sensor::resolver::{ResolverParameter, RESOLVER};
use crate::transmission::backlash::{BacklashParameter, BACKLASH};
use crate::transmission::bearing::{BearingParameter, BEARING};
use crate::transmission::friction::{FrictionParameter, FRICTION};
use crate::transmission::friction_law::{FrictionLawParameter, FRICTION_LAW};
use crate::transmission::gear::{GearParameter, LoadParameter, StopParameter, GEAR, LOAD, STOP};
use crate::transmission::lubricant::{LubricantParameter, LUBRICANT};
use crate::transmission::tooth::{ToothParameter, TOOTH};
use crate::variable::acts::{when, When};
use crate::variable::{relabelled, Relabel, Variable};
use crate::{choices, groups, variables};

choices! {
    DriveKind { Hysteresis "hysteresis", Pwm "pwm", Off "off" }
    Commutation { Sinusoidal "sinusoidal", SixStep "six_step" }
    CommutationSource { Resolver "resolver", Separate "separate" }
    FeedbackLoss { Run "run", Stop "stop" }
    Method { Explicit "explicit", SemiImplicit "semi_implicit" }
}

variables! {
    /// Which drive feeds the motor.
    DriveParameter, DRIVE {
        Kind => "kind", "-", "1", Choice(DriveKind::NAMES), Plant, Some(0.0), "three hysteresis relays (the papers' model), a carrier-PWM current controller (the real bench), or no drive: the motor is turned by torques on its shaft alone";
        Commutation => "commutation", "-", "1", Choice(Commutation::NAMES), Controller, Some(0.0), "shape of the phase current references over the electrical angle (hysteresis drive)",
            when(&[Chosen("drive.kind", &["hysteresis"])]);
        CommutationSource => "commutation_source", "-", "1", Choice(CommutationSource::NAMES), Controller, Some(0.0), "angle (and its rate) that the current references, and the current controller of a carrier drive, turn with: the resolver's, or a track of its own that a lost or offset resolver does not touch",
            when(&[Either(&[
                Away("sensor.resolver.mismatch", 0.0), Away("sensor.resolver.offset", 0.0), Away("sensor.resolver.power_off", 0.0),
                Away("sensor.resolver.sine_short", 0.0), Away("sensor.resolver.cosine_short", 0.0), Away("sensor.resolver.excitation_short", 0.0),
                Away("sensor.resolver.sine_open", 0.0), Away("sensor.resolver.cosine_open", 0.0), Away("sensor.resolver.stuck", 0.0),
                Away("sensor.resolver.quadrature", 0.0), Away("sensor.resolver.sine_offset", 0.0), Away("sensor.resolver.cosine_offset", 0.0),
                Away("sensor.resolver.noise_deviation", 0.0),
            ])]);
        FeedbackLoss => "feedback_loss", "-", "1", Choice(FeedbackLoss::NAMES), Controller, Some(0.0), "without resolver power the drive runs on with the last reading, or opens its bridge until it returns",
            when(&[Either(&[
                Away("sensor.resolver.power_off", 0.0), Away("sensor.resolver.sine_short", 0.0), Away("sensor.resolver.cosine_short", 0.0),
                Away("sensor.resolver.excitation_short", 0.0), Away("sensor.resolver.sine_open", 0.0), Away("sensor.resolver.cosine_open", 0.0),
            ])]);
    }
}

variables! {
    /// The fixed-step solver.
    SolverParameter, SOLVER {
        Step => "step", "dt", "s", Between(1e-12, 1.0), Solver, Some(1e-6), "solver step of the switching model",
            high_only("it has low.step");
        Method => "method", "-", "1", Choice(Method::NAMES), Solver, Some(0.0), "explicit Euler (the papers), or semi-implicit: positions move with the new speed",
            high_only("it is semi-implicit");
        FaultGrid => "fault_grid", "-", "s", Between(1e-12, 1e6), Solver, Some(1e-3), "smooth fault profiles are held over this time";
    }
}

/// Which friction there is for the temperature of motor and transmission to change.
const GREASE: [Variable; LUBRICANT.len()] = relabelled(
    LUBRICANT,
    &[
        Relabel::acts(LubricantParameter::ViscosityRate as usize, when(&[When::Away("friction.viscous", 0.0)])),
        Relabel::acts(
            LubricantParameter::ViscosityExponent as usize,
            when(&[When::Away("lubricant.viscosity_rate", 0.0), When::Away("friction.viscous", 0.0)]),
        ),
        Relabel::acts(
            LubricantParameter::LossRate as usize,
            when(&[When::Either(&[
                When::Away("gear.efficiency", 1.0),
                When::Away("gear.efficiency_aiding", 1.0),
                When::Away("screw.efficiency", 1.0),
                When::Away("screw.efficiency_aiding", 1.0),
            ])]),
        ),
    ],
);

groups! {
    motor: "motor", MOTOR, MotorParameter;
    gear: "gear", GEAR, GearParameter;
    friction: "friction", FRICTION, FrictionParameter;
    backlash: "backlash", BACKLASH, BacklashParameter;
    stop: "stop", STOP, StopParameter;
    load: "load", LOAD, LoadParameter;
    drive: "drive", DRIVE, DriveParameter;
    inverter: "inverter", INVERTER, InverterParameter;
    pwm: "pwm", PWM, PwmParameter;
    control: "control", CONTROL, ControlParameter;
    current_sensor: "sensor", CURRENT_SENSOR, CurrentSensorParameter;
    encoder: "sensor", ENCODER, EncoderParameter;
    resolver: "sensor", RESOLVER, ResolverParameter;
    low: "low", LOW, LowParameter;
    solver: "solver", SOLVER, SolverParameter;
    thermal: "thermal", THERMAL, ThermalParameter;
    tap: "motor", TAP, TapParameter;
    unbalance: "motor", UNBALANCE, UnbalanceParameter;
    friction_law: "friction", FRICTION_LAW, FrictionLawParameter;
    cogging: "motor", COGGING, CoggingParameter;
    magnetic_pull: "motor", MAGNETIC_PULL, MagneticPullParameter;
    bearing: "bearing", BEARING, BearingParameter;
    tooth: "gear", TOOTH, ToothParameter;
    relays: "inverter", RELAYS, RelayParameter;
    short: "motor", SHORT, ShortParameter;
    pole: "motor", POLE, PoleParameter;
    link: "inverter", LINK, LinkParameter;
    switching: "inverter", SWITCHING, SwitchingParameter;
    drive_heat: "thermal", DRIVE_HEAT, DriveHeatParameter;
    rub: "motor", RUB, RubParameter;
    lubricant: "lubricant", &GREASE, LubricantParameter;
    flux_map: "motor", FLUX_MAP, FluxMapParameter;
    iron_loss: "motor", IRON_LOSS, IronLossParameter;
    limits: "control", LIMITS, LimitParameter;
}

pub const PORTS: &[Port] = &[
    Port {
        name: "command",
        unit: "rad",
        text: "position, speed or torque command (rad at the output, rad/s or N m at the motor shaft)",
        parameter: "",
    },
    Port { name: "brake", unit: "N m", text: "resistive torque on the motor shaft", parameter: "" },
    Port { name: "shaft", unit: "N m", text: "signed torque on the motor shaft, positive opposes positive motion", parameter: "" },
    Port { name: "output", unit: "N m", text: "signed torque on the output side, positive opposes positive motion", parameter: "" },
    Port { name: "supply", unit: "V", text: "DC link voltage", parameter: "inverter.supply_voltage" },
    Port { name: "ambient", unit: "K", text: "temperature of the air, held over 10 ms", parameter: "thermal.ambient" },
];

pub const COMMAND: usize = 0;
pub const BRAKE: usize = 1;
pub const SHAFT: usize = 2;
pub const OUTPUT: usize = 3;
pub const SUPPLY: usize = 4;
pub const AMBIENT: usize = 5;
