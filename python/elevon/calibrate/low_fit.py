"""The reduced-order model's own numbers, fitted to runs of the switching model."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.calibrate.write import actuator_name
from elevon.compare import CUTOFF_HZ, GRID_HZ, RATES, SIGNALS, compared_rate, filtered
from elevon.errors import InputError, SimulationError
from elevon.estimate.held_out import folds
from elevon.faults import Fault
from elevon.parameters import Parameter
from elevon.parameters.load import base_reference
from elevon.parameters.records import records
from elevon.parameters.write import write_set
from elevon.plain import WORKING, Plain, key
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.scenario import Scenario
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
    from elevon.report import Report

Array = npt.NDArray[np.float64]

FREE = {"low.band_ratio": (0.05, 1.0), "low.voltage_ratio": (0.3, 0.9)}
"""What may be fitted and between which limits. `low.step` is no free number: it is accuracy."""
START_S = 4.0
"""What came before is left out: the start from rest and the catching up after it [s]."""
PROBE = 0.05
"""Relative change by which is seen whether the runs depend on a number at all."""
SEEN = 1e-4
"""Smallest change of a signal over its size, for `PROBE`, that determines a number."""


class FittedNumber(NamedTuple):
    """A number that was fitted [SI]; `deviation` over the cases, by leaving out one at a time."""

    path: str
    old: float
    new: float
    deviation: float


class UnfittedNumber(NamedTuple):
    """A number that is left as it was, and why."""

    path: str
    reason: str


class CaseErrors(NamedTuple):
    """Of a case, RMS of low less high over the size of high, by signal, before and after."""

    name: str
    before: Mapping[str, float]
    after: Mapping[str, float]


@dataclass(frozen=True)
class LowFit(Plain):
    """What was fitted, and how far the reduced-order model was and is from the switching one.

    Attributes
    ----------
    before, actuator : Actuator
        As given; with the fitted numbers.
    fitted : tuple of FittedNumber
        What the cases determine.
    unchanged : tuple of UnfittedNumber
        What they do not.
    cases : tuple of CaseErrors
        Over which the fit ran; the size of a position is its RMS about its mean.
    """

    before: Annotated[Actuator, WORKING]
    actuator: Annotated[Actuator, WORKING]
    fitted: tuple[FittedNumber, ...]
    unchanged: Annotated[tuple[UnfittedNumber, ...], key("kept")]
    cases: tuple[CaseErrors, ...]

    COMPUTED: ClassVar = ("status", "actuator=name", "drive", "rms_before", "rms_after")
    status: ClassVar = "ok"

    @property
    def name(self) -> str:
        """Of the actuator."""
        return self.before.name

    @property
    def drive(self) -> str:
        """Kind of drive that the numbers belong to."""
        return str(self.before.parameters["drive.kind"].value)

    @property
    def rms_before(self) -> dict[str, float]:
        """RMS of the errors over the cases, by signal."""
        return _total([case.before for case in self.cases])

    @property
    def rms_after(self) -> dict[str, float]:
        """The same with the fitted numbers."""
        return _total([case.after for case in self.cases])


ROTARY_FAULTS = (
    "short@motor.phase_a=0.1",
    "eccentricity_static@motor=0.2",
    "demagnetisation@motor=0.1",
    "friction@transmission=0.25",
)
"""Faults that change the current the load takes, each at the size a diagnosis has to see."""


@dataclass(frozen=True, slots=True)
class FitCase:
    """One comparison: a name for people and what both models run.

    Attributes
    ----------
    name : str
        Scenario and fault in words.
    scenario : Scenario
        Its faults included.
    """

    name: str
    scenario: Scenario


def default_cases(actuator: Actuator) -> list[FitCase]:
    """Return the cases of an actuator when none are given.

    A rotary actuator: one cycle of the loaded campaign's motion (faster, under 0.5 and 1.5 N m of
    brake), healthy under both loads and with each of four faults under the larger one, and a
    steady speed that two low supplies cannot give, under both loads. Any other: its own scenario.

    Raises
    ------
    InputError
        The actuator has no scenario of its own.
    """
    if actuator.wiring == "rotary":
        return _rotary()
    if actuator.default_scenario is None:
        raise InputError(
            f"fit-low: {actuator.name} has no scenario of its own; give some with --scenario"
        )
    default = Scenario.from_dict(actuator.default_scenario, f"{actuator.name}: scenario")
    return [FitCase("its own scenario", default)]


def named_cases(scenarios: Sequence[tuple[str, Scenario]], faults: Sequence[str]) -> list[FitCase]:
    """Return every scenario healthy and with each of the faults alone.

    Parameters
    ----------
    scenarios : sequence of (str, Scenario)
        Name and scenario.
    faults : sequence of str
        In the grammar of the command line.

    Raises
    ------
    InputError
        A fault that cannot be read.
    """
    parsed = [Fault.parse(text) for text in faults]
    cases = []
    for name, scenario in scenarios:
        cases.append(FitCase(f"{name}, as given", scenario))
        cases += [FitCase(f"{name}, {fault}", scenario.with_faults([fault])) for fault in parsed]
    return cases


def _rotary() -> list[FitCase]:
    light, heavy = (_motion(brake) for brake in ("0.5 N m", "1.5 N m"))
    loaded = named_cases([("1.5 N m of brake", heavy)], ROTARY_FAULTS)
    starved = [
        FitCase(f"{volts:g} V, {brake:g} N m of brake", _starved(volts, brake))
        for volts in (45.0, 55.0)
        for brake in (0.5, 1.5)
    ]
    return [FitCase("0.5 N m of brake, as given", light), *loaded, *starved]


def _motion(brake: str) -> Scenario:
    sine = {"kind": "sine", "amplitude": "30 deg", "bias": "30 deg", "frequency": "0.1 Hz"}
    return Scenario.from_dict(
        {
            "duration": "15 s",
            "command": {"mode": "position", "terms": [sine]},
            "load": {"brake": {"terms": [{"kind": "constant", "value": brake}]}},
        }
    )


def _starved(volts: float, brake: float) -> Scenario:
    """A steady speed that the supply cannot give: what is reached tells the voltage ratio."""
    return Scenario.from_dict(
        {
            "duration": "10 s",
            "command": {"mode": "speed", "terms": [{"kind": "constant", "value": "500 rpm"}]},
            "load": {"brake": {"terms": [{"kind": "constant", "value": f"{brake} N m"}]}},
            "supply": {"terms": [{"kind": "constant", "value": f"{volts} V"}]},
        }
    )


def fit_low(
    actuator: ActuatorLike,
    cases: Sequence[FitCase],
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> LowFit:
    """Fit the reduced-order model's free numbers to the switching model.

    Parameters
    ----------
    actuator : Actuator, str or path
        Its drive kind as set: the numbers belong to it.
    cases : sequence of FitCase
        At least one; the switching model runs each once.
    seed : int
        Of every run.
    progress : callable, optional
        As for `simulate_batch`.

    Returns
    -------
    LowFit

    Raises
    ------
    InputError
        No case, a case that is too short, or an actuator without any of these numbers.
    SimulationError
        A run did not reach its end.
    """
    from elevon.simulate.acting import together

    model = as_actuator(actuator)
    free = _free(model)
    _check(cases)
    with together((model, case.scenario, name) for case in cases for name in RATES):
        return _fitted(model, cases, free, seed, progress)


def _fitted(
    actuator: Actuator,
    cases: Sequence[FitCase],
    free: Sequence[str],
    seed: int,
    progress: Progress | None,
) -> LowFit:
    high = _signals(actuator, cases, "high", seed, part(progress, 0.0, 0.9))
    problem = _Problem(actuator, tuple(cases), tuple(high), seed)
    seen, unchanged = problem.split(free)
    old = {path: float(actuator.parameters.value(path)) for path in seen}
    new = problem.solve(seen, range(len(cases)))
    deviation = problem.jackknife(seen, new, progress)
    after = actuator.with_values(new, source="fitted to the switching model", request=False)
    errors = zip(cases, problem.errors(old), problem.errors(new), strict=True)
    return LowFit(
        actuator,
        after,
        tuple(FittedNumber(path, old[path], new[path], deviation[path]) for path in seen),
        tuple(UnfittedNumber(path, reason) for path, reason in unchanged.items()),
        tuple(CaseErrors(case.name, *both) for case, *both in errors),
    )


@dataclass(frozen=True)
class _Problem:
    """The switching model's signals, and the reduced-order model's distance from them."""

    actuator: Actuator
    cases: tuple[FitCase, ...]
    high: tuple[Mapping[str, Array], ...]
    seed: int

    def low(self, values: Mapping[str, float], rows: Sequence[int]) -> list[Mapping[str, Array]]:
        changed = (
            self.actuator.with_values(dict(values), request=False) if values else self.actuator
        )
        return _signals(changed, [self.cases[row] for row in rows], "low", self.seed, None)

    def errors(
        self, values: Mapping[str, float], rows: Sequence[int] | None = None
    ) -> tuple[Mapping[str, float], ...]:
        """Return RMS of the difference over the size of the switching one, by case and signal."""
        chosen = range(len(self.cases)) if rows is None else rows
        pairs = zip(self.low(values, chosen), (self.high[row] for row in chosen), strict=True)
        return tuple({n: _rms(low[n] - high[n]) / _size(n, high[n]) for n in SIGNALS}
                     for low, high in pairs)  # fmt: skip

    def moved(self, path: str, value: float) -> float:
        """Return the largest change of a signal, over its size, that another value makes."""
        rows = range(len(self.cases))
        pairs = zip(self.low({}, rows), self.low({path: value}, rows), self.high, strict=True)
        return max(_rms(b[n] - a[n]) / _size(n, high[n]) for a, b, high in pairs for n in SIGNALS)

    def split(self, free: Sequence[str]) -> tuple[list[str], dict[str, str]]:
        """Return what the cases determine, and why the rest is kept."""
        seen, unchanged = [], {}
        for path in free:
            value = (1.0 - PROBE) * float(self.actuator.parameters.value(path))
            if self.moved(path, value) > SEEN:
                seen.append(path)
            else:
                unchanged[path] = "no case depends on it with this drive"
        return seen, unchanged

    def solve(self, paths: Sequence[str], rows: Sequence[int]) -> dict[str, float]:
        """Return the best values over the cases in `rows`, one coordinate after another, twice.

        Each number acts in cases in which the other hardly does, and the backlash of a relay band
        makes the sum of squares uneven on a small scale: a bracketing search is safe where a
        gradient is not.
        """
        from scipy.optimize import minimize_scalar

        values = {path: float(self.actuator.parameters.value(path)) for path in paths}
        for _ in range(2):
            for path in paths:

                def cost(x: float, path: str = path) -> float:
                    errors = self.errors({**values, path: x}, rows)
                    return float(sum(value**2 for row in errors for value in row.values()))

                best = minimize_scalar(
                    cost, bounds=FREE[path], method="bounded", options={"xatol": 1e-4}
                )
                values[path] = float(best.x) if best.fun < cost(values[path]) else values[path]
        return values

    def jackknife(
        self, paths: Sequence[str], best: Mapping[str, float], progress: Progress | None
    ) -> dict[str, float]:
        """Return the deviation of each number over the cases, from leaving out one at a time."""
        count = len(self.cases)
        if count < 2:
            return dict.fromkeys(paths, float("nan"))
        solutions = []
        for number, (others, _) in enumerate(folds(range(count))):
            if progress is not None:
                progress(0.9 + 0.1 * number / count)
            solutions.append(self.solve(paths, others))
        return {
            path: math.sqrt(
                (count - 1) / count * sum((x[path] - best[path]) ** 2 for x in solutions)
            )
            for path in paths
        }


def _signals(
    actuator: Actuator,
    cases: Sequence[FitCase],
    fidelity: str,
    seed: int,
    progress: Progress | None,
) -> list[Mapping[str, Array]]:
    from elevon.simulate import Run, simulate_batch

    runs = [Run(actuator, case.scenario, seed, case.name) for case in cases]
    record = f"{','.join(SIGNALS)}@{compared_rate(actuator, fidelity)}"
    recordings = simulate_batch(runs, fidelity=fidelity, record=record, progress=progress)
    return [_filtered(run, case) for run, case in zip(recordings, cases, strict=True)]


def _filtered(run: Recording, case: FitCase) -> Mapping[str, Array]:
    if run.status != "ok":
        message = f"fit-low: {case.name}: the {run.meta['fidelity']} model ended as {run.status}"
        raise SimulationError(f"{message}: {run.meta['message']}", run.status)
    grid = np.arange(START_S, case.scenario.seconds, 1.0 / GRID_HZ)
    return {name: filtered(run, name, grid, CUTOFF_HZ) for name in SIGNALS}


def _free(actuator: Actuator) -> list[str]:
    known = records(actuator.wiring)
    free = [path for path in FREE if path in known]
    if not free:
        raise InputError(
            f"fit-low: the reduced-order model of {actuator.name} ({actuator.wiring}) has none of "
            f"{', '.join(FREE)}: there is nothing to fit"
        )
    return free


def _check(cases: Sequence[FitCase]) -> None:
    if not cases:
        raise InputError("fit-low: there is no case to fit to")
    for case in cases:
        shortest = START_S + 1.0 / CUTOFF_HZ
        if case.scenario.seconds <= shortest:
            raise InputError(
                f"fit-low: {case.name} lasts {case.scenario.seconds:g} s; more than "
                f"{shortest:g} s are needed"
            )


def _total(errors: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {name: float(np.sqrt(np.mean([row[name] ** 2 for row in errors]))) for name in SIGNALS}


def _size(name: str, values: Array) -> float:
    """RMS; of a position, whose zero says nothing, RMS about the mean."""
    return max(_rms(values - np.mean(values) if name == "output_position" else values), 1e-12)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def fitted_parameters(fit: LowFit) -> list[Parameter]:
    """Return one entry for each fitted number: source, old value, deviation over the cases."""
    names = "; ".join(case.name for case in fit.cases)
    entries = []
    for path, old, new, spread in fit.fitted:
        note = f"For drive.kind = {fit.drive}. Standard deviation over the cases {spread:.2g}."
        source = f"fitted to the switching model over {len(fit.cases)} cases: {names}"
        rounded = float(f"{new:.4g}")
        entries.append(Parameter(path, rounded, "", source, note, "calibrated", old))
    return entries


def write_fit(path: str | os.PathLike[str], fit: LowFit, *, force: bool = False) -> Path:
    """Write the fitted numbers as an actuator file; errors as `elevon.files.write_text`."""
    target = Path(path).expanduser()
    return write_set(
        target,
        name=actuator_name(target.stem),
        changes=fitted_parameters(fit),
        base=base_reference(fit.before.path, fit.before.name, target),
        title=f"{fit.before.title or fit.before.name}, reduced-order model fitted",
        force=force,
    )


def lowfit_report(fit: LowFit, actuator: str, *, date: str | None = None) -> Report:
    """Return the page of a fit; `actuator` is named as on the command line."""
    from elevon.report import Report, ReportTable, provenance

    values = fit.to_dict()
    report = Report(
        f"Reduced-order model of {values['actuator']} fitted",
        "The reduced-order model's own numbers, by least squares of filtered position, speed and q "
        f"current against the switching model with drive.kind = {values['drive']}.",
        date=date,
    )
    for row in values["fitted"]:
        report.fact(row["path"], f"{row['new']:.4g}", f"was {row['old']:.4g}")
    fitted = [[row["path"], row["old"], row["new"], row["deviation"]] for row in values["fitted"]]
    section = report.section("Numbers")
    section.table(ReportTable(["Number", "Old", "New", "Deviation over the cases"], fitted))
    for row in values["kept"]:
        section.text(f"{row['path']} is kept: {row['reason']}.")
    names = list(values["rms_before"])
    head = [f"{n.replace('_', ' ')} {when} [%]" for n in names for when in ("before", "after")]
    rows = [
        [case["name"], *(100 * case[when][n] for n in names for when in ("before", "after"))]
        for case in values["cases"]
    ]
    report.section("Cases").table(ReportTable(["Case", *head], rows))
    report.provenance(provenance(f"elevon fit-low {actuator} --report FILE", Hash=fit.before.hash))
    return report
