"""What severities do to the actuator: exposure by a mission and requirements, in tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError, Interrupted
from elevon.prognose.exposure import exposure, recorded_signals, shown
from elevon.prognose.grid import Grid, axis_points
from elevon.prognose.law import Law
from elevon.prognose.requirement import MEASURES, SEVERITY, Requirement, Shown
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.mission import Mission
    from elevon.scenario import Scenario

__all__ = ["Response", "check_start", "respond"]

Floats = npt.NDArray[np.float64]
_CHUNK = 128  # runs held in memory at once
_LOADS = (0.5, 1.0, 2.0)  # factors on the mission's loads where the future may differ
_SNAPSHOTS = 3  # severities of each axis run at high fidelity


@dataclass(frozen=True)
class Response:
    """Tables over severities.

    Attributes
    ----------
    laws : tuple of Law
        One an axis.
    requirements : tuple of Requirement
        What must hold.
    thresholds, units : tuple
        Where each ends the life, SI; and its unit.
    grid : Grid
        Severities, and the factor on the loads as the last axis where that may vary.
    drivers : mapping of str to ndarray, shape (points,)
        Exposure by one repetition of the mission.
    values : ndarray, shape (points, m)
        What each requirement measures.
    runs : int
        Model runs behind it.
    fidelity : str
        Of the runs; ``low, corrected by high`` with snapshots.
    """

    laws: tuple[Law, ...]
    requirements: tuple[Requirement, ...]
    thresholds: tuple[float, ...]
    units: tuple[str, ...]
    grid: Grid
    drivers: Mapping[str, Floats]
    values: Floats
    runs: int
    fidelity: str
    _tables: tuple[Floats, Floats] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        reserves = [
            requirement.reserve(self.values[:, k], self.thresholds[k])
            for k, requirement in enumerate(self.requirements)
        ]
        exposures = np.column_stack([self.drivers[name] for name in self.drivers])
        object.__setattr__(self, "_tables", (exposures, np.column_stack(reserves)))

    @property
    def loaded(self) -> bool:
        """Whether the last axis is the load's factor."""
        return len(self.grid.axes) > len(self.laws)

    def exposed(self, severity: Floats, load: Floats) -> dict[str, Floats]:
        """Return the exposure of units of severities, shape (n, k), under load factors (n,)."""
        table = self.grid.interpolate(self._tables[0], self._at(severity, load))
        return dict(zip(self.drivers, table, strict=True))

    def reserve(self, severity: Floats) -> Floats:
        """Return the distance to each threshold, in thresholds, shape (m, n); negative: failed.

        Requirements are judged at the loads as the mission states them.
        """
        ones = np.ones(len(severity))
        out = self.grid.interpolate(self._tables[1], self._at(severity, ones))
        for k, requirement in enumerate(self.requirements):
            if requirement.measure == SEVERITY:
                at = [law.key for law in self.laws].index(str(requirement.fault))
                out[k] = requirement.reserve(severity[:, at], self.thresholds[k])
        return out

    def measured(self, severity: Floats) -> Floats:
        """Return what each requirement measures, shape (m, n), SI."""
        finite = np.where(np.isfinite(self.values), self.values, np.nan)
        return self.grid.interpolate(finite, self._at(severity, np.ones(len(severity))))

    def _at(self, severity: Floats, load: Floats) -> list[Floats]:
        columns = [severity[:, k] for k in range(len(self.laws))]
        return [*columns, load] if self.loaded else columns


def respond(
    actuator: Actuator,
    mission: Mission,
    *,
    laws: Sequence[Law] | None = None,
    fidelity: str = "low",
    snapshots: bool = False,
    progress: Progress | None = None,
) -> Response:
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
        Correct the low fidelity's tables by runs at high fidelity: at zero, half and full
        severity of each axis, their ratio interpolated between.

    Raises
    ------
    InputError
        A fault the actuator has not, a requirement it cannot be asked, a mission it cannot do.
    """
    acting = tuple(mission.laws() if laws is None else laws)
    grid = _grid(acting, mission, axis_points(len(acting)))
    base = _tabulate(actuator, mission, acting, grid, fidelity=fidelity, progress=progress)
    if not snapshots or fidelity == "high":
        return base
    coarse = _grid(acting, mission, _SNAPSHOTS)
    high = _tabulate(actuator, mission, acting, coarse, fidelity="high", progress=progress)
    return _corrected(base, high)


def _grid(laws: Sequence[Law], mission: Mission, count: int) -> Grid:
    steps = np.linspace(0.0, 1.0, count) ** 1.5  # denser where life is spent
    axes = [law.highest * steps for law in laws]
    usage = mission.usage
    if usage.load_spread > 0.0 or usage.load != 1.0:
        axes.append(np.array(_LOADS))
    return Grid(tuple(axes))


def _tabulate(
    actuator: Actuator,
    mission: Mission,
    laws: tuple[Law, ...],
    grid: Grid,
    *,
    fidelity: str,
    progress: Progress | None,
) -> Response:
    """Run every point of the grid."""
    base = mission.scenarios()
    requirements = mission.requirement
    plans = [_own_runs(item, base) for item in requirements]
    output, load = _units(actuator)
    faults = {law.key: law.unit for law in laws}
    _check_measures(actuator, requirements)
    units = tuple(item.unit(output, load, faults) for item in requirements)
    points = list(grid.points())
    own = [scenario for plan in plans for scenario in plan]
    # Requirements are judged at the loads as stated: elsewhere only the mission is run.
    jobs = [[base, *own] if _as_stated(laws, point) else [base] for point in points]
    work = [[_scenario(s, laws, p) for s in job] for job, p in zip(jobs, points, strict=True)]
    drivers: dict[str, list[float]] = {}
    values = []
    batches = _runs(actuator, work, fidelity, progress)
    for k, (flown, *rest) in enumerate(batches):
        if k == 0:
            _check_capability(actuator, flown)
        for name, value in exposure(flown, mission).items():
            drivers.setdefault(name, []).append(value)
        stated = _as_stated(laws, points[k])
        values.append(_values(requirements, plans, flown, rest) if stated else [])
    return Response(
        laws,
        requirements,
        tuple(item.threshold(unit) for item, unit in zip(requirements, units, strict=True)),
        units,
        grid,
        {name: np.array(column) for name, column in drivers.items()},
        np.array(_spread_over_loads(values)),
        sum(map(len, work)),
        fidelity,
    )


def _check_measures(actuator: Actuator, requirements: Sequence[Requirement]) -> None:
    """Refuse a requirement that the actuator's signals cannot show."""
    from elevon import _core

    units = {s["role"]: s["unit"] for s in reversed(_core.signals(actuator.wiring, "low"))}
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


_FOLLOWED = 0.9  # share of the command's travel that a healthy unit must reach


def _check_capability(actuator: Actuator, flown: Shown) -> None:
    """Refuse a mission that the healthy unit trips on or does not follow."""
    if not flown.complete:
        raise InputError(
            f"the mission is outside the capability of {actuator.name}: the healthy unit trips at "
            f"{flown.time[-1]:.4g} s"
        )
    from elevon import _core

    units = {s["role"]: s["unit"] for s in reversed(_core.signals(actuator.wiring, "low"))}
    if units["command"] != units["output_position"]:
        return
    asked, done = (float(np.ptp(flown[role])) for role in ("command", "output_position"))
    if done < _FOLLOWED * asked:
        unit = units["output_position"]
        raise InputError(
            f"the mission is outside the capability of {actuator.name}: the healthy unit travels "
            f"{done:.4g} {unit} of the {asked:.4g} {unit} asked for"
        )


def _as_stated(laws: Sequence[Law], point: Sequence[float]) -> bool:
    return len(point) == len(laws) or point[-1] == 1.0


def _spread_over_loads(values: Sequence[list[float]]) -> list[list[float]]:
    """Give points under other loads the values of the same severities under the stated ones.

    The load is the last axis, so they stand beside each other.
    """
    if all(values):
        return list(values)
    blocks = [values[at : at + len(_LOADS)] for at in range(0, len(values), len(_LOADS))]
    return [next(row for row in block if row) for block in blocks for _ in _LOADS]


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
    flown: Shown,
    rest: Sequence[Shown],
) -> list[float]:
    out, at = [], 0
    for requirement, plan in zip(requirements, plans, strict=True):
        own = rest[at : at + len(plan)]
        at += len(plan)
        if requirement.measure == SEVERITY:
            out.append(0.0)
        else:
            out.append(requirement.value(own or [flown]))
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
    """Return the scenario with every term of the user's load scaled."""
    data = scenario.to_dict()
    terms = data.get("load", {}).get("user", {}).get("terms", [])
    scaled = [_scaled(term, factor) for term in terms]
    load = {**data.get("load", {}), "user": {"terms": scaled}}
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


def _units(actuator: Actuator) -> tuple[str, str]:
    from elevon import _core

    names = {s["role"]: s["unit"] for s in reversed(_core.signals(actuator.wiring, "low"))}
    ports = {p["name"]: p["unit"] for p in _core.ports(actuator.wiring)}
    return names["output_position"], ports.get("user", "")


def _runs(
    actuator: Actuator,
    work: Sequence[Sequence[Scenario]],
    fidelity: str,
    progress: Progress | None,
) -> Iterator[list[Shown]]:
    """Yield the runs of each point, in blocks that fit in memory."""
    from elevon.simulate import Run, simulate_batch

    record = recorded_signals(actuator.wiring, fidelity)
    step = max(1, _CHUNK // max(map(len, work)))
    for first in range(0, len(work), step):
        block = work[first : first + step]
        runs = [Run(actuator, scenario) for point in block for scenario in point]
        try:
            results = iter(simulate_batch(runs, fidelity=fidelity, record=record))
        except InputError as error:
            raise InputError(f"the mission on {actuator.name}: {error}") from error
        for point in block:
            yield [shown(next(results), actuator.wiring, fidelity) for _ in point]
        if progress is not None and progress((first + len(block)) / len(work)) is False:
            raise Interrupted("interrupted while the tables were made")


def _corrected(low: Response, high: Response) -> Response:
    """Scale the low model's tables by what the high one says at a few points."""
    points = np.array(list(low.grid.points())).T
    at = list(points)
    coarse_low = np.array(list(high.grid.points())).T

    def scaled(table: Floats, other: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = other / low.grid.interpolate(table, list(coarse_low)).T
        ratio = np.where(np.isfinite(ratio), ratio, 1.0)
        return table * high.grid.interpolate(ratio, at).T

    drivers = {
        name: scaled(low.drivers[name][:, None], high.drivers[name][:, None])[:, 0]
        for name in low.drivers
    }
    return replace(
        low,
        drivers=drivers,
        values=scaled(low.values, high.values),
        runs=low.runs + high.runs,
        fidelity="low, corrected by high",
    )


def check_start(response: Response, severity: Floats) -> list[str]:
    """Return what is violated by a unit of these severities, shape (k,), in words."""
    reserve = response.reserve(severity[None, :])[:, 0]
    values = response.measured(severity[None, :])[:, 0]
    out = []
    for k, requirement in enumerate(response.requirements):
        if reserve[k] < 0.0:
            sign = "least" if requirement.at_least else "limit"
            out.append(
                f"requirement {requirement.name}: {values[k]:.4g} {response.units[k]}, {sign} "
                f"{response.thresholds[k]:.4g} {response.units[k]}"
            )
    return out
