"""Exact derivatives against differences of runs, for any parameter or fault of a servo."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import elevon
from elevon import _core
from elevon.errors import InputError
from elevon.parameters import records
from elevon.scenario import Scenario
from elevon.simulate.sensitivity import sensitivities

SIGNALS = (
    "motor_position",
    "motor_speed",
    "current_q",
    "output_position",
    "resolver_position",
    "resolver_speed",
    "winding_temperature",
)
RECORD = ",".join(SIGNALS) + "@1 kHz"
#: Steps of a difference, relative (absolute about zero): each is exact for some parameters only.
STEPS = (1e-3, 1e-5, 1e-7)
#: Tried as another value of what is zero.
OTHERS = (0.05, 1e-3, 1e-5)
#: Of a signal's largest derivative, and of the largest of all signals.
RELATIVE, ABSOLUTE = 1e-3, 1e-6

Rows = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Motion:
    """One actuator that turns at a steady speed against a load: nothing switches on the way."""

    name: str
    drive: str
    values: tuple[tuple[str, Any], ...] = ()
    speed: float = 40.0
    load: float = 0.05
    output: float = 0.0

    @property
    def actuator(self) -> elevon.Actuator:
        chosen = {"drive.kind": self.drive, **dict(self.values)}
        return elevon.Actuator.load(self.name).with_values(chosen)

    def scenario(self, fault: dict[str, Any] | None = None) -> Scenario:
        acting = {"shaft": self.load, "output": self.output}
        loads = {
            port: {"terms": [{"kind": "constant", "value": value}]}
            for port, value in acting.items()
            if value
        }
        return Scenario.from_dict(
            {
                "duration": "0.15 s",
                "command": {
                    "mode": "speed",
                    "terms": [{"kind": "constant", "value": self.speed}],
                },
                "load": loads,
                "initial": {"motor_speed": 0.95 * self.speed},
                "fault": [] if fault is None else [fault],
            }
        )


def rows(actuator: elevon.Actuator, scenario: Scenario) -> Rows:
    """Every sample of the signals, shape (signals, n)."""
    run = elevon.simulate(actuator, scenario, fidelity="low", record=RECORD)
    return np.stack([run[name].values for name in SIGNALS])


@dataclass(frozen=True)
class Place:
    """One number by which a run is differentiated: where it stands, and its bounds."""

    label: str
    value: float
    minimum: float
    maximum: float
    exact: Callable[[], Rows]
    run: Callable[[float], Rows]


def parameter_places(motion: Motion, *, neutral: bool) -> Iterator[Place]:
    """Every number of an actuator, at its value or at another one."""
    actuator = motion.actuator
    for path, record in records(actuator.wiring).items():
        if "low" not in record.fidelities or record.choices is not None or record.whole:
            continue
        value = float(actuator.parameters.value(path))
        at = value if neutral else another(value, lambda x, p=path: _runs(motion, p, x))
        if at is None:
            continue
        yield Place(
            label=f"{path} = {at:g}",
            value=at,
            minimum=record.minimum,
            maximum=record.maximum,
            exact=lambda p=path, x=at: _derivative(motion, p, x),
            run=lambda x, p=path: rows(motion.actuator.with_values({p: x}), motion.scenario()),
        )


def _runs(motion: Motion, path: str, value: float) -> bool:
    try:
        rows(motion.actuator.with_values({path: value}), motion.scenario())
    except elevon.ElevonError:
        return False
    return True


def another(value: float, accepted: Callable[[float], bool]) -> float | None:
    """Return another value that runs, or None."""
    tried = [1.05 * value, 0.95 * value] if value else OTHERS
    return next((x for x in tried if accepted(x)), None)


def _derivative(motion: Motion, path: str, value: float) -> Rows:
    actuator = motion.actuator.with_values({path: value})
    found = sensitivities(actuator, motion.scenario(), [path], record=RECORD).derivatives[path]
    return np.stack([found[name] for name in SIGNALS])


def fault_places(motion: Motion, *, neutral: bool) -> Iterator[Place]:
    """Every kind of fault in its first and its last place, at severity 0 or at another one."""
    actuator = motion.actuator
    for item in _core.faults(actuator.wiring):
        if "low" not in item["fidelities"] or item["whole"]:
            continue
        known = {
            a["name"]: 0.5 if a["default"] is None else a["default"] for a in item["attributes"]
        }
        for place in {item["places"][0]: 0, item["places"][-1]: 0}:
            made = {"kind": item["kind"], "place": place, **known}
            at = 0.0 if neutral else another(0.0, lambda x, m=made: _bears(motion, m, x))
            if at is None:
                continue
            yield Place(
                label=f"{item['kind']}@{place} = {at:g}",
                value=at,
                minimum=item["minimum"],
                maximum=item["maximum"],
                exact=lambda m=made, x=at: _severity(motion, m, x),
                run=lambda x, m=made: rows(motion.actuator, motion.scenario({**m, "severity": x})),
            )


def _bears(motion: Motion, fault: dict[str, Any], severity: float) -> bool:
    try:
        rows(motion.actuator, motion.scenario({**fault, "severity": severity}))
    except elevon.ElevonError:
        return False
    return True


def _severity(motion: Motion, fault: dict[str, Any], severity: float) -> Rows:
    scenario = motion.scenario({**fault, "severity": severity})
    found = sensitivities(motion.actuator, scenario, faults=[0], record=RECORD).derivatives
    return np.stack([found["fault_1"][name] for name in SIGNALS])


def differences(place: Place) -> Iterator[tuple[Rows, float]]:
    """Differences of second order and their rounding; at zero and at a bound from one side."""
    for size in STEPS:
        h = size * (abs(place.value) or 1.0)
        rounding = 2e-12 / h
        inside = [
            side for side in (1, -1) if place.minimum <= place.value + 3 * side * h <= place.maximum
        ]
        try:
            if place.value != 0.0 and len(inside) == 2:
                yield (place.run(place.value + h) - place.run(place.value - h)) / (2 * h), rounding
                continue
            for side in inside:
                one, two, three = (place.run(place.value + k * side * h) for k in (1, 2, 3))
                yield side * (-5 * one + 8 * two - 3 * three) / (2 * h), rounding
        except InputError:
            continue


def excess(place: Place) -> float:
    """Return by how much the exact derivative misses the nearest difference; 1 is allowed.

    Raises
    ------
    InputError
        There is no derivative, with the reason.
    """
    exact = place.exact()
    misses = []
    for difference, rounding in differences(place):
        scale = np.maximum(np.abs(exact), np.abs(difference)).max(axis=1)
        error = np.abs(exact - difference).max(axis=1)
        misses.append(float(np.max(error / (RELATIVE * scale + ABSOLUTE * scale.max() + rounding))))
        if misses[-1] <= 1.0:
            break
    return min(misses)
