"""One suite over every fault of every actuator; a new one is covered the day its catalogue line
exists.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import elevon
from tests.contract import sets

CASES = [
    pytest.param(name, fidelity, kind, place, record, id=f"{name}-{fidelity}-{kind}@{place}")
    for name in sets.names()
    for fidelity in sets.fidelities(name)
    for kind, place, record in sets.places(name)
    if fidelity in record["fidelities"]
]
PROFILES = [
    None,
    {"kind": "step", "time": "5 ms"},
]


@cache
def healthy(name: str, fidelity: str) -> Any:
    """The run without any fault."""
    return simulate(name, fidelity, None)


def simulate(name: str, fidelity: str, fault: dict[str, Any] | None) -> Any:
    """Every signal of a short run."""
    chosen = ",".join(sets.signals(name, fidelity)) + "@1 kHz"
    return elevon.simulate(
        elevon.Actuator.load(name),
        sets.scenario(name, fault),
        fidelity=fidelity,
        record=[chosen],
        seed=5,
    )


def attributes(record: dict[str, Any]) -> dict[str, Any]:
    """The attributes that have no default, at zero."""
    return {a["name"]: 0.0 for a in record["attributes"] if a["default"] is None}


def extreme(record: dict[str, Any]) -> float:
    """A severity well inside the range but far from healthy."""
    top = record["maximum"]
    if record["unit"] in ("", "1", None) and top in (0.0, 1.0):
        return 1.0 if "switch" in record["kind"] or "open" in record["kind"] else 0.5
    return min(0.5 * top, 1.0) if top > 0 else 0.5 * record["minimum"]


@pytest.mark.parametrize(
    "profile",
    [PROFILES[0], pytest.param(PROFILES[1], marks=pytest.mark.long)],
    ids=["constant", "step"],
)
@pytest.mark.parametrize(("name", "fidelity", "kind", "place", "record"), CASES)
def test_severity_zero_is_bit_identical_to_no_fault(
    name: str,
    fidelity: str,
    kind: str,
    place: str,
    record: dict[str, Any],
    profile: dict[str, Any] | None,
) -> None:
    """All signals, every sample, every bit."""
    fault = {"kind": kind, "place": place, "severity": 0.0, **attributes(record)}
    if profile:
        fault["profile"] = profile
    zero, none = simulate(name, fidelity, fault), healthy(name, fidelity)
    assert zero.meta["status"] == none.meta["status"] == "ok"
    for signal in sets.signals(name, fidelity):
        if not signal.startswith("fault"):
            assert np.array_equal(zero[signal].values, none[signal].values, equal_nan=True), signal


@pytest.mark.parametrize(("name", "fidelity", "kind", "place", "record"), CASES)
def test_every_fault_does_something(
    name: str, fidelity: str, kind: str, place: str, record: dict[str, Any]
) -> None:
    """A severe one changes some signal, or trips the drive; its label records the severity
    applied.
    """
    severity = extreme(record)
    fault = {"kind": kind, "place": place, "severity": severity, **attributes(record)}
    broken, none = simulate(name, fidelity, fault), healthy(name, fidelity)
    assert broken.meta["status"] in {"ok", "tripped"}
    assert broken.labels
    changed = broken.meta["status"] == "tripped" or any(
        not np.array_equal(broken[signal].values, none[signal].values, equal_nan=True)
        for signal in sets.signals(name, fidelity)
        if not signal.startswith("fault")
    )
    assert changed


@pytest.mark.parametrize(("name", "fidelity", "kind", "place", "record"), CASES)
def test_severity_out_of_range_is_refused_by_name(
    name: str, fidelity: str, kind: str, place: str, record: dict[str, Any]
) -> None:
    """Above the maximum (if there is one), below the minimum, and NaN."""
    wrong = [float("nan")]
    if np.isfinite(record["maximum"]):
        wrong.append(record["maximum"] + 1.0)
    if np.isfinite(record["minimum"]):
        wrong.append(record["minimum"] - 1.0)
    for severity in wrong:
        fault = {"kind": kind, "place": place, "severity": severity, **attributes(record)}
        with pytest.raises(elevon.InputError) as caught:
            simulate(name, fidelity, fault)
        assert kind in str(caught.value) or "severity" in str(caught.value)
