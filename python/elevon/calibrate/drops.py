"""A table of hung weights: stiffness and dead zone of the transmission.

    loss = dead zone + load / stiffness (+ an offset for each further group of drops)

The load is set and exact, the scatter is in the angle: so the loss is regressed on the load. Drops
of one weight share their errors and count as one block. Slips of the pen are found from the table
itself: the encoder came back to the same few end positions while the motor never stopped twice at
the same place; every weight pulls to the same side; the printed loss is the distance between the
two positions of its row.
"""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats, Ints
from elevon.calibrate.outcome import Calibration, LogFacts
from elevon.data import read_table
from elevon.errors import FormatError, InputError, RangeError
from elevon.estimate import Estimate
from elevon.estimate.regression import huber, with_deviations
from elevon.files import read_regular

_ROUNDING = 2e-5
"""Half a unit of the last printed digit of two positions and a loss, together [deg]."""
_NEAR = 1e-3
"""Readings closer than this are the same encoder position: a count is 4.5e-3 deg [deg]."""


@dataclass(frozen=True, slots=True)
class WeightDrop:
    """One weight let down once.

    Attributes
    ----------
    row : int
        Place in the printed order, from 1.
    load_n : float
        Printed load [N].
    motor_deg, encoder_deg : float
        End positions at the output shaft [deg].
    loss_deg : float
        Angle lost between them [deg].
    """

    row: int
    load_n: float
    motor_deg: float
    encoder_deg: float
    loss_deg: float

    @property
    def drop(self) -> int:
        """Which of the four drops of its weight this is, from 1."""
        return (self.row - 1) % 4 + 1


@dataclass(frozen=True, slots=True)
class Slip:
    """One thing wrong in a printed row.

    Attributes
    ----------
    row : int
        Place in the printed order, from 1.
    kind : str
        `swapped` (columns exchanged), `sign`, `decimal` or `loss` (not that of its positions).
    reason : str
        The evidence, in words.
    """

    row: int
    kind: str
    reason: str


def printed_drops() -> list[WeightDrop]:
    """Return the forty rows as printed."""
    table = read_table("torino_compliance")
    names = ("load_n", "motor_deg", "encoder_deg", "loss_deg")
    return [
        WeightDrop(k, *(float(line[name]) for name in names)) for k, line in enumerate(table, 1)
    ]


def find_slips(drops: Sequence[WeightDrop]) -> tuple[list[WeightDrop], list[Slip]]:
    """Find what is wrong in each row, and what the row should have read.

    Parameters
    ----------
    drops : sequence of WeightDrop
        Rows in printed order.

    Returns
    -------
    repaired : list of WeightDrop
        Rows in the same order; a row without a slip is the row given.
    slips : list of Slip
        Every slip with its evidence, in the order of the rows.
    """
    ends = _encoder_ends(drops)
    downwards = sum(_motor(drop, ends) < 0 for drop in drops) * 2 > len(drops)
    repaired, slips = [], []
    for drop in drops:
        fixed, misplaced = _positions(drop, ends, downwards)
        fixed, wrong = _loss(drop, fixed, bool(misplaced), drops)
        repaired.append(fixed)
        slips += misplaced + wrong
    return repaired, slips


def _encoder_ends(drops: Sequence[WeightDrop]) -> list[float]:
    """Positions at which at least three rows ended: only the encoder repeats itself."""
    readings = [value for drop in drops for value in (drop.motor_deg, drop.encoder_deg)]
    counts = Counter(round(value, 5) for value in readings)
    return [value for value, count in counts.items() if count >= 3]


def _is_end(value: float, ends: Sequence[float]) -> bool:
    return any(abs(value - end) < _NEAR for end in ends)


def _swapped(drop: WeightDrop, ends: Sequence[float]) -> bool:
    return _is_end(drop.motor_deg, ends) and not _is_end(drop.encoder_deg, ends)


def _motor(drop: WeightDrop, ends: Sequence[float]) -> float:
    return drop.encoder_deg if _swapped(drop, ends) else drop.motor_deg


def _positions(
    drop: WeightDrop, ends: Sequence[float], downwards: bool
) -> tuple[WeightDrop, list[Slip]]:
    """Mend the two positions of a row."""
    fixed, slips = drop, []
    if _swapped(drop, ends):
        fixed = replace(drop, motor_deg=drop.encoder_deg, encoder_deg=drop.motor_deg)
        reason = f"the motor column holds {drop.motor_deg:g}, an end position of the encoder"
        slips.append(Slip(drop.row, "swapped", reason))
    if (fixed.motor_deg < 0) != downwards:
        slips.append(Slip(drop.row, "sign", f"the motor ends at {fixed.motor_deg:+g} deg, alone"))
        fixed = replace(fixed, motor_deg=-fixed.motor_deg)
    if not _is_end(fixed.encoder_deg, ends) and _is_end(fixed.encoder_deg / 10, ends):
        reason = f"{fixed.encoder_deg:g} is ten times an end position of the encoder"
        slips.append(Slip(drop.row, "decimal", reason))
        fixed = replace(fixed, encoder_deg=fixed.encoder_deg / 10)
    return fixed, slips


def _loss(
    printed: WeightDrop, fixed: WeightDrop, moved: bool, drops: Sequence[WeightDrop]
) -> tuple[WeightDrop, list[Slip]]:
    """Hold the printed loss against the positions, as printed and as mended."""
    difference = abs(printed.encoder_deg - printed.motor_deg)
    slips = []
    if abs(difference - printed.loss_deg) > _ROUNDING:
        twins = [d.row for d in drops if d.loss_deg == printed.loss_deg and d.row != printed.row]
        copy = f"; {printed.loss_deg:g} is the loss of row {twins[0]}" if twins else ""
        reason = f"printed loss {printed.loss_deg:g}, its positions give {difference:.5f}{copy}"
        slips.append(Slip(printed.row, "loss", reason))
    distance = abs(fixed.encoder_deg - fixed.motor_deg)
    if slips or (moved and abs(distance - printed.loss_deg) > _ROUNDING):
        fixed = replace(fixed, loss_deg=distance)
    return fixed, slips


@dataclass(frozen=True)
class ComplianceCalibration:
    """The answer, in SI at the output shaft.

    Attributes
    ----------
    estimates : tuple of Estimate
        ``backlash.stiffness`` [N m/rad], ``derived.dead_zone`` [rad]: angle lost at the smallest
        load, one ``derived.group_offset[k]`` [rad] a further group.
    residual : ndarray, shape (n,)
        Measured less fitted loss [rad].
    outliers : tuple of int
        Observations (from 0) that kept less than half their weight.
    """

    estimates: tuple[Estimate, ...]
    residual: Floats
    outliers: tuple[int, ...]


def calibrate_compliance(
    torque: npt.ArrayLike,
    loss: npt.ArrayLike,
    *,
    weight: npt.ArrayLike,
    group: npt.ArrayLike | None = None,
    old: float | None = None,
) -> ComplianceCalibration:
    """Estimate stiffness and dead zone with intervals.

    Parameters
    ----------
    torque : array_like, shape (n,)
        Torque of the load at the output [N m].
    loss : array_like, shape (n,)
        Angle lost between motor over ratio and encoder [rad].
    weight : array_like of int, shape (n,)
        Which observations share one weight: they count as one block.
    group : array_like of int, shape (n,), optional
        0 for the common offset, 1, 2, ... for drops that began from elsewhere.
    old : float, optional
        Stiffness before [N m/rad].

    Raises
    ------
    InputError
        Lengths that differ, fewer than four weights, one torque only.
    RangeError
        A value that is not finite, or a loss that does not grow with the load.
    """
    x, y = np.asarray(torque, dtype=np.float64), np.asarray(loss, dtype=np.float64)
    blocks = np.unique(np.asarray(weight), return_inverse=True)[1].astype(np.int64)
    groups = np.zeros(len(x), dtype=np.int64) if group is None else np.asarray(group)
    _check(x, y, blocks, groups)
    labels = [label for label in np.unique(groups) if label != 0]
    design = np.column_stack((x, np.ones_like(x), *[(groups == k) * 1.0 for k in labels]))
    beta, misfit, trust = huber(design, y)
    if not beta[0] > 0.0:
        raise RangeError("compliance: the loss does not grow with the load: no stiffness")
    names = ("compliance", "derived.dead_zone", *(f"derived.group_offset[{k}]" for k in labels))
    fit = with_deviations(names, beta, design, misfit, trust, strokes=blocks)
    # The compliance has the even interval; its inverse, the stiffness, an uneven one.
    low, high = fit.estimate(names[0]).interval
    ends = (1.0 / high, 1.0 / low if low > 0.0 else math.inf)
    stiffness = replace(
        fit.estimate(names[0]).inverted(), interval=ends, path="backlash.stiffness",
        unit="N m/rad", register="plant", old=old, note="loss regressed on load",
    )  # fmt: skip
    notes = ("angle lost without load", *["lost beyond the common offset"] * len(labels))
    others = [
        replace(
            fit.estimate(name), path=name, unit="rad", register="plant", note=note, in_set=False
        )
        for name, note in zip(names[1:], notes, strict=True)
    ]
    outliers = tuple(int(k) for k in np.flatnonzero(trust < 0.5))
    return ComplianceCalibration((stiffness, *others), misfit, outliers)


def _check(x: Floats, y: Floats, blocks: Ints, groups: Ints) -> None:
    if not x.shape == y.shape == blocks.shape == groups.shape or x.ndim != 1:
        raise InputError(
            f"compliance: {x.shape} torques, {y.shape} losses, {blocks.shape} weights, "
            f"{groups.shape} groups"
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise RangeError("compliance: a torque or a loss is not finite")
    if len(np.unique(blocks)) < 4 or np.ptp(x) == 0.0:
        raise InputError(
            f"compliance: {len(np.unique(blocks))} weights; four different ones are needed"
        )


COLUMNS = ("load_n", "motor_deg", "encoder_deg", "loss_deg")
_MOST_BYTES = 10_000_000
GUIDE_RADIUS = 0.08
"""Radius of the winding guide [m]; the load hangs on each of its two cables (ASSUMED)."""


def is_drop_table(path: Path) -> bool:
    """Whether a file's header names the columns of a table of drops."""
    try:
        lines = read_regular(path, _MOST_BYTES).decode("utf-8-sig").splitlines()
    except (InputError, UnicodeDecodeError):
        return False
    header = next((line for line in lines if not line.startswith("#")), "")
    return header.strip().replace(" ", "").split(",")[:4] == list(COLUMNS)


def run_drops(path: Path, actuator: Actuator) -> Calibration:
    """Calibrate on a table of drops; the slips of the pen are found, mended and listed.

    Raises
    ------
    FormatError
        A cell that is no number.
    InputError
        Too few weights.
    """
    import numpy as np

    drops = _read(path)
    mended, slips = find_slips(drops)
    loads = np.array([drop.load_n for drop in mended])
    first = [k == 0 or loads[k] != loads[k - 1] for k in range(len(loads))]
    result = calibrate_compliance(
        2.0 * GUIDE_RADIUS * loads,
        np.radians([drop.loss_deg for drop in mended]),
        weight=np.unique(loads, return_inverse=True)[1],
        group=np.array(first, dtype=np.int64),
        old=actuator.parameters.value("backlash.stiffness"),
    )
    facts = {
        "residual_rms": float(np.sqrt(np.mean(result.residual**2))),
        "outliers": result.outliers,
        "rows": len(drops),
        "slips": [{"row": s.row, "kind": s.kind, "reason": s.reason} for s in slips],
        "assumed": f"the load hangs on each of two cables at {GUIDE_RADIUS} m; it is mass times 10",
        "stiffness_n_per_deg": result.estimates[0].value / (2.0 * GUIDE_RADIUS) * math.pi / 180.0,
    }
    values: dict[str, str | float] = {i.path: i.value for i in result.estimates if i.in_set}
    return Calibration(
        actuator=actuator.with_values(values, source="calibration"),
        before=actuator,
        logs=(LogFacts(path.name, len(drops), math.nan),),
        parameters={item.path: item for item in result.estimates},
        facts=facts,
        findings=(f"{len(slips)} slips mended; {facts['assumed']}",),
    )


def _read(path: Path) -> list[WeightDrop]:
    text = read_regular(path, _MOST_BYTES).decode("utf-8-sig")
    lines = [x for x in text.splitlines() if x and not x.startswith("#")]
    drops = []
    for number, line in enumerate(csv.DictReader(lines), 1):
        try:
            values = [float(str(line[name])) for name in COLUMNS]
        except (TypeError, ValueError, KeyError) as error:
            raise FormatError(f"{path}, row {number}: {error}; four numbers expected") from error
        if not all(math.isfinite(value) for value in values):
            raise FormatError(f"{path}, row {number}: a value is not finite")
        drops.append(WeightDrop(number, *values))
    return drops
