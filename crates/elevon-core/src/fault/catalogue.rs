//! The form in which a wiring lists its faults.

use super::rate::Rate;
use crate::variable::acts::{records, Fidelity};
use crate::variable::{Group, Range};

/// What a severity `s` does to a parameter `x`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Op {
    /// x (1 - s): a fraction lost.
    Lose,
    /// x (1 + s): a fraction added.
    Grow,
    /// x + s.
    Add,
    /// x + the whole part of s: things that are counted.
    AddWhole,
    /// A switch: 1 from s = 1/2 on, else x.
    Set,
    /// 1 during the fraction s of each period (attribute `period`), cut to whole steps, else x.
    Pulse,
}

impl Op {
    /// What acts of a severity: labels state this.
    pub fn acting(self, severity: f64) -> f64 {
        match self {
            Self::AddWhole => severity.floor(),
            Self::Set => f64::from(u8::from(severity >= 0.5)),
            Self::Lose | Self::Grow | Self::Add | Self::Pulse => severity,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Target {
    pub path: &'static str,
    pub op: Op,
}

#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub name: &'static str,
    pub targets: &'static [Target],
}

/// The places of a fault: `"name": "path" op, ...`, a target each. Behind `each [a b ...]` both are beginnings, which go with each
/// of the endings.
#[macro_export]
macro_rules! places {
    (each [$($end:ident)*] $name:literal: $path:literal $op:ident) => {
        $crate::places!($(concat!($name, stringify!($end)) => concat!($path, stringify!($end)), $op);*)
    };
    ($($name:expr => $path:expr, $op:ident);*) => {{
        const PLACES: &[$crate::fault::Place] =
            &[$($crate::fault::Place { name: $name, targets: &[$crate::fault::Target { path: $path, op: $crate::fault::Op::$op }] }),*];
        PLACES
    }};
    ($($name:literal: $path:literal $op:ident),* $(,)?) => { $crate::places!($($name => $path, $op);*) };
}

/// The places of a fault of a phase.
#[macro_export]
macro_rules! phases {
    ($name:literal: $path:literal $op:ident) => {
        $crate::places!(each [a b c] $name: $path $op)
    };
}

/// A further number of a fault. It sets the parameter `path` (if any) when given; `flag` is a parameter set to
/// zero because the attribute was given.
#[derive(Clone, Copy, Debug)]
pub struct Attribute {
    pub name: &'static str,
    pub unit: &'static str,
    pub default: Option<f64>,
    pub path: &'static str,
    pub flag: &'static str,
    pub text: &'static str,
}

impl Attribute {
    /// One that has to be given.
    pub const fn new(name: &'static str, unit: &'static str, path: &'static str, text: &'static str) -> Self {
        Self { name, unit, default: None, path, flag: "", text }
    }
}

/// One line of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct FaultKind {
    pub kind: &'static str,
    pub unit: &'static str,
    pub range: Range,
    pub places: &'static [Place],
    pub attributes: &'static [Attribute],
    pub effect: &'static str,
    pub source: &'static str,
    pub rate: Rate,
}

impl FaultKind {
    /// Is the severity a count?
    pub fn counted(&self) -> bool {
        self.moves_by(Op::AddWhole)
    }

    /// Is it a switch: not there below half the severity, whole from there on?
    pub fn switched(&self) -> bool {
        self.moves_by(Op::Set)
    }

    fn moves_by(&self, op: Op) -> bool {
        self.places.iter().flat_map(|p| p.targets).any(|t| t.op == op)
    }

    /// Why a fidelity of an actuator of these parameters does not carry the fault, if so: it acts where the parameters act
    /// that it moves.
    pub fn not_modelled(&self, groups: &[Group], fidelity: Fidelity) -> Option<&'static str> {
        let moved = |path: &str| self.places.iter().flat_map(|p| p.targets).any(|t| t.path == path);
        records(groups).filter(|(path, _)| moved(path)).find_map(|(_, v)| v.acts.not_modelled(fidelity))
    }
}
