//! The wirings by name, and one entry for each thing a caller may request of any of them.

use crate::actuator::{ballscrew, landing_gear, rotary, Finding, Machine, Port, Wiring};
use crate::fault::{FaultKind, FaultSpec};
use crate::scalar::fused;
use crate::solver::{self, Clock, Embedded, Live, Monitor, RunOutput, RunSpec, Width};
use crate::variable::acts::{Fidelity, Standing};
use crate::variable::{Group, Signal};

/// A wiring of one fidelity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    RotaryHigh,
    RotaryLow,
    BallscrewHigh,
    BallscrewLow,
    LandingGearHigh,
    LandingGearLow,
}

/// A kind of actuator and its fidelities.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    pub name: &'static str,
    pub text: &'static str,
    pub fidelities: &'static [(&'static str, Model)],
}

/// Every kind of actuator.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "rotary",
        text: "three-phase motor, inverter, gearbox with friction and backlash",
        fidelities: &[("high", Model::RotaryHigh), ("low", Model::RotaryLow)],
    },
    Kind {
        name: "ballscrew",
        text: "three-phase motor, inverter, ball screw, ram with backlash and a load side of its own",
        fidelities: &[("high", Model::BallscrewHigh), ("low", Model::BallscrewLow)],
    },
    Kind {
        name: "landing_gear",
        text: "six-step motor, planetary gearbox with release, roller screw, down-lock, leg on a lever, control unit",
        fidelities: &[("high", Model::LandingGearHigh), ("low", Model::LandingGearLow)],
    },
];

macro_rules! dispatch {
    ($model:expr, $w:ident => $body:expr) => {
        match $model {
            Model::RotaryHigh => {
                type $w = rotary::High;
                $body
            }
            Model::RotaryLow => {
                type $w = rotary::Low;
                $body
            }
            Model::BallscrewHigh => {
                type $w = ballscrew::High;
                $body
            }
            Model::BallscrewLow => {
                type $w = ballscrew::Low;
                $body
            }
            Model::LandingGearHigh => {
                type $w = landing_gear::High;
                $body
            }
            Model::LandingGearLow => {
                type $w = landing_gear::Low;
                $body
            }
        }
    };
}

impl Model {
    /// How many there are.
    pub const COUNT: usize = Self::LandingGearLow as usize + 1;

    pub fn find(kind: &str, fidelity: &str) -> Option<Self> {
        let kind = KINDS.iter().find(|k| k.name == kind)?;
        kind.fidelities.iter().find(|f| f.0 == fidelity).map(|f| f.1)
    }
    pub fn groups(self) -> &'static [Group] {
        dispatch!(self, W => W::groups())
    }
    pub fn signals(self) -> &'static [Signal] {
        dispatch!(self, W => W::signals())
    }
    pub fn ports(self) -> &'static [Port] {
        dispatch!(self, W => W::PORTS)
    }
    /// Ports that set their parameter.
    pub fn held_ports(self) -> &'static [usize] {
        dispatch!(self, W => <<W as Wiring>::Machine as Machine>::HELD_PORTS)
    }
    pub fn initial(self) -> &'static [&'static str] {
        dispatch!(self, W => W::INITIAL)
    }
    pub fn modes(self) -> &'static [&'static str] {
        dispatch!(self, W => <<W as Wiring>::Machine as Machine>::MODES)
    }
    /// Units of the command in each mode; empty: the command port's own.
    pub fn mode_units(self) -> &'static [&'static str] {
        dispatch!(self, W => <<W as Wiring>::Machine as Machine>::MODE_UNITS)
    }
    pub fn actions(self) -> &'static [&'static str] {
        dispatch!(self, W => <<W as Wiring>::Machine as Machine>::ACTIONS)
    }
    pub fn fidelity(self) -> Fidelity {
        match self {
            Self::RotaryHigh | Self::BallscrewHigh | Self::LandingGearHigh => Fidelity::High,
            Self::RotaryLow | Self::BallscrewLow | Self::LandingGearLow => Fidelity::Low,
        }
    }
    /// The faults of the actuator, whatever the fidelity.
    pub fn catalogue(self) -> Vec<FaultKind> {
        dispatch!(self, W => W::faults())
    }
    /// The faults that this fidelity carries.
    pub fn faults(self) -> Vec<FaultKind> {
        let (groups, fidelity) = (self.groups(), self.fidelity());
        self.catalogue().into_iter().filter(|f| f.not_modelled(groups, fidelity).is_none()).collect()
    }
    /// The parameters that do not act in a run with these values and faults, and why.
    pub fn not_acting(self, raw: &[f64], faults: &[FaultSpec], paths: Option<&[String]>) -> Vec<(String, String)> {
        let mut touched = vec![false; raw.len()];
        for index in faults.iter().flat_map(FaultSpec::moved) {
            touched[index] = true;
        }
        Standing { groups: self.groups(), raw, touched: &touched, fidelity: self.fidelity() }.not_acting(paths)
    }
    pub fn check(self, raw: &[f64]) -> Vec<Finding> {
        dispatch!(self, W => W::check(raw))
    }
    /// Findings on the parameters with every fault at its whole severity.
    pub fn check_faulted(self, raw: &[f64]) -> Vec<Finding> {
        dispatch!(self, W => W::check_faulted(raw))
    }
    /// Why a run cannot start from these values together.
    pub fn refuses_start(self, raw: &[f64], initial: &[f64]) -> Option<String> {
        dispatch!(self, W => W::refuses_start(raw, initial))
    }
    pub fn step(self, raw: &[f64]) -> f64 {
        dispatch!(self, W => W::step(raw))
    }
    pub fn run_all(self, runs: &[RunSpec], clocks: &[Clock], threads: usize, width: Width, monitor: &Monitor) -> Vec<RunOutput> {
        dispatch!(self, W => solver::run_all::<W>(runs, clocks, threads, width, monitor))
    }
    /// Runs that go on from call to call, in blocks: which runs each holds, and the block.
    pub fn live(self, runs: &[RunSpec], recorded: &[usize], width: Width) -> Vec<(Vec<usize>, Box<dyn Live>)> {
        dispatch!(self, W => solver::live::<W>(runs, recorded, width))
    }
    /// A run by itself for whoever embeds it, in plain numbers; none where the processor has no fused multiply-add for them.
    pub fn embedded(self, run: RunSpec, recorded: &[usize]) -> Option<Box<dyn Embedded>> {
        fused().then(|| dispatch!(self, W => solver::embedded::<W>(run, recorded)))
    }
    /// Low fidelities without a state machine only: switching has no useful derivative.
    pub fn sensitivities(
        self,
        run: &RunSpec,
        parameters: &[usize],
        faults: &[usize],
        clocks: &[Clock],
        monitor: &Monitor,
    ) -> Option<Vec<RunOutput>> {
        match self {
            Self::RotaryLow => Some(solver::sensitivities::<rotary::Low>(run, parameters, faults, clocks, monitor)),
            Self::BallscrewLow => Some(solver::sensitivities::<ballscrew::Low>(run, parameters, faults, clocks, monitor)),
            Self::RotaryHigh | Self::BallscrewHigh | Self::LandingGearHigh | Self::LandingGearLow => None,
        }
    }
}
