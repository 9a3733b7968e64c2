"""Runs of the low model through a log's test, shown by the same roles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.candidates import Candidate
from elevon.diagnose.bymodel.evidence import Evidence
from elevon.diagnose.bymodel.replay import Replay
from elevon.diagnose.byroles.asked import RoleTest, action_numbers, same_test
from elevon.diagnose.byroles.candidates import counted_of, switched_of
from elevon.diagnose.byroles.log import BEFORE, RoleLog
from elevon.diagnose.byroles.numbers import Numbers, floors, numbers_of
from elevon.diagnose.byroles.spread import daily, factors_of

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["RoleReplay", "Unit", "channels_by", "numbers_of_log", "replay_by_roles", "shown_by"]

Floats = npt.NDArray[np.float64]
_DRAWS = 28
#: Deviations of the days that are run over those stated: what sets in on a rare day is seen, and
#: counts in full; what is linear counts as stated.
_WIDE = 2.0
_POINTS = 4  # severities of each candidate, one way
_ACTS = 0.5  # severity from which on a fault that is there or not acts
_LATE = 0.1  # deviation, in samples, of where a log is seen to begin. ASSUMED: straight onsets
_CHUNK = 64  # runs held at once
_OVER = 4  # samples of the model to one of the log, which are averaged: loggers filter, too
_SET_POINT = "_ref"  # end of roles that a drive knows as numbers: nothing filters them
_REMEMBERED = 16  # tests
_MOST = 1e4  # least deviations that a fault moves a number by: beyond it nothing more is learnt


class RoleReplay(Replay):
    """Numbers of the model in one test.

    Attributes
    ----------
    shown : Numbers
        Of the healthy unit, with their kinds and sizes.
    spread : ndarray, shape (k, k)
        Covariance of the numbers from day to day.
    switched : frozenset of str
        Kinds of faults that are there or not.
    """

    def __init__(
        self, shown: Numbers, severities: Mapping[str, Floats], shifts: Mapping[str, Floats],
        *, draws: Floats, spread: Floats, switched: frozenset[str],
    ) -> None:  # fmt: skip
        super().__init__(_evidence(shown), severities, shifts, draws)
        self.shown = shown
        self.spread = spread
        self.switched = switched

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities of shape (m,) do to the evidence, shape (m, k)."""
        at, table = self.severities[key], self.shifts[key]
        if key.partition("@")[0] in self.switched:  # as `Candidate.switched`
            severity = (severity >= _ACTS).astype(np.float64)
        low = np.clip(np.searchsorted(at, severity, side="right") - 1, 0, len(at) - 2)
        part = np.clip((severity - at[low]) / (at[low + 1] - at[low]), 0.0, 1.0)[:, None]
        return np.asarray(table[low] * (1.0 - part) + table[low + 1] * part, dtype=np.float64)


@dataclass(frozen=True)
class Unit:
    """A unit of the replay.

    Attributes
    ----------
    values : mapping of str to float
        What differs from the set.
    faults : tuple of str
        As in ``--fault``.
    late : float
        Samples that it is seen to begin too late.
    phase : float
        Samples by which the recorder's instants precede those of the log: kinks and steps of
        the command fall between samples.
    number : int
        Of its random numbers; healthy days differ in them, faults do not.
    """

    values: Mapping[str, float]
    faults: tuple[str, ...] = ()
    late: float = 0.0
    phase: float = 0.0
    number: int = 0


@dataclass(frozen=True)
class _Remembered:
    """A replay and what it served."""

    actuator: str
    candidates: tuple[Candidate, ...]
    roles: tuple[str, ...]
    clock: tuple[int, int]
    test: RoleTest
    made: RoleReplay


_RECENT: list[_Remembered] = []


def replay_by_roles(
    item: RoleLog, actuator: Actuator, candidates: Sequence[Candidate]
) -> RoleReplay:
    """Run the test: healthy, each candidate at several severities, and the spread.

    Logs of one test share the runs of the first of them.
    """
    own = _Remembered(
        actuator.hash,
        tuple(candidates),
        tuple(item.channels),
        (len(item.time), round(item.rate)),
        item.test,
        None,  # type: ignore[arg-type]
    )
    for past in _RECENT:
        alike = all(
            getattr(past, name) == getattr(own, name)
            for name in ("actuator", "candidates", "roles", "clock")
        )
        if alike and past.test.settings == item.test.settings and same_test(past.test, item.test):
            return past.made
    made = _replayed(item, actuator, candidates)
    _RECENT.append(replace(own, made=made))
    del _RECENT[:-_REMEMBERED]
    return made


def _replayed(item: RoleLog, actuator: Actuator, candidates: Sequence[Candidate]) -> RoleReplay:
    severities = {c.key: _severities(c, actuator) for c in candidates}
    units = [Unit({})]
    for c in candidates:
        units += [Unit({}, (c.text(float(s)),)) for s in severities[c.key] if s != 0.0]
    ready = _as_on_stand(actuator, item.test)
    steps = _steps_of_days(len(factors_of(ready)))
    units += _days(ready, steps)
    shown = list(shown_by(item, actuator, units))
    names = tuple(shown[0].values)
    rows = np.array([[s.values.get(n, np.nan) for n in names] for s in shown])
    most = _MOST * floors(shown[0], names, rows[0])
    shifts, at = {}, 1
    for c in candidates:
        zero = severities[c.key] == 0.0
        table = np.zeros((len(zero), len(names)))
        count = int((~zero).sum())
        table[~zero] = np.clip(np.nan_to_num(rows[at : at + count] - rows[0]), -most, most)
        shifts[c.key] = table
        at += count
    draws = np.where(np.isfinite(rows[at:]), rows[at:], rows[0])
    return RoleReplay(
        shown[0],
        severities,
        shifts,
        draws=draws,
        spread=spread_of(draws, steps),
        switched=switched_of(actuator),
    )


def _steps_of_days(factors: int) -> Floats:
    """Draws in deviations, shape (d, factors + 2): factors, where it begins, the clock's phase.

    The factors are drawn `_WIDE` times as far as they are; the phase is even over a sample.
    """
    rng = np.random.default_rng(15)
    wide = _WIDE * rng.standard_normal((_DRAWS, factors))
    phase = np.sqrt(12.0) * (rng.random(_DRAWS) - 0.5)
    return np.column_stack([wide, rng.standard_normal(_DRAWS), phase])


def _days(ready: Actuator, steps: Floats) -> list[Unit]:
    """Healthy units of other days; an action is seen at a sample, so it has no other lateness."""
    factors = factors_of(ready)
    late = 0.0 if action_numbers(ready.wiring) else _LATE
    return [
        Unit(
            daily(ready, dict(zip(factors, row, strict=False))),
            late=late * row[-2],
            phase=row[-1] / np.sqrt(12.0),
            number=k + 1,
        )
        for k, row in enumerate(steps.tolist())
    ]


def spread_of(draws: Floats, steps: Floats) -> Floats:
    """Covariance of healthy days, shape (k, k), from draws, shape (d, k), and their factors.

    What is linear in the factors stands as it is. The rest (a motion that ends a step later, a
    loop at its limit) is known from few draws only, so each number carries its own.
    """
    design = np.column_stack([np.ones(len(steps)), steps])
    slopes = np.linalg.lstsq(design, draws, rcond=None)[0]
    rest = draws - design @ slopes
    free = max(len(steps) - design.shape[1], 1)
    own = np.sum(rest**2, axis=0) / free
    return np.asarray(slopes[1:].T @ slopes[1:] + np.diag(own), dtype=np.float64)


def _severities(c: Candidate, actuator: Actuator) -> Floats:
    """Those that are run, from the least to the greatest; what is counted or there or not: one."""
    if c.kind in counted_of(actuator) | switched_of(actuator):
        return np.array([0.0, 1.0])
    steps = np.linspace(0.0, 1.0, _POINTS + 1) ** 3
    low = c.low * steps[:0:-1] if c.low < 0.0 else np.zeros(0)
    return np.concatenate((low, c.high * steps))


def _as_on_stand(actuator: Actuator, test: RoleTest) -> Actuator:
    ready = actuator.with_values(dict(test.settings), source="stand of the log")
    if test.stroke is None:
        return ready
    return ready.with_values(test.stroke.settings(ready), source="load of the log")


def _evidence(shown: Numbers) -> Evidence:
    values = np.array(list(shown.values.values()))
    return Evidence(tuple(shown.values), values, np.zeros(len(values)))


def numbers_of_log(item: RoleLog, actuator: Actuator, channels: Mapping[str, Floats]) -> Numbers:
    """Return the numbers of a log, or of a model run on its instants."""
    known = actuator.parameters
    pairs = known.value("motor.pole_pairs") if "motor.pole_pairs" in known else None
    return numbers_of(channels, item.command, item.time, item.units, pairs)


def shown_by(item: RoleLog, actuator: Actuator, units: Sequence[Unit]) -> Iterator[Numbers]:
    """Run units through a log's test; numbers of each by the log's roles."""
    for channels in channels_by(item, actuator, units):
        yield numbers_of_log(item, actuator, channels)


def channels_by(
    item: RoleLog, actuator: Actuator, units: Sequence[Unit]
) -> Iterator[dict[str, Floats]]:
    """Run units through a log's test; what each shows by the log's roles, on its instants.

    One run is prepared; the others exchange parameters and faults in what goes to the core.
    """
    from elevon.simulate import Run, solver_step
    from elevon.simulate.batch import simulate_prepared
    from elevon.simulate.prepare import prepare

    ready = _as_on_stand(actuator, item.test)
    signals = _signals(item, actuator)
    over = _over(item.rate, solver_step(ready, "low"))
    record = f"{','.join(signals.values())}@{over * item.rate:.12g} Hz"
    base = prepare(Run(ready, _scenario(item, actuator)), "low", record, doubts=False)
    base = replace(base, core=_with_arrays(base.core, item, actuator))
    places = {path: k for k, path in enumerate(ready.parameters)}
    actions = action_numbers(actuator.wiring)
    for first in range(0, len(units), _CHUNK):
        runs = [
            replace(base, core=_of_unit(base.core, unit, places, item, actuator.wiring))
            for unit in units[first : first + _CHUNK]
        ]
        shown = simulate_prepared(runs, fidelity="low")
        for unit, result in zip(units[first : first + _CHUNK], shown, strict=True):
            rows = result["clocks"][base.plan[0].name]
            late = unit.late if actions else unit.late + unit.phase
            yield _channels(item, rows, base.plan[0].signals, signals, late / item.rate)


def _of_unit(
    core: Mapping[str, Any], unit: Unit, places: Mapping[str, int], item: RoleLog, wiring: str
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
            filtered = values if role.endswith(_SET_POINT) else _averaged(values, over)
            out[role] = np.interp(at, clock, filtered)
    return out


def _over(rate: float, step: float) -> int:
    """Samples of the model to one of a log, an even number as far as its steps allow it."""
    steps = round(1.0 / (rate * step))
    return next((n for n in (_OVER, 2) if steps % n == 0), 1)


def _averaged(values: Floats, over: int) -> Floats:
    """Means over a log's period about each sample of the model."""
    if over == 1 or len(values) < 2 * over:
        return values
    half = over // 2
    total = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]))))
    out = values.copy()
    out[half:-half] = (total[over:] - total[:-over]) / over
    return out


def _signals(item: RoleLog, actuator: Actuator) -> dict[str, str]:
    """Role to the low model's signal, what a sensor shows before what is true."""
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
        document["load"] = {"user": {"terms": [_EMPTY]}}
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
        inputs["user"] = [_table(inputs["user"][0], item.test.load)]
    return {**core, "inputs": inputs}


def _table(term: Mapping[str, Any], points: tuple[Floats, Floats]) -> dict[str, Any]:
    times, values = points
    return {
        **term,
        "times": np.ascontiguousarray(times + BEFORE),
        "values": np.ascontiguousarray(values),
    }
