"""The stage of the friction rig: tables of friction, harmonics, detent, the mass that hangs."""

from __future__ import annotations

import numpy as np

from elevon.calibrate.stages.context import Context
from elevon.calibrate.stages.rig_tables import friction_knots, hanging_mass, harmonic_knots
from elevon.calibrate.stages.rig_tests import RigTest, rig_tests
from elevon.estimate import Estimate

_MASS = "screw.moving_mass"


def friction(ctx: Context) -> None:
    """Evaluate the logs in which a rig moved the ram."""
    tests = rig_tests(ctx.logs, ctx.actuator)
    mass = hanging_mass([test for test in tests if test.kind != "brake"])
    why = "too few rig tests in both directions at different levels of friction"
    ctx.add({} if mass is None else {_MASS: mass}, {_MASS: why})
    given = ctx.given_value(_MASS)
    ctx.add(*friction_knots(tests, ctx.actuator, mass or Estimate(given, 0.1 * given)))
    ctx.add(*harmonic_knots(tests, ctx.actuator))
    why = "no slow rig test with the motor connected shows it below the recorder's filter"
    ctx.add(_detent(tests, ctx.ratio), {"motor.detent_torque": why})


def _detent(tests: list[RigTest], ratio: float) -> dict[str, Estimate]:
    """Detent torque at the motor, over all tests that show it."""
    pairs = [
        (test.detent / ratio, test.detent_std / ratio)
        for test in tests
        if test.detent is not None and test.detent_std is not None
    ]
    if not pairs:
        return {}
    sizes, deviations = np.array(pairs).T
    spread = float(np.std(sizes)) / np.sqrt(max(len(sizes) - 1, 1)) if len(sizes) > 1 else 0.0
    std = float(np.hypot(np.mean(deviations) / np.sqrt(len(sizes)), spread))
    size = Estimate(float(np.mean(sizes)), std, max(len(sizes) - 1, 1))
    return {"motor.detent_torque": size}
