"""A calibration as an actuator file: what changed, from which logs, and its thresholds."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elevon.calibrate.validation import SignalError, Validation
from elevon.data import packaged_toml
from elevon.estimate import LEVEL
from elevon.files import write_text
from elevon.parameters import Parameter
from elevon.parameters.load import base_reference
from elevon.parameters.records import record_of
from elevon.parameters.write import updated_set

if TYPE_CHECKING:
    from elevon.calibrate.outcome import Calibration
    from elevon.calibrate.validation import Validation


_MARGIN = 2.0  # a threshold over the largest error seen on held-out data
_APART = 5.0  # times the median over the logs: a log that is not like the others ...
_BAD = 2.0  # ... and percent of the range: kinds of tests differ as much at small errors


def outliers(validation: Validation) -> list[str]:
    """Return the logs that are far worse than the others: no measure of a healthy machine."""
    names = set()
    for rows in _by_signal(validation).values():
        middle = float(np.median([row.of_range for row in rows]))
        if len(rows) > 2:
            names |= {row.log for row in rows if row.of_range > max(_APART * middle, _BAD)}
    return sorted(names)


def thresholds(validation: Validation) -> dict[str, float]:
    """Return twice the largest error of each signal over the logs, two digits, rounded up.

    Of three logs or more those that are far worse than the others do not count.
    """
    apart = outliers(validation)
    limits = {}
    for name, rows in _by_signal(validation).items():
        largest = max((row.of_range for row in rows if row.log not in apart), default=0.0)
        if largest > 0.0:
            limits[name] = _up(_MARGIN * largest)
    return limits


def _by_signal(validation: Validation) -> dict[str, list[SignalError]]:
    groups: dict[str, list[SignalError]] = {}
    for row in validation.errors:
        if math.isfinite(row.of_range) and row.log not in validation.notes:
            groups.setdefault(row.signal, []).append(row)
    return groups


def _up(value: float) -> float:
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit) * unit:.6g}")


def calibrated_parameters(result: Calibration) -> list[Parameter]:
    """Return the changed parameters with source, old value and interval."""
    reasons = result.undetermined
    names = ", ".join(log.name for log in result.logs)
    source = f"calibrated from {names}"
    known = {item.path: item for item in result.estimates if item.in_set}
    changes = []
    for path, entry in result.actuator.parameters.items():
        old = result.before.parameters[path]
        item = known.get(path)
        if item is None and entry.value == old.value and old.confidence != "override":
            continue
        wiring = result.actuator.wiring
        unit = old.unit or _unit(wiring, path)
        if item is None and entry.value == old.value:
            # Changed before the calibration: the base on disk does not have it.
            source_before = f"ASSUMED: {old.source}"
            changes.append(Parameter(path, entry.value, unit, source_before, "", "assumed"))
            continue
        if item is None:
            # `calibrated` is what the data narrowed: what moved with it is not.
            if path in reasons:
                note = f"not determined: {reasons[path]}"
                whence = f"ASSUMED: moved with what was {source}"
                moved = Parameter(path, entry.value, unit, whence, note, "assumed", old.value)
            else:
                note = _followed(path)
                moved = Parameter(path, entry.value, unit, source, note, "derived", old.value)
            changes.append(moved)
            continue
        given = f"; holds for {', '.join(item.given)} as given" if item.given else ""
        note = f"{item.note}{'; ' if item.note else ''}{100 * LEVEL:.0f} % interval{given}"
        changes.append(
            Parameter(path, item.value, unit, source, note, "calibrated", old.value, item.interval)
        )
    return changes


def _unit(wiring: str, path: str) -> str:
    record = record_of(wiring, path)
    return "" if record.choices is not None or record.unit == "1" else record.unit


def _followed(path: str) -> str:
    reasons: Mapping[str, str] = packaged_toml("elevon.calibrate", "followed.toml")
    return reasons.get(path, "scaled with motor.inertia: only the sum is determined")


def set_text(result: Calibration, *, name: str, base: str, validation: Validation | None) -> str:
    """Return the TOML text of the calibrated actuator file."""
    import tomlkit

    head = tomlkit.document()
    head.add("name", tomlkit.item(name))
    head.add("title", tomlkit.item(f"{result.before.title or result.before.name}, calibrated"))
    head.add("base", tomlkit.item(base))
    if validation is not None:
        table = tomlkit.table()
        table.add("transient", validation.transient)
        limits = tomlkit.table()
        limits.comment("largest RMS error, percent of the signal's range")
        for signal, limit in thresholds(validation).items():
            limits.add(signal, limit)
        table.add("limits", limits)
        offsets = tomlkit.table()
        offsets.comment("SI: what the bench's sensors add, taken off a log")
        for signal, value in validation.offsets.items():
            offsets.add(signal, float(f"{value:.6g}"))
        if validation.offsets:
            table.add("offsets", offsets)
        law = (result.actuator.validation or {}).get("law")
        if law is not None:
            table.add("law", tomlkit.item(dict(law)))
        head.add("validation", table)
    return updated_set(tomlkit.dumps(head), calibrated_parameters(result))


def write_calibration(
    path: str | os.PathLike[str],
    result: Calibration,
    *,
    validation: Validation | None = None,
    force: bool = False,
) -> Path:
    """Write the actuator file, whole or not at all; errors as `elevon.files.write_text`.

    Parameters
    ----------
    path : path
        The TOML file; the actuator is named after it.
    result : Calibration
        What was found.
    validation : Validation, optional
        On data held out of the fit, where there are any: gives the actuator file its thresholds.
    force : bool
        Whether an existing file may be replaced.
    """
    target = Path(path).expanduser()
    name = actuator_name(target.stem)
    text = set_text(
        result,
        name=name,
        base=base_reference(result.before.path, result.before.name, target),
        validation=validation,
    )
    return write_text(target, text, force=force)


def actuator_name(stem: str) -> str:
    """Return the name of an actuator that is written to a file of this stem."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in stem)
    return plain if plain and plain[0].isalnum() else f"actuator-{plain.strip('-._')}"
