"""Rates of failures: parts, their modes, and the checks that reveal what nobody sees in flight.

Both come from files of one form, packaged ones and those of ``--rates`` and ``--checks``; an entry
of a name that the packaged file has takes its place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Self

from pydantic import Field, StrictBool, StrictStr, model_validator

from elevon.data import packaged_toml
from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError, unknown
from elevon.plain import Plain
from elevon.strict import Number, Quantity, Strict
from elevon.units import parse_quantity

_PACKAGE = "elevon.safety"


class ModeTable(Strict):
    """A mode of a part: failures of the campaign that share `ratio` of its rate equally."""

    failure: tuple[StrictStr, ...]
    ratio: Number = Field(ge=0.0, le=1.0)
    effect: Number = Field(default=1.0, ge=0.0, le=1.0)
    severity: Number | None = None
    attributes: dict[str, Number] = Field(default_factory=dict)
    evident: StrictBool | None = None
    source: StrictStr


class PartTable(Strict):
    """A part, or several alike at `places` (PLACE in the names of the failures)."""

    name: StrictStr
    places: tuple[StrictStr, ...] = ("",)
    wiring: StrictStr = ""
    rate: Number = Field(ge=0.0)
    factor: Number = Field(default=1.0, ge=1.0)
    source: StrictStr
    family: StrictStr = ""
    beta: Number = Field(default=0.0, ge=0.0, le=1.0)
    beta_source: StrictStr = ""
    mode: tuple[ModeTable, ...]

    @model_validator(mode="after")
    def _at_most_one(self) -> Self:
        total = sum(mode.ratio for mode in self.mode)
        if total > 1.0 + 1e-9:
            raise ValueError(
                f"part {self.name!r}: the ratios of its modes sum to {total:g}, above the limit 1"
            )
        if self.beta > 0.0 and not self.family:
            raise ValueError(f"part {self.name!r}: beta needs the family of like components")
        return self


class RatesFile(Strict):
    """A file of rates."""

    part: tuple[PartTable, ...] = ()


class PhaseTable(Strict):
    """A phase of flight, or a situation that arises with the probability `demand` a flight."""

    name: StrictStr
    duration: Quantity
    demand: Number = Field(default=1.0, ge=0.0, le=1.0)
    follows: StrictStr = ""
    source: StrictStr = ""


class CheckTable(Strict):
    """A check that reveals failures, by patterns of their names."""

    name: StrictStr
    interval: Quantity
    reveals: tuple[StrictStr, ...]
    source: StrictStr = ""


class MonitorTable(Strict):
    """A monitor of the drive: a signal, less another scaled, above a limit for a time."""

    name: StrictStr
    signal: StrictStr
    minus: StrictStr = ""
    scale: Number = 1.0
    limit: Number = Field(gt=0.0)
    time: Quantity
    source: StrictStr = ""


class FlightTable(Strict):
    """The flight."""

    time: Quantity
    source: StrictStr = ""


class ChecksFile(Strict):
    """A file of phases, monitors and checks."""

    flight: FlightTable | None = None
    phase: tuple[PhaseTable, ...] = ()
    check: tuple[CheckTable, ...] = ()
    monitor: tuple[MonitorTable, ...] = ()


@dataclass(frozen=True)
class FailureRate(Plain):
    """The rate of one failure, and how it is revealed.

    Attributes
    ----------
    name : str
        As in the campaign: kind, place, and the severity where several are tried.
    rate, rate_low, rate_high : float
        Failures an hour, and the interval in which the rate lies [1/h].
    alpha : float
        Share of the part's failures.
    effect : float
        Conditional probability that it is as severe as it is tried.
    part, source : str
        Whose rate it is a share of, and where the numbers are from.
    severity : float or None
        In place of the catalogue's.
    attributes : dict
        Further numbers of the fault, such as a depth.
    stated : bool or None
        Whether a file says that it is evident; None: the campaign finds it.
    family : str
        Like components with which it shares common causes; empty: none.
    beta : float
        Share of the rate that common causes have.
    """

    name: str
    rate: float
    rate_low: float
    rate_high: float
    alpha: float
    effect: float
    part: str
    source: str
    severity: float | None = None
    attributes: dict[str, float] = field(default_factory=dict)
    stated: bool | None = None
    family: str = ""
    beta: float = 0.0


@dataclass(frozen=True)
class Phase(Plain):
    """A phase: duration in s, probability a flight that it arises, the phase whose loss it follows.

    A failure that announces itself in the phase `follows` makes it arise.
    """

    name: str
    duration: float
    demand: float
    follows: str = ""


@dataclass(frozen=True)
class RevealingCheck(Plain):
    """A check: the interval in h, and patterns of the failures that it reveals."""

    name: str
    interval: float
    reveals: tuple[str, ...]


@dataclass(frozen=True)
class DriveMonitor(Plain):
    """A monitor: the size of a signal, less `scale` times another, above a limit for a time [s]."""

    name: str
    signal: str
    minus: str
    scale: float
    limit: float
    time: float


@dataclass(frozen=True)
class Service(Plain):
    """How the actuator is flown and looked after.

    Attributes
    ----------
    flight : float
        Duration of a flight, in h.
    phases, checks, monitors : tuple
        In the order in which they are looked up.
    """

    flight: float
    phases: tuple[Phase, ...]
    checks: tuple[RevealingCheck, ...]
    monitors: tuple[DriveMonitor, ...]

    def check_of(self, name: str) -> RevealingCheck:
        """Return the check that reveals a failure: the first whose patterns have its name.

        Raises
        ------
        InputError
            None has it.
        """
        for check in self.checks:
            if any(fnmatchcase(name, pattern) for pattern in check.reveals):
                return check
        raise InputError(
            f'no check reveals {name}: give one with --checks (reveals = ["{name}"]); '
            f"there are {', '.join(check.name for check in self.checks) or 'none'}"
        )

    def phase_of(self, name: str) -> Phase:
        """Return a phase by its name; raise `UnknownNameError` with the nearest."""
        for phase in self.phases:
            if phase.name == name:
                return phase
        raise unknown("phase", name, [phase.name for phase in self.phases])


def read_service(
    wiring: str, file: str | Path | None = None, flight_time: str | float | None = None
) -> Service:
    """Return phases, checks and monitors of a wiring, with those of a file in front.

    Parameters
    ----------
    wiring : str
        Whose packaged file.
    file : path, optional
        Entries of the names that the packaged file has take their place, others come first.
    flight_time : str or float, optional
        Of a flight, in s, or a text with its unit.

    Raises
    ------
    InputError
        A file that is wrong; place, value and limit are named.
    """
    packaged = _packaged(ChecksFile, f"{wiring}_checks.toml")
    given = _given(ChecksFile, file)
    flight = given.flight or packaged.flight
    time = flight_time if flight_time is not None else flight.time if flight else 0.0
    hours = _positive(time, "flight time") / 3600.0
    merged = [_merged(getattr(given, key), getattr(packaged, key))
              for key in ("phase", "check", "monitor")]  # fmt: skip
    phases, checks, monitors = merged
    return Service(
        hours,
        tuple(Phase(p.name, _positive(p.duration, f"phase {p.name!r}: duration"), float(p.demand),
                    p.follows)
              for p in phases),
        tuple(
            RevealingCheck(c.name, _positive(c.interval, f"check {c.name!r}: interval") / 3600.0,
                       c.reveals)
            for c in checks
        ),
        tuple(DriveMonitor(m.name, m.signal, m.minus, float(m.scale), float(m.limit),
                      _positive(m.time, f"monitor {m.name!r}: time")) for m in monitors),
    )  # fmt: skip


def read_rates(
    wiring: str, names: Sequence[str], file: str | Path | None = None
) -> dict[str, FailureRate]:
    """Return the rate of each failure of a campaign.

    Parameters
    ----------
    wiring : str
        Whose packaged file.
    names : sequence of str
        The failures of the campaign, kind and place, with the severity where several are tried.
    file : path, optional
        Parts of the names that the packaged file has take their place. A failure that such a file
        names is of its part alone.

    Raises
    ------
    InputError
        A file that is wrong, a pattern that is no failure's, a failure that two parts claim.
    """
    packaged = _packaged(RatesFile, f"{_files(wiring)}_rates.toml")
    given = _given(RatesFile, file)
    rates: dict[str, FailureRate] = {}
    for item in _rates_of(given.part, names, f"{file}"):
        if item.name in rates:
            raise InputError(
                f"{file}: {item.name} is of the part {rates[item.name].part!r} and of "
                f"{item.part!r}; one part alone can have it"
            )
        rates[item.name] = item
    parts = [p for p in packaged.part if p.name not in {g.name for g in given.part}]
    for item in _rates_of([p for p in parts if p.wiring in {"", wiring}], names, ""):
        rates.setdefault(item.name, item)
    return {name: rates[name] for name in names if name in rates}


def _files(wiring: str) -> str:
    return "landing_gear" if wiring == "landing_gear" else "servo"


def _rates_of(
    parts: Sequence[PartTable], names: Sequence[str], origin: str
) -> Iterator[FailureRate]:
    """Yield the rates of the failures of some parts, each place a part of its own."""
    for part in parts:
        for place in part.places:
            for mode in part.mode:
                patterns = [text.replace("PLACE", place) for text in mode.failure]
                matching = [n for n in names if any(_matches(n, pattern) for pattern in patterns)]
                if not matching and origin:
                    raise unknown("failure", patterns[0], names, f"{origin}: part {part.name!r}")
                yield from (_rate(part, place, mode, name, len(matching)) for name in matching)


def _matches(name: str, pattern: str) -> bool:
    """Whether a name is a pattern's, with its severity or without."""
    return fnmatchcase(name, pattern) or fnmatchcase(name.partition("=")[0], pattern)


def _rate(part: PartTable, place: str, mode: ModeTable, name: str, count: int) -> FailureRate:
    alpha = mode.ratio / count
    rate = part.rate * alpha * mode.effect
    kind = name.partition("@")[0]
    return FailureRate(
        name, rate, rate / part.factor, rate * part.factor, alpha, float(mode.effect),
        f"{part.name} {place}".strip(), f"{part.source}; {mode.source}",
        None if mode.severity is None else float(mode.severity),
        {name: float(value) for name, value in mode.attributes.items()}, mode.evident,
        f"{part.family}: {kind}" if part.family else "", float(part.beta),
    )  # fmt: skip


def _merged(given: Sequence[Any], packaged: Sequence[Any]) -> list[Any]:
    names = {item.name for item in given}
    return [*given, *(item for item in packaged if item.name not in names)]


def _packaged(model: type[Any], name: str) -> Any:
    data = packaged_toml(_PACKAGE, name)
    return validated(model, data, Document(name, "", {}))


def _given(model: type[Any], file: str | Path | None) -> Any:
    if file is None:
        return model()
    document = read_toml(file)
    return validated(model, document.data, document)


def _positive(given: str | float, place: str) -> float:
    seconds = parse_quantity(given, "s", place)
    if seconds <= 0.0:
        raise InputError(f"{place} {given} must be longer than zero")
    return seconds
