"""Runs of the low model through a log's test, shown by the same roles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.candidates import Candidate
from elevon.diagnose.bymodel.evidence import Evidence
from elevon.diagnose.bymodel.replay import Replay
from elevon.diagnose.byroles.candidates import counted_of
from elevon.diagnose.byroles.log import RoleLog, evidence_of

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["DAILY", "Unit", "drawn", "modelled", "replay_by_roles", "shown_by"]

Floats = npt.NDArray[np.float64]
_DRAWS = 24
_POINTS = 3  # severities of each candidate, one way
_CHUNK = 32  # runs held at once

#: Deviation of what changes from day to day, by the end of a parameter's path. ASSUMED, as for the
#: rotary actuator: 15 K of winding, 1 % of flux, friction by some percent, the supply's regulation.
DAILY: Mapping[str, tuple[float, str]] = {
    "winding_temperature": (15.0, "add"),
    "emf_constant": (0.01, "scale"),
    "friction.dynamic": (0.05, "scale"),
    "friction.static": (0.05, "scale"),
    "friction.viscous": (0.10, "scale"),
    "friction_coefficient": (0.05, "scale"),
    "coulomb_force": (0.05, "scale"),
    "viscous_torque": (0.10, "scale"),
    "supply_voltage": (0.01, "scale"),
}


@dataclass(frozen=True)
class Unit:
    """A unit of the replay: its values and its faults."""

    actuator: Actuator
    faults: tuple[str, ...] = ()


def drawn(actuator: Actuator, rng: np.random.Generator) -> Actuator:
    """Return a healthy unit of another day."""
    values: dict[str, float | str] = {}
    steps = {end: float(rng.standard_normal()) for end in DAILY}
    steps["friction.static"] = steps["friction.dynamic"]
    for path, entry in actuator.parameters.items():
        end = next((end for end in DAILY if path.endswith(end)), None)
        if end is None or isinstance(entry.value, str) or path.startswith("thermal."):
            continue
        spread, way = DAILY[end]
        old = actuator.parameters.value(path)
        values[path] = (
            old + spread * steps[end] if way == "add" else old * (1 + spread * steps[end])
        )
    return actuator.with_values(values, source="run-to-run spread")


def replay_by_roles(item: RoleLog, actuator: Actuator, candidates: Sequence[Candidate]) -> Replay:
    """Run the test: healthy, each candidate at several severities, and the spread."""
    counted = counted_of(actuator)
    severities = {
        c.key: np.array([0.0, 1.0]) if c.kind in counted else _severities(c) for c in candidates
    }
    units = [Unit(actuator)]
    for c in candidates:
        units += [Unit(actuator, (c.text(float(s)),)) for s in severities[c.key] if s != 0.0]
    units += [Unit(drawn(actuator, np.random.default_rng([15, k]))) for k in range(_DRAWS)]
    shown = list(shown_by(item, units))
    healthy = shown[0]
    rows = np.array([_on(healthy, e) for e in shown])
    shifts, at = {}, 1
    for c in candidates:
        zero = severities[c.key] == 0.0
        table = np.zeros((len(zero), len(healthy.names)))
        count = int((~zero).sum())
        table[~zero] = np.nan_to_num(rows[at : at + count] - healthy.values)
        shifts[c.key] = table
        at += count
    draws = np.where(np.isfinite(rows[at:]), rows[at:], healthy.values)
    return Replay(healthy, severities, shifts, draws)


def modelled(item: RoleLog, actuator: Actuator) -> Evidence:
    """Return what the healthy model shows of a log's test."""
    return next(shown_by(item, [Unit(actuator)]))


def _on(healthy: Evidence, other: Evidence) -> Floats:
    """Values by the healthy run's names; NaN where the other run gives none."""
    there = dict(zip(other.names, other.values.tolist(), strict=True))
    return np.array([there.get(name, np.nan) for name in healthy.names])


def _severities(c: Candidate) -> Floats:
    steps = np.linspace(0.0, 1.0, _POINTS + 1) ** 2
    low = c.low * steps[:0:-1] if c.low < 0.0 else np.zeros(0)
    return np.concatenate((low, c.high * steps))


def shown_by(item: RoleLog, units: Sequence[Unit]) -> Iterator[Evidence]:
    """Run units through a log's test; evidence of each by the log's roles."""
    from elevon.faults import Fault
    from elevon.simulate import Run
    from elevon.simulate.batch import simulate_prepared
    from elevon.simulate.prepare import prepare

    actuator = units[0].actuator
    scenario, signals = _scenario(item, actuator), _signals(item, actuator)
    for first in range(0, len(units), _CHUNK):
        ready = [
            prepare(
                Run(u.actuator, scenario.with_faults([Fault.parse(t) for t in u.faults])),
                "low",
                f"{','.join(signals.values())}@{item.rate:g} Hz",
                doubts=False,
            )
            for u in units[first : first + _CHUNK]
        ]
        plan = ready[0].plan[0]
        for result in simulate_prepared(ready, fidelity="low"):
            rows = result["clocks"][plan.name]
            yield _evidence(item, rows, plan.signals, signals, actuator)


def _evidence(
    item: RoleLog,
    rows: Mapping[str, Any],
    names: Sequence[str],
    signals: Mapping[str, str],
    actuator: Actuator,
) -> Evidence:
    at = np.clip(item.time, 0.0, float(rows["time"][-1]))
    columns = dict(zip(names, rows["values"].T, strict=False))
    channels = {
        role: np.interp(at, rows["time"], np.nan_to_num(columns[name]))
        for role, name in signals.items()
    }
    return evidence_of(channels, item, actuator)


def _signals(item: RoleLog, actuator: Actuator) -> dict[str, str]:
    """Role to the low model's signal, what a sensor shows before what is true."""
    from elevon import _core

    played: dict[str, str] = {}
    for signal in _core.signals(actuator.wiring, "low"):
        if signal["role"] is not None:
            played[signal["role"]] = signal["name"]
    return {role: played[role] for role in item.channels if role in played}


def _scenario(item: RoleLog, actuator: Actuator) -> Any:
    from elevon.scenario import Scenario

    document: dict[str, Any] = {"duration": float(item.time[-1]) + 2.0 / item.rate}
    document["command"] = _command(item, actuator)
    if item.load is not None:
        points = {"kind": "table", "times": item.time.tolist(), "values": item.load.tolist()}
        document["load"] = {"user": {"terms": [points]}}
    initial = _initial(item, actuator)
    if initial:
        document["initial"] = initial
    return Scenario.from_dict(document)


def _command(item: RoleLog, actuator: Actuator) -> dict[str, Any]:
    """What was asked: a table, or actions where the actuator is asked by actions."""
    from elevon import _core

    wiring = next(w for w in _core.wirings() if w["name"] == actuator.wiring)
    if not wiring["actions"]:
        points = {"kind": "table", "times": item.time.tolist(), "values": item.command.tolist()}
        return {"mode": wiring["modes"][0], "terms": [points]}
    level = np.round(item.command).astype(int)
    turns = [0, *(np.flatnonzero(np.diff(level)) + 1).tolist()]
    steps = [
        {"time": float(item.time[k]), "action": wiring["actions"][int(level[k])]} for k in turns
    ]
    return {"mode": wiring["modes"][0], "steps": steps}


def _initial(item: RoleLog, actuator: Actuator) -> dict[str, float]:
    from elevon import _core

    if "output_position" not in item.channels:
        return {}
    start = float(np.mean(item.channels["output_position"][:3]))
    names = _core.initial(actuator.wiring, "low")
    if "nut_position" in names:
        return {"nut_position": start}
    known = actuator.parameters
    lead = known.value("screw.lead") if "screw.lead" in known else 1.0
    if "motor_position" in item.channels:
        motor = float(np.mean(item.channels["motor_position"][:3]))
    else:
        motor = start * known.value("gear.ratio") / lead
    return {"motor_position": motor, "user_position": start}
