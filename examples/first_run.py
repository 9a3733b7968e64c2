"""Simulate the Torino bench actuator following a sine, and look at what it did."""

import elevon

actuator = elevon.Actuator.load("torino-rotary")
scenario = elevon.Scenario.from_dict(
    {
        "duration": "2 s",
        "command": {"terms": [{"kind": "sine", "amplitude": "7 deg", "frequency": "1 Hz"}]},
    }
)
recording = elevon.simulate(actuator, scenario, record="drive_log,user_position@400 Hz")
print(recording)
print("greatest position:", recording["user_position"].to("deg").max(), "deg")
