"""Which logs the campaign makes: healthy, single faults at, above and below limits, pairs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

from studies.diagnosis_limits.judge import Injected
from studies.diagnosis_limits.logs import TESTS, Trial

__all__ = ["FAULTS", "CampaignFault", "Planned", "planned", "trials_of"]

HEALTHY = 9  # logs of each test and unit
ABOVE = (1.0, 2.0)  # times the limit: where faults must be isolated
BELOW = (0.25, 0.5)  # for the detection curve


@dataclass(frozen=True)
class CampaignFault:
    """A fault of the campaign.

    Attributes
    ----------
    kind : str
        Of the catalogue.
    places : tuple of str
        Drawn in turn.
    limit, loaded : float
        Severity from which it must be isolated: without load, and in the loaded test.
    range : float
        The largest severity tested.
    both : bool
        Whether it goes either way.
    """

    kind: str
    places: tuple[str, ...]
    limit: float
    loaded: float
    range: float
    both: bool = False

    def at(self, test: str) -> float:
        """Return the limit in a test."""
        return self.loaded if test == "loaded" else self.limit


_PHASES = tuple(f"motor.phase_{p}" for p in "abc")
FAULTS: tuple[CampaignFault, ...] = (
    CampaignFault(
        "backlash", ("transmission",), math.radians(0.13), math.radians(0.13), math.radians(0.26)
    ),
    CampaignFault("friction", ("transmission",), 0.25, 0.25, 1.0),
    CampaignFault("short", _PHASES, 0.20, 0.10, 0.40),
    CampaignFault("eccentricity_static", ("motor",), 0.10, 0.05, 0.20),
    CampaignFault("gain_drift", ("control.position",), 0.02, 0.02, 0.04, both=True),
)


@dataclass(frozen=True)
class Planned:
    """A trial and what it is for.

    Attributes
    ----------
    trial : Trial
        The log.
    group : str
        ``healthy``, ``single``, ``below``, ``pair``.
    truth : tuple of Injected
        The faults.
    """

    trial: Trial
    group: str
    truth: tuple[Injected, ...]


def trials_of(test: str, seed: int, name: str, truth: tuple[Injected, ...] = ()) -> Trial:
    """Return a trial with its faults in the grammar."""
    return Trial(name, test, tuple(item.text for item in truth), seed)


def planned(seed: int, unit: int) -> list[Planned]:
    """Return a unit's logs; each has a seed of its own, so that any of them can be made alone."""
    out: list[Planned] = []
    for number, (group, test, truth) in enumerate(_wanted(unit)):
        key = (seed * 1000 + unit) * 1000 + 10 + number
        trial = trials_of(test, key, f"u{unit}-{number:03d}-{group}-{test}", truth)
        out.append(Planned(trial, group, truth))
    return out


def _wanted(unit: int) -> Iterator[tuple[str, str, tuple[Injected, ...]]]:
    for test in TESTS:
        for _ in range(HEALTHY):
            yield "healthy", test, ()
    for k, fault in enumerate(FAULTS):
        for j, test in enumerate(TESTS):
            for times in ABOVE:
                # The largest one goes as far as the range, once in each test of each unit.
                far = fault.range / fault.at(test) if times > 1.0 else times
                for sign in (1.0, -1.0) if fault.both else (1.0,):
                    yield "single", test, (_one(fault, test, sign * far, unit + j),)
            if not fault.both:
                yield "single", test, (_one(fault, test, 1.0, unit + j + 1),)
        for i, times in enumerate(BELOW):
            test = list(TESTS)[(unit + k + i) % len(TESTS)]
            sign = -1.0 if fault.both and (unit + i) % 2 else 1.0
            yield "below", test, (_one(fault, test, sign * times, unit),)
    for k, (a, b) in enumerate(combinations(FAULTS, 2)):
        test = list(TESTS)[(unit + k) % len(TESTS)]
        yield "pair", test, (_one(a, test, 1.0, unit), _one(b, test, 1.0, unit))


def _one(fault: CampaignFault, test: str, times: float, turn: int) -> Injected:
    place = fault.places[turn % len(fault.places)]
    return Injected(fault.kind, place, times * fault.at(test))
