"""What the rows showed: outcomes by fidelity, and who could see each failure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from elevon.plain import Plain
from elevon.safety.hazards import Message
from elevon.safety.rates import Service
from elevon.safety.rows import Row


@dataclass(frozen=True)
class Outcome(Plain):
    """What one run showed.

    Attributes
    ----------
    hazards : dict
        Name to when it begins, in s.
    messages : tuple of Message
        What is displayed, in order.
    end : str
        State at the end.
    distance : float
        From the nearest limit that could change it, over the limit.
    nearest : str
        Of what: current, voltage, time, force, position.
    """

    hazards: dict[str, float]
    messages: tuple[Message, ...]
    end: str
    distance: float
    nearest: str

    def differs(self, other: Outcome) -> bool:
        """Whether hazards, state at the end or messages (but warnings) are others."""
        return self._signature() != other._signature()

    def _signature(self) -> tuple[object, ...]:
        texts = {item.text for item in self.messages if not item.text.startswith("warning")}
        return sorted(self.hazards), self.end, sorted(texts)


@dataclass
class Outcomes:
    """The rows of a campaign and what they showed at each fidelity.

    Attributes
    ----------
    rows : list of Row
        All of them.
    low, high : dict
        Place of a row to its outcome.
    near : set of int
        Rows near a limit.
    drawn : tuple of int
        Rows drawn at random among those that are far from every limit.
    """

    rows: list[Row]
    low: dict[int, Outcome] = field(default_factory=dict)
    high: dict[int, Outcome] = field(default_factory=dict)
    near: set[int] = field(default_factory=set)
    drawn: tuple[int, ...] = ()

    def append(self, rows: Sequence[Row]) -> range:
        """Add rows; return their places."""
        begin = len(self.rows)
        self.rows += rows
        return range(begin, len(self.rows))

    def add(self, fidelity: str, places: Iterable[int], results: Iterable[Outcome]) -> None:
        """Add what rows showed."""
        (self.low if fidelity == "low" else self.high).update(zip(places, results, strict=True))

    def both(self, place: int) -> Iterator[tuple[str, Outcome]]:
        """Yield what a row showed, by fidelity; high last."""
        for fidelity, known in (("low", self.low), ("high", self.high)):
            if place in known:
                yield fidelity, known[place]

    def changed(self) -> list[int]:
        """Return the rows whose outcome the two fidelities do not share."""
        twice = self.low.keys() & self.high.keys()
        return sorted(p for p in twice if self.low[p].differs(self.high[p]))


@dataclass(frozen=True)
class Detection(Plain):
    """Who sees a failure in one phase.

    Attributes
    ----------
    phase : str
        Its phase.
    situations, announced : int
        Situations in which the failure alone is there, and how many of them announce it.
    latency : float or None
        Median time from its coming to its message, in s.
    message : str
        The most frequent first message; empty: none.
    messages : dict
        First message to the number of situations.
    audience : str
        To whom it is displayed.
    scenario : int
        A row of it: one that shows a hazard where there is one.
    hazards : tuple of str
        What the failure alone leads to.
    """

    phase: str
    situations: int
    announced: int
    latency: float | None
    message: str
    messages: dict[str, int]
    audience: str
    scenario: int
    hazards: tuple[str, ...]


def detections(outcomes: Outcomes) -> dict[str, list[Detection]]:
    """Return for each failure, phase by phase, what announces it while it is there alone.

    A message counts where the same situation without a failure has none of its text. What is
    displayed from a failure that comes and goes is left out: a lasting one decides.
    """
    twins = {
        (row, fidelity): outcome
        for place, row in enumerate(outcomes.rows)
        if not row.faults
        for fidelity, outcome in outcomes.both(place)
    }
    grouped: dict[str, dict[str, list[tuple[int, Message | None, Outcome]]]] = {}
    for place, row in enumerate(outcomes.rows):
        if len(row.faults) != 1 or not row.lasting:
            continue
        for fidelity, outcome in outcomes.both(place):
            healthy = twins.get((row.healthy(), fidelity), twins.get((row.healthy(), "low")))
            message = _announcement(row, outcome, healthy)
            phases = grouped.setdefault(row.faults[0].name, {})
            phases.setdefault(row.phase, []).append((place, message, outcome))
    return {
        name: [_detection(phase, rows) for phase, rows in phases.items()]
        for name, phases in grouped.items()
    }


def _announcement(row: Row, outcome: Outcome, healthy: Outcome | None) -> Message | None:
    """Return the first message that the healthy unit does not show, timed from the failure on."""
    usual = {item.text for item in healthy.messages} if healthy is not None else set()
    for item in outcome.messages:
        if item.text not in usual:
            return Message(max(item.time - row.faults[0].onset, 0.0), item.text, item.audience)
    return None


def _detection(
    phase: str, rows: Sequence[tuple[int, Message | None, Outcome]]
) -> Detection:  # fmt: skip
    messages = [message for _, message, _ in rows if message is not None]
    texts = Counter(message.text for message in messages)
    first = texts.most_common(1)[0][0] if texts else ""
    unsafe = [place for place, _, outcome in rows if outcome.hazards]
    hazards = dict.fromkeys(name for _, _, outcome in rows for name in outcome.hazards)
    return Detection(
        phase,
        len({place for place, _, _ in rows}),
        len({place for place, message, _ in rows if message is not None}),
        float(np.median([message.time for message in messages])) if messages else None,
        first,
        dict(texts),
        next((message.audience for message in messages if message.text == first), ""),
        min(unsafe or [place for place, _, _ in rows]),
        tuple(hazards),
    )


def is_evident(detected: Iterable[Detection], service: Service, stated: bool | None) -> bool:
    """Whether a failure is seen within the flight: announced in a phase that every flight has.

    Dormant means unannounced in every situation of every such phase.

    Parameters
    ----------
    detected : iterable of Detection
        Of the failure.
    service : Service
        With the phases.
    stated : bool or None
        What a file of rates says in place of the campaign.
    """
    if stated is not None:
        return stated
    return any(
        item.announced > 0 and service.phase_of(item.phase).demand >= 1.0 for item in detected
    )


def coverage(
    detected: Mapping[str, Sequence[Detection]], rates: Mapping[str, float], service: Service
) -> list[tuple[str, int, float]]:
    """Return the coverage of each monitor: message, failures, share of all rates that it announces.

    A failure counts by the share of its situations, in phases of every flight, whose first message
    is the monitor's.
    """
    total = sum(rates.values()) or 1.0
    seen: dict[str, list[float]] = {}
    for name, items in detected.items():
        usual = [item for item in items if service.phase_of(item.phase).demand >= 1.0]
        situations = sum(item.situations for item in usual)
        counts = sum((Counter(item.messages) for item in usual), Counter[str]())
        for text, count in counts.items():
            seen.setdefault(text, []).append(rates.get(name, 0.0) * count / situations / total)
    rows = [(text, len(shares), min(sum(shares), 1.0)) for text, shares in seen.items()]
    return sorted(rows, key=lambda row: -row[2])
