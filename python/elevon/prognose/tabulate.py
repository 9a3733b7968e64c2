"""Model runs over severities: the mission and the requirements' own runs, in blocks."""

from __future__ import annotations

import time as clock
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError, Interrupted, NotActingWarning
from elevon.prognose.law import LAWS, Law, laws_of
from elevon.prognose.requirement import MEASURES, SEVERITY, Requirement, RunSignals
from elevon.prognose.response import Grid, ResponseTables, axis_points
from elevon.progress import Progress
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.mission import Mission
    from elevon.recording import Recording
    from elevon.scenario import Scenario


_RATE = 400.0  # Hz
_ROLES = (
    "command",
    "output_position",
    "motor_speed",
    "torque_current",
    "temperature",
    "surface_temperature",
    "locked",
)
_NAMES = ("motor_torque", "friction_torque", "energy_friction", "energy_efficiency")
_AGEING = LAWS["insulation"].coefficients["activation"].value  # K


@lru_cache(maxsize=16)
def _signals(wiring: str, fidelity: str) -> dict[str, str]:
    """Role, or name where a signal has no role, to the signal that is recorded."""
    from elevon import _core

    there = _core.signals(wiring, fidelity)
    out: dict[str, str] = {}
    for role in _ROLES:
        name = next((s["name"] for s in there if s["role"] == role), None)
        if name is not None:
            out[role] = name
    return {**out, **{n: n for n in _NAMES if any(s["name"] == n for s in there)}}


def recorded_signals(wiring: str, fidelity: str) -> str:
    """Return the recording plan of a run."""
    return ",".join(dict.fromkeys(_signals(wiring, fidelity).values())) + f"@{_RATE:g} Hz"


def run_signals(recording: Recording, wiring: str, fidelity: str) -> RunSignals:
    """Return the signals of a run by role."""
    names = _signals(wiring, fidelity)
    first = recording[next(iter(names.values()))]
    return RunSignals(
        np.asarray(first.time, dtype=np.float64),
        {role: np.asarray(recording[name].values) for role, name in names.items()},
        recording.status == "ok",
    )


def exposure(run: RunSignals, mission: Mission) -> dict[str, float]:
    """Return the drivers of a mission, keys of `DRIVERS`, for one of its units of use."""
    step = np.diff(run.time, append=run.time[-1])
    speed = run["motor_speed"]
    travel = np.abs(speed) * step
    torque = np.abs(run["motor_torque"])
    travelled = float(travel.sum())
    cubic = float((torque**3 @ travel) / travelled) if travelled > 0.0 else 0.0
    winding = run["temperature"]
    out = {
        "hours": float(mission.hours),
        "friction_work": mission.repeats * _friction_work(run, step),
        "shaft_travel": mission.repeats * travelled,
        "torque_cubic_mean": float(np.cbrt(cubic)),
        "winding_temperature": _ageing_mean(winding),
    }
    surface = run.signals.get("surface_temperature", winding)
    return {**out, "surface_temperature": float(surface.mean())}


def _friction_work(run: RunSignals, step: Floats) -> float:
    if "friction_torque" in run.signals:
        return float(np.abs(run["friction_torque"] * run["motor_speed"]) @ step)
    parts = [run[name] for name in ("energy_friction", "energy_efficiency") if name in run.signals]
    return float(sum(part[-1] - part[0] for part in parts))


def _ageing_mean(kelvin: Floats) -> float:
    """Temperature at which insulation ages as it does over the course given."""
    return float(-_AGEING / np.log(np.mean(np.exp(-_AGEING / np.maximum(kelvin, 1.0)))))


_CHUNK = 128  # runs held in memory at once
_LOADS = (
    0.5,
    1.0,
    2.0,
)  # factors on the mission's loads and on its median, where the future may differ


def severity_grid(laws: Sequence[Law], mission: Mission, count: int) -> Grid:
    """Return the severities that are run, and loads where the future may differ."""
    steps = np.linspace(0.0, 1.0, count) ** 1.5  # denser where life is spent
    axes = [
        np.arange(np.floor(law.highest) + 1.0) if law.whole else law.highest * steps for law in laws
    ]
    usage = mission.usage
    if usage.load_spread > 0.0 or usage.load != 1.0:
        low, stated, high = _LOADS
        axes.append(np.array([low * min(usage.load, 1.0), stated, high * max(usage.load, 1.0)]))
    return Grid(tuple(axes))


def tabulate(
    actuator: Actuator,
    mission: Mission,
    laws: tuple[Law, ...],
    grid: Grid,
    *,
    fidelity: str,
    progress: Progress | None,
    points: Sequence[tuple[float, ...]] | None = None,
) -> ResponseTables:
    """Run every point of the grid, or those given."""
    base = mission.scenarios(known=actuator.parameters)
    requirements = mission.requirement
    plans = [_own_runs(item, base) for item in requirements]
    _check_measures(actuator, requirements)
    units = _units(actuator, requirements, laws)
    points = list(grid.points()) if points is None else points
    extra = [scenario for plan in plans for scenario in plan]
    # Requirements are judged at the loads as stated: elsewhere only the mission is run.
    jobs = [[base, *extra] if _as_stated(laws, point) else [base] for point in points]
    work = [[_scenario(s, laws, p) for s in job] for job, p in zip(jobs, points, strict=True)]
    drivers: dict[str, list[float]] = {}
    values = []
    batches = _runs(actuator, work, fidelity, progress)
    for k, (flown, *others) in enumerate(batches):
        if k == 0:
            _check_capability(actuator, flown)
        for name, value in exposure(flown, mission).items():
            drivers.setdefault(name, []).append(value)
        stated = _as_stated(laws, points[k])
        values.append(_values(requirements, plans, flown, others) if stated else [])
    return ResponseTables(
        laws,
        requirements,
        tuple(item.threshold(unit) for item, unit in zip(requirements, units, strict=True)),
        units,
        grid,
        {name: np.array(column) for name, column in drivers.items()},
        np.array(_filled(values)),
        sum(map(len, work)),
        fidelity,
    )


def _check_measures(actuator: Actuator, requirements: Sequence[Requirement]) -> None:
    """Refuse a requirement that the actuator's signals cannot show."""
    units = _role_units(actuator)
    for item in requirements:
        needed = () if item.measure == SEVERITY else MEASURES[item.measure].roles
        lacking = next((role for role in needed if role not in units), None)
        if lacking is not None:
            raise InputError(
                f"requirement {item.name}: {actuator.name} has no signal of the role {lacking!r}, "
                f"which {item.measure} needs"
            )
        if "command" in needed and units["command"] != units["output_position"]:
            raise InputError(
                f"requirement {item.name}: {item.measure} compares command and output, and the "
                f"command of {actuator.name} is no position"
            )


_FOLLOWED = 0.9  # share of the command's range that a healthy unit must reach


def _check_capability(actuator: Actuator, flown: RunSignals) -> None:
    """Refuse a mission that the healthy unit trips on or does not follow."""
    if not flown.complete:
        raise InputError(
            f"the mission is outside the capability of {actuator.name}: the healthy unit trips at "
            f"{flown.time[-1]:.4g} s"
        )
    units = _role_units(actuator)
    if units["command"] != units["output_position"]:
        return
    commanded, done = (float(np.ptp(flown[role])) for role in ("command", "output_position"))
    if done < _FOLLOWED * commanded:
        unit = display_unit(units["output_position"])
        raise InputError(
            f"the mission is outside the capability of {actuator.name}: the healthy unit travels "
            f"{to_display(done, unit):.4g} {unit} of the {to_display(commanded, unit):.4g} {unit} "
            f"commanded; at least {_FOLLOWED:.0%} are needed"
        )


def _as_stated(laws: Sequence[Law], point: Sequence[float]) -> bool:
    return len(point) == len(laws) or point[-1] == 1.0


def _filled(values: Sequence[list[float]]) -> list[list[float]]:
    """Give points under other loads the values of the nearest point before or after, as stated.

    The load is the last axis, so points of the same severities stand beside each other; of the
    three loads the stated one is in the middle.
    """
    last = next(row for row in values if row)
    out: list[list[float]] = []
    for k, row in enumerate(values):
        near = values[k + 1] if k + 1 < len(values) else []
        last = row or near or last
        out.append(last)
    return out


def _own_runs(requirement: Requirement, mission: Scenario) -> list[Scenario]:
    from elevon.scenario import Scenario

    if requirement.measure == SEVERITY:
        return []
    if requirement.scenario is not None:
        place = f"requirement {requirement.name}: scenario"
        return [Scenario.from_dict(requirement.scenario, place)]
    make = MEASURES[requirement.measure].scenarios
    return [] if make is None else make(requirement, mission)


def _values(
    requirements: Sequence[Requirement],
    plans: Sequence[Sequence[Scenario]],
    flown: RunSignals,
    others: Sequence[RunSignals],
) -> list[float]:
    out, at = [], 0
    for requirement, plan in zip(requirements, plans, strict=True):
        runs = others[at : at + len(plan)]
        at += len(plan)
        if requirement.measure == SEVERITY:
            out.append(0.0)
        else:
            out.append(requirement.value(runs or [flown]))
    return out


def _scenario(scenario: Scenario, laws: Sequence[Law], point: Sequence[float]) -> Scenario:
    faults = [
        f"{law.key}={value!r}" for law, value in zip(laws, point, strict=False) if value != 0.0
    ]
    load = point[len(laws)] if len(point) > len(laws) else 1.0
    if load != 1.0:
        scenario = _loaded(scenario, load)
    return scenario.with_faults(faults) if faults else scenario


def _loaded(scenario: Scenario, factor: float) -> Scenario:
    """Return the scenario with every term of the output's load scaled."""
    data = scenario.to_dict()
    terms = data.get("load", {}).get("output", {}).get("terms", [])
    scaled = [_scaled(term, factor) for term in terms]
    load = {**data.get("load", {}), "output": {"terms": scaled}}
    return scenario.replaced(load=load) if terms else scenario


_SIZES = ("value", "amplitude", "bias", "slope", "initial", "final", "low", "high", "gain")


def _scaled(term: Mapping[str, object], factor: float) -> dict[str, object]:
    """Scale what of a term carries the load's unit; numbers with units keep them."""
    out = dict(term)
    if term["kind"] == "table":
        out["gain"] = factor * float(str(term.get("gain", 1.0)))
        return out
    for name in _SIZES:
        if name in term:
            given = term[name]
            if isinstance(given, str):
                number, _, unit = given.strip().partition(" ")
                out[name] = f"{factor * float(number)!r} {unit}"
            else:
                out[name] = factor * float(str(given))
    return out


def _units(
    actuator: Actuator, requirements: Sequence[Requirement], laws: Sequence[Law]
) -> tuple[str, ...]:
    """Return the SI unit of each requirement's value."""
    from elevon import _core

    ports = {p["name"]: p["unit"] for p in _core.ports(actuator.wiring)}
    output, load = _role_units(actuator)["output_position"], ports.get("output", "")
    faults = {law.key: law.unit for law in laws}
    return tuple(item.unit(output, load, faults) for item in requirements)


def _role_units(actuator: Actuator) -> dict[str | None, str]:
    """Return the unit of each role's first signal."""
    from elevon import _core

    return {s["role"]: s["unit"] for s in reversed(_core.signals(actuator.wiring, "low"))}


def _runs(
    actuator: Actuator,
    work: Sequence[Sequence[Scenario]],
    fidelity: str,
    progress: Progress | None,
) -> Iterator[list[RunSignals]]:
    """Yield the runs of each point, in blocks that fit in memory."""
    from elevon.simulate import Run, simulate_batch

    record = recorded_signals(actuator.wiring, fidelity)
    step = max(1, _CHUNK // max(map(len, work)))
    for first in range(0, len(work), step):
        block = work[first : first + step]
        runs = [Run(actuator, scenario) for point in block for scenario in point]
        try:
            with warnings.catch_warnings():
                # What an actuator file has for another fidelity or drive is none of the caller's
                # doing.
                warnings.simplefilter("ignore", NotActingWarning)
                results = iter(simulate_batch(runs, fidelity=fidelity, record=record))
        except InputError as error:
            raise InputError(f"the mission on {actuator.name}: {error}") from error
        for point in block:
            yield [run_signals(next(results), actuator.wiring, fidelity) for _ in point]
        if progress is not None and progress((first + len(block)) / len(work)) is False:
            raise Interrupted("interrupted while the tables were made")


_POINTS = 5  # severities of each axis


@dataclass(frozen=True)
class Correction:
    """What the switching model gives over the reduced-order one, along each axis from the origin.

    Between axes the ratios multiply: they are near one, so that what two faults do to a ratio
    together is small of second order.

    Attributes
    ----------
    axes : tuple of ndarray
        Points of each axis; the load's holds its stated value 1 in the middle.
    drivers : mapping of str to tuple of ndarray
        Ratios of the exposure along each axis.
    values : tuple of ndarray, shape (points, m)
        Ratios of what requirements measure, along each axis.
    runs : int
        Runs of the switching model behind it.
    """

    axes: tuple[Floats, ...]
    drivers: Mapping[str, tuple[Floats, ...]]
    values: tuple[Floats, ...]
    runs: int

    def of(self, low: ResponseTables) -> ResponseTables:
        """Return low-fidelity tables of the same axes, corrected."""
        points = np.array(list(low.grid.points()))
        drivers = {
            name: low.drivers[name] * self._ratio([r[:, None] for r in ratios], points)[:, 0]
            for name, ratios in self.drivers.items()
        }
        return replace(
            low,
            drivers=drivers,
            values=low.values * self._ratio(self.values, points),
            runs=low.runs + self.runs,
            fidelity="low, corrected by high",
        )

    def _ratio(self, tables: Sequence[Floats], points: Floats) -> Floats:
        """Return the product of the ratios along the axes, shape (n, m)."""
        origin = tables[0][0]
        out: Floats = np.ones((len(points), tables[0].shape[1])) * origin
        for axis, table, at in zip(self.axes, tables, points.T, strict=True):
            along = np.column_stack([np.interp(at, axis, column) for column in table.T])
            out *= along / origin
        return out


def correction(
    actuator: Actuator,
    mission: Mission,
    low: ResponseTables,
    progress: Progress | None = None,
) -> Correction:
    """Run a few points of each axis of the switching model; compare with the `low` tables.

    Points: nothing, and four of each axis up to its greatest severity.
    """
    axes = severity_grid(low.laws, mission, _POINTS).axes
    origin = tuple(1.0 if k == len(low.laws) else 0.0 for k in range(len(axes)))
    points = [origin]
    for k, axis in enumerate(axes):
        points += [(*origin[:k], float(v), *origin[k + 1 :]) for v in axis if float(v) != origin[k]]
    high = tabulate(actuator, mission, low.laws, low.grid, points=points, fidelity="high",
                     progress=progress)  # fmt: skip
    at = list(np.array(points).T)

    def ratio(table: Floats, other: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            out = other / low.grid.interpolate(table, at).T
        return np.where(np.isfinite(out), out, 1.0)

    def along(table: Floats) -> tuple[Floats, ...]:
        rows = dict(zip(points, table, strict=True))
        return tuple(
            np.array([rows[(*origin[:k], float(v), *origin[k + 1 :])] for v in axis])
            for k, axis in enumerate(axes)
        )

    drivers = {
        name: tuple(r[:, 0] for r in along(ratio(low.drivers[name][:, None],
                                                 high.drivers[name][:, None])))
        for name in low.drivers
    }  # fmt: skip
    return Correction(axes, drivers, along(ratio(low.values, high.values)), high.runs)


def respond(
    actuator: Actuator,
    mission: Mission,
    *,
    laws: Sequence[Law] | None = None,
    fidelity: str = "low",
    snapshots: bool = False,
    progress: Progress | None = None,
) -> ResponseTables:
    """Run the mission and the requirements over a grid of severities.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    mission : Mission
        What is done and must hold.
    laws : sequence of Law, optional
        Those that act; default: the mission's.
    fidelity : str
        Of the runs.
    snapshots : bool
        Correct the reduced-order tables by runs of the switching model, see `correction`.

    Raises
    ------
    InputError
        A fault the actuator has not, a requirement it cannot be judged by, a mission it cannot do.
    """
    begin = clock.perf_counter()
    acting = tuple(mission.laws() if laws is None else laws)
    _check_laws(actuator, acting)
    grid = severity_grid(acting, mission, axis_points(len(acting)))
    made = tabulate(actuator, mission, acting, grid, fidelity=fidelity, progress=progress)
    if snapshots and fidelity != "high":
        made = correction(actuator, mission, made, progress).of(made)
    return replace(made, seconds=clock.perf_counter() - begin)


def _check_laws(actuator: Actuator, laws: Sequence[Law]) -> None:
    """Refuse a law whose fault the actuator has not, or has in another unit; name those it has."""
    from elevon.faults import catalogue

    records = catalogue(actuator.wiring)
    there = {f"{r.kind}@{place}": r.unit for r in records for place in r.places}
    for law in laws:
        unit = there.get(law.key)
        if unit == law.unit:
            continue
        why = (
            f"has no {law.key}" if unit is None else f"has its {law.key} in {unit}, not {law.unit}"
        )
        fit = ", ".join(laws_of(actuator.wiring))
        raise InputError(f"law {law.name}: {actuator.name} {why}; laws that fit it: {fit}")
