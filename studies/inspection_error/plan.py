"""Which inspections are made: healthy days, then each fault at each severity on several days."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from studies.diagnosis_limits.logs import TESTS, Trial

__all__ = ["BASELINES", "DAYS", "FAULTS", "DayVisit", "Growing", "healthy_trials", "visits"]

BASELINES = 3  # healthy days, each with one log of every test
DAYS = 3  # on which a severity is inspected
_JITTER = 0.1  # of a severity's logarithm, from unit to unit


@dataclass(frozen=True)
class Growing:
    """A fault that a life ends by.

    Attributes
    ----------
    law : str
        Of `elevon.prognose.LAWS`.
    key : str
        ``KIND@PLACE``.
    levels : tuple of float
        Severities [the catalogue's unit], over the range of the run-to-failure histories.
    faint, beyond : float or None
        One day each: below what is seen, and beyond what diagnosis looks at.
    """

    law: str
    key: str
    levels: tuple[float, ...]
    faint: float | None = None
    beyond: float | None = None


FAULTS: tuple[Growing, ...] = (
    Growing("gear_wear", "backlash@transmission", (3e-4, 2e-3, 0.01, 0.025), faint=1.5e-4),
    Growing("lubricant_loss", "friction@transmission", (0.2, 0.6, 1.1, 1.5), 0.1, 2.3),
    Growing("insulation", "short@motor.phase_a", (0.05, 0.1, 0.2, 0.4), faint=0.025),
)


@dataclass(frozen=True)
class DayVisit:
    """One log of every test of a unit, all of one day.

    Attributes
    ----------
    name : str
        Key in what is finished.
    law : str
        Whose fault it has.
    level : int
        Place among the fault's levels; -1 faint, as many as levels: beyond.
    severity : float
        As it is.
    day : int
        Of that severity.
    trials : tuple of Trial
        One a test.
    """

    name: str
    law: str
    level: int
    severity: float
    day: int
    trials: tuple[Trial, ...]


def healthy_trials(seed: int, unit: int, days: int = BASELINES) -> list[Trial]:
    """Return healthy days of a unit, each with one log of every test."""
    key = _key(seed, unit)
    return [trial for day in range(days) for trial in _of_a_day(f"base-{day}", (), key + 10 * day)]


def visits(seed: int, unit: int) -> list[DayVisit]:
    """Return a unit's inspections; each day has a seed of its own."""
    rng = np.random.default_rng([seed, 104, unit])
    out = []
    for number, (fault, level, severity, days) in enumerate(_wanted()):
        jittered = severity * float(np.exp(_JITTER * rng.uniform(-1.0, 1.0)))
        for day in range(days):
            name = f"u{unit}-{number:02d}-{fault.law}-{day}"
            key = _key(seed, unit) + 1000 + 100 * number + 10 * day
            trials = _of_a_day(name, (f"{fault.key}={jittered!r}",), key)
            out.append(DayVisit(name, fault.law, level, jittered, day, trials))
    return out


def _wanted() -> Iterator[tuple[Growing, int, float, int]]:
    for fault in FAULTS:
        if fault.faint is not None:
            yield fault, -1, fault.faint, 1
        for level, severity in enumerate(fault.levels):
            yield fault, level, severity, DAYS
        if fault.beyond is not None:
            yield fault, len(fault.levels), fault.beyond, 1


def _of_a_day(name: str, faults: tuple[str, ...], key: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(f"{name}-{test}", test, faults, key + k, day=key) for k, test in enumerate(TESTS)
    )


def _key(seed: int, unit: int) -> int:
    return (seed * 1000 + unit) * 10_000
