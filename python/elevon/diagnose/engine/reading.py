"""A log made ready for one kind of features: what it shows, what the model shows in its place."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.table import FeatureTable, FeatureVector
from elevon.experiment import Variant

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log


@dataclass(frozen=True)
class ReplayUnit:
    """A unit of the replay.

    Attributes
    ----------
    variant : Variant
        How its run differs from that of the actuator file.
    late : float
        Samples that it is seen to begin too late.
    compliant : bool or None
        Whether its output deflects under the log's load, which the reduced-order model does not
        know; None: as the log has it.
    """

    variant: Variant = field(default_factory=Variant)
    late: float = 0.0
    compliant: bool | None = None


class Days(NamedTuple):
    """Healthy units of other days, and the factors they were drawn by.

    Attributes
    ----------
    units : list of ReplayUnit
        The d of them.
    steps : ndarray, shape (d, f), or None
        Factors in deviations; what is linear in them counts as stated, so they may be drawn wider.
        None: the units scatter as healthy ones do.
    """

    units: list[ReplayUnit]
    steps: Floats | None = None


@dataclass(frozen=True)
class SignalPanel:
    """One signal of a log beside the model's.

    Attributes
    ----------
    name, unit : str
        As drawn.
    log, healthy : ndarray, shape (n,)
        Of the log, and of the healthy model in the log's test.
    named : ndarray, shape (n,), or None
        Of the model with the faults that are named; None where none is.
    """

    name: str
    unit: str
    log: Floats
    healthy: Floats
    named: Floats | None = None

    @property
    def apart(self) -> float:
        """How far the log is from the healthy model, over that signal's own spread."""
        off = float(np.sqrt(np.nanmean((self.log - self.healthy) ** 2)))
        return off / (float(np.nanstd(self.healthy)) or 1.0)


class Reading(ABC):
    """A log that can be diagnosed, read by one kind of features.

    Attributes
    ----------
    log : Log
        On its clock.
    actuator : Actuator
        The healthy unit, as it is run.
    """

    #: Degrees of freedom of Student's distribution: how well the spread is known. ASSUMED.
    DEGREES: float
    #: Severities of each candidate that are run, one way, and how they grow.
    SEVERITIES: tuple[int, int]
    #: Whether faults may set in between two severities: one more is run there.
    SETS_IN: bool = False
    #: Deviations between two faults' shifts below which no log separates them. ASSUMED.
    ALIKE: float = 1.0

    #: Whether the model's mean, within its mismatch, counts beside baselines; else they replace it.
    PRIOR: bool = True

    log: Log
    actuator: Actuator

    @property
    def name(self) -> str:
        """Of the log."""
        return self.log.name

    @property
    @abstractmethod
    def features(self) -> FeatureVector:
        """What the log shows."""

    @property
    @abstractmethod
    def table(self) -> FeatureTable:
        """Its features' records."""

    @property
    def plausible(self) -> FeatureVector:
        """What the log shows beside its features and no candidate moves."""
        return FeatureVector((), np.zeros(0), np.zeros(0))

    @property
    def plausible_table(self) -> FeatureTable:
        """Records of that."""
        return {}

    def plausible_of(self, units: Sequence[ReplayUnit]) -> list[FeatureVector]:
        """Return the same of units that run the test."""
        return [FeatureVector((), np.zeros(0), np.zeros(0)) for _ in units]

    def lookalike_moves(self, key: str, severity: float) -> dict[str, float]:  # noqa: ARG002
        """Return how far what looks like a candidate, ``KIND@PLACE``, moves plausible features."""
        return {}

    def periodic(self) -> tuple[list[FeatureVector], list[FeatureVector]]:
        """Return how far errors of a sensor that are new at each power-up move what the log shows.

        Of each a vector that stands for one deviation: of features, and of what is plausible.
        """
        return [], []

    @abstractmethod
    def digest(self) -> bytes:
        """Of all that its model runs depend on."""

    def key(self) -> bytes:
        """Of what was recorded: an order of logs that no caller chose."""
        out = hashlib.sha256(np.ascontiguousarray(self.log.time).tobytes())
        for role in sorted(self.log):
            out.update(role.encode() + np.ascontiguousarray(self.log[role]).tobytes())
        return out.digest()

    @abstractmethod
    def outcomes(self, units: Sequence[ReplayUnit]) -> Iterator[FeatureVector]:
        """Run units through the test; what each would have shown in the log's place."""

    @abstractmethod
    def days(self) -> Days:
        """Return healthy units of other days."""

    @abstractmethod
    def drawn(self, units: Sequence[ReplayUnit]) -> list[SignalPanel]:
        """Return the log's signals that a page draws, each beside those of units."""

    @abstractmethod
    def same(self, other: Reading) -> bool:
        """Whether another log, a baseline, is of the same test."""

    @abstractmethod
    def serves(self, other: Reading) -> bool:
        """Whether the faults' runs of a baseline of the same test serve for this log."""

    def repeats(self, other: Reading) -> bool:  # noqa: ARG002
        """Whether a baseline's features are those of this log's command as they stand."""
        return False

    def matched(self, same: Sequence[Reading]) -> tuple[Reading, list[Reading]]:
        """Return the log and its baselines as far as they are comparable."""
        return self, list(same)

    def usable(self, names: Sequence[str], same: Sequence[Reading]) -> list[str]:  # noqa: ARG002
        """Return the features that count with these baselines."""
        return list(names)

    def pools(self, other: Reading) -> bool:  # noqa: ARG002
        """Whether a baseline of another test says something of what is pooled."""
        return False

    def doubts(self) -> list[ReplayUnit]:
        """Return units whose difference from the healthy run is uncertain by its own size."""
        return []

    def notes(self, same: Sequence[Reading]) -> list[str]:  # noqa: ARG002
        """Return findings: what the log lacks and what it costs."""
        return []
