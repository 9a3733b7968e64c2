"""Ten backlashes at once: the batch is bit-identical to ten single runs."""

import elevon

actuator = elevon.Actuator.load("torino-rotary")
scenario = elevon.Scenario.from_dict(
    {
        "duration": "0.5 s",
        "command": {"terms": [{"kind": "sine", "amplitude": "7 deg", "frequency": "2 Hz"}]},
    }
)
runs = [
    elevon.Run(actuator, scenario.with_faults([f"backlash@transmission={tenths / 10} deg"]))
    for tenths in range(10)
]
for run, recording in zip(runs, elevon.simulate_batch(runs, fidelity="low"), strict=True):
    lost = recording["motor_position"].values / 124 - recording["output_position"].values
    print(run.scenario.fault[0], f"lost motion {abs(lost).max():.5f} rad")
