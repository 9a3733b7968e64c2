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
#: Median error of a number that the logs bear; of friction, whose law has more than its numbers.
SHARE, OF_FRICTION = 0.02, 0.05
#: Where they do not: largest median of the fit's own deviation. ASSUMED, half of what counts as not
#: determined.
BOUND = 0.10
#: Deviations within which the median error must lie; of five draws it lies beyond by chance once in
#: a hundred times.
HALF = 1.645


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


def missed(path, errors, deviations):
    """Return why the draws do not show a number; empty: they do.

    From its relative errors and the fit's own relative deviations. The median error is within the
    share asked for, or, where the logs do not bear that, within what the fit itself states, which
    must be small enough to be worth stating.
    """
    errors, deviations = np.abs(errors), np.asarray(deviations)
    share = OF_FRICTION if path.startswith("friction.") else SHARE
    error, stated, size = np.median(errors), np.median(deviations), np.median(errors / deviations)
    if error < share or (size < HALF and stated < BOUND):
        return ""
    return f"{path}: median error {error:.3f}, {size:.2f} deviations of {stated:.3f}"
