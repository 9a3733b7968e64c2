//! The numbers by which the control unit names commands, faults, refusals and warnings, and their texts.

/// Why the control unit is in its fault state.
pub const FAULTS: &[&str] = &[
    "none",
    "motion time-out",
    "lock not released",
    "lock not engaged",
    "stalled",
    "overspeed",
    "overcurrent",
    "hall",
    "proximity",
    "the drive tripped",
    "uncommanded motion",
    "the supply left its limits in motion",
    "weight on wheels in retraction",
    "no current in the motor",
    "the control unit lost its power",
];
pub const MOTION: u8 = 1;
pub const NOT_RELEASED: u8 = 2;
pub const NOT_ENGAGED: u8 = 3;
pub const STALLED: u8 = 4;
pub const OVERSPEED: u8 = 5;
pub const OVERCURRENT: u8 = 6;
pub const HALL: u8 = 7;
pub const PROXIMITY: u8 = 8;
pub const TRIPPED: u8 = 9;
pub const UNCOMMANDED: u8 = 10;
pub const SUPPLY: u8 = 11;
pub const WHEELS_DOWN: u8 = 12;
pub const NO_CURRENT: u8 = 13;
pub const POWER: u8 = 14;

pub const COMMANDS: &[&str] = &["stop", "extend", "retract", "free_fall"];
pub const STOP: u8 = 0;
pub const EXTEND: u8 = 1;
pub const RETRACT: u8 = 2;
pub const FREE_FALL: u8 = 3;

/// Why a command was refused.
pub const REFUSALS: &[&str] = &[
    "none",
    "the free-fall release is open",
    "the control unit is in its fault state",
    "the supply is below control.undervoltage",
    "the supply is above control.overvoltage",
    "weight on wheels",
    "the down-lock is engaged",
    "it repeats the command in force",
];
pub const RELEASED_ALREADY: u8 = 1;
pub const IN_FAULT: u8 = 2;
pub const SUPPLY_LOW: u8 = 3;
pub const SUPPLY_HIGH: u8 = 4;
pub const ON_WHEELS: u8 = 5;
pub const LOCK_ENGAGED: u8 = 6;
pub const REPEATED: u8 = 7;

/// What the unit warns of without stopping.
pub const WARNINGS: &[&str] = &[
    "none",
    "the motor works against a drag",
    "the switch at 0 % fails",
    "the switch at 25 % fails",
    "the switch at 75 % fails",
    "the switch on the lock sleeve fails",
    "the weight-on-wheels switch fails",
    "the Hall sensors' power is interrupted",
    "the switches contradict each other",
];
pub const DRAG: u8 = 1;
/// Of the first switch; the others follow.
pub const SWITCH: u8 = 2;
pub const HALL_POWER: u8 = 7;
pub const CONTRADICTION: u8 = 8;
