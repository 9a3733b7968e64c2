"""What an actuator file promises of its agreement with a log: from healthy held-out data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from elevon.actuator import Actuator
from elevon.calibrate.validation import Validation, validate
from elevon.estimate.held_out import held_out
from elevon.logs.log import Log
from elevon.progress import Progress


def held_out_agreement(
    logs: Sequence[Log],
    before: Actuator,
    free: Sequence[str] | None,
    like: Validation,
    progress: Progress | None = None,
) -> Validation | None:
    """Calibrate without each log in turn and hold the outcome against that log.

    Parameters
    ----------
    logs : sequence of Log
        Healthy, as calibrated.
    before : Actuator
        Values before.
    free : sequence of str or None
        As calibrated.
    like : Validation
        Of the logs under values fitted to all: its transient and its offsets.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    Validation or None
        One row a log and signal; a log without which the others determine too little is left out.
        None where nothing could be held out (a single log).
    """
    from elevon.calibrate.calibration import calibrate

    if len(logs) < 2:
        return None

    def fit(others: Sequence[Log]) -> Actuator:
        return calibrate(others, before, free=free, hold_out=False, model_runs=False).actuator

    def judge(log: Log, model: Actuator, _share: Progress | None) -> Validation:
        return validate([log], model, transient=like.transient)

    rows = [
        row
        for _, judged in held_out(logs, fit, judge, progress)
        if judged is not None
        for row in judged.errors
    ]
    return replace(like, errors=tuple(rows)) if rows else None
