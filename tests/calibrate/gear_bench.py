"""Drawn landing gears on the virtual rig: what was put in, and the logs that came out."""

import numpy as np

from elevon import Actuator
from elevon.bench.loaded import run_loaded
from elevon.bench.procedure import Procedure, load_procedure
from elevon.bench.run import stand_setups
from elevon.calibrate.stages import role_log

#: Half range of the logarithm of each number that is drawn.
SPREADS = {
    "motor.emf_constant": 0.1, "motor.winding_resistance": 0.2, "motor.winding_inductance": 0.15,
    "motor.inertia": 0.15, "motor.detent_torque": 0.3, "screw.moving_mass": 0.2,
    "screw.efficiency_unloaded": 0.04, "screw.efficiency_loaded": 0.04,
    "control.gain_extension": 0.15, "control.gain_retraction": 0.15,
    "control.zero_extension": 0.15, "control.zero_retraction": 0.15,
    "control.acceleration_limit": 0.1, "control.speed_high": 0.05, "control.speed_low": 0.05,
    "brake.torque": 0.15, "lock.engage_travel": 0.1, "lock.release_travel": 0.15,
    "lock.spring_force": 0.1,
}  # fmt: skip
ASYMMETRY = 0.03  # of the friction, half between the directions
FRICTION, KNOT, HARMONIC = 0.15, 0.05, 0.2


def drawn(seed):
    """Return the drawn values by path, and the actuator."""
    rng = np.random.default_rng(seed)
    base = Actuator.load("pisa-landing-gear")

    def factor(half):
        return float(np.exp(half * rng.uniform(-1.0, 1.0)))

    value = base.parameters.value
    values = {path: value(path) * factor(half) for path, half in SPREADS.items()}
    level, apart = factor(FRICTION), ASYMMETRY * rng.uniform(-1.0, 1.0)
    for k in range(1, 9):
        for kind in ("ff", "ffm"):
            force = value(f"friction.{kind}_extension_{k}") * level * factor(KNOT)
            values[f"friction.{kind}_extension_{k}"] = force * (1.0 + apart)
            values[f"friction.{kind}_retraction_{k}"] = force * (1.0 - apart)
        for n in range(1, 6):
            path = f"friction.harmonic_{n}_{k}"
            values[path] = value(path) * factor(HARMONIC)
    return values, base.with_values(values)


def chosen(name, traces):
    """Return a procedure of the package with some of its traces only."""
    document = load_procedure(name).model_dump(exclude_unset=True, mode="json")
    document["step"] = [
        step for step in document["step"] if step["kind"] != "trace" or step["name"] in traces
    ]
    return Procedure.model_validate(document)


def make_logs(model, procedures, *, seed, fidelity="low"):
    """Run procedures and return their logs as the calibration reads them."""
    return [
        role_log(run_loaded(setup, fidelity)[0], f"{procedure.name}-{setup.trace.name}", model)
        for procedure in procedures
        for setup in stand_setups(procedure, model, seed=seed)
    ]
