"""Simulate the Torino bench actuator following a sine, look at what it did, plot it."""

import elevon

sine = {"kind": "sine", "amplitude": "7 deg", "frequency": "1 Hz"}
scenario = {"duration": "2 s", "command": {"terms": [sine]}}
recording = elevon.simulate("torino-rotary", scenario)
print(recording)
print("greatest position:", recording["output_position"].to("deg").max(), "deg")
recording.plot(path="first_run.png", force=True)  # or first_run.html, to zoom
