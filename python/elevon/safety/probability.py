"""How often the failures of a set come together: closed forms of rare events.

Every failure comes at a constant rate; times of life are far shorter than one over the rate, so the
first term of each exponential is kept. An evident failure is repaired before the next flight, a
dormant one lasts until the check that reveals it. docs/explanation/safety.md derives the forms.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

__all__ = ["Exposure", "Frequency", "Occurrence", "frequency"]


@dataclass(frozen=True)
class Occurrence:
    """One failure as it enters a set.

    Attributes
    ----------
    name : str
        Its name.
    rate : float
        Failures an hour of flight.
    evident : bool
        Whether it is repaired before the next flight.
    interval : float
        Hours between the checks that reveal a dormant failure.
    check : str
        Name of that check: failures of one check are revealed together, those of different checks
        at independent times.
    family : str
        Like components of one family can fail by a common cause; empty: of none.
    beta : float
        Share of the rate that is a common cause's, which fails all of the family.
    """

    name: str
    rate: float
    evident: bool
    interval: float
    check: str = ""
    family: str = ""
    beta: float = 0.0


@dataclass(frozen=True)
class Exposure:
    """When a set of failures leads to a hazard.

    Attributes
    ----------
    flight : float
        Duration of a flight, in h.
    share : float
        Share of the flight within which the last failure must come, 0 to 1.
    demand : float
        Probability a flight that the situation arises in which the failures are a hazard; 1: it
        arises in every flight.
    last : collection of str, optional
        Failures of which one has to come last; None: any of them.
    """

    flight: float
    share: float = 1.0
    demand: float = 1.0
    last: Collection[str] | None = None


@dataclass(frozen=True)
class Frequency:
    """Events an hour of flight: mean over all flights, and in the worst flight.

    Attributes
    ----------
    mean, worst : float
        In 1/h; `worst` is that of the last flight before the checks.
    common : float
        Part of the mean that common causes have.
    """

    mean: float
    worst: float
    common: float = 0.0


def frequency(failures: Sequence[Occurrence], exposure: Exposure) -> Frequency:
    """Return how often a set of failures leads to a hazard.

    Parameters
    ----------
    failures : sequence of Occurrence
        At least one; none of them alone or with fewer of the others leads to it.
    exposure : Exposure
        Flight, order, situation.

    Returns
    -------
    Frequency
        With the common causes of like components.
    """
    count = Counter(item.family for item in failures if item.family)
    single = [
        replace(item, rate=item.rate * (1.0 - item.beta)) if count[item.family] > 1 else item
        for item in failures
    ]
    mean, worst = _independent(single, exposure)
    common = 0.0
    for merged in _common_causes(failures):
        shared, most = _independent(merged, replace(exposure, last=None))
        common, worst = common + shared, worst + most
    return Frequency(mean + common, worst, common)


def _independent(failures: Sequence[Occurrence], exposure: Exposure) -> tuple[float, float]:
    """Mean and worst frequency of failures that come independently."""
    flight, last = exposure.flight, exposure.last
    mean = worst = 0.0
    for number, item in enumerate(failures):
        if last is None or item.name in last:
            others = [other for place, other in enumerate(failures) if place != number]
            mean += item.rate * unavailability(others, flight)
            worst += item.rate * _at_the_end(others, flight)
    present = math.prod(item.rate * _span(item, flight) for item in failures)
    if len({item.evident for item in failures}) == 2:
        # All of them are there by the end of the flight: more than once it cannot begin there.
        worst = min(worst, present / flight)
    mean, worst = exposure.share * mean, exposure.share * worst
    if exposure.demand < 1.0:
        rate = exposure.demand / flight
        evident = math.prod(item.rate * flight for item in failures if item.evident)
        dormant = unavailability([item for item in failures if not item.evident], flight)
        mean, worst = min(mean, rate * evident * dormant), min(worst, rate * present)
    return mean, worst


def unavailability(failures: Iterable[Occurrence], flight: float) -> float:
    """Return the mean probability that all of some failures are there at one time.

    Parameters
    ----------
    failures : iterable of Occurrence
        Those of one check lie together within its interval, T^k / (k + 1); those of different
        checks are independent. Evident ones lie within the flight.
    flight : float
        Duration of a flight, in h.
    """
    groups: dict[tuple[str, float], list[Occurrence]] = {}
    for number, item in enumerate(failures):
        key = ("", 0.0) if item.evident else (item.check or f"{number}", item.interval)
        groups.setdefault(key, []).append(item)
    return math.prod(
        math.prod(item.rate for item in group)
        * _span(group[0], flight) ** len(group)
        / (len(group) + 1)
        for group in groups.values()
    )


def _at_the_end(failures: Iterable[Occurrence], flight: float) -> float:
    """Probability that all are there in the worst flight: dormant ones since their last check."""
    items = list(failures)
    dormant = math.prod(item.rate * item.interval for item in items if not item.evident)
    return dormant * unavailability([item for item in items if item.evident], flight)


def _span(item: Occurrence, flight: float) -> float:
    return flight if item.evident else item.interval


def _common_causes(failures: Sequence[Occurrence]) -> list[list[Occurrence]]:
    """Return the set with the like components of each family as one event, family by family."""
    families: dict[str, list[Occurrence]] = {}
    for item in failures:
        if item.family and item.beta > 0.0:
            families.setdefault(item.family, []).append(item)
    merged = []
    for family, members in families.items():
        if len(members) < 2:
            continue
        rates = [item.beta * item.rate for item in members]
        cause = replace(
            members[0],
            name=f"common cause of {family}",
            rate=math.prod(rates) ** (1.0 / len(rates)),
            evident=any(item.evident for item in members),
            interval=max(item.interval for item in members),
            beta=0.0,
        )
        merged.append([cause, *(item for item in failures if item not in members)])
    return merged
