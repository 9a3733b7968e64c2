//! What a run of a servo can record; a form may rename and extend.

use super::shaft::TRAIN;
use crate::scalar::Scalar;
use crate::variable::{extended, Signal};
use crate::{signals, signals_of};

signals! {
    /// Signals of the switching model.
    HighSignal, HIGH_SPECIFIC {
        Command => "command", "-", "rad", "command with its noise (rad at the output, rad/s or N m by the control mode)", Command;
        OutputPosition => "output_position", "theta_u", "rad", "output position", OutputPosition;
        OutputSpeed => "output_speed", "omega_u", "rad/s", "output speed", OutputSpeed;
        MotorPosition => "motor_position", "theta_m", "rad", "motor angle", MotorPosition;
        MotorSpeed => "motor_speed", "omega_m", "rad/s", "motor speed", MotorSpeed;
        SpeedRef => "speed_ref", "omega_ref", "rad/s", "speed reference", SpeedRef;
        TorqueRef => "torque_ref", "T_ref", "N m", "torque reference after its limit", TorqueRef;
        CurrentRef => "current_ref", "i_q_ref", "A", "quadrature current reference, peak", CurrentRef;
        CurrentA => "current_a", "i_a", "A", "phase current a at the terminal", CurrentA;
        CurrentB => "current_b", "i_b", "A", "phase current b at the terminal", CurrentB;
        CurrentC => "current_c", "i_c", "A", "phase current c at the terminal", CurrentC;
        CurrentQ => "current_q", "i_q", "A", "quadrature current, peak", TorqueCurrent;
        CurrentD => "current_d", "i_d", "A", "direct current, peak", DirectCurrent;
        VoltageA => "voltage_a", "v_a", "V", "phase-to-neutral voltage a", VoltageA;
        VoltageB => "voltage_b", "v_b", "V", "phase-to-neutral voltage b", VoltageB;
        VoltageC => "voltage_c", "v_c", "V", "phase-to-neutral voltage c", VoltageC;
        VoltageQRef => "voltage_q_ref", "v_q_ref", "V", "quadrature voltage set point (PWM drive)", TorqueVoltage;
        CurrentQMeas => "current_q_meas", "i_q_meas", "A", "measured quadrature current, filtered", TorqueCurrent;
        CurrentDMeas => "current_d_meas", "i_d_meas", "A", "measured direct current, filtered", DirectCurrent;
        VoltageQMeas => "voltage_q_meas", "v_q_meas", "V", "quadrature voltage, filtered", TorqueVoltage;
        CurrentAMeas => "current_a_meas", "i_a_meas", "A", "current sensor a", CurrentA;
        CurrentBMeas => "current_b_meas", "i_b_meas", "A", "current sensor b", CurrentB;
        CurrentCMeas => "current_c_meas", "i_c_meas", "A", "current sensor c", CurrentC;
        LoopCurrentA => "loop_current_a", "i_fa", "A", "current in the shorted turns of phase a";
        LoopCurrentB => "loop_current_b", "i_fb", "A", "current in the shorted turns of phase b";
        LoopCurrentC => "loop_current_c", "i_fc", "A", "current in the shorted turns of phase c";
        PhaseShortCurrentAb => "phase_short_current_ab", "-", "A", "current from winding a to winding b through a contact";
        PhaseShortCurrentBc => "phase_short_current_bc", "-", "A", "current from winding b to winding c through a contact";
        PhaseShortCurrentCa => "phase_short_current_ca", "-", "A", "current from winding c to winding a through a contact";
        GroundCurrent => "ground_current", "-", "A", "current from the windings to ground";
        MotorTorque => "motor_torque", "T_m", "N m", "electromagnetic torque after the flux's saturation";
        FrictionTorque => "friction_torque", "T_fric", "N m", "dry and viscous friction on the motor shaft, the brake's and the iron's drag included";
        BrakeTorque => "brake_torque", "T_b", "N m", "torque the brake can oppose", Brake;
        LoadTorque => "load_torque", "T_load", "N m", "signed load referred to the motor shaft";
        OutputTorque => "output_torque", "T_u", "N m", "load on the output side, spring included", Load;
        TransmissionTorque => "transmission_torque", "T_t", "N m", "torque through the backlash at the output (elastic model)", LoadCell;
        SupplyVoltage => "supply_voltage", "V_dc", "V", "DC link voltage", SupplyVoltage;
        WindingTemperature => "winding_temperature", "T_w", "K", "winding temperature", Temperature;
        WindingTemperatureHottest => "winding_temperature_hottest", "-", "K", "temperature of the hottest phase (thermal network): at standstill up to twice the winding's rise over the surface";
        SurfaceTemperature => "surface_temperature", "T_s", "K", "temperature of the motor's surface", SurfaceTemperature;
        HeatCopper => "heat_copper", "P", "W", "copper heat of the phases, mean of the network's last tick; without a network of the present currents";
        HeatLoop => "heat_loop", "-", "W", "copper heat of shorted turns, mean of the network's last tick; without a network of the present currents";
        HeatContact => "heat_contact", "-", "W", "heat of contacts in the windings, mean of the network's last tick";
        HeatPhaseHottest => "heat_phase_hottest", "-", "W", "heat of the phase that has most, mean of the network's last tick; without a network of the present currents";
        HeatAir => "heat_air", "-", "W", "heat given to the air, mean of the network's last tick";
        ThermalWarning => "thermal_warning", "-", "1", "1 while the winding is above its warning temperature";
        Limited => "limited", "-", "1", "1 while the speed or the torque reference stands at its limit";
        LegCurrentA => "leg_current_a", "-", "A", "current of leg a, with that of a resistor to the centre tap";
        LegCurrentB => "leg_current_b", "-", "A", "current of leg b, with that of a resistor to the centre tap";
        LegCurrentC => "leg_current_c", "-", "A", "current of leg c, with that of a resistor to the centre tap";
        TapCurrentA => "tap_current_a", "-", "A", "current from terminal a to the centre tap";
        TapCurrentB => "tap_current_b", "-", "A", "current from terminal b to the centre tap";
        TapCurrentC => "tap_current_c", "-", "A", "current from terminal c to the centre tap";
        UnbalanceTorque => "unbalance_torque", "T_u", "N m", "gravity torque of the rotor's excess mass";
        EncoderPosition => "encoder_position", "-", "rad", "output position the encoder reports", OutputPosition;
        ResolverPosition => "resolver_position", "-", "rad", "motor angle the resolver reports", MotorPosition;
        ResolverSpeed => "resolver_speed", "-", "rad/s", "motor speed the resolver reports", MotorSpeed;
        ResolverSignal => "resolver_signal", "-", "1", "size of the resolver's sine and cosine over the healthy one";
        LegTransitions => "leg_transitions", "-", "1", "leg transitions since the start; with sampled relays (inverter.relay_crossing) at 1 us a quarter more than relays without delay make: the step's own, as is that part of the currents' ripple", Transitions;
        Tripped => "tripped", "-", "1", "1 once the drive has tripped";
        EnergySupply => "energy_supply", "-", "J", "energy drawn from the DC link (given by the source, where the link has a capacitor)";
        EnergyCopper => "energy_copper", "-", "J", "copper losses, shorted turns included";
        EnergyInverter => "energy_inverter", "-", "J", "losses in switches and diodes, switching losses included";
        EnergyFriction => "energy_friction", "-", "J", "work against friction, without the brake";
        EnergyBrake => "energy_brake", "-", "J", "work against the brake";
        EnergyLoad => "energy_load", "-", "J", "work against the signed loads";
        EnergyImpact => "energy_impact", "-", "J", "kinetic energy lost at the end stops and in the contact";
        EnergyKinetic => "energy_kinetic", "-", "J", "kinetic energy";
        EnergyMagnetic => "energy_magnetic", "-", "J", "magnetic energy of the windings, shorted turns included";
        EnergyTap => "energy_tap", "-", "J", "heat of resistors at the centre tap";
        EnergyContact => "energy_contact", "-", "J", "heat of contacts in the windings: shorted turns, phase to phase, to ground";
        EnergyHeatStored => "energy_heat_stored", "-", "J", "heat in winding, housing and drive above that of the start";
        EnergyAir => "energy_air", "-", "J", "heat given to the air";
        EnergySource => "energy_source", "-", "J", "lost in the source's resistance (inverter.link_capacitance)";
        EnergyLink => "energy_link", "-", "J", "energy of the link's capacitor above that of the start";
        DriveTemperature => "drive_temperature", "T_d", "K", "temperature of the drive, warmed by the inverter's losses (thermal network)", DriveTemperature;
        HeatDrive => "heat_drive", "-", "W", "losses of the inverter, mean of the network's last tick";
        StopTorque => "stop_torque", "-", "N m", "torque of the end stop at the motor shaft: what its reaction cancels, or of its stiffness and damping (stop.stiffness)";
        AmbientTemperature => "ambient_temperature", "T_a", "K", "temperature of the air: thermal.ambient, or the input `ambient`";
        EnergyIron => "energy_iron", "-", "J", "iron losses of the motor";
        HeatIron => "heat_iron", "P_Fe", "W", "iron loss of the motor at the present speed";
    }
}

signals_of! {
    /// Signals of the reduced-order model: those of the switching model that it has, too.
    LowSignal, LOW_SPECIFIC of HighSignal, HIGH_SPECIFIC {
        Command;
        OutputPosition;
        OutputSpeed;
        MotorPosition;
        MotorSpeed;
        SpeedRef;
        TorqueRef;
        CurrentRef;
        CurrentQ: "quadrature current of the equivalent phase, peak";
        CurrentQMeas;
        VoltageQRef: "quadrature voltage of the equivalent phase";
        VoltageQMeas;
        MotorTorque;
        FrictionTorque;
        BrakeTorque;
        LoadTorque;
        SupplyVoltage;
        WindingTemperature;
        WindingTemperatureHottest;
        SurfaceTemperature;
        HeatCopper;
        HeatPhaseHottest;
        HeatAir;
        ThermalWarning;
        Limited;
        EncoderPosition;
        ResolverPosition;
        ResolverSpeed;
        ResolverSignal;
        Tripped;
        EnergySupply: "energy drawn from the DC link (given by the source, where the link has a capacitor)";
        EnergyCopper: "copper losses, shorted turns and the relays' ripple included";
        EnergyHeatStored: "heat in winding and housing above that of the start";
        EnergyAir;
        EnergySource;
        EnergyLink;
        StopTorque;
        AmbientTemperature;
        EnergyIron;
        HeatIron;
    }
}

/// Both fidelities report what acts on the shaft in addition to plain friction.
pub const HIGH: &[Signal] = &extended::<{ HIGH_SPECIFIC.len() + TRAIN.len() }>(HIGH_SPECIFIC, &[], TRAIN);
pub const LOW: &[Signal] = &extended::<{ LOW_SPECIFIC.len() + TRAIN.len() }>(LOW_SPECIFIC, &[], TRAIN);

/// Writes what stands behind the `own` signals of a fidelity.
#[inline(always)]
pub(super) fn shared<S: Scalar>(list: &[Signal], values: [S; TRAIN.len()], out: &mut [S]) {
    out[list.len()..list.len() + TRAIN.len()].copy_from_slice(&values);
}
