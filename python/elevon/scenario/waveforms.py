"""The core's records of waveforms, and the rules their parameters follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from elevon.errors import InputError

__all__ = ["TABLE", "WaveRecord", "check_values", "unit_of", "wave_records"]

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
            item["kind"],
            item["text"],
            tuple(
                WaveParameter(p["name"], p["unit"], p["default"], p["text"])
                for p in item["parameters"]
            ),
        )
        for item in _core.waveforms()
    }


def unit_of(parameter: WaveParameter, own: str) -> str:
    """Return the SI unit of a parameter where the waveform drives a quantity in the unit `own`."""
    if parameter.unit == "":
        return own
    return own + parameter.unit if parameter.unit.startswith("/") else parameter.unit


#: Names of instants: any of them may be anywhere on the time axis.
_INSTANTS = frozenset({"start", "end", "time"})
_POSITIVE = frozenset({"period", "sweep_time", "start_period", "end_period"})


def check_values(record: WaveRecord, values: Mapping[str, float], place: str) -> None:
    """Check what the values of one waveform must obey together.

    Raises
    ------
    InputError
        A negative duration or frequency, a zero period, a switch that is neither 0 nor 1, a duty
        outside 0 to 1, or an end before the start.
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
    if record.kind == "trapezoid":
        _check_cycle(values, place)


def _check_cycle(values: Mapping[str, float], place: str) -> None:
    cycle = sum(values[name] for name in ("rise", "hold_high", "fall", "hold_low"))
    if values["repeat"] and cycle <= 0.0:
        raise InputError(f"{place}: a repeated trapezoid needs a cycle longer than zero")
