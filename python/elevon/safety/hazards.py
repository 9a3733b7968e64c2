"""Hazards: properties watched in a run, by its recording and what was commanded alone.

Nothing here reads what a control unit or a drive knows; hazards share no code with them. One of a
user's own is a function and a line::

    def _far(run):
        return lasting(run, abs(run["output_position"]) > 0.2, 0.1)


    mine = Hazard("too far", "the output stands beyond its range", _far, "hazardous")
    safety("torino-rotary", hazards=[mine])
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, unknown
from elevon.plain import Plain
from elevon.recording import Recording
from elevon.safety.rows import Row

TARGETS: Mapping[str, float] = {
    "catastrophic": 1e-9, "hazardous": 1e-7, "major": 1e-5, "minor": 1e-3,
}  # fmt: skip
"""Classes and the largest mean probability of one flight hour (AMC 25.1309, section 7)."""
LATENT_SUM = 1e-3
"""CS 25.1309(b)(5)(iii): largest sum of latent failures' probabilities beside an evident one."""
LATENT_LEFT = 1e-5
"""CS 25.1309(b)(5)(ii): with a latent failure there, a catastrophe is at least remote [1/h]."""


@dataclass(frozen=True)
class Watched:
    """What a hazard is judged by: signals by name, their time, the row, the limits of the unit."""

    time: Floats
    signals: Mapping[str, Floats]
    row: Row
    status: str
    limits: Mapping[str, float]

    def __getitem__(self, name: str) -> Floats:
        """Return the values of a signal."""
        return self.signals[name]


Judge = Callable[[Watched], float | None]


@dataclass(frozen=True)
class Hazard:
    """A property that no run may have.

    Attributes
    ----------
    name : str
        Short name.
    text : str
        What it is, in words.
    judge : callable
        Time in s at which a run shows it; None: never.
    severity : str
        catastrophic, hazardous, major or minor.
    """

    name: str
    text: str
    judge: Judge
    severity: str = "major"

    def __post_init__(self) -> None:
        if self.severity not in TARGETS:
            raise unknown("class", self.severity, TARGETS, f"hazard {self.name!r}")


@dataclass(frozen=True)
class Message(Plain):
    """What is displayed, when [s], and to whom."""

    time: float
    text: str
    audience: str = "crew"


def watched(recording: Recording, row: Row, limits: Mapping[str, float] | None = None) -> Watched:
    """Return a run as hazards see it; every recorded channel on the clock of the first."""
    signals = {channel.name: channel.values for channel in recording.channels}
    time = next(iter(recording.channels)).time
    return Watched(time, signals, row, recording.status, limits or {})


def observe(run: Watched, hazards: Iterable[Hazard]) -> dict[str, float]:
    """Return the hazards of a run and when each begins, in s."""
    times = {hazard.name: hazard.judge(run) for hazard in hazards}
    return {name: float(time) for name, time in times.items() if time is not None}


def lasting(run: Watched, flags: npt.NDArray[np.bool_], least: float) -> float | None:
    """Return when a condition that lasts longer than `least` (s) begins; None: never."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if run.time[last - 1] - run.time[first] > least:
            return float(run.time[first])
    return None


def read_targets(given: Iterable[str]) -> dict[str, float]:
    """Return the targets by class, those given as ``CLASS=P`` in place of the usual ones.

    Raises
    ------
    InputError
        No such class, or no probability between 0 and 1.
    """
    targets = dict(TARGETS)
    for text in given:
        name, _, value = text.partition("=")
        if name.strip() not in TARGETS:
            raise unknown("class", name.strip(), TARGETS, "--target")
        try:
            limit = float(value)
        except ValueError:
            limit = 0.0
        if not 0.0 < limit <= 1.0:
            raise InputError(f"--target {text}: the probability must lie above 0 and at most at 1")
        targets[name.strip()] = limit
    return targets
