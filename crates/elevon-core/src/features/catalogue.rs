//! Every feature: its name, unit, definition and the roles it needs.

use super::rows::{Role, Signal};
use super::{bands, friction, level, lost_motion, orders, phases, slow};
use std::sync::OnceLock;

/// A family of features that are summed up together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    Level(Signal),
    Friction,
    LostMotion,
    Orders(Signal),
    Phases,
    Bands(Signal),
    Temperature,
    Switching,
}

use Family::{Bands, Friction, Level, LostMotion, Orders, Phases, Switching, Temperature};

pub const FAMILIES: [Family; 15] = [
    Level(Signal::TrackingError),
    Level(Signal::TorqueCurrent),
    Level(Signal::MotorSpeed),
    Level(Signal::Vibration),
    Friction,
    LostMotion,
    Orders(Signal::TorqueCurrent),
    Orders(Signal::MotorSpeed),
    Phases,
    Bands(Signal::TrackingError),
    Bands(Signal::TorqueCurrent),
    Bands(Signal::MotorSpeed),
    Bands(Signal::Vibration),
    Temperature,
    Switching,
];

impl Family {
    pub fn name(self) -> &'static str {
        match self {
            Level(_) => "level",
            Friction => "friction",
            LostMotion => "transmission",
            Orders(_) => "orders",
            Phases => "phases",
            Bands(_) => "bands",
            Temperature => "temperature",
            Switching => "switching",
        }
    }

    pub fn roles(self) -> Vec<Role> {
        let moved = [Role::MotorPosition, Role::MotorSpeed];
        match self {
            Level(signal) | Bands(signal) => signal.roles().to_vec(),
            Friction => [&[Role::TorqueCurrent], &moved[..]].concat(),
            LostMotion => [&[Role::OutputPosition], &moved[..]].concat(),
            Orders(signal) => [signal.roles(), &[Role::MotorPosition]].concat(),
            Phases => vec![Role::CurrentA, Role::CurrentB, Role::CurrentC, Role::MotorPosition],
            Temperature => vec![Role::Temperature],
            Switching => vec![Role::Transitions],
        }
    }

    /// Names, units and definitions, in the order in which the family gives its values.
    fn outputs(self) -> Vec<(String, String, String)> {
        let owned = |r: &[(&str, &str, &str)]| r.iter().map(|(n, u, t)| ((*n).into(), (*u).into(), (*t).into())).collect();
        match self {
            Friction => owned(&friction::RECORDS),
            LostMotion => owned(&lost_motion::RECORDS),
            Phases => owned(&phases::RECORDS),
            Temperature => owned(&slow::TEMPERATURE),
            Switching => owned(&slow::SWITCHING),
            Level(signal) => level::SUFFIXES.iter().map(|(suffix, text)| level_output(signal, suffix, text)).collect(),
            Orders(signal) => orders::SUFFIXES.iter().map(|(suffix, often)| order_output(signal, suffix, often)).collect(),
            Bands(signal) => bands::EDGES.windows(2).map(|edges| band_output(signal, edges[0], edges[1])).collect(),
        }
    }

    /// Rate in Hz below which its output `index` bears no information.
    fn minimum_rate(self, index: usize) -> f64 {
        match self {
            Bands(_) => 2.0 * bands::EDGES[index + 1],
            _ => 0.0,
        }
    }
}

fn unit(signal: Signal) -> String {
    format!("{{{}}}", signal.roles()[signal.roles().len() - 1].name())
}

fn level_output(signal: Signal, suffix: &str, text: &str) -> (String, String, String) {
    let unit = if suffix == "kurtosis" { "1".to_string() } else { unit(signal) };
    (format!("{}_{suffix}", signal.name()), unit, text.replace("{}", signal.text()))
}

fn order_output(signal: Signal, suffix: &str, often: &str) -> (String, String, String) {
    let text = orders::TEXT.replacen("{}", signal.text(), 1).replacen("{}", often, 1);
    (format!("{}_{suffix}", signal.name()), unit(signal), text)
}

fn band_output(signal: Signal, from: f64, to: f64) -> (String, String, String) {
    let text = bands::TEXT.replacen("{}", signal.text(), 1).replacen("{}", &format!("{from} and {to}"), 1);
    (format!("{}_band_{from}_{to}", signal.name()), unit(signal), text)
}

/// One feature.
#[derive(Clone, Debug)]
pub struct Record {
    pub name: String,
    /// In SI; `{role}` stands for the unit of that role's column.
    pub unit: String,
    pub text: String,
    pub family: &'static str,
    pub roles: Vec<Role>,
    /// Hz; 0 where any rate will do.
    pub minimum_rate: f64,
    /// Place of the family in `FAMILIES` and of the feature in it.
    pub(super) place: (usize, usize),
}

/// All features, in the order in which they are listed.
pub fn records() -> &'static [Record] {
    static RECORDS: OnceLock<Vec<Record>> = OnceLock::new();
    RECORDS.get_or_init(|| {
        let one = |(f, family): (usize, &Family)| {
            let family = *family;
            let outputs = family.outputs().into_iter().enumerate();
            outputs.map(move |(i, (name, unit, text))| Record {
                name,
                unit,
                text,
                family: family.name(),
                roles: family.roles(),
                minimum_rate: family.minimum_rate(i),
                place: (f, i),
            })
        };
        FAMILIES.iter().enumerate().flat_map(one).collect()
    })
}
