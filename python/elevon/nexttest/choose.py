"""The next test: all of them ranked."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar

from elevon.diagnose.engine.candidates import CANDIDATES
from elevon.errors import InputError, Interrupted
from elevon.nexttest.belief import Belief
from elevon.nexttest.information import expected_information, planned
from elevon.nexttest.profiles import profiles
from elevon.plain import Plain, in_unit, key
from elevon.results import Result

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress


@dataclass(frozen=True)
class RankedTest(Plain):
    """A test of the bench and what it is expected to tell.

    Attributes
    ----------
    name, procedure : str
        The test and the procedure that runs it.
    parameters : mapping of str to str
        Of the procedure.
    standard : bool
        Whether a healthy unit's log of it is at hand as a rule.
    information : float
        Expected [bit].
    """

    name: str
    procedure: str
    parameters: Mapping[str, str]
    standard: bool
    information: Annotated[float, key("expected_information_bit"), in_unit("bit")]


@dataclass(frozen=True)
class PossibleSet(Plain):
    """A set of faults, ``KIND@PLACE`` each, none for healthy, and its probability."""

    faults: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class NextTest(Result):
    """The answer.

    Attributes
    ----------
    tests : tuple of RankedTest
        Most informative first.
    unknown : float
        What is not known now [bit].
    possible : tuple of PossibleSet
        Sets of faults that may be there, most probable first.
    seconds : float
        Time it took.
    """

    tests: tuple[RankedTest, ...]
    unknown: Annotated[float, key("unknown_bit"), in_unit("bit")]
    possible: tuple[PossibleSet, ...]
    seconds: Annotated[float, in_unit("s")] = field(default=0.0, compare=False)

    KIND: ClassVar = "next-test"
    COMPUTED: ClassVar = ("next",)
    TABLE: ClassVar = "tests"
    BARS: ClassVar = ("name", "expected_information_bit")

    @property
    def next(self) -> RankedTest:
        """The test to run."""
        return self.tests[0]

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        values = ", ".join(f"{name} {value}" for name, value in self.next.parameters.items())
        return (
            f"Run {self.next.name} ({values}): {self.next.information:.2g} of the "
            f"{self.unknown:.2g} bit still unknown are expected from it."
        )


def next_test(
    actuator: Actuator,
    results: Sequence[Mapping[str, object]] = (),
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
        bits = expected_information(case, belief)
        name, parameters = profile.procedure.name, dict(profile.parameters)
        out.append(RankedTest(profile.name, name, parameters, profile.standard, bits))
    out.sort(key=lambda item: -item.information)
    ranked = sorted(belief.possible, key=lambda p: -p.weight)
    possible = tuple(PossibleSet(p.keys, p.weight) for p in ranked)
    return NextTest(tuple(out), belief.entropy, possible, clock.perf_counter() - begin)
