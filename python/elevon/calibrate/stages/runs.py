"""The logs' motions run again with what the balances say: what the same balances read there.

A balance is a short form of the machine: commutations are no resistance, a smoothed speed has not
quite its slope. In a run of the model whose numbers are known it misreads them by as much, and that
comes off its estimates (indirect inference: C. Gourieroux, A. Monfort, E. Renault, Journal of
Applied Econometrics 8, 1993).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.replay import as_recorded, replayed, unit_experiment
from elevon.calibrate.stages.moves import moves_of
from elevon.errors import ElevonError
from elevon.estimate import Estimate
from elevon.logs.log import Log
from elevon.progress import Progress, part

_RATE = 25e3  # Hz at least of a run's channels, before the recorder's filter
_SHARE = 0.1  # of a correction, as its deviation: ASSUMED, the model is not the machine
_MOST = 0.3  # relative: a larger correction says that the run is another motion
_INPUTS = ("command", "load", "load_cell")
_SAMPLED = ("_ref",)


def run_again(
    logs: Sequence[Log],
    actuator: Actuator,
    fidelity: str,
    progress: Progress | None = None,
) -> list[Log]:
    """Return the logs of motions as the model shows them, without noise.

    Parameters
    ----------
    logs : sequence of Log
        Those without motion, or whose recording is not known, are passed over.
    actuator : Actuator
        The model.
    fidelity : str
        Of the runs.
    progress : callable, optional
        As for `elevon.simulate`.

    Returns
    -------
    list of Log
        Empty where a run does not carry out its motions as the log did.
    """
    moving = [log for log in logs if moves_of(log) and log.recording and log.has("command")]
    again = []
    for number, log in enumerate(moving):
        share = part(progress, number / len(moving), (number + 1) / len(moving))
        try:
            inputs = _run(log, actuator, fidelity, share)
        except ElevonError:
            return []
        ways = [[move.extending for move in moves_of(item)] for item in (inputs, log)]
        if ways[0] != ways[1]:
            return []
        again.append(inputs)
    return again


def _run(log: Log, actuator: Actuator, fidelity: str, progress: Progress | None) -> Log:
    experiment = unit_experiment(log, actuator, fidelity, period=1.0 / _RATE)
    run = replayed(experiment, progress)
    channels = {role: log[role] for role in log.channels if role in _INPUTS}
    for role in (role for role in log.channels if role in experiment.shows):
        channels[role] = as_recorded(log, run, role, stepped=role.endswith(_SAMPLED))
    return replace(log, channels=channels)


def with_noise(again: Sequence[Log], logs: Sequence[Log], seed: int) -> list[Log]:
    """Return runs with as much noise as the logs have: what is new in each sample."""
    rng = np.random.default_rng([seed, len(again)])
    by_name = {log.name: log for log in logs}
    result = []
    for run in again:
        noise = {role: by_name[run.name][role] - values for role, values in run.channels.items()}
        # Third differences of both, outliers (edges) aside.
        sizes = {role: float(np.median(np.abs(np.diff(d, 3)))) for role, d in noise.items()}
        scale = 1.4826 / np.sqrt(20.0)
        result.append(
            replace(
                run,
                channels={
                    role: values + scale * sizes[role] * rng.standard_normal(len(values))
                    for role, values in run.channels.items()
                },
            )
        )
    return result


def corrected(
    levels: Mapping[str, Estimate], readings: Sequence[Mapping[str, Estimate]], ran: Actuator
) -> dict[str, Estimate]:
    """Return levels less what the same balances misread in runs whose numbers are known.

    Parameters
    ----------
    levels : mapping of str to Estimate
        Read in the logs.
    readings : sequence of mapping of str to Estimate
        Read in the runs, one for each draw of their noise.
    ran : Actuator
        What was run.
    """
    result = {}
    for path, level in levels.items():
        true = ran.parameters.value(path)
        read = float(np.mean([item[path].value if path in item else np.nan for item in readings]))
        if not abs(read - true) < _MOST * true:
            result[path] = level
            continue
        scale = true / read
        std = float(np.hypot(scale * level.std, _SHARE * (scale - 1.0) * level.value))
        result[path] = Estimate(scale * level.value, std, level.degrees)
    return result
