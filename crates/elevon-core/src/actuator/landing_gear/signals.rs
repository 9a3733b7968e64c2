//! What a run of the landing-gear actuator can record; both fidelities share the names.

use crate::signals;

signals! {
    /// Signals of both fidelities; the reduced-order model leaves out the phases (`PHASES`).
    Quantity, ALL {
        Command => "command", "-", "1", "0 stop, 1 extend, 2 retract, 3 free fall", Command;
        State => "state", "-", "1", "0 retracted, 1 extending, 2 locked, 3 retracting, 4 stopped, 5 released, 6 fault, 7 unconfirmed, 8 off", State;
        CommandRefused => "command_refused", "-", "1", "why the last command was refused: 1 released, 2 fault, 3 undervoltage, 4 overvoltage, 5 weight on wheels, 6 locked, 7 repeated; 0 accepted";
        FaultCode => "fault_code", "-", "1", "1 motion, 2 lock not released, 3 lock not engaged, 4 stalled, 5 overspeed, 6 overcurrent, 7 hall, 8 proximity, 9 drive tripped, 10 uncommanded motion, 11 supply in motion, 12 weight on wheels, 13 no motor current, 14 unit without power; 0 none", FaultCode;
        WarningCode => "warning_code", "-", "1", "1 drag: the current is above what any healthy load needs, 2 switch at 0 %, 3 switch at 25 %, 4 switch at 75 %, 5 lock switch, 6 wheels switch, 7 hall power interrupted, 8 switches contradict each other; 0 none";
        OutputPosition => "output_position", "x_a", "m", "position of the ram", OutputPosition;
        OutputSpeed => "output_speed", "v_a", "m/s", "speed of the ram", OutputSpeed;
        NutPosition => "nut_position", "x_n", "m", "position of the nut, from retracted; beyond the stroke it works the lock";
        MotorPosition => "motor_position", "theta_m", "rad", "motor angle", MotorPosition;
        MotorSpeed => "motor_speed", "omega_m", "rad/s", "motor speed", MotorSpeed;
        SpeedRef => "speed_ref", "omega_ref", "rad/s", "speed reference behind the rate limiter", SpeedRef;
        SpeedMeas => "speed_meas", "-", "rad/s", "speed from the Hall edges", MotorSpeed;
        VoltageRef => "voltage_ref", "V_dem", "V", "demanded voltage", TorqueVoltage;
        Duty => "duty", "d", "1", "demand over link voltage";
        CurrentBus => "current_bus", "i_bus", "A", "current drawn from the link";
        CurrentSource => "current_source", "i_s", "A", "current of the source", SupplyCurrent;
        SupplyVoltage => "supply_voltage", "V_dc", "V", "link voltage", SupplyVoltage;
        CurrentLine => "current_line", "i", "A", "current of the conducting pair, positive gives torque towards extension (half the sum of the magnitudes)", TorqueCurrent;
        CurrentMean => "current_mean", "-", "A", "mean of current_line over the last control period", TorqueCurrent;
        CurrentPeak => "current_peak", "-", "A", "largest current of the pair over the last control period";
        HallA => "hall_a", "-", "1", "Hall sensor a", HallA;
        HallB => "hall_b", "-", "1", "Hall sensor b", HallB;
        HallC => "hall_c", "-", "1", "Hall sensor c", HallC;
        MotorTorque => "motor_torque", "T_m", "N m", "electromagnetic torque";
        DetentTorque => "detent_torque", "T_mc", "N m", "detent torque";
        BrakeTorque => "brake_torque", "T_br", "N m", "torque the brake can oppose", Brake;
        BrakeReleased => "brake_released", "-", "1", "1 while the brake is open", BrakeReleased;
        SoftwareBrake => "software_brake", "-", "1", "1 while all low switches are on and short the windings";
        FrictionForce => "friction_force", "F_f", "N", "kinetic friction of the tables at the present speed and position, without the efficiencies";
        LoadForce => "load_force", "F", "N", "load on the ram, positive towards extension", Load;
        LockForce => "lock_force", "-", "N", "force in the locked segments, else of the sleeve spring on the nut";
        Efficiency => "efficiency", "eta", "1", "efficiency of the train in its present state";
        Locked => "locked", "-", "1", "1 while the down-lock is engaged", Locked;
        Released => "released", "-", "1", "1 once the free-fall release is open";
        Proximity0 => "proximity_0", "-", "1", "switch at 0 %", Switch0;
        Proximity25 => "proximity_25", "-", "1", "switch at 25 %", Switch25;
        Proximity75 => "proximity_75", "-", "1", "switch at 75 %", Switch75;
        Proximity100 => "proximity_100", "-", "1", "switch on the lock sleeve", Switch100;
        ProximityWheels => "proximity_wheels", "-", "1", "weight-on-wheels switch";
        LeverAngle => "lever_angle", "alpha_c", "rad", "swing of the leg from retracted";
        LeverArm => "lever_arm", "h_a", "m", "effective lever arm dx_a/dalpha";
        Inertia => "equivalent_inertia", "J_tot", "kg m2", "inertia of everything connected, at the motor";
        LoadCell => "load_cell", "F_LC", "N", "force of the friction rig on the ram, with the cell's noise", LoadCell;
        WindingTemperature => "winding_temperature", "T_w", "K", "winding temperature", Temperature;
        AmbientTemperature => "ambient_temperature", "T_a", "K", "temperature of the air, which the lubricant has: lubricant.temperature, or the input `ambient`";
        EnergySupply => "energy_supply", "-", "J", "energy given by the source";
        EnergySource => "energy_source", "-", "J", "lost in the source's resistance and limiter";
        EnergyDump => "energy_dump", "-", "J", "lost in the dump resistor";
        EnergyCopper => "energy_copper", "-", "J", "copper losses";
        EnergyInverter => "energy_inverter", "-", "J", "losses in switches and diodes";
        EnergyMotor => "energy_motor", "-", "J", "work of the motor torque";
        EnergyLoad => "energy_load", "-", "J", "work against the load";
        EnergyLock => "energy_lock", "-", "J", "work against the lock's spring";
        EnergyDetent => "energy_detent", "-", "J", "work against the detent";
        EnergyFriction => "energy_friction", "-", "J", "work against the friction of the tables, jams and bearings";
        EnergyEfficiency => "energy_efficiency", "-", "J", "lost by the efficiencies of gear and screw";
        EnergyBrake => "energy_brake", "-", "J", "work against the brake";
        EnergyGovernor => "energy_governor", "-", "J", "work against the governor";
        EnergyImpact => "energy_impact", "-", "J", "kinetic energy lost at the stops and when the nut leaves or picks up the ram";
        EnergyKinetic => "energy_kinetic", "-", "J", "kinetic energy";
        EnergyCapacitor => "energy_capacitor", "-", "J", "energy of the link capacitor";
        EnergyMagnetic => "energy_magnetic", "-", "J", "magnetic energy of the windings";
        CurrentA => "current_a", "i_a", "A", "phase current a", CurrentA;
        CurrentB => "current_b", "i_b", "A", "phase current b", CurrentB;
        CurrentC => "current_c", "i_c", "A", "phase current c", CurrentC;
        VoltageA => "voltage_a", "v_a", "V", "phase-to-neutral voltage a", VoltageA;
        VoltageB => "voltage_b", "v_b", "V", "phase-to-neutral voltage b", VoltageB;
        VoltageC => "voltage_c", "v_c", "V", "phase-to-neutral voltage c", VoltageC;
        EmfA => "emf_a", "e_a", "V", "EMF of phase a";
        EmfB => "emf_b", "e_b", "V", "EMF of phase b";
        EmfC => "emf_c", "e_c", "V", "EMF of phase c";
    }
}

/// First of the signals that only the switching model has.
pub const PHASES: usize = Quantity::CurrentA as usize;
/// First and last energy.
pub const ENERGIES: std::ops::Range<usize> = Quantity::EnergySupply as usize..PHASES;
