"""The next test: all of them ranked."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from elevon.diagnose.bymodel.candidates import CANDIDATES
from elevon.diagnose.nexttest.belief import Belief
from elevon.diagnose.nexttest.information import expected_information, planned
from elevon.diagnose.nexttest.profiles import BenchProfile, profiles
from elevon.errors import InputError, Interrupted

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress

__all__ = ["NextTest", "RankedTest", "next_test"]


@dataclass(frozen=True)
class RankedTest:
    """A test and the information [bit] it is expected to give."""

    profile: BenchProfile
    information: float

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "name": self.profile.name,
            "procedure": self.profile.procedure.name,
            "parameters": dict(self.profile.parameters),
            "standard": self.profile.standard,
            "expected_information_bit": self.information,
        }


@dataclass(frozen=True)
class NextTest:
    """The answer.

    Attributes
    ----------
    tests : tuple of RankedTest
        Most informative first.
    belief : Belief
        What is possible now.
    seconds : float
        Time it took.
    """

    tests: tuple[RankedTest, ...]
    belief: Belief
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "next": self.tests[0].to_dict(),
            "tests": [item.to_dict() for item in self.tests],
            "unknown_bit": self.belief.entropy,
            "possible": [
                {"faults": list(p.keys), "probability": p.weight}
                for p in sorted(self.belief.possible, key=lambda p: -p.weight)
            ],
            "seconds": self.seconds,
        }


def next_test(
    actuator: Actuator,
    results: Sequence[Mapping[str, Any]] = (),
    *,
    progress: Progress | None = None,
) -> NextTest:
    """Rank the bench's tests by the information they are expected to give.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit, calibrated; rotary.
    results : sequence of mapping
        Diagnoses so far, as `elevon diagnose --json` prints them, of different logs.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    InputError
        Another wiring; results that contradict each other.
    """
    begin = clock.perf_counter()
    if actuator.wiring != "rotary":
        raise InputError(
            f"{actuator.name}: next-test serves the wiring 'rotary' so far, not {actuator.wiring!r}"
        )
    belief = Belief.after(results).leading()
    keys = {key for p in belief.possible for key in p.keys}
    candidates = [c for c in CANDIDATES if c.key in keys] or list(CANDIDATES)
    every = profiles()
    out = []
    for number, profile in enumerate(every):
        if progress is not None and progress(number / len(every)) is False:
            raise Interrupted("interrupted between two tests")
        case = planned(profile, actuator, candidates)
        out.append(RankedTest(profile, expected_information(case, belief)))
    out.sort(key=lambda item: -item.information)
    return NextTest(tuple(out), belief, clock.perf_counter() - begin)
