"""An own controller in a live session: a PD on the position, by torque, on three units at once."""

import elevon

actuator = elevon.Actuator.load("torino-rotary")
torque = {"duration": 1, "command": {"mode": "torque"}}
loads = [{"user": {"terms": [{"kind": "constant", "value": f"{n} N m"}]}} for n in (0, 10, 20)]
session = elevon.Session([elevon.Run(actuator, {**torque, "load": load}) for load in loads])
wanted = 0.1  # rad at the user's side


def controller(now):
    return 120.0 * (wanted - now["user_position"]) - 0.2 * now["motor_speed"]


recordings = session.run("1 s", controller, period="1 ms", record=["user_position"])
print(*(f"{r['user_position'].values[-1]:.4f} rad" for r in recordings))
