//! One record per parameter and signal. Documentation, bindings, error texts and validation all come from it.

pub mod acts;
mod macros;
pub mod role;

pub use role::Role;
use std::marker::PhantomData;

/// Which register of numbers a parameter belongs to: what the plant is, what the controller
/// believes, what the sensors do to a signal, how the run is loaded and solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Register {
    Plant,
    Controller,
    Sensor,
    Load,
    Solver,
}

impl Register {
    pub fn name(self) -> &'static str {
        match self {
            Self::Plant => "plant",
            Self::Controller => "controller",
            Self::Sensor => "sensor",
            Self::Load => "load",
            Self::Solver => "solver",
        }
    }
}

crate::choices! {
    Switch { Off "off", On "on" }
}

/// Admissible values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    Any,
    Positive,
    NonNegative,
    /// `(0, 1]`, a healthy fraction.
    Fraction,
    /// `[0, 1]`.
    Unit,
    /// `[0, 1]`, on from one half: between the two nothing differs.
    Flag,
    Between(f64, f64),
    AtLeast(f64),
    /// A whole number in between, both included.
    Count(f64, f64),
    /// The index of one of these names.
    Choice(&'static [&'static str]),
}

impl Range {
    /// `(minimum, maximum, minimum is excluded)`.
    pub fn bounds(self) -> (f64, f64, bool) {
        let inf = f64::INFINITY;
        match self {
            Self::Any => (-inf, inf, false),
            Self::Positive => (0.0, inf, true),
            Self::NonNegative => (0.0, inf, false),
            Self::Fraction => (0.0, 1.0, true),
            Self::Unit | Self::Flag => (0.0, 1.0, false),
            Self::Between(low, high) | Self::Count(low, high) => (low, high, false),
            Self::AtLeast(low) => (low, inf, false),
            Self::Choice(names) => (0.0, names.len() as f64 - 1.0, false),
        }
    }

    pub fn contains(self, value: f64) -> bool {
        let (low, high, open) = self.bounds();
        let integral = !self.whole() || value.fract() == 0.0;
        value.is_finite() && integral && value <= high && if open { value > low } else { value >= low }
    }

    /// Are its values whole numbers?
    pub fn whole(self) -> bool {
        matches!(self, Self::Choice(_) | Self::Count(..))
    }

    /// Do two values act differently?
    pub fn differ(self, a: f64, b: f64) -> bool {
        match self {
            Self::Flag => (a >= 0.5) != (b >= 0.5),
            _ => a != b,
        }
    }
}

/// A parameter of a component. Its full path is `prefix.path` of the group it stands in.
#[derive(Clone, Copy, Debug)]
pub struct Variable {
    pub path: &'static str,
    pub symbol: &'static str,
    pub unit: &'static str,
    pub range: Range,
    pub register: Register,
    /// Value of a healthy, plain component; `None` where an actuator file must state it.
    pub default: Option<f64>,
    pub text: &'static str,
    /// In which fidelities, and under which values of others.
    pub acts: acts::Acts,
}

/// The parameters of one component of a wiring, under a prefix.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    pub prefix: &'static str,
    pub variables: &'static [Variable],
}

impl Group {
    pub fn path(&self, index: usize) -> String {
        join(self.prefix, self.variables[index].path)
    }
}

pub fn join(prefix: &str, path: &str) -> String {
    if prefix.is_empty() {
        path.to_string()
    } else {
        format!("{prefix}.{path}")
    }
}

/// Where group `index` begins in the parameter vector of a wiring.
pub const fn offset(groups: &[Group], index: usize) -> usize {
    let (mut sum, mut i) = (0, 0);
    while i < index {
        sum += groups[i].variables.len();
        i += 1;
    }
    sum
}

/// A parameter of a component: its place in the component's table.
pub trait Parameter: Copy {
    const TABLE: &'static [Variable];
    fn index(self) -> usize;
}

/// The parameters of one component in a run, and which of them faults move.
#[derive(Clone, Copy)]
pub struct View<'a, P> {
    pub raw: &'a [f64],
    touched: &'a [bool],
    table: PhantomData<P>,
}

impl<'a, P: Parameter> View<'a, P> {
    pub fn new(raw: &'a [f64], touched: &'a [bool]) -> Self {
        Self { raw, touched, table: PhantomData }
    }

    pub fn value(&self, parameter: P) -> f64 {
        self.raw[parameter.index()]
    }

    /// The most a parameter may be in the run: its value, without bound where a fault moves it.
    pub fn most(&self, parameter: P) -> f64 {
        if self.touched[parameter.index()] {
            f64::INFINITY
        } else {
            self.value(parameter)
        }
    }

    /// Is the parameter away from its neutral value, that of its record, now or later?
    pub fn away(&self, parameter: P) -> bool {
        self.apart(parameter.index())
    }

    /// Is the parameter other than zero, now or later?
    pub fn used(&self, parameter: P) -> bool {
        self.value(parameter) != 0.0 || self.touched[parameter.index()]
    }

    pub fn any_away(&self, parameters: impl IntoIterator<Item = P>) -> bool {
        parameters.into_iter().any(|p| self.away(p))
    }

    /// The same of all rows from `first` to `last`.
    pub fn any_away_among(&self, first: P, last: P) -> bool {
        (first.index()..=last.index()).any(|i| self.apart(i))
    }

    fn apart(&self, row: usize) -> bool {
        let record = &P::TABLE[row];
        record.range.differ(self.raw[row], record.default.unwrap_or(0.0)) || self.touched[row]
    }
}

/// The parameters of group `index` in the vector of a wiring.
#[inline(always)]
pub fn slice<'a, S>(groups: &[Group], index: usize, raw: &'a [S]) -> &'a [S] {
    let begin = offset(groups, index);
    &raw[begin..begin + groups[index].variables.len()]
}

/// `first`, then `further`.
pub const fn followed<const N: usize>(first: &[Group], further: &[Group]) -> [Group; N] {
    let mut all = [first[0]; N];
    let mut i = 0;
    while i < N {
        all[i] = if i < first.len() { first[i] } else { further[i - first.len()] };
        i += 1;
    }
    all
}

/// A group of parameters under a prefix.
pub const fn group(prefix: &'static str, variables: &'static [Variable]) -> Group {
    Group { prefix, variables }
}

/// Is `variant` the last part of the dotted `path` in the spelling of Rust? Underscores apart.
pub const fn named(variant: &str, path: &str) -> bool {
    let (variant, path) = (variant.as_bytes(), path.as_bytes());
    let (mut v, mut p) = (variant.len(), path.len());
    loop {
        while v > 0 && variant[v - 1] == b'_' {
            v -= 1;
        }
        while p > 0 && path[p - 1] == b'_' {
            p -= 1;
        }
        let begun = p == 0 || path[p - 1] == b'.';
        if v == 0 || begun {
            return v == 0 && begun;
        }
        if variant[v - 1].to_ascii_lowercase() != path[p - 1] {
            return false;
        }
        (v, p) = (v - 1, p - 1);
    }
}

/// A recordable quantity.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    pub name: &'static str,
    pub symbol: &'static str,
    pub unit: &'static str,
    pub text: &'static str,
    /// What it is to the actuator; `None` for what only a simulation can report.
    pub role: Option<Role>,
}

impl Signal {
    /// The same with another text; an empty one leaves the record's.
    pub const fn reworded(self, text: &'static str) -> Self {
        Self { text: or(text, self.text), ..self }
    }
}

/// What a form of a component changes in one of its records. Empty texts leave the record's.
#[derive(Clone, Copy, Debug)]
pub struct Relabel {
    pub index: usize,
    pub name: &'static str,
    pub unit: &'static str,
    pub text: &'static str,
    /// Where it acts in this form, if elsewhere than in others.
    pub acts: Option<acts::Acts>,
}

impl Relabel {
    pub const fn acts(index: usize, acts: acts::Acts) -> Self {
        Self { index, name: "", unit: "", text: "", acts: Some(acts) }
    }
}

/// A copy of a table of parameters with other names, units or texts.
pub const fn relabelled<const N: usize>(table: &[Variable], changes: &[Relabel]) -> [Variable; N] {
    let mut all = [table[0]; N];
    let mut i = 0;
    while i < N {
        all[i] = table[i];
        i += 1;
    }
    let mut i = 0;
    while i < changes.len() {
        let change = changes[i];
        let old = all[change.index];
        all[change.index] = Variable {
            path: or(change.name, old.path),
            unit: or(change.unit, old.unit),
            text: or(change.text, old.text),
            acts: match change.acts {
                Some(acts) => acts,
                None => old.acts,
            },
            ..old
        };
        i += 1;
    }
    all
}

/// A copy of a table of signals with other names, units or texts, and further signals behind them.
pub const fn extended<const N: usize>(table: &[Signal], changes: &[Relabel], further: &[Signal]) -> [Signal; N] {
    let mut all = [table[0]; N];
    let mut i = 0;
    while i < N {
        all[i] = if i < table.len() { table[i] } else { further[i - table.len()] };
        i += 1;
    }
    let mut i = 0;
    while i < changes.len() {
        let change = changes[i];
        let old = all[change.index];
        all[change.index] =
            Signal { name: or(change.name, old.name), unit: or(change.unit, old.unit), text: or(change.text, old.text), ..old };
        i += 1;
    }
    all
}

const fn or(given: &'static str, other: &'static str) -> &'static str {
    if given.is_empty() {
        other
    } else {
        given
    }
}
