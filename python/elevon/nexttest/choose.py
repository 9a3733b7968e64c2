"""The next test: all of them ranked."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar

from elevon.diagnose.engine.candidates import candidates_of
from elevon.errors import DivergedError, InputError, Interrupted
from elevon.nexttest.belief import Belief
from elevon.nexttest.information import expected_information, planned, profiles
from elevon.plain import Plain, in_unit, key
from elevon.report import ReportTable
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
    duration : float
        Of its log [s]: what it costs.
    """

    name: str
    procedure: str
    parameters: Mapping[str, str]
    standard: bool
    information: Annotated[float, key("expected_information_bit"), in_unit("bit")]
    duration: Annotated[float, in_unit("s")] = 0.0

    @property
    def rate(self) -> float:
        """Expected information over its time [bit/min]."""
        return 60.0 * self.information / self.duration if self.duration else 0.0


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
    findings : tuple of str
        Tests that this actuator cannot run.
    seconds : float
        Time it took.
    """

    tests: tuple[RankedTest, ...]
    unknown: Annotated[float, key("unknown_bit"), in_unit("bit")]
    possible: tuple[PossibleSet, ...]
    findings: tuple[str, ...] = ()
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

    def text_tables(self) -> list[ReportTable]:
        """Return the tests, the best first, and what is still possible."""
        tests = [
            (t.name, f"{t.information:.3f}", f"{t.duration:g}", f"{t.rate:.2g}",
             "yes" if t.standard else "no")
            for t in self.tests
        ]  # fmt: skip
        columns = ("test", "expected [bit]", "takes [s]", "[bit/min]", "healthy log at hand")
        possible = [
            (" and ".join(p.faults) or "healthy", f"{p.probability:.3f}")
            for p in self.possible[:10]
        ]
        return [
            ReportTable(columns, tests), ReportTable(("still possible", "probability"), possible)
        ]  # fmt: skip

    @property
    def remarks(self) -> Sequence[str]:
        """What the caller should know."""
        return self.findings


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
        The healthy unit, calibrated.
    results : sequence of mapping
        Diagnoses so far, as `elevon diagnose --json` prints them, of different logs.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    InputError
        Results that contradict each other; no test that the actuator can run.
    """
    begin = clock.perf_counter()
    belief = Belief.after(results, candidates_of(actuator)).leading()
    keys = {key for p in belief.possible for key in p.keys}
    candidates = [c for c in belief.candidates if c.key in keys] or list(belief.candidates)
    every = profiles(actuator)
    out, findings = [], []
    for number, profile in enumerate(every):
        if progress is not None and progress(number / len(every)) is False:
            raise Interrupted("interrupted between two tests")
        try:
            case = planned(profile, actuator, candidates)
        except (InputError, DivergedError) as error:
            findings.append(f"{profile.name} is left out: {error}")
            continue
        bits = expected_information(case, belief)
        name, parameters = profile.procedure.name, dict(profile.parameters)
        out.append(
            RankedTest(profile.name, name, parameters, profile.standard, bits, profile.duration)
        )
    if not out:
        raise InputError("; ".join(findings) or f"{actuator.name}: its stand has no test")
    out.sort(key=lambda item: -item.information)
    ranked = sorted(belief.possible, key=lambda p: -p.weight)
    possible = tuple(PossibleSet(p.keys, p.weight) for p in ranked)
    return NextTest(
        tuple(out), belief.entropy, possible, tuple(findings), clock.perf_counter() - begin
    )
