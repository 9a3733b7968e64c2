"""When to look again, and with which test, for a risk of failing before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from elevon.errors import RangeError
from elevon.number_text import count_text
from elevon.prognose.assumptions import Assumed
from elevon.results import Result

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis


@dataclass(frozen=True)
class NextInspection(Result):
    """When to look next.

    Attributes
    ----------
    unit : str
        Of use.
    usage : float
        Use at the last inspection.
    risk : float
        Probability of failing before the next one that is accepted.
    within : float or None
        Use from now on in which the risk is not exceeded; None: no end of life reaches it.
    requirement : str or None
        That most likely fails first.
    status : str
        Of the prediction.
    test : str or None
        Standard test that is expected to tell most; None where none is known to.
    assumptions : tuple of Assumed
        What each assumption costs.
    findings : tuple of str
        Of the prediction, and of the choice.
    serial : str or None
        Of the unit.
    """

    unit: str
    usage: float
    risk: float
    within: float | None
    requirement: str | None
    status: str
    test: str | None
    assumptions: tuple[Assumed, ...]
    findings: tuple[str, ...]
    serial: str | None = None

    KIND: ClassVar = "next-inspection"
    TABLE: ClassVar = "assumptions"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        how = f" with the test {self.test}" if self.test else ""
        if self.within is None:
            return f"No end of life is in sight at a risk of {self.risk:.2g}; look at leisure{how}."
        if self.within <= 0.0:
            return f"Inspect now{how}: the risk that the unit has failed exceeds {self.risk:.2g}."
        within = count_text(self.within)
        return (
            f"Inspect within {within} {self.unit}{how}: until then the unit fails with a "
            f"probability of at most {self.risk:.2g}."
        )


def next_inspection(
    result: Prognosis,
    risk: float,
    *,
    test: str | None,
    assumed: Sequence[Assumed] = (),
    findings: Sequence[str] = (),
) -> NextInspection:
    """Return when the probability of having failed reaches a risk.

    Parameters
    ----------
    result : Prognosis
        Of the unit.
    risk : float
        Accepted; at least what the number of futures can show.
    test : str or None
        What to look with.
    assumed, findings
        As in `NextInspection`.

    Raises
    ------
    RangeError
        The risk is not between that of a few futures and 1.
    """
    least = _FEW / result.samples
    if not least <= risk < 1.0:
        raise RangeError(
            f"--risk {risk:g}: is not from {least:g} ({_FEW} of {result.samples} futures; "
            "--particles gives more) to 1"
        )
    ranked = np.sort(result.future.remaining)
    end = float(ranked[int(risk * len(ranked))])
    return NextInspection(
        result.unit,
        result.usage,
        risk,
        end if np.isfinite(end) else None,
        result.first_requirement,
        result.status,
        test,
        tuple(assumed),
        (*findings, *result.findings),
        result.serial,
    )


_FEW = 5
"""Futures that a probability needs to be seen."""
