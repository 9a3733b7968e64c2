"""Fault severity over time: the applied value, read off a signal that is proportional to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from elevon import _core
from tests.physics.rig import FREE_SHAFT, SUPPLY, run

SEVERITY, GRID = 0.4, 1e-3
Formula = Callable[[np.ndarray], np.ndarray]


def exponential(t: np.ndarray) -> np.ndarray:
    """From nothing at 0.1 s to everything at 0.5 s, e-folding in 0.15 s."""
    grown = np.expm1((np.clip(t, 0.1, 0.5) - 0.1) / 0.15)
    return np.asarray(grown / np.expm1(0.4 / 0.15))


CASES: dict[str, tuple[dict[str, Any], Formula]] = {
    "constant": ({}, np.ones_like),
    "step": ({"time": "0.25 s"}, lambda t: (t >= 0.25 - 1e-9).astype(float)),
    "ramp": ({"start": "0.1 s", "end": "0.5 s"}, lambda t: np.clip((t - 0.1) / 0.4, 0, 1)),
    "exponential": ({"start": "0.1 s", "end": "0.5 s", "time_constant": "0.15 s"}, exponential),
    "intermittent": (
        {"start": "0.05 s", "period": "0.2 s", "duty": 0.25},
        lambda t: ((t >= 0.05 - 1e-9) & (np.mod(t - 0.05 + 1e-9, 0.2) < 0.05)).astype(float),
    ),
    "table": (
        {"times": [0.0, 0.2, 0.6], "values": [0.0, 1.0, 0.5]},
        lambda t: np.interp(t, [0.0, 0.2, 0.6], [0.0, 1.0, 0.5]),
    ),
}


def test_every_profile_has_a_case() -> None:
    """A profile added to the core without a formula here is an untested one."""
    assert {record["kind"] for record in _core.profiles()} == set(CASES)


@pytest.mark.parametrize("kind", CASES)
def test_profile_follows_its_formula(kind: str) -> None:
    """A sag of the supply shows its severity directly: V = V_dc (1 - s(t)).

    Smooth profiles are held on the fault grid, so they lag by up to one grid step of their slope.
    """
    arguments, formula = CASES[kind]
    sag = {
        "kind": "sag",
        "place": "supply",
        "severity": SEVERITY,
        "profile": {"kind": kind, **arguments},
    }
    rec = run(
        FREE_SHAFT | {"solver.fault_grid": GRID},
        duration=0.8,
        record="supply_voltage@500 Hz",
        scenario={"fault": [sag]},
    )
    time, volts = rec["supply_voltage"].time, rec["supply_voltage"].values
    applied = 1 - volts / SUPPLY
    expected = SEVERITY * formula(time)
    late = SEVERITY * formula(np.maximum(time - GRID, 0.0))
    low, high = np.minimum(expected, late), np.maximum(expected, late)
    assert np.all(applied >= low - 1e-5)
    assert np.all(applied <= high + 1e-5)
    assert np.ptp(applied) >= 0.9 * np.ptp(expected)


def test_the_label_is_the_applied_severity() -> None:
    """Recorded with the run, so that a data set needs no second source of truth."""
    sag = {"kind": "sag", "place": "supply", "severity": SEVERITY}
    rec = run(FREE_SHAFT, duration=0.1, record="supply_voltage@100 Hz", scenario={"fault": [sag]})
    assert rec.labels
