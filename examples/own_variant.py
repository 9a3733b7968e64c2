"""An own variant of an actuator: a file that names its base and what is different."""

from pathlib import Path

import elevon

Path("light.toml").write_text('base = "torino-rotary"\n[gear]\nratio = 50\n', "utf-8")
scenario = {"duration": "1 s", "command": {"terms": [{"kind": "step", "final": "5 deg"}]}}
for name in ("torino-rotary", "light.toml"):
    recording = elevon.simulate(name, scenario, record="output_position@1 kHz")
    position = recording["output_position"].to("deg")
    print(name, f"reaches 4.5 deg after {1e3 * recording.clock().time[position > 4.5][0]:.0f} ms")
