"""What the reduced-order model shows of a log's test, by the same roles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.byroles.log import BEFORE, RoleLog
from elevon.diagnose.byroles.numbers import Numbers, numbers_of
from elevon.diagnose.byroles.role_test import RoleTest, action_numbers
from elevon.diagnose.byroles.series import averaged

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = [
    "RoleUnit",
    "as_on_stand",
    "channels_by",
    "deflection_under",
    "driven",
    "numbers_by",
    "numbers_of_log",
]

_CHUNK = 64  # runs held at once
_OVER = 4  # samples of the model to one of the log, which are averaged: loggers filter, too
_ELASTIC = 1.0  # backlash.model: an elastic contact
_PUSHED = 0.1  # of the greatest load, of the fastest motion, and share of the time
_SET_POINT = "_ref"  # end of roles that a drive knows as numbers: nothing filters them


@dataclass(frozen=True)
class RoleUnit:
    """A unit of the replay.

    Attributes
    ----------
    values : mapping of str to float
        What differs from the actuator.
    faults : tuple of str
        As in ``--fault``.
    late : float
        Samples that it is seen to begin too late.
    phase : float
        Samples by which the recorder's instants precede those of the log: kinks and steps of
        the command fall between samples.
    number : int
        Of its random numbers; healthy days differ in them, faults do not.
    compliant : bool
        Whether its output deflects under the log's load, which the reduced-order model does not
        know.
    """

    values: Mapping[str, float]
    faults: tuple[str, ...] = ()
    late: float = 0.0
    phase: float = 0.0
    number: int = 0
    compliant: bool = True


def as_on_stand(actuator: Actuator, test: RoleTest) -> Actuator:
    """Return the actuator with what the log's stand set, its load over the stroke among it."""
    ready = actuator.with_values(dict(test.settings), source="stand of the log")
    if test.stroke is None:
        return ready
    return ready.with_values(test.stroke.settings(ready), source="load of the log")


def numbers_of_log(item: RoleLog, actuator: Actuator, channels: Mapping[str, Floats]) -> Numbers:
    """Return the numbers of a log, or of a model run on its instants."""
    known = actuator.parameters
    pairs = known.value("motor.pole_pairs") if "motor.pole_pairs" in known else None
    return numbers_of(channels, item.command, item.time, item.units, pairs)


def numbers_by(item: RoleLog, actuator: Actuator, units: Sequence[RoleUnit]) -> Iterator[Numbers]:
    """Run units through a log's test; numbers of each by the log's roles."""
    for channels in channels_by(item, actuator, units):
        yield numbers_of_log(item, actuator, channels)


def channels_by(
    item: RoleLog, actuator: Actuator, units: Sequence[RoleUnit]
) -> Iterator[dict[str, Floats]]:
    """Run units through a log's test; what each shows by the log's roles, on its instants.

    One run is prepared; the others exchange parameters and faults in what goes to the core.
    """
    from elevon.simulate import Run, solver_step
    from elevon.simulate.batch import simulate_prepared
    from elevon.simulate.prepare import prepare

    ready = as_on_stand(actuator, item.test)
    signals = _signals(item, actuator)
    over = _over(item.rate, solver_step(ready, "low"))
    record = f"{','.join(signals.values())}@{over * item.rate:.12g} Hz"
    base = prepare(Run(ready, _scenario(item, actuator)), "low", record, notices=False)
    base = replace(base, core=_with_arrays(base.core, item, actuator))
    places = {path: k for k, path in enumerate(ready.parameters)}
    actions = action_numbers(actuator.wiring)
    deflection = deflection_under(item, ready)
    for first in range(0, len(units), _CHUNK):
        runs = [
            replace(base, core=_of_unit(base.core, unit, places, item, actuator.wiring))
            for unit in units[first : first + _CHUNK]
        ]
        results = simulate_prepared(runs, fidelity="low")
        for unit, result in zip(units[first : first + _CHUNK], results, strict=True):
            rows = result["clocks"][base.plan[0].name]
            late = unit.late if actions else unit.late + unit.phase
            shows = _channels(item, rows, base.plan[0].signals, signals, late / item.rate)
            if deflection is not None and unit.compliant and "output_position" in shows:
                shows["output_position"] = shows["output_position"] - deflection
            yield shows


def driven(item: RoleLog, ready: Actuator) -> bool:
    """Whether a load drives the output of an elastic backlash over a tenth of the motion."""
    deflection = deflection_under(item, ready)
    if deflection is None:
        return False
    speed = np.gradient(item.command, item.time)
    pushed = deflection * np.sign(speed) < -_PUSHED * np.abs(deflection).max()
    moving = np.abs(speed) > _PUSHED * np.abs(speed).max()
    return bool(np.mean(pushed[moving]) > _PUSHED)


def deflection_under(item: RoleLog, ready: Actuator) -> Floats | None:
    """Return how far the output stands back under the log's load, shape (n,): force by stiffness.

    The reduced-order model's backlash is rigid. None without a load, or where the unit's contact is
    rigid.
    """
    known = ready.parameters
    if (
        item.test.load is None
        or "backlash.model" not in known
        or known.value("backlash.model") != _ELASTIC
    ):
        return None
    return np.asarray(
        np.interp(item.time, *item.test.load) / known.value("backlash.stiffness"), dtype=np.float64
    )


def _of_unit(
    core: Mapping[str, Any], unit: RoleUnit, places: Mapping[str, int], item: RoleLog, wiring: str
) -> dict[str, Any]:
    from elevon.faults import Fault

    vector = np.array(core["parameters"])
    for path, value in unit.values.items():
        vector[places[path]] = value
    faults = [
        Fault.parse(text).resolved(wiring, "low", f"fault[{k}]")
        for k, text in enumerate(unit.faults)
    ]
    out = {**core, "parameters": vector, "faults": faults, "run": unit.number}
    if unit.phase != 0.0:
        later = unit.phase / item.rate
        out["inputs"] = {
            port: [{**t, "times": np.asarray(t["times"]) + later} for t in terms]
            for port, terms in core["inputs"].items()
        }
    return out


def _channels(
    item: RoleLog,
    rows: Mapping[str, Any],
    names: Sequence[str],
    signals: Mapping[str, str],
    late: float,
) -> dict[str, Floats]:
    """A run's rows by role, on the log's instants; a run that ended early shows its end on."""
    clock = np.asarray(rows["time"])
    columns = dict(zip(names, np.asarray(rows["values"]).T, strict=False))
    at = item.time + BEFORE + late
    over = round(1.0 / (item.rate * (clock[1] - clock[0]))) if len(clock) > 1 else 1
    out = {}
    for role, name in signals.items():
        values = np.nan_to_num(columns[name])
        if len(clock) == 0:
            out[role] = np.zeros(len(at))
        elif item.units[role] == "1":
            out[role] = values[(np.searchsorted(clock, at + 1e-9, side="right") - 1).clip(0)]
        else:
            filtered = values if role.endswith(_SET_POINT) else averaged(values, over)
            out[role] = np.interp(at, clock, filtered)
    return out


def _over(rate: float, step: float) -> int:
    """Samples of the model to one of a log, an even number as far as its steps allow it."""
    steps = round(1.0 / (rate * step))
    return next((n for n in (_OVER, 2) if steps % n == 0), 1)


def _signals(item: RoleLog, actuator: Actuator) -> dict[str, str]:
    """Role to the reduced-order model's signal, what a sensor shows before what is true."""
    from elevon import _core

    played: dict[str, str] = {}
    for signal in _core.signals(actuator.wiring, "low"):
        if signal["role"] is not None:
            played[signal["role"]] = signal["name"]
    return {role: played[role] for role in item.channels if role in played}


_EMPTY: Mapping[str, Any] = {"kind": "table", "times": [0.0, 1.0], "values": [0.0, 0.0]}


def _scenario(item: RoleLog, actuator: Actuator) -> Any:
    """The test with empty tables: their arrays are put in when everything is checked."""
    from elevon import _core
    from elevon.scenario import Scenario

    wiring = next(w for w in _core.wirings() if w["name"] == actuator.wiring)
    actions = action_numbers(actuator.wiring)
    command: dict[str, Any] = {"mode": wiring["modes"][0], "terms": [_EMPTY]}
    if actions:
        command = {"mode": wiring["modes"][0], "steps": _steps(item.test, actions)}
    document: dict[str, Any] = {
        "duration": item.test.seconds + BEFORE + 2.0 / item.rate,
        "command": command,
    }
    if item.test.load is not None:
        document["load"] = {"output": {"terms": [_EMPTY]}}
    if item.test.initial:
        document["initial"] = dict(item.test.initial)
    return Scenario.from_dict(document)


def _steps(test: RoleTest, actions: Sequence[str]) -> list[dict[str, Any]]:
    times, numbers = test.command
    return [
        {"time": max(float(t) + BEFORE, 0.0), "action": actions[int(n) % len(actions)]}
        for t, n in zip(times, numbers, strict=True)
        if t < test.seconds
    ]


def _with_arrays(core: Mapping[str, Any], item: RoleLog, actuator: Actuator) -> dict[str, Any]:
    inputs = dict(core["inputs"])
    if not action_numbers(actuator.wiring):
        inputs["command"] = [_table(inputs["command"][0], item.test.command)]
    if item.test.load is not None:
        inputs["output"] = [_table(inputs["output"][0], item.test.load)]
    return {**core, "inputs": inputs}


def _table(term: Mapping[str, Any], points: tuple[Floats, Floats]) -> dict[str, Any]:
    times, values = points
    return {
        **term,
        "times": np.ascontiguousarray(times + BEFORE),
        "values": np.ascontiguousarray(values),
    }
