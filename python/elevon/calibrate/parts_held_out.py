"""How well values determined without a log predict it: the source of thresholds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from elevon.actuator import Actuator
from elevon.calibrate.validation import Validation
from elevon.errors import InputError
from elevon.progress import Progress, part


def held_out_logs(
    names: Sequence[str],
    fitted: Actuator,
    without: Callable[[str], Actuator],
    validate: Callable[[str, Actuator, Progress | None], Validation],
    progress: Progress | None = None,
) -> tuple[Validation, bool]:
    """Calibrate without each log in turn and hold it against the outcome.

    Parameters
    ----------
    names : sequence of str
        Logs of motions.
    fitted : Actuator
        With the values of all logs.
    without : callable
        Name to the actuator calibrated from all other logs.
    validate : callable
        Name, actuator and progress to the log's errors.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    Validation, bool
        One row a log and signal, and whether the logs were held out: a single motion, or one
        without which too little is determined, is held against the values of all.
    """
    results, rows, apart = [], [], len(names) > 1
    for k, name in enumerate(names):
        model = fitted
        if apart:
            try:
                model = without(name)
            except InputError:
                apart = False
        share = part(progress, k / len(names), (k + 1) / len(names))
        results.append(validate(name, model, share))
        rows += list(results[-1].errors)
    how = {log: text for item in results for log, text in item.commands.items()}
    return replace(results[0], errors=tuple(rows), traces=(), commands=how), apart
