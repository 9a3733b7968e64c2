"""The door `elevon.next_test`: the bench's tests, ranked."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.candidates import CandidateFault, candidates_of
from elevon.errors import DivergedError, InputError, Interrupted
from elevon.nexttest.belief import Belief, read_result
from elevon.nexttest.information import expected_information, planned, profiles
from elevon.option import Option
from elevon.plain import Plain, in_unit, key
from elevon.report import ReportTable
from elevon.results import Result
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
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
    actuator: ActuatorLike,
    results: Annotated[
        Sequence[Diagnosis | Mapping[str, object] | str | os.PathLike[str]],
        Option("--so-far", metavar="RESULT"),
    ] = (),
    *,
    progress: Progress | None = None,
) -> NextTest:
    """Rank the bench's tests by the information they are expected to give.

    Parameters
    ----------
    actuator : Actuator, str or path
        The healthy unit, calibrated.
    results : sequence of Diagnosis, mapping or path
        Diagnoses so far, of different logs, also as JSON of elevon diagnose.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    FormatError
        A result that is none, or that lists no hypotheses.
    InputError
        No test that the actuator can run; results that contradict each other.
    """
    begin = clock.perf_counter()
    model = as_actuator(actuator)
    known = candidates_of(model)
    belief = Belief.after([_read(item, known) for item in results], known).leading()
    keys = {key for p in belief.possible for key in p.keys}
    candidates = [c for c in belief.candidates if c.key in keys] or list(belief.candidates)
    every = profiles(model)
    out, findings = [], []
    for number, profile in enumerate(every):
        if progress is not None and progress(number / len(every)) is False:
            raise Interrupted("interrupted between two tests")
        try:
            case = planned(profile, model, candidates)
        except (InputError, DivergedError) as error:
            findings.append(f"{profile.name} is left out: {error}")
            continue
        bits = expected_information(case, belief)
        name, parameters = profile.procedure.name, dict(profile.parameters)
        out.append(
            RankedTest(profile.name, name, parameters, profile.standard, bits, profile.duration)
        )
    if not out:
        raise InputError("; ".join(findings) or f"{model.name}: its stand has no test")
    out.sort(key=lambda item: -item.information)
    ranked = sorted(belief.possible, key=lambda p: -p.weight)
    possible = tuple(PossibleSet(p.keys, p.weight) for p in ranked)
    return NextTest(
        tuple(out), belief.entropy, possible, tuple(findings), clock.perf_counter() - begin
    )


def _read(
    item: Diagnosis | Mapping[str, object] | str | os.PathLike[str],
    candidates: Sequence[CandidateFault],
) -> Mapping[str, object]:
    """Return a diagnosis as its JSON."""
    if isinstance(item, Diagnosis):
        return read_result(item.to_dict(), candidates)
    return read_result(item if isinstance(item, Mapping) else Path(item), candidates)
