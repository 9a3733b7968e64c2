"""An own controller in a live session: PD on the position, by torque, on three units at once."""

import elevon

units = [
    {"duration": 1, "command": {"mode": "torque"}, "load": {"output": {"terms": [load]}}}
    for load in ({"kind": "constant", "value": f"{n} N m"} for n in (0, 10, 20))
]
session = elevon.Session([elevon.Run("torino-rotary", unit) for unit in units])
recordings = session.run(
    "1 s",
    lambda now: 120.0 * (0.1 - now["output_position"]) - 0.2 * now["motor_speed"],
    record=["output_position"],
)
print(*(f"{r['output_position'].values[-1]:.4f} rad" for r in recordings))
