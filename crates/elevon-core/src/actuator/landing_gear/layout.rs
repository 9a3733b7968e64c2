//! The parameters of the landing-gear actuator: the groups of its components, and where each begins.

use crate::actuator::Port;
use crate::control::pi_rate::{PiRateParameter, PI_RATE};
use crate::control::sequence::{SequenceParameter, SEQUENCE};
use crate::inverter::bridge::{InverterParameter, INVERTER};
use crate::inverter::six_step::{SixStepParameter, SIX_STEP};
use crate::inverter::supply::{SupplyParameter, SUPPLY as LINK};
use crate::motor::star::{MotorParameter, MOTOR};
use crate::sensor::hall::{HallParameter, HALL};
use crate::sensor::proximity::{ProximityParameter, PROXIMITY};
use crate::transmission::brake::{BrakeParameter, BRAKE};
use crate::transmission::lever::{LegParameter, LeverParameter, LEG, LEVER};
use crate::transmission::lock::{LockParameter, LOCK};
use crate::transmission::lubricant::{LubricantParameter, LUBRICANT};
use crate::transmission::planetary::{PlanetaryParameter, ReleaseParameter, PLANETARY, RELEASE};
use crate::transmission::roller_screw::{ScrewParameter, SCREW};
use crate::transmission::train_friction::{TrainFrictionParameter, TRAIN_FRICTION};
use crate::variable::acts::{self, Acts, When};
use crate::variable::{relabelled, Relabel, Variable};
use crate::{groups, variables};

variables! {
    /// The shaft of the motor.
    ShaftParameter, SHAFT {
        DetentTorque => "detent_torque", "T_mc", "N m", NonNegative, Plant, Some(0.0), "amplitude of the detent torque";
        DetentPeriods => "detent_periods", "n", "1", AtLeast(1.0), Plant, Some(1.0), "periods of the detent torque per turn";
        BearingTorque => "bearing_torque", "-", "N m", NonNegative, Plant, Some(0.0), "dry friction of worn bearings; healthy 0";
    }
}

/// Knots of the load curve.
pub const LOADS: usize = 9;

variables! {
    // The curve is read as a slice from its first value.
    #[allow(dead_code)]
    /// Load of the leg on the ram at load factor 1, at nine even positions of the stroke; it pushes towards extension.
    LoadCurveParameter, LOAD_CURVE {
        Factor => "factor", "N_z", "1", NonNegative, Load, Some(1.0), "load factor on the load curve";
        Force0 => "force_0", "F_ext", "N", Any, Load, None, "load at the retracted end";
        Force1 => "force_1", "F_ext", "N", Any, Load, None, "load at 1/8 of the stroke";
        Force2 => "force_2", "F_ext", "N", Any, Load, None, "load at 2/8 of the stroke";
        Force3 => "force_3", "F_ext", "N", Any, Load, None, "load at 3/8 of the stroke";
        Force4 => "force_4", "F_ext", "N", Any, Load, None, "load at 4/8 of the stroke";
        Force5 => "force_5", "F_ext", "N", Any, Load, None, "load at 5/8 of the stroke";
        Force6 => "force_6", "F_ext", "N", Any, Load, None, "load at 6/8 of the stroke";
        Force7 => "force_7", "F_ext", "N", Any, Load, None, "load at 7/8 of the stroke";
        Force8 => "force_8", "F_ext", "N", Any, Load, None, "load at the extended end";
    }
}

variables! {
    /// The lubricant's temperature: nothing here warms it.
    LubricantStateParameter, LUBRICANT_STATE {
        Temperature => "temperature", "T_l", "K", Positive, Plant, Some(293.15), "temperature of the lubricant, where no input `ambient` sets it",
            when(&[Either(&[Away("lubricant.viscosity_rate", 0.0), Away("lubricant.loss_rate", 0.0), Away("lubricant.dry_rate", 0.0)])]);
    }
}

variables! {
    /// The load cell of the friction rig.
    CellParameter, CELL {
        LoadCellNoise => "load_cell_noise", "-", "N", NonNegative, Sensor, Some(0.0), "standard deviation of the load cell's noise, held over a control period";
    }
}

variables! {
    /// The reduced-order model.
    LowParameter, LOW {
        Step => "step", "dt_low", "s", Between(1e-12, 1.0), Solver, Some(2e-5), "solver step of the reduced-order model",
            low_only("it has solver.step");
        CommutationFactor => "commutation_factor", "c", "1", NonNegative, Plant, Some(1.1), "mean torque loss of the commutations as a resistance c p |w| L",
            low_only("it has the commutations themselves");
    }
}

variables! {
    /// The fixed-step solver of the switching model.
    SolverParameter, SOLVER {
        Step => "step", "dt", "s", Between(1e-12, 1.0), Solver, Some(1e-6), "solver step of the electrical part",
            high_only("it has low.step");
        MechanicalStep => "mechanical_step", "-", "s", Between(1e-12, 1.0), Solver, Some(1e-5), "step of speeds, friction and lock: a whole number of electrical steps",
            high_only("it has low.step for all");
        FaultGrid => "fault_grid", "-", "s", Between(1e-12, 1e6), Solver, Some(1e-3), "smooth fault profiles are held over this time";
    }
}

/// What this actuator's motor and bridge have otherwise than a servo's.
const GEAR_MOTOR: [Variable; MOTOR.len()] = relabelled(
    MOTOR,
    &[
        Relabel::acts(MotorParameter::EmfShape as usize, acts::ALWAYS),
        Relabel::acts(MotorParameter::EmfFlatWidth as usize, acts::when(&[When::Chosen("motor.emf_shape", &["trapezoidal"])])),
        Relabel::acts(MotorParameter::ElectricalOffset as usize, acts::ALWAYS),
        Relabel::acts(MotorParameter::ShortModel as usize, REDUCED),
        Relabel::acts(MotorParameter::ShortCoupling as usize, REDUCED),
        Relabel::acts(MotorParameter::ShortContactResistance as usize, REDUCED),
    ],
);
const REDUCED: Acts = acts::nowhere("this actuator has the reduced model of shorted turns only");

const GEAR_INVERTER: [Variable; INVERTER.len()] = {
    use InverterParameter as P;
    const SHORTED: Acts = acts::high_only("its conducting pair has no single switches");
    relabelled(
        INVERTER,
        &[
            Relabel::acts(
                P::HysteresisBand as usize,
                acts::nowhere("its bridge is commutated by Hall sensors and a carrier, not by relays"),
            ),
            Relabel::acts(P::TripCurrent as usize, acts::high_only("its mean current has no peaks to trip on")),
            Relabel::acts(P::DeadTime as usize, acts::high_only("its mean voltages have no switches")),
            Relabel::acts(P::OnResistance as usize, acts::ALWAYS),
            Relabel::acts(P::DiodeDrop as usize, acts::ALWAYS),
            Relabel::acts(P::ShortedAHigh as usize, SHORTED),
            Relabel::acts(P::ShortedALow as usize, SHORTED),
            Relabel::acts(P::ShortedBHigh as usize, SHORTED),
            Relabel::acts(P::ShortedBLow as usize, SHORTED),
            Relabel::acts(P::ShortedCHigh as usize, SHORTED),
            Relabel::acts(P::ShortedCLow as usize, SHORTED),
        ],
    )
};

groups! {
    motor: "motor", &GEAR_MOTOR, MotorParameter;
    shaft: "motor", SHAFT, ShaftParameter;
    inverter: "inverter", &GEAR_INVERTER, InverterParameter;
    six_step: "inverter", SIX_STEP, SixStepParameter;
    supply: "supply", LINK, SupplyParameter;
    gear: "gear", PLANETARY, PlanetaryParameter;
    screw: "screw", SCREW, ScrewParameter;
    lever: "lever", LEVER, LeverParameter;
    leg: "leg", LEG, LegParameter;
    load: "load", LOAD_CURVE, LoadCurveParameter;
    friction: "friction", TRAIN_FRICTION, TrainFrictionParameter;
    lubricant_state: "lubricant", LUBRICANT_STATE, LubricantStateParameter;
    lubricant: "lubricant", LUBRICANT, LubricantParameter;
    brake: "brake", BRAKE, BrakeParameter;
    lock: "lock", LOCK, LockParameter;
    release: "release", RELEASE, ReleaseParameter;
    pi_rate: "control", PI_RATE, PiRateParameter;
    sequence: "control", SEQUENCE, SequenceParameter;
    proximity: "proximity", PROXIMITY, ProximityParameter;
    hall: "hall", HALL, HallParameter;
    cell: "sensor", CELL, CellParameter;
    low: "low", LOW, LowParameter;
    solver: "solver", SOLVER, SolverParameter;
}

pub const PORTS: &[Port] = &[
    Port {
        name: "command",
        unit: "1",
        text: "0 stop, 1 extend, 2 retract, 3 free fall, held until the next one; 4 more repeats the one before",
        parameter: "",
    },
    Port { name: "output", unit: "N", text: "signed load on the ram besides the leg's, positive opposes extension", parameter: "" },
    Port { name: "supply", unit: "V", text: "voltage of the source", parameter: "inverter.supply_voltage" },
    Port { name: "weight_on_wheels", unit: "1", text: "1: the aircraft stands on its wheels", parameter: "" },
    Port { name: "rig_speed", unit: "m/s", text: "speed that the friction rig imposes on the ram, in place of the leg", parameter: "" },
    Port {
        name: "ambient",
        unit: "K",
        text: "temperature of the air, which the lubricant has, held over 10 ms",
        parameter: "lubricant.temperature",
    },
];

pub const COMMAND: usize = 0;
pub const OUTPUT: usize = 1;
pub const SUPPLY: usize = 2;
pub const WHEELS: usize = 3;
pub const RIG: usize = 4;
pub const AMBIENT: usize = 5;
