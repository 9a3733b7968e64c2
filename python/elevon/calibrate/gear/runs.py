"""The logs' motions run again with what the balances say: what the same balances read there.

A balance is a short form of the machine: commutations are no resistance, a smoothed speed has not
quite its slope. In a run of the model whose numbers are known it misreads them by as much, and that
comes off its estimates (indirect inference: C. Gourieroux, A. Monfort, E. Renault, Journal of
Applied Econometrics 8, 1993).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.gear.log import GearLog
from elevon.calibrate.level import Level
from elevon.calibrate.replay import as_recorded, replay_scenario
from elevon.errors import ElevonError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress
    from elevon.recording.channel import Channel

__all__ = ["corrected", "run_again", "with_noise"]

_RATE = 25e3  # Hz at least of a run's channels, before the recorder's filter
_SHARE = 0.1  # of a correction, as its deviation: ASSUMED, the model is not the machine
_MOST = 0.3  # relative: a larger correction says that the run is another motion
_INPUTS = ("command", "load", "load_cell")
_SAMPLED = ("_ref",)


def run_again(
    logs: Sequence[GearLog],
    actuator: Actuator,
    fidelity: str,
    progress: Progress | None = None,
) -> list[GearLog]:
    """Return the logs of motions as the model shows them, without noise.

    Parameters
    ----------
    logs : sequence of GearLog
        Those without motion, or whose recording is not known, are passed over.
    actuator : Actuator
        The model.
    fidelity : str
        Of the runs.
    progress : callable, optional
        As for `elevon.simulate`.

    Returns
    -------
    list of GearLog
        Empty where a run does not carry out its motions as the log did.
    """
    from elevon.progress import part

    moving = [log for log in logs if log.moves and log.recording is not None and log.has("command")]
    again = []
    for number, log in enumerate(moving):
        share = part(progress, number / len(moving), (number + 1) / len(moving))
        try:
            inputs = _run(log, actuator, fidelity, share)
        except ElevonError:
            return []
        if [move.extending for move in inputs.moves] != [move.extending for move in log.moves]:
            return []
        again.append(inputs)
    return again


def _run(log: GearLog, actuator: Actuator, fidelity: str, progress: Progress | None) -> GearLog:
    from elevon.scenario.compile import signal_records
    from elevon.simulate import simulate, solver_step

    assert log.recording is not None
    model, scenario = replay_scenario(log.recording, actuator, log.name)
    by_role = {item["role"]: name for name, item in signal_records(model.wiring, fidelity).items()}
    roles = [role for role in log.roles if role in by_role and role not in _INPUTS]
    step = solver_step(model, fidelity)
    every = max(1, int(1.0 / (_RATE * step))) * step
    names = ",".join(dict.fromkeys(by_role[role] for role in roles))
    run = simulate(
        model, scenario, fidelity=fidelity, record=f"{names}@{1.0 / every:.12g} Hz",
        progress=progress,
    )  # fmt: skip
    inputs = {role: log[role] for role in log.roles if role in _INPUTS}
    for role in roles:
        stepped = role.endswith(_SAMPLED) or run[by_role[role]].unit == "1"
        inputs[role] = (_last if stepped else _recorded)(log, run[by_role[role]])
    return replace(log, roles=inputs)


def _last(log: GearLog, channel: Channel) -> Floats:
    """What was written last: digital channels are not filtered."""
    values = np.asarray(channel.values, dtype=np.float64)
    at = np.searchsorted(channel.time, log.time + 1e-9, side="right") - 1
    return np.asarray(values[at.clip(0, len(values) - 1)])


def _recorded(log: GearLog, channel: Channel) -> Floats:
    """A run's channel as the recorder would have kept it."""
    assert log.recording is not None
    return np.asarray(np.interp(log.time, channel.time, as_recorded(log.recording, channel)))


def with_noise(again: Sequence[GearLog], logs: Sequence[GearLog], seed: int) -> list[GearLog]:
    """Return runs with as much noise as the logs have: what is new in each sample."""
    rng = np.random.default_rng([seed, len(again)])
    by_name = {log.name: log for log in logs}
    result = []
    for run in again:
        noise = {role: by_name[run.name][role] - values for role, values in run.roles.items()}
        # Third differences of both, outliers (edges) aside.
        sizes = {role: float(np.median(np.abs(np.diff(d, 3)))) for role, d in noise.items()}
        scale = 1.4826 / np.sqrt(20.0)
        result.append(
            replace(
                run,
                roles={
                    role: values + scale * sizes[role] * rng.standard_normal(len(values))
                    for role, values in run.roles.items()
                },
            )
        )
    return result


def corrected(
    levels: Mapping[str, Level], readings: Sequence[Mapping[str, Level]], ran: Actuator
) -> dict[str, Level]:
    """Return levels less what the same balances misread in runs whose numbers are known.

    Parameters
    ----------
    levels : mapping of str to Level
        Read in the logs.
    readings : sequence of mapping of str to Level
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
        result[path] = Level(scale * level.value, std, level.degrees)
    return result
