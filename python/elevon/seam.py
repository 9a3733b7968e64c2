"""Forms of the dictionaries that cross the seam to the core: every number SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NotRequired, TypedDict

from elevon.arrays import Floats

#: Instants or values of a table.
Points = Sequence[float] | Floats


class WiringRecord(TypedDict):
    """A wiring; ``mode_units`` has the unit of the command by mode."""

    name: str
    text: str
    modes: list[str]
    mode_units: dict[str, str]
    actions: list[str]
    fidelities: list[str]


class SignalRecord(TypedDict):
    """A recordable signal; without a role only a simulation has it."""

    name: str
    symbol: str
    unit: str
    text: str
    role: str | None


class ProfileParameter(TypedDict):
    """A parameter of a fault profile; without default it must be given."""

    name: str
    unit: str
    default: float | None
    text: str


class ProfileRecord(TypedDict):
    """A kind of fault profile, its parameters in the core's order."""

    kind: str
    text: str
    parameters: list[ProfileParameter]


class ValueFinding(TypedDict):
    """What the core says against values together: ``error`` (nothing runs) or ``warning``."""

    severity: str
    path: str
    value: float
    limit: float
    message: str


class CoreTerm(TypedDict):
    """A waveform of an input; a table has points, the others none."""

    kind: str
    enabled: bool
    parameters: list[float]
    times: Points
    values: Points


class CoreProfile(TypedDict):
    """How a severity goes over time; a table has points, the others none."""

    kind: str
    parameters: list[float]
    times: Points
    values: Points


class CoreFault(TypedDict):
    """A fault at its place."""

    kind: str
    place: str
    severity: float
    attributes: Mapping[str, float]
    profile: CoreProfile


class CoreRows(TypedDict):
    """What a clock recorded: ``time``, shape (n,), ``values``, shape (n, signals + faults)."""

    time: Floats
    values: Floats


class CoreResult(TypedDict):
    """What became of a run."""

    status: str
    message: str
    time: float
    steps: int
    wall_s: float
    clocks: dict[str, CoreRows]
    features: dict[str, Floats]
    final: dict[str, float]
    diverged_signal: NotRequired[str]
