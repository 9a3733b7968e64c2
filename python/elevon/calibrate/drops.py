"""A table of hung weights: stiffness and dead zone of the transmission."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from elevon.actuator import Actuator
from elevon.calibrate.outcome import Calibration, LogFacts, by_path
from elevon.calibrate.slips import WeightDrop, find_slips
from elevon.errors import FormatError, InputError
from elevon.files import read_regular

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

    from elevon.calibrate.compliance import calibrate_compliance

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
        parameters=by_path(result.estimates),
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
