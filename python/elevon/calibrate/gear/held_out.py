"""How well values determined without a motion predict it: where a set's thresholds come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from elevon.calibrate.gear.log import gear_log
from elevon.calibrate.gear.result import calibrate_gear
from elevon.calibrate.replay import validate_replay
from elevon.errors import InputError
from elevon.progress import Progress, part

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate.validation import Validation
    from elevon.recording import Recording

__all__ = ["held_out_motions"]


def held_out_motions(
    recordings: Mapping[str, Recording],
    before: Actuator,
    fitted: Actuator,
    *,
    free: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> tuple[Validation, bool]:
    """Calibrate without each motion in turn and replay it; logs of the rig stay in.

    Parameters
    ----------
    recordings : mapping of str to Recording
        By name, as calibrated.
    before, fitted : Actuator
        As given, and with the values of all logs.
    free : sequence of str, optional
        As calibrated.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    Validation, bool
        One row a log and role, and whether the logs were held out: a single motion, or one without
        which too little is determined, is held against the values of all.
    """
    logs = {name: gear_log(recording, name) for name, recording in recordings.items()}
    motions = [name for name, log in logs.items() if log.moves] or list(recordings)
    rows, shown, apart = [], [], len(motions) > 1
    for k, name in enumerate(motions):
        rest = [log for other, log in logs.items() if other != name]
        model = fitted
        if apart:
            try:
                model = calibrate_gear(rest, before, free=free).actuator
            except InputError:
                apart = False
        share = part(progress, k / len(motions), (k + 1) / len(motions))
        rows.append(validate_replay([(name, recordings[name])], model, progress=share))
        shown += list(rows[-1].errors)
    return replace(rows[0], errors=tuple(shown), traces=()), apart
