//! One record per parameter and signal. Documentation, bindings, error texts and validation all come from it.

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
    Between(f64, f64),
    AtLeast(f64),
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
            Self::Unit => (0.0, 1.0, false),
            Self::Between(low, high) => (low, high, false),
            Self::AtLeast(low) => (low, inf, false),
            Self::Choice(names) => (0.0, names.len() as f64 - 1.0, false),
        }
    }

    pub fn contains(self, value: f64) -> bool {
        let (low, high, open) = self.bounds();
        let integral = !matches!(self, Self::Choice(_)) || value.fract() == 0.0;
        value.is_finite() && integral && value <= high && if open { value > low } else { value >= low }
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
    /// Value of a healthy, plain component; `None` where a parameter set must say.
    pub default: Option<f64>,
    pub text: &'static str,
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

/// A recordable quantity.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    pub name: &'static str,
    pub symbol: &'static str,
    pub unit: &'static str,
    pub text: &'static str,
}

/// What a form of a component changes in one of its records. Empty texts leave the record's.
#[derive(Clone, Copy, Debug)]
pub struct Relabel {
    pub index: usize,
    pub name: &'static str,
    pub unit: &'static str,
    pub text: &'static str,
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
        all[change.index] =
            Variable { path: or(change.name, old.path), unit: or(change.unit, old.unit), text: or(change.text, old.text), ..old };
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

/// Declares an enum of parameters and the table of their records, in one place.
#[macro_export]
macro_rules! variables {
    ($(#[$meta:meta])* $id:ident, $table:ident {
        $($variant:ident => $path:literal, $symbol:literal, $unit:literal, $range:expr, $register:ident, $default:expr, $text:literal;)*
    }) => {
        $(#[$meta])*
        // Rows of one kind are reached by counting from the first: not every name is written out.
        #[allow(dead_code)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        pub enum $id { $($variant),* }
        pub const $table: &[$crate::variable::Variable] = {
            #[allow(unused_imports)]
            use $crate::variable::Range::*;
            &[$($crate::variable::Variable {
                path: $path, symbol: $symbol, unit: $unit, range: $range,
                register: $crate::variable::Register::$register, default: $default, text: $text,
            }),*]
        };
    };
}

/// Declares an enum of signals and the table of their records.
#[macro_export]
macro_rules! signals {
    ($(#[$meta:meta])* $id:ident, $table:ident {
        $($variant:ident => $name:literal, $symbol:literal, $unit:literal, $text:literal;)*
    }) => {
        $(#[$meta])*
        // Phases b and c are reached by counting from a: not every name is written out.
        #[allow(dead_code)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(usize)]
        pub enum $id { $($variant),* }
        pub const $table: &[$crate::variable::Signal] = &[$($crate::variable::Signal {
            name: $name, symbol: $symbol, unit: $unit, text: $text,
        }),*];
    };
}
