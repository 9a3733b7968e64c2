"""Tables of friction from tests at a few speeds: what they determine; the mass that hangs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.rig_tests import HARMONICS, RigTest
from elevon.estimate import Estimate

KNOTS = 8
GRAVITY = 9.80665
_SEEN = 0.98  # resolution from which a knot is determined by tests
_BELIEF = 0.3  # of a table's value, as a deviation: what holds a knot that no test reaches
_SHAPE = 2.5e-4  # of a table's value: what a table of straight pieces leaves between its knots


#: Path to value.
Knot = dict[str, Estimate]


def knots(actuator: Actuator) -> Floats:
    """Return the speeds of the tables, m/s."""
    value = actuator.parameters.value
    return np.array([value(f"friction.speed_{k}") for k in range(1, KNOTS + 1)])


def hats(speed: Floats, at: Floats) -> Floats:
    """Return the weight of each knot at some speeds, shape (n, KNOTS): linear, held outside."""
    return np.stack([np.interp(np.abs(speed), at, row) for row in np.eye(len(at))], axis=1)


def hanging_mass(tests: Sequence[RigTest]) -> Estimate | None:
    """Mass that hangs from the cell, from tests in both directions at several levels of friction.

    Half the sum of both directions is the weight, and half of what friction differs: that part
    grows with the friction, the weight does not.
    """
    pairs = []
    for test in tests:
        back = [
            t for t in tests
            if t.kind == test.kind and test.speed > 0.0 > t.speed
            and abs(t.speed + test.speed) < 0.02 * test.speed
        ]  # fmt: skip
        pairs += [(0.5 * (test.level + t.level), 0.5 * (test.level - t.level)) for t in back[:1]]
    if len(pairs) < 4:
        return None
    middle, size = np.array(pairs).T
    if float(np.ptp(size)) < 0.2 * float(np.mean(size)):
        return None
    design = np.stack([np.ones_like(size), size], axis=1)
    value, *_ = np.linalg.lstsq(design, middle, rcond=None)
    residual = middle - design @ value
    degrees = len(pairs) - 2
    spread = float(residual @ residual) / degrees
    std = float(np.sqrt(spread * np.linalg.inv(design.T @ design)[0, 0]))
    return Estimate(-float(value[0]) / GRAVITY, max(std / GRAVITY, 1e-3), degrees)


def friction_knots(
    tests: Sequence[RigTest], actuator: Actuator, mass: Estimate
) -> tuple[Knot, dict[str, str]]:
    """Return the knots of both tables that the tests determine, and why the others are not."""
    rows = []
    for kind in ("ff", "ffm"):
        for name, direction in (("extension", 1.0), ("retraction", -1.0)):
            mine = [t for t in tests if t.kind == kind and t.direction == direction]
            forces = [t.direction * (t.level + mass.value * GRAVITY) for t in mine]
            deviations = [np.hypot(t.level_std, _SHAPE * abs(t.level)) for t in mine]
            rows.append((f"friction.{kind}_{name}", mine, forces, deviations))
    levels, reasons = _tables(rows, actuator)
    weight = mass.std * GRAVITY  # the mass moves a whole table
    return {
        path: Estimate(item.value, float(np.hypot(item.std, weight)), mass.degrees)
        for path, item in levels.items()
    }, reasons


def harmonic_knots(tests: Sequence[RigTest], actuator: Actuator) -> tuple[Knot, dict[str, str]]:
    """Return the knots of the harmonics that the tests determine, and why not the others."""
    mine, rows = [t for t in tests if t.kind in ("ff", "ffm")], []
    for n in range(1, HARMONICS + 1):
        amplitudes = [t.harmonics[n - 1] for t in mine]
        deviations = [np.hypot(t.harmonics_std[n - 1], 0.02) for t in mine]
        rows.append((f"friction.harmonic_{n}", mine, amplitudes, deviations))
    return _tables(rows, actuator)


def _tables(
    rows: Sequence[tuple[str, Sequence[RigTest], list[float], list[float]]], actuator: Actuator
) -> tuple[Knot, dict[str, str]]:
    """Return the knots of tables: of each its name, tests, values, deviations."""
    determined: Knot = {}
    reasons: dict[str, str] = {}
    for name, tests, values, deviations in rows:
        paths = [f"{name}_{k}" for k in range(1, KNOTS + 1)]
        levels, missing = _table(paths, tests, np.array(values), np.array(deviations), actuator)
        determined |= levels
        reasons |= missing
    return determined, reasons


def _table(
    paths: Sequence[str],
    tests: Sequence[RigTest],
    values: Floats,
    deviation: Floats,
    actuator: Actuator,
) -> tuple[Knot, dict[str, str]]:
    """Weighted least squares over the knots, each held weakly by the value of the actuator file."""
    if not tests:
        return {}, dict.fromkeys(paths, "no rig test of this kind and direction")
    at = knots(actuator)
    prior = np.array([actuator.parameters.value(path) for path in paths])
    belief = _BELIEF * np.maximum(prior, 0.1 * float(prior.max()) + 1e-9)
    design = hats(np.array([t.speed for t in tests]), at) / deviation[:, None]
    normal = design.T @ design
    inverse = np.linalg.inv(normal + np.diag(belief**-2.0))
    value = prior + inverse @ (design.T @ (values / deviation - design @ prior))
    seen = np.diag(inverse @ normal)
    residual = values / deviation - design @ value
    degrees = max(len(tests) - int(np.sum(seen > _SEEN)), 1)
    inflation = max(1.0, float(residual @ residual) / degrees)
    levels, missing = {}, {}
    for k, path in enumerate(paths):
        if seen[k] > _SEEN:
            levels[path] = Estimate(
                max(float(value[k]), 0.0), float(np.sqrt(inverse[k, k] * inflation))
            )
        else:
            missing[path] = f"no rig test at or beside {1e3 * at[k]:.4g} mm/s"
    return levels, missing
