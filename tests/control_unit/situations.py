"""Situations of the control unit's tests: faults in time, states and codes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

(RETRACTED, EXTENDING, LOCKED, RETRACTING, STOPPED, RELEASED, FAULT, UNCONFIRMED,
 OFF) = range(9)  # fmt: skip
NOT_ENGAGED, STALLED, HALL, PROXIMITY, UNCOMMANDED = 3, 4, 7, 8, 10
SUPPLY, WHEELS, NO_CURRENT, POWER = 11, 12, 13, 14
BOTH = pytest.mark.parametrize("fidelity", ["low", "high"])
#: The switching model takes most of the time; the numbered scenarios run both in any case.
EACH = pytest.mark.parametrize("fidelity", ["low", pytest.param("high", marks=pytest.mark.long)])
SWITCHES = ("0", "25", "75", "100")
JAM = {"kind": "jam", "place": "screw", "severity": 40e3, "position": "130 mm", "width": "20 mm"}


def during(kind: str, place: str, *edges: float, severity: float = 1.0) -> dict[str, Any]:
    """A fault that is on between the first and the second time, the third and the fourth ..."""
    times, values = [0.0], [0.0]
    for number, edge in enumerate(edges):
        times += [edge, edge + 1e-6]
        values += [float(number % 2), float(1 - number % 2)]
    profile = {"kind": "table", "times": [*times, 1e3], "values": [*values, values[-1]]}
    return {"kind": kind, "place": place, "severity": severity, "profile": profile}


def flicker(period: float, duty: float) -> dict[str, Any]:
    """The switch at 75 %, off for a share of each period."""
    profile = {"kind": "intermittent", "start": 0.05, "period": period, "duty": duty}
    return {**during("proximity_off", "sensor.proximity_75"), "profile": profile}


def stuck(switch: str, state: str = "on") -> str:
    """A proximity switch that reads the same for ever."""
    place = "weight_on_wheels" if switch == "wheels" else f"proximity_{switch}"
    return f"proximity_{state}@sensor.{place}=1"


def hall_supply(period: float, duty: float, start: float = 0.0) -> dict[str, Any]:
    """An intermittent supply of the Hall sensors."""
    profile = {"kind": "intermittent", "start": start, "period": period, "duty": duty}
    return {"kind": "dropout", "place": "sensor.hall", "severity": 1.0, "profile": profile}


def on_wheels(*edges: float, start: float = 1.0) -> dict[str, Any]:
    """Weight on wheels from the start (or none), changing at each edge."""
    times, values, now = [0.0], [start], start
    for edge in edges:
        times += [edge, edge + 1e-6]
        values += [now, 1.0 - now]
        now = 1.0 - now
    return {
        "weight_on_wheels": {
            "terms": [{"kind": "table", "times": [*times, 1e3], "values": [*values, now]}]
        }
    }


def false_end(rec: Any) -> bool:
    """Locked or retracted displayed for more than 50 ms where the leg is not."""
    locked = rec["locked"].values > 0.5
    home = rec["nut_position"].values < 3e-3
    state = rec["state"].values
    wrong = ((state == LOCKED) & ~locked) | ((state == RETRACTED) & ~home)
    return longest(wrong) > 0.05


def longest(flags: Any) -> float:
    """Longest time of a condition in a recording at 1 kHz, in s."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return float(np.max(edges[1::2] - edges[::2], initial=0)) * 1e-3
