"""What is learnt from: numbers of many logs, and what was wrong in each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Bools, Floats
from elevon.campaign import Dataset
from elevon.diagnose.learning.labels import HEALTHY, LabelledLog
from elevon.diagnose.learning.motion import KnownMotion, LoggedMotion, motion_of, motions
from elevon.errors import InputError, Interrupted
from elevon.logs.log import Log
from elevon.progress import Progress
from elevon.recording import Channel, Clock, Recording

Strings = npt.NDArray[np.str_]
Rows = npt.NDArray[np.intp]
_DONE = ("ok", "tripped")  # how a run ends whose signals are whole


@dataclass(frozen=True)
class Examples:
    """Numbers of logs of one motion, and what was wrong in each.

    Attributes
    ----------
    names : tuple of str
        Of the numbers.
    values : ndarray, shape (n, k)
        Finite.
    kinds : tuple of str
        Faults and other classes, without ``healthy``.
    present : ndarray of bool, shape (n, f)
        Which of them a log has.
    severity : ndarray, shape (n, f)
        SI; NaN where nobody knows, zero where absent.
    severity_units : tuple of str
        SI unit of each kind's severity.
    unit, condition : ndarray of str, shape (n,)
        Of each log; a log whose unit nobody knows is a unit by itself.
    """

    names: tuple[str, ...]
    values: Floats
    kinds: tuple[str, ...]
    present: Bools
    severity: Floats
    severity_units: tuple[str, ...]
    unit: Strings
    condition: Strings

    @property
    def healthy(self) -> Bools:
        """Which logs have nothing."""
        return np.asarray(~self.present.any(axis=1))

    @property
    def exclusive(self) -> bool:
        """Whether no log has two kinds."""
        return bool(self.present.sum(axis=1).max() <= 1)

    @property
    def labels(self) -> Strings:
        """What each log has, as one word."""
        names = np.array(self.kinds, dtype=object)
        return np.array(["+".join(names[row]) or HEALTHY for row in self.present], dtype=np.str_)

    def take(self, rows: Rows) -> Examples:
        """Return some of the logs."""
        parts = ("values", "present", "severity", "unit", "condition")
        return replace(self, **{name: getattr(self, name)[rows] for name in parts})

    def against_baselines(self, seed: int) -> Examples:
        """Return the changes of logs against another healthy log of their unit, drawn.

        One, not the mean of several: a threshold that holds for one baseline holds for more. A log
        whose unit has no other healthy one is left out.
        """
        rng = np.random.default_rng([seed, 1])
        rows, others = [], []
        for row, unit in enumerate(self.unit):
            near = np.flatnonzero(self.healthy & (self.unit == unit))
            near = near[near != row]
            if len(near):
                rows.append(row)
                others.append(int(rng.choice(near)))
        out = self.take(np.array(rows, dtype=np.intp))
        baselines = self.values[np.array(others, dtype=np.intp)]
        return replace(out, values=out.values - baselines)


def examples_of_logs(
    logs: Sequence[Log], known: Sequence[LabelledLog], pole_pairs: float | None
) -> tuple[Examples, KnownMotion]:
    """Return the numbers of labelled logs, and their motion.

    Raises
    ------
    InputError
        Logs of different motions; a log that cannot be read; two units of one kind's severity.
    """
    items, motion = motions(logs, pole_pairs)
    kinds = tuple(sorted({k.label for k in known} - {HEALTHY}))
    units = tuple(next(k.severity_unit for k in known if k.label == kind) for kind in kinds)
    present = np.array([[k.label == kind for kind in kinds] for k in known])
    names, values = _shared_varied_numbers(items)
    return Examples(
        names, values, kinds, present,
        np.where(present, np.array([[k.severity] for k in known]), 0.0), units,
        np.array([k.unit or f"log {n}" for n, k in enumerate(known)]),
        np.array([k.condition for k in known]),
    ), motion  # fmt: skip


def examples_of_dataset(
    ds: Dataset, pole_pairs: float | None, progress: Progress | None = None
) -> tuple[Examples, KnownMotion, dict[str, int], list[int]]:
    """Return the numbers of a campaign's runs, their motion, and which runs could be read.

    A run has each fault whose severity is not nought. Its unit is that of the population, else its
    draw.

    Parameters
    ----------
    ds : Dataset
        Of a campaign that recorded a command and what followed it.
    pole_pairs : float or None
        Of the motor.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    Examples, KnownMotion, dict of str to int, list of int
        The third counts runs that were left out, by the reason; the last numbers those read.

    Raises
    ------
    InputError
        No fault varies, no signals, no run that can be read.
    """
    kinds = tuple(item["name"] for item in ds.manifest.faults)
    if not kinds:
        raise InputError(f"{ds.folder}: no fault varies in it: there is nothing to learn")
    table = ds.runs.to_pandas().set_index("run")
    items, rows = [], []
    lost: dict[str, int] = {}
    for number, log in run_logs(ds, progress):
        try:
            status = str(table.at[number, "status"])
            if status not in _DONE:
                raise InputError(f"{log.name}: {status}")
            items.append(motion_of(log, pole_pairs))
            rows.append(number)
        except InputError as error:
            reason = str(error).removeprefix(f"{log.name}: ")
            lost[reason] = lost.get(reason, 0) + 1
    if not items:
        reasons = "; ".join(f"{count} {text}" for text, count in lost.items())
        raise InputError(f"{ds.folder}: no run can be read as a log: {reasons or 'none is done'}")
    chosen = table.loc[rows]
    severity = chosen[list(kinds)].to_numpy(dtype=np.float64)
    by = "unit" if table["unit"].nunique() > 1 else "draw"
    numbers = chosen[by].to_numpy(dtype=np.int64).tolist()
    unit = np.array([f"{by} {number}" for number in numbers])
    names, values = _shared_varied_numbers(items)
    examples = Examples(
        names, values, kinds, severity != 0.0, severity,
        tuple(item["unit"] or "1" for item in ds.manifest.faults), unit,
        np.full(len(items), "", dtype=np.str_),
    )  # fmt: skip
    return examples, KnownMotion.spanning(items), lost, rows


def _shared_varied_numbers(items: Sequence[LoggedMotion]) -> tuple[tuple[str, ...], Floats]:
    """Return the numbers that all logs have and that are not the same in all of them."""
    shared = set.intersection(*(set(item.values) for item in items))
    names = [name for name in items[0].values if name in shared]
    values = np.array([[item.values[name] for name in names] for item in items])
    varied = np.flatnonzero(np.ptp(values, axis=0) > 0.0)
    return tuple(names[k] for k in varied), values[:, varied]


def run_logs(
    ds: Dataset,
    progress: Progress | None = None,
    wanted: Callable[[int], bool] = lambda _: True,
) -> Iterator[tuple[int, Log]]:
    """Yield number and log of each finished run of a campaign, in order.

    Parameters
    ----------
    ds : Dataset
        Its first clock is read.
    progress : callable, optional
        Told the done fraction; returns False to stop.
    wanted : callable
        Whether the run of a number is wanted; default: all.

    Raises
    ------
    InputError
        The campaign recorded no signals, or none of a log.
    Interrupted
        `progress` returned False.
    """
    import pyarrow.compute as pc

    resolved, table = ds.resolved(), ds.signals
    plan, units = resolved.prepared(0).plan[0], table.units
    scenario = resolved.run(0).scenario.to_dict()
    about: dict[str, Any] = {
        "wiring": resolved.wiring, "fidelity": resolved.fidelity, "scenario": scenario,
    }  # fmt: skip
    for item in ds.items:
        numbers = [n for n in range(item.data["first"], item.data["last"] + 1) if wanted(n)]
        rows = table.to_arrow(["run", "time", *plan.signals], numbers or [-1])
        for number in numbers:
            one = rows.filter(pc.equal(rows["run"], number))
            clock = Clock("log", one["time"].to_numpy(), plan.rate)
            channels = [Channel(n, units[n], one[n].to_numpy(), clock, "") for n in plan.signals]
            recording = Recording(channels, clocks=[clock], meta=about)
            yield number, Log.of(recording, f"run {number}")
        if progress is not None and not progress((item.data["last"] + 1) / len(ds)):
            raise Interrupted(f"interrupted after {item.data['last'] + 1} runs were read")


def pole_pairs_of(ds: Dataset) -> float | None:
    """Return the pole pairs of the campaign's actuator, None where it has none."""
    known = ds.resolved().run(0).actuator.parameters
    value = known.value("motor.pole_pairs") if "motor.pole_pairs" in known else math.nan
    return float(value) if math.isfinite(value) else None
