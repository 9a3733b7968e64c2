"""Real machines: what Elevon determines of them, predicts on held-out logs, beside their authors.

The logs are public and not part of this package. Each data set is stated in ``machines.toml``:
where it comes from, the SHA-256 of each file, which files are held out, what its authors print.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from elevon.actuator import Actuator
from elevon.data import packaged_toml
from elevon.errors import InputError
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.report import Check, Report
from elevon.report.checks import CheckedResult
from elevon.units import to_si
from elevon_cases.page import Column, table_of, with_end

FOLDER = Path(__file__).parent
"""Of the column maps and of the files that describe the axes."""


@dataclass(frozen=True, slots=True)
class Fit:
    """One calibration, and the logs that it has not seen.

    Attributes
    ----------
    name, group : str
        Fits of one group must agree; empty: none.
    logs, held_out : sequence of str
        File names.
    map, held_out_map : str
        Column maps; that of the held-out logs only where it is another.
    scale : str
        Torque or force of one unit of the effort; empty: not stated.
    """

    name: str
    logs: Sequence[str]
    map: str
    held_out: Sequence[str] = ()
    held_out_map: str = ""
    scale: str = ""
    group: str = ""


@dataclass(frozen=True, slots=True)
class PrintedValue:
    """What the authors print of a quantity, how near ours must be [%], and where it stands."""

    quantity: str
    value: float
    unit: str
    percent: float
    where: str


@dataclass(frozen=True, slots=True)
class Prediction:
    """Largest RMS error of a signal on held-out logs: absolute, or in percent of its range."""

    signal: str
    rms: float | None = None
    unit: str = "%"
    percent_of_range: float | None = None

    @property
    def limit(self) -> float:
        """In `unit`."""
        limit = self.percent_of_range if self.rms is None else self.rms
        assert limit is not None
        return limit


@dataclass(frozen=True, slots=True)
class Machine:
    """One public data set."""

    name: str
    title: str
    source: str
    licence: str
    axis: str
    files: Mapping[str, str]
    fits: Sequence[Fit]
    printed: Sequence[PrintedValue]
    predicted: Sequence[Prediction]


@cache
def machines() -> Mapping[str, Machine]:
    """Return the data sets by name."""
    kinds: Mapping[str, Any] = {"fits": Fit, "printed": PrintedValue, "predicted": Prediction}
    found = {}
    for name, entry in packaged_toml("elevon_cases.real", "machines.toml").items():
        lists = {key: tuple(kind(**item) for item in entry[key]) for key, kind in kinds.items()}
        found[name] = Machine(name, **{**entry, **lists})
    return found


def check_files(machine: Machine, folder: Path) -> None:
    """Refuse a folder whose files are not those that the figures were made of.

    Raises
    ------
    InputError
        A file is missing, or its SHA-256 is another than stated.
    """
    for name, stated in machine.files.items():
        path = folder / name
        if not path.is_file():
            raise InputError(f"{path}: no such file; it comes from {machine.source}")
        with path.open("rb") as stream:
            found = hashlib.file_digest(stream, "sha256").hexdigest()
        if found != stated:
            raise InputError(f"{path}: SHA-256 {found}, stated is {stated}: another file")


@dataclass(frozen=True, slots=True)
class DeterminedRow(Plain):
    """A quantity that a fit determined, with its 90 % interval, and what the authors print."""

    fit: str
    quantity: str
    value: float
    low: float
    high: float
    unit: str
    printed: float | None
    off_percent: float | None
    outside: bool | None


@dataclass(frozen=True, slots=True)
class PredictedRow(Plain):
    """RMS error of a signal on a log; ``held_out``: whether the fit had not seen it."""

    fit: str
    log: str
    signal: str
    held_out: bool
    rms: float
    unit: str
    percent_of_range: float


@dataclass(frozen=True)
class RealMachineResult(CheckedResult):
    """Everything `elevon reproduce real-NAME` reports.

    Attributes
    ----------
    rows : list of DeterminedRow
        What was determined.
    predictions : list of PredictedRow
        Errors, first on the logs of the fit.
    not_determined : mapping of str to str
        Fit and subsystem, and why.
    """

    rows: list[DeterminedRow]
    predictions: list[PredictedRow]
    not_determined: Mapping[str, str]
    source: str
    licence: str
    sha256: Mapping[str, str]
    machine: Annotated[Machine, WORKING]

    @property
    def checks(self) -> list[Check]:
        """Nearness to the authors' numbers, agreement of fits, errors on held-out logs."""
        return [*self._against_authors(), *self._agreement(), *self._held_out()]

    def _against_authors(self) -> list[Check]:
        """Return a check of each printed number; one that no fit determined is not finite."""
        checks = []
        for printed in self.machine.printed:
            rows = [
                row
                for row in self.rows
                if row.quantity == printed.quantity and not self._fit(row.fit).group
            ]
            quantity = printed.quantity.replace("_", " ")
            for row in rows:
                off = float("nan") if row.off_percent is None else abs(row.off_percent)
                name = f"{row.fit}: {quantity} less the authors'"
                checks.append(Check(name, off, printed.percent, "%", ours=row.value,
                                    ours_unit=row.unit))  # fmt: skip
            if not rows:
                name = f"no fit: {quantity} less the authors'"
                checks.append(Check(name, float("nan"), printed.percent, "%"))
        return checks

    def _agreement(self) -> list[Check]:
        """Return by how much the inertias of the fits of a group lie apart.

        Where a fit did not determine it, that is no number, and no pass.
        """
        checks = []
        groups = [fit.group for fit in self.machine.fits if fit.group]
        for group in dict.fromkeys(groups):
            rows = [
                row
                for row in self.rows
                if row.quantity == "inertia" and self._fit(row.fit).group == group
            ]
            apart = float("nan")
            if len(rows) == groups.count(group):
                apart = max(row.low for row in rows) - min(row.high for row in rows)
            checks.append(Check(f"{group}: inertia, intervals apart", apart, 0.0, "kg m2"))
        return checks

    def _held_out(self) -> list[Check]:
        checks = []
        for wanted in self.machine.predicted:
            for fit in self.machine.fits:
                if not fit.held_out:
                    continue
                place = (fit.name, wanted.signal, True)
                rows = [
                    row for row in self.predictions if (row.fit, row.signal, row.held_out) == place
                ]
                errors = [row.percent_of_range if wanted.rms is None else row.rms for row in rows]
                signal = wanted.signal.replace("_", " ")
                name = f"{fit.name}: {signal} on held-out logs, the worst"
                value = max(errors, default=float("nan"))
                checks.append(Check(name, value, wanted.limit, wanted.unit))
        return checks

    def _fit(self, name: str) -> Fit:
        return next(fit for fit in self.machine.fits if fit.name == name)


def real_emps(data: Path, *, progress: Progress | None = None) -> RealMachineResult:
    """Identify the linear axis EMPS and predict its run with pulses."""
    return reproduce_machine(machines()["emps"], data, progress=progress)


def real_hsm150(data: Path, *, progress: Progress | None = None) -> RealMachineResult:
    """Identify the servo HSM150 from steps of torque and predict repeated ones."""
    return reproduce_machine(machines()["hsm150"], data, progress=progress)


def real_dynamometer(data: Path, *, progress: Progress | None = None) -> RealMachineResult:
    """Identify the dynamometer's actuator and predict the speed of another log."""
    return reproduce_machine(machines()["dynamometer"], data, progress=progress)


def reproduce_machine(
    machine: Machine, folder: Path, *, progress: Progress | None = None
) -> RealMachineResult:
    """Calibrate on the logs of each fit and predict its held-out logs.

    Parameters
    ----------
    machine : Machine
        The data set.
    folder : path
        Of its files.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        As `check_files`.
    """
    import elevon
    from elevon.logs.read import read_logs

    check_files(machine, folder)
    axis = Actuator.load(FOLDER / machine.axis)
    rows: list[DeterminedRow] = []
    predictions: list[PredictedRow] = []
    why: dict[str, str] = {}
    for number, fit in enumerate(machine.fits):
        logs = read_logs([folder / name for name in fit.logs], FOLDER / fit.map)
        share = part(progress, number / len(machine.fits), (number + 1) / len(machine.fits))
        scale = fit.scale or None
        try:
            answer = elevon.calibrate(logs, axis, torque_constant=scale, progress=share)
        except InputError as error:  # what it was to determine fails for want of a number
            why[fit.name] = str(error)
            continue
        subsystems = answer.to_dict(stored=False)["subsystems"]
        rows += _determined(fit, subsystems, machine.printed)
        why |= {f"{fit.name}, {name}": item["reason"] for name, item in subsystems.items()
                if item["reason"]}  # fmt: skip
        predictions += _errors(fit, answer.validation, held_out=False)
        if fit.held_out:
            unseen = [folder / name for name in fit.held_out]
            logs = read_logs(unseen, FOLDER / (fit.held_out_map or fit.map))
            predictions += _errors(fit, elevon.validate(logs, answer.actuator), held_out=True)
    return RealMachineResult(rows, predictions, why, machine.source, machine.licence,
                             machine.files, machine)  # fmt: skip


def _determined(
    fit: Fit, subsystems: Mapping[str, Mapping[str, Any]], printed: Iterable[PrintedValue]
) -> list[DeterminedRow]:
    """Return what a fit determined, each beside what the authors print."""
    authors = {item.quantity: item for item in printed}
    rows = []
    for subsystem in subsystems.values():
        for name, item in subsystem["parameters"].items():
            value, low, high, unit = (item[key] for key in ("value", "low", "high", "unit"))
            theirs = off = outside = None
            if name in authors:
                theirs = float(to_si(authors[name].value, authors[name].unit))
                ours, least, most = (float(to_si(v, unit)) for v in (value, low, high))
                off = 100.0 * (ours / theirs - 1.0)
                outside = not least <= theirs <= most
            rows.append(DeterminedRow(fit.name, name, value, low, high, unit, theirs, off, outside))
    return rows


def _errors(fit: Fit, validation: Any, *, held_out: bool) -> list[PredictedRow]:
    if validation is None:
        return []
    return [
        PredictedRow(fit.name, error.log, error.signal, held_out, error.rms, error.unit,
                     error.of_range)
        for error in validation.errors
    ]  # fmt: skip


def machine_page(result: RealMachineResult, date: str | None = None) -> Report:
    """Return the report of one machine."""
    machine = result.machine
    report = Report(
        machine.title,
        f"Data: {machine.source}; licence: {machine.licence}. Nothing of them is part of Elevon. "
        "Held-out files were fixed before they were run.",
        date=date,
    )
    determined = (
        ("Fit", "fit"),
        ("Quantity", "quantity"),
        ("Value", "value"),
        ("from", "low"),
        ("to", "high"),
        ("Unit", "unit"),
        ("Authors, SI", "printed"),
        ("Off [%]", "off_percent", "+.2f"),
        ("Outside the interval", "outside"),
    )
    section = report.section("Determined")
    section.table(table_of(result.rows, determined, "With 90 % intervals."))
    section.points([f"{name}: {reason}" for name, reason in result.not_determined.items()])
    predicted = (
        ("Fit", "fit"),
        ("Log", "log"),
        ("Signal", "signal"),
        ("Held out", "held_out"),
        ("RMS error", "rms", ".4g"),
        ("Unit", "unit"),
        ("% of range", "percent_of_range", ".3g"),
    )
    report.section("Predicted").table(table_of(result.predictions, predicted))
    stated: tuple[Column, ...] = (
        ("Quantity", "quantity"),
        ("Value", "value"),
        ("Unit", "unit"),
        ("Where", "where"),
    )
    report.section("What the authors print").table(table_of(machine.printed, stated, digits=7))
    files: tuple[Column, ...] = (("File", lambda item: item[0]), ("SHA-256", lambda item: item[1]))
    report.section("Files").table(table_of(machine.files.items(), files))
    return with_end(report, result.checks, f"real-{machine.name} --data FOLDER")
