//! The columns that features are made of, by their roles.

/// What a column is to the actuator, whatever its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Role {
    Command,
    OutputPosition,
    MotorPosition,
    MotorSpeed,
    TorqueCurrent,
    CurrentA,
    CurrentB,
    CurrentC,
    Temperature,
    Transitions,
    Vibration,
}

impl Role {
    pub const ALL: [Self; 11] = [
        Self::Command,
        Self::OutputPosition,
        Self::MotorPosition,
        Self::MotorSpeed,
        Self::TorqueCurrent,
        Self::CurrentA,
        Self::CurrentB,
        Self::CurrentC,
        Self::Temperature,
        Self::Transitions,
        Self::Vibration,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Command => "command",
            Self::OutputPosition => "output_position",
            Self::MotorPosition => "motor_position",
            Self::MotorSpeed => "motor_speed",
            Self::TorqueCurrent => "torque_current",
            Self::CurrentA => "current_a",
            Self::CurrentB => "current_b",
            Self::CurrentC => "current_c",
            Self::Temperature => "temperature",
            Self::Transitions => "leg_transitions",
            Self::Vibration => "vibration",
        }
    }

    pub fn text(self) -> &'static str {
        match self {
            Self::Command => "position commanded of the output",
            Self::OutputPosition => "position of the output, as its sensor reports it",
            Self::MotorPosition => "angle of the motor's shaft",
            Self::MotorSpeed => "speed of the motor's shaft",
            Self::TorqueCurrent => "current that makes torque, signed (a torque serves as well)",
            Self::CurrentA => "current of phase a",
            Self::CurrentB => "current of phase b",
            Self::CurrentC => "current of phase c",
            Self::Temperature => "temperature of the winding",
            Self::Transitions => "count of the bridge's leg transitions since some instant",
            Self::Vibration => "acceleration at the actuator's structure",
        }
    }

    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.name() == name)
    }
}

/// Some rows, column by column; a role without a column has none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Columns<'a>([&'a [f64]; Role::ALL.len()]);

impl<'a> Columns<'a> {
    /// All columns must be of one length.
    pub fn set(&mut self, role: Role, values: &'a [f64]) {
        self.0[role as usize] = values;
    }

    #[inline(always)]
    pub fn get(&self, role: Role) -> &'a [f64] {
        self.0[role as usize]
    }

    /// The rows `from..to` of every column that is there.
    pub fn part(&self, from: usize, to: usize) -> Self {
        Self(self.0.map(|column| if column.is_empty() { column } else { &column[from..to] }))
    }
}

/// A quantity that families of features are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    TorqueCurrent,
    MotorSpeed,
    TrackingError,
    Vibration,
}

impl Signal {
    pub fn name(self) -> &'static str {
        match self {
            Self::TorqueCurrent => "torque_current",
            Self::MotorSpeed => "motor_speed",
            Self::TrackingError => "tracking_error",
            Self::Vibration => "vibration",
        }
    }

    pub fn text(self) -> &'static str {
        match self {
            Self::TorqueCurrent => "the torque current",
            Self::MotorSpeed => "the motor's speed",
            Self::TrackingError => "command less output position",
            Self::Vibration => "the vibration",
        }
    }

    pub fn roles(self) -> &'static [Role] {
        match self {
            Self::TorqueCurrent => &[Role::TorqueCurrent],
            Self::MotorSpeed => &[Role::MotorSpeed],
            Self::TrackingError => &[Role::Command, Role::OutputPosition],
            Self::Vibration => &[Role::Vibration],
        }
    }

    #[inline(always)]
    pub fn of<'a>(self, rows: &Columns<'a>) -> Values<'a> {
        match self {
            Self::TrackingError => Values { plus: rows.get(Role::Command), minus: Some(rows.get(Role::OutputPosition)) },
            _ => Values { plus: rows.get(self.roles()[0]), minus: None },
        }
    }
}

/// The values of a quantity: a column, or the difference of two.
#[derive(Clone, Copy, Debug)]
pub struct Values<'a> {
    plus: &'a [f64],
    minus: Option<&'a [f64]>,
}

impl Values<'_> {
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.plus.len()
    }

    #[inline(always)]
    pub fn at(&self, i: usize) -> f64 {
        match self.minus {
            Some(minus) => self.plus[i] - minus[i],
            None => self.plus[i],
        }
    }
}
