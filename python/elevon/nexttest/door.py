"""The door `elevon.next_test`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.candidates import candidates_of
from elevon.nexttest.belief import read_result
from elevon.nexttest.choose import next_test as choose
from elevon.option import Option
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
    from elevon.nexttest.choose import NextTest
    from elevon.progress import Progress


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
    model = as_actuator(actuator)
    candidates = candidates_of(model)
    data = [
        read_result(
            item.to_dict()
            if isinstance(item, Diagnosis)
            else item
            if isinstance(item, Mapping)
            else Path(item),
            candidates,
        )
        for item in results
    ]
    return choose(model, data, progress=progress)
