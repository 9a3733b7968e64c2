"""The core's waveforms: their records, the rules their parameters follow, their values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError, unknown

TABLE = "table"


@dataclass(frozen=True, slots=True)
class WaveParameter:
    """A parameter of a waveform; an empty unit is that of the quantity the waveform drives."""

    name: str
    unit: str
    default: float | None
    text: str


@dataclass(frozen=True, slots=True)
class WaveRecord:
    """A kind of waveform and its parameters in the core's order."""

    kind: str
    text: str
    parameters: tuple[WaveParameter, ...]

    @property
    def names(self) -> list[str]:
        """Names of the parameters."""
        return [parameter.name for parameter in self.parameters]


@lru_cache(maxsize=1)
def wave_records() -> Mapping[str, WaveRecord]:
    """Return the core's waveforms by kind."""
    from elevon import _core

    return {
        item["kind"]: WaveRecord(
            item["kind"], item["text"], tuple(WaveParameter(**p) for p in item["parameters"])
        )
        for item in _core.waveforms()
    }


def complete(kind: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return all parameters of a waveform in the core's order, defaults filled in.

    Raises
    ------
    UnknownNameError
        Unknown waveform or parameter.
    InputError
        A parameter without default is missing.
    """
    known = wave_records()
    if kind not in known:
        raise unknown("waveform", kind, known)
    record = known[kind]
    for name in given:
        if name not in record.names:
            raise unknown("parameter", name, record.names, f"waveform {kind}")
    values = {}
    for parameter in record.parameters:
        value = given.get(parameter.name, parameter.default)
        if value is None:
            raise InputError(f"waveform {kind}: parameter {parameter.name!r} is missing")
        values[parameter.name] = float(value)
    return values


def evaluate(kind: str, given: Mapping[str, float], time: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the values of a waveform, as the core computes them.

    Parameters
    ----------
    kind : str
        Any waveform but a table, which has points instead.
    given : mapping of str to float
        Parameters (SI); those left out take their default.
    time : array_like, shape (n,)
        Instants in s.

    Returns
    -------
    ndarray, shape (n,)
        In the unit of the parameters.

    Raises
    ------
    UnknownNameError, InputError
        As for `complete`.
    """
    from elevon import _core

    values = list(complete(kind, given).values())
    return _core.waveform(kind, values, np.ascontiguousarray(time, dtype=np.float64))


def unit_of(parameter: WaveParameter, port_unit: str) -> str:
    """Return the SI unit of a parameter where the waveform drives a quantity in the unit `own`."""
    if parameter.unit == "":
        return port_unit
    return port_unit + parameter.unit if parameter.unit.startswith("/") else parameter.unit


#: Names of instants: any of them may be anywhere on the time axis.
_INSTANTS = frozenset({"start", "end", "time"})
_POSITIVE = frozenset({"period", "sweep_time", "start_period", "end_period"})
_SHORTEST = 1e-9
"""Shortest cycle [s]. ASSUMED: a thousandth of the shortest steps of the models in use."""
_SHORTEST_PART = 1e-12
"""Shortest cycle as a part of the start: time then places its phase within 2e-4 of a cycle."""


def check_values(record: WaveRecord, values: Mapping[str, float], place: str) -> None:
    """Check what the values of one waveform must obey together.

    Raises
    ------
    InputError
        A negative duration or frequency, a cycle too short for its phase to have digits, a switch
        that is neither 0 nor 1, a duty outside 0 to 1, or an end before the start.
    """
    for parameter in record.parameters:
        name, value = parameter.name, values[parameter.name]
        positive = name in _POSITIVE or (record.kind == "triangle" and name == "frequency")
        duration = parameter.unit in ("s", "Hz") and name not in _INSTANTS
        if positive and value <= 0.0:
            raise InputError(f"{place}: {name} = {value:g} {parameter.unit} must be positive")
        if duration and value < 0.0:
            raise InputError(f"{place}: {name} = {value:g} {parameter.unit} must not be negative")
        if name in ("repeat", "hold") and value not in (0.0, 1.0):
            raise InputError(f"{place}: {name} must be true or false")
        if name == "duty" and not 0.0 <= value <= 1.0:
            raise InputError(f"{place}: duty = {value:g} must be from 0 to 1")
    if "end" in values and values["end"] <= values["start"]:
        raise InputError(
            f"{place}: ends before it starts: end = {values['end']:g} s, "
            f"start = {values['start']:g} s"
        )
    _check_cycle(record, values, place)
    if values.get("acceleration"):
        _check_acceleration(record, values, place)


def _check_cycle(record: WaveRecord, values: Mapping[str, float], place: str) -> None:
    """Check that time has digits enough for the phase of what repeats."""
    least = max(_SHORTEST, _SHORTEST_PART * abs(values.get("start", 0.0)))
    for parameter in record.parameters:
        name, value = parameter.name, values[parameter.name]
        fast = parameter.unit == "Hz" and value * least > 1.0
        if fast or (name in _POSITIVE and value < least):
            what = "above" if fast else "below"
            limit = 1.0 / least if fast else least
            raise InputError(f"{place}: {name} = {value:g} {parameter.unit}: {what} {limit:g}")
    if record.kind == "trapezoid" and values["repeat"]:
        cycle = sum(values[name] for name in ("rise", "hold_high", "fall", "hold_low"))
        if cycle < least:
            raise InputError(
                f"{place}: a repeated trapezoid needs a cycle longer than zero and than the "
                f"rounding of its time: {cycle:g} s, at least {least:g} s"
            )


def check_repeated(times: npt.NDArray[np.float64], start: float, place: str) -> None:
    """Check that a table that repeats has a cycle whose phase has digits.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Instants of the table's points [s]. One point is a constant, and repeats as one.
    start : float
        Instant at which the table's time is zero [s].
    place : str
        For the message.

    Raises
    ------
    InputError
        A cycle below the rounding of its time.
    """
    cycle = float(times[-1] - times[0])
    least = max(_SHORTEST, _SHORTEST_PART * abs(start + float(times[0])))
    if len(times) > 1 and cycle < least:
        raise InputError(
            f"{place}: a repeated table needs a cycle longer than the rounding of its time: "
            f"{cycle:g} s, at least {least:g} s"
        )


def _check_acceleration(record: WaveRecord, values: Mapping[str, float], place: str) -> None:
    """Rounded corners must fit between each other, and what is rounded must have no jumps."""
    acceleration = values["acceleration"]
    if acceleration < 0.0:
        raise InputError(f"{place}: acceleration = {acceleration:g} must not be negative")
    if values.get("end", math.inf) < math.inf:
        raise InputError(f"{place}: end and acceleration exclude each other: the end is a corner")
    if record.kind == "trapezoid" and not (values["rise"] > 0.0 and values["fall"] > 0.0):
        raise InputError(f"{place}: acceleration needs rise and fall above 0 s")
    corners = _corners(record, values)
    if any(b[0] <= a[0] for a, b in pairwise(corners)):
        raise InputError(f"{place}: a part of it is shorter than the rounding of its time")
    slopes = [0.0, *((b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(corners))]
    bends = [abs(b - a) for a, b in pairwise(slopes)]
    spans = [b[0] - a[0] for a, b in pairwise(corners)]
    # Half of the parabola at each end of a line must fit into it.
    least = max(0.5 * (a + b) / span for (a, b), span in zip(pairwise(bends), spans, strict=False))
    if acceleration < least:
        raise InputError(
            f"{place}: acceleration = {acceleration:g} is too small for its corners to be rounded "
            f"between each other; at least {least:.6g}"
        )


def _corners(record: WaveRecord, values: Mapping[str, float]) -> list[tuple[float, float]]:
    """Corners (s, value) from where the motion begins, through more than one cycle."""
    entered = max(-values["start"], 0.0)
    if record.kind == "triangle":
        size, frequency = values["amplitude"], values["frequency"]
        quarters = 4.0 * (values["phase"] / (2.0 * math.pi) + frequency * entered)
        # Turning points stand at the odd quarters.
        first = 2.0 * math.floor(0.5 * (quarters - 1.0)) + 3.0
        turns = [first + 2.0 * k for k in range(3)]
        past = quarters - first + 2.0
        start = size * (1.0 - past) * (1.0 if (first - 2.0) % 4.0 == 1.0 else -1.0)
        return [
            (0.0, start),
            *((0.25 * (q - quarters) / frequency, size if q % 4.0 == 1.0 else -size)
              for q in turns),
        ]  # fmt: skip
    levels = (values["high"], values["high"], values["low"], values["low"])
    spans = [values[name] for name in ("rise", "hold_high", "fall", "hold_low")]
    cycle = sum(spans)
    corners, time = [(0.0, values["low"])], 0.0
    cycles = 3 if values["repeat"] else 1
    for _ in range(cycles):
        for span, level in zip(spans, levels, strict=True):
            time += span
            if span > 0.0:
                corners.append((time, level))
    entered = entered % cycle if values["repeat"] else min(entered, cycle)
    behind = next((i for i, corner in enumerate(corners) if corner[0] > entered), len(corners) - 1)
    (t0, v0), (t1, v1) = corners[behind - 1], corners[behind]
    here = (entered, v0 + (v1 - v0) * (entered - t0) / (t1 - t0))
    return [(time - entered, value) for time, value in (here, *corners[behind:])]
