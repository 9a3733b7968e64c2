//! What a signal is to its actuator, whatever its name: logs, calibration and diagnosis request roles.

/// Declares the roles: variant, name, SI units that a signal in this role may have, and what it is.
macro_rules! roles {
    ($($variant:ident $name:literal [$($unit:literal),*] $text:literal;)*) => {
        /// Of several recorded signals with one role the last in a wiring's table backlashes it: a sensor stands behind
        /// what it senses.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Role { $($variant),* }

        impl Role {
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }

            pub fn units(self) -> &'static [&'static str] {
                match self { $(Self::$variant => &[$($unit),*]),* }
            }

            pub fn text(self) -> &'static str {
                match self { $(Self::$variant => $text),* }
            }
        }
    };
}

roles! {
    Command "command" ["rad", "m", "rad/s", "N m", "1"] "what is commanded of the actuator: position, speed or torque by its mode, or the state to go to";
    OutputPosition "output_position" ["rad", "m"] "position of the output, as its sensor reports it";
    OutputSpeed "output_speed" ["rad/s", "m/s"] "speed of the output";
    MotorPosition "motor_position" ["rad"] "angle of the motor's shaft";
    MotorSpeed "motor_speed" ["rad/s"] "speed of the motor's shaft";
    SpeedRef "speed_ref" ["rad/s"] "speed set point of the motor's shaft";
    TorqueRef "torque_ref" ["N m"] "torque set point of the motor";
    CurrentRef "current_ref" ["A"] "set point of the current that makes torque";
    TorqueCurrent "torque_current" ["A"] "current that makes torque, signed, peak of the phase";
    DirectCurrent "direct_current" ["A"] "current along the magnets, peak of the phase";
    CurrentA "current_a" ["A"] "current of phase a";
    CurrentB "current_b" ["A"] "current of phase b";
    CurrentC "current_c" ["A"] "current of phase c";
    TorqueVoltage "torque_voltage" ["V"] "voltage that drives the torque current";
    VoltageA "voltage_a" ["V"] "voltage of phase a to neutral";
    VoltageB "voltage_b" ["V"] "voltage of phase b to neutral";
    VoltageC "voltage_c" ["V"] "voltage of phase c to neutral";
    SupplyVoltage "supply_voltage" ["V"] "voltage of the DC link";
    SupplyCurrent "supply_current" ["A"] "current drawn from the source";
    Load "load" ["N m", "N"] "load on the output";
    LoadCell "load_cell" ["N m", "N"] "what a load cell between actuator and load or brake reports";
    Brake "brake" ["N m", "N"] "what a brake can oppose";
    Temperature "temperature" ["K"] "temperature of the winding";
    SurfaceTemperature "surface_temperature" ["K"] "temperature of the motor's surface";
    NutTemperature "nut_temperature" ["K"] "temperature of the screw's nut";
    DriveTemperature "drive_temperature" ["K"] "temperature of the drive";
    Switch0 "switch_0" ["1"] "switch at the retracted end";
    Switch25 "switch_25" ["1"] "switch at a quarter of the stroke";
    Switch75 "switch_75" ["1"] "switch at three quarters of the stroke";
    Switch100 "switch_100" ["1"] "switch at the extended end";
    HallA "hall_a" ["1"] "Hall sensor a";
    HallB "hall_b" ["1"] "Hall sensor b";
    HallC "hall_c" ["1"] "Hall sensor c";
    BrakeReleased "brake_released" ["1"] "1 while the brake is open";
    Locked "locked" ["1"] "1 while a lock is engaged";
    State "state" ["1"] "state of the control unit";
    FaultCode "fault_code" ["1"] "fault that the control unit reports";
    Trigger "trigger" ["1"] "edge that starts another recorder";
    Vibration "vibration" ["m/s2"] "acceleration at the actuator's structure";
    Transitions "leg_transitions" ["1"] "count of the bridge's leg transitions since some instant";
}

/// The one role given, if any.
pub const fn only(given: &[Role]) -> Option<Role> {
    if given.is_empty() {
        None
    } else {
        Some(given[0])
    }
}
