"""Drawn ballscrews on the virtual stand: what was put in, and the logs that came out."""

import numpy as np

from elevon import Actuator
from elevon.bench.loaded import run_loaded
from elevon.bench.procedure import load_procedure
from elevon.bench.run import stand_setups
from elevon.calibrate.stages import role_log

#: Half range of the logarithm of each number that is drawn.
SPREADS = {
    "motor.emf_constant": 0.1, "motor.winding_resistance": 0.15, "motor.inertia": 0.2,
    "friction.dynamic": 0.3, "friction.viscous": 0.4, "screw.preload": 0.3,
    "load.mass": 0.3, "load.damping": 0.3, "load.friction": 0.3,
    "control.position_gain": 0.15, "control.speed_gain": 0.15, "control.integral_time": 0.2,
    "thermal.winding_mass": 0.2, "thermal.housing_capacity": 0.2,
    "thermal.winding_to_surface": 0.2, "thermal.convection": 0.2,
    "screw.nut_capacity": 0.2, "screw.nut_to_air": 0.2,
}  # fmt: skip
LOSS = 0.3  # the same, of what each efficiency loses


def drawn(seed, name="nasa-ballscrew"):
    """Return the drawn values by path, and the actuator."""
    rng = np.random.default_rng(seed)
    base = Actuator.load(name)
    value = base.parameters.value

    def factor(half):
        return float(np.exp(half * rng.uniform(-1.0, 1.0)))

    values = {path: value(path) * factor(half) for path, half in SPREADS.items()}
    opposing, aiding = value("screw.efficiency"), value("screw.efficiency_aiding")
    values["screw.efficiency"] = 1.0 - (1.0 - opposing) * factor(LOSS)
    values["screw.efficiency_aiding"] = values["screw.efficiency"] - (opposing - aiding) * factor(
        LOSS
    )
    # The same ratio at rest: no table has it apart.
    static = value("friction.static") / value("friction.dynamic") * values["friction.dynamic"]
    return values, base.with_values({**values, "friction.static": static})


def make_logs(model, procedures, *, seed, fidelity):
    """Run procedures, by name or as they are; return their logs as the calibration reads them."""
    logs = []
    for procedure in procedures:
        ready = load_procedure(procedure) if isinstance(procedure, str) else procedure
        for setup in stand_setups(ready, model, seed=seed):
            name = f"{ready.name}-{setup.trace.name}"
            logs.append(role_log(run_loaded(setup, fidelity)[0], name, model))
    return logs
