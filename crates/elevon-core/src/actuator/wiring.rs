//! What the solver needs of a wiring. The model is constant, all of a run lives in its state.

use crate::command::Source;
use crate::control::position_speed::Mode;
use crate::fault::FaultKind;
use crate::kept::Store;
use crate::scalar::Scalar;
use crate::time::Steps;
use crate::variable::{Group, Signal};
use std::fmt::Debug;
use std::hash::Hash;

/// Most chunks of lanes that one thread runs side by side.
pub const MAX_CHUNKS: usize = 4;

/// Time over which a port that sets a parameter holds its value, s: short against any temperature's change.
pub const HELD: f64 = 0.01;

/// A stretch of steps of a block, all its chunks side by side. The types are those of a wiring: whatever shares them shares code.
pub struct Stretch<'a, Q, M, Z, S> {
    pub structure: &'a Q,
    pub models: &'a [M],
    pub inputs: &'a [Inputs<S>],
    pub states: &'a mut [Z],
    pub from: Steps,
    pub count: Steps,
}

/// A tick of a chunk.
pub struct Event<'a, Q, M, Z, S> {
    /// What the wiring does then.
    pub kind: u8,
    pub structure: &'a Q,
    pub model: &'a M,
    pub inputs: &'a Inputs<S>,
    pub state: &'a mut Z,
    pub t: S,
    /// Gaussian numbers of unit deviation, of a channel.
    pub noise: &'a mut dyn FnMut(u64) -> S,
}

/// The signals of a chunk at an instant, into `out`: those of `selection`, others where they cost nothing.
pub struct Observation<'a, Q, M, Z, S> {
    pub structure: &'a Q,
    pub model: &'a M,
    pub inputs: &'a Inputs<S>,
    pub state: &'a Z,
    pub t: S,
    pub selection: Signals,
    pub out: &'a mut [S],
}

pub type StretchOf<'a, W, S> = Stretch<'a, <W as Wiring>::Structure, <W as Wiring>::Model<S>, <W as Wiring>::State<S>, S>;
pub type EventOf<'a, W, S> = Event<'a, <W as Wiring>::Structure, <W as Wiring>::Model<S>, <W as Wiring>::State<S>, S>;
pub type ObservationOf<'a, W, S> = Observation<'a, <W as Wiring>::Structure, <W as Wiring>::Model<S>, <W as Wiring>::State<S>, S>;

/// Quantities that the solver watches.
pub const WATCHED: usize = 4;

/// An input of a wiring that waveforms drive.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    pub name: &'static str,
    pub unit: &'static str,
    pub text: &'static str,
    /// Path of the parameter that is its value when no waveform is given; empty: zero.
    pub parameter: &'static str,
}

/// The inputs of one chunk of lanes, in the order of `Wiring::PORTS`.
pub type Inputs<S> = Vec<Source<S>>;

/// Parameters of a run and which of them faults will move: what decides its structure.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    pub raw: &'a [f64],
    pub touched: &'a [bool],
    /// A port is driven by waveforms (in the order of `PORTS`).
    pub driven: &'a [bool],
    /// Indices of the recorded signals.
    pub recorded: &'a [usize],
}

/// A periodic event of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Tick {
    pub period: Steps,
    /// Step of its first occurrence.
    pub first: Steps,
    /// What the wiring does then.
    pub kind: u8,
}

impl Tick {
    /// From the start on.
    pub fn every(period: Steps, kind: u8) -> Self {
        Self { period, first: 0, kind }
    }
}

/// Does a finding stop the run, or only state what to expect of it?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    Error,
    Warning,
}

impl Severity {
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
        }
    }
}

/// A finding of the cross-parameter checks.
#[derive(Clone, Debug)]
pub struct Finding {
    pub severity: Severity,
    pub path: String,
    pub value: f64,
    pub limit: f64,
    pub message: String,
}

impl Finding {
    /// The run cannot be.
    pub fn error(path: &str, value: f64, limit: f64, message: String) -> Self {
        Self { severity: Severity::Error, path: path.to_string(), value, limit, message }
    }

    /// The run can be; its caller should know.
    pub fn warning(path: &str, value: f64, limit: f64, message: String) -> Self {
        Self { severity: Severity::Warning, ..Self::error(path, value, limit, message) }
    }
}

/// Some of the signals of a wiring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signals(u128);

impl Signals {
    pub const ALL: Self = Self(u128::MAX);

    /// By their indices.
    pub const fn of(indices: &[usize]) -> Self {
        let (mut bits, mut i) = (0, 0);
        while i < indices.len() {
            assert!(indices[i] < 128);
            bits |= 1 << indices[i];
            i += 1;
        }
        Self(bits)
    }

    /// These, and all from the index `first` on.
    pub const fn and_from(self, first: usize) -> Self {
        Self(self.0 | u128::MAX << first)
    }

    /// Are any of the others among them?
    #[inline(always)]
    pub const fn any(self, others: Self) -> bool {
        self.0 & others.0 != 0
    }
}

/// A quantity watched for divergence.
#[derive(Clone, Copy, Debug)]
pub struct Watch<S> {
    pub name: &'static str,
    pub value: S,
    pub limit: f64,
}

/// Temperature of a winding.
#[derive(Clone, Copy, Debug)]
pub struct Overheat<S> {
    /// Positive once it has passed the trip.
    pub over: S,
    /// K.
    pub temperature: S,
}

/// What a machine is, whatever the fidelity.
pub trait Machine: Clone + Send + Sync + 'static {
    const GROUPS: &'static [Group];
    const PORTS: &'static [Port];
    /// Ports whose drive decides which equations run, and that a session may drive at any time.
    const LATE_PORTS: &'static [usize] = &[];
    /// Ports that set their parameter: its value is held over `HELD` seconds, and all that is derived from it follows.
    const HELD_PORTS: &'static [usize] = &[];
    /// What a command may set.
    const MODES: &'static [&'static str] = Mode::NAMES;
    /// Units of the command in each mode; empty: the command port's own.
    const MODE_UNITS: &'static [&'static str] = &["", "rad/s", "N m"];
    /// Names of the values of a command that is a sequence of actions (mode `gear`).
    const ACTIONS: &'static [&'static str] = &[];

    fn faults() -> Vec<FaultKind>;
}

pub trait Wiring: Clone + Send + Sync + 'static {
    type Structure: Clone + Eq + Hash + Debug + Send + Sync;
    type Model<S: Scalar>: Clone + Send + Sync;
    type State<S: Scalar>: Clone + Send + Sync;

    type Machine: Machine;
    const PORTS: &'static [Port] = Self::Machine::PORTS;
    /// Signals whose initial value a scenario may set.
    const INITIAL: &'static [&'static str];

    fn groups() -> &'static [Group] {
        Self::Machine::GROUPS
    }
    fn signals() -> &'static [Signal];
    fn faults() -> Vec<FaultKind> {
        Self::Machine::faults()
    }

    /// Solver step, s.
    fn step(raw: &[f64]) -> f64;
    /// Grid on which smooth fault profiles are held, s.
    fn fault_grid(raw: &[f64]) -> f64;
    fn structure(setup: &Setup) -> Self::Structure;
    fn ticks(raw: &[f64], structure: &Self::Structure) -> Vec<Tick>;
    fn check(raw: &[f64]) -> Vec<Finding>;
    /// What cannot be once all faults of a run have their whole severity.
    fn check_faulted(_raw: &[f64]) -> Vec<Finding> {
        Vec::new()
    }

    fn derive<S: Scalar>(raw: &[S], structure: &Self::Structure) -> Self::Model<S>;
    /// The same into a model that is there, whose memory is used again.
    fn derive_anew<S: Scalar>(model: &mut Self::Model<S>, raw: &[S], structure: &Self::Structure) {
        *model = Self::derive(raw, structure);
    }
    /// Writes the state of a single run to a store, or reads it there.
    fn keep(state: &mut Self::State<f64>, store: &mut Store);
    /// Why a run cannot start from these values for `INITIAL` together.
    fn refuses_start(_raw: &[f64], _initial: &[f64]) -> Option<String> {
        None
    }
    /// After the structure has grown while the run goes on: what joins begins where the run stands.
    fn join<S: Scalar>(_model: &Self::Model<S>, _before: &Self::Structure, _after: &Self::Structure, _state: &mut Self::State<S>) {}
    /// State at the start; `initial` holds the values given for `INITIAL`, NaN where none was.
    fn start<S: Scalar>(model: &Self::Model<S>, raw: &[S], initial: &[S]) -> Self::State<S>;
    /// After a fault changed parameters.
    fn refresh<S: Scalar>(_model: &Self::Model<S>, _structure: &Self::Structure, _raw: &[S], _state: &mut Self::State<S>) {}
    fn tick<S: Scalar>(event: EventOf<'_, Self, S>);
    fn advance<S: Scalar>(stretch: StretchOf<'_, Self, S>);
    /// Signals in the order of `signals()`.
    fn observe<S: Scalar>(observation: ObservationOf<'_, Self, S>);
    /// Quantities whose leaving of their limit means divergence.
    fn watch<S: Scalar>(state: &Self::State<S>) -> [Watch<S>; WATCHED];
    /// The winding and whether it has passed its limit, which ends a run; none where nothing heats.
    fn overheated<S: Scalar>(_state: &Self::State<S>) -> Option<Overheat<S>> {
        None
    }
    /// Positive once the drive of a lane has tripped.
    fn tripped<S: Scalar>(_state: &Self::State<S>) -> S {
        S::zero()
    }
    /// Why it has.
    fn trip_reason<S: Scalar>(_model: &Self::Model<S>, _state: &Self::State<S>, _lane: usize) -> Option<String> {
        None
    }
}
