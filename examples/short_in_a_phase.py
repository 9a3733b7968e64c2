"""What a short in one phase does to the torque current: healthy beside broken."""

import numpy as np

import elevon

actuator = elevon.Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})
healthy = elevon.Scenario.from_dict(
    {
        "duration": "1 s",
        "command": {"mode": "speed", "terms": [{"kind": "constant", "value": "200 rpm"}]},
        "load": {"brake": {"terms": [{"kind": "constant", "value": "1 N m"}]}},
    }
)
broken = healthy.with_faults(["short@motor.phase_a=0.2"])
for name, scenario in (("healthy", healthy), ("20 % of the turns of phase a shorted", broken)):
    recording = elevon.simulate(actuator, scenario, record="voltage_q_meas,motor_torque@1 kHz")
    voltage = recording["voltage_q_meas"].values[500:]
    print(f"{name}: ripple of the q voltage {np.ptp(voltage):.2f} V")
