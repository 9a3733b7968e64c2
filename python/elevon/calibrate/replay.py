"""An actuator with a control unit of its own held against logs: the recorded inputs, replayed.

Command, load and the stand's settings come from the log; everything else that the log shows and the
model has is compared, role by role.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.validation import Validation, ValidationTrace, promised, promised_transient
from elevon.errors import InputError, SimulationError
from elevon.experiment import Experiment, Inputs, ModelRun
from elevon.logs.log import Log, on_clock
from elevon.progress import Progress, part
from elevon.recording import Recording

_INPUTS = ("command", "load")
_SMOOTH = 0.5  # s over which the ram's imposed speed is taken from its position
_SHORTEST = 64  # samples that a filter of the recorder needs


def unit_experiment(
    log: Log, actuator: Actuator, fidelity: str, *, period: float | None = None
) -> Experiment:
    """Return the test of a log as it was commanded, the actuator as the log's stand had it.

    Raises
    ------
    InputError
        A role that is needed is missing, or the model shows nothing of the log.
    """
    position, stand = log["output_position"], log.stand
    loads = {}
    if stand.moves_output:
        loads["rig_speed"] = (log.time, _speed(log.time, position))
    elif log.has("load"):
        loads["output"] = (log.time, log["load"])
    inputs = Inputs(
        log.duration, "gear", actions=_actions(log, actuator.wiring), loads=loads,
        initial=dict(stand.initial) or {"nut_position": float(position[0])},
    )  # fmt: skip
    ready = actuator.with_values(dict(stand.parameters), source="stand of the log", place=log.name)
    shows = {
        role: signal
        for role, signal in _signals(actuator.wiring, fidelity).items()
        if log.has(role) and role not in _INPUTS and (stand.moves_output or role != "load_cell")
    }
    if not shows:
        raise InputError(f"{log.name}: shows nothing that the model has; roles: {', '.join(log)}")
    return Experiment(log, ready, inputs, shows, period=period, fidelity=fidelity, notices=True)


def _signals(wiring: str, fidelity: str) -> dict[str, str]:
    """Role to the model's signal, the last of a role."""
    from elevon.scenario.compile import signal_records

    records = signal_records(wiring, fidelity)
    return {item["role"]: name for name, item in records.items() if item["role"] is not None}


def _actions(log: Log, wiring: str) -> tuple[tuple[float, str], ...]:
    """Return the actions commanded: a held number, one round higher when it is repeated."""
    from elevon.parameters.records import wirings

    names: list[str] = wirings()[wiring]["actions"]
    command = log if log.recording is None else log.on("command")
    values = np.rint(command["command"])
    changes = np.flatnonzero(np.diff(values)) + 1
    start = command.start - log.start
    return tuple(
        (float(command.time[k] + start), names[int(values[k]) % len(names)]) for k in changes
    )


def _speed(time: Floats, position: Floats) -> Floats:
    """Speed of a ram that is moved: the slope of its position over half a second."""
    from scipy.signal import savgol_filter

    period = float(np.median(np.diff(time)))
    width = max(5, 2 * round(0.5 * _SMOOTH / period) + 1)
    slope = savgol_filter(position, min(width, len(position) - 1 | 1), 1, deriv=1, delta=period)
    return np.asarray(slope, dtype=np.float64)


def replayed(experiment: Experiment, progress: Progress | None = None) -> ModelRun:
    """Run a log's test once.

    Raises
    ------
    SimulationError
        It left the finite numbers.
    """
    run = next(experiment.run(progress=progress))
    if run.status == "diverged":
        raise SimulationError(f"{experiment.log.name}: the run diverges", run.status)
    return run


def as_recorded(log: Log, run: ModelRun, role: str, *, stepped: bool = False) -> Floats:
    """Return a run's channel on the log's instants, through the filter of its recorder, if any.

    States, and what else is `stepped`, are as they were written last.
    """
    from scipy.signal import butter, sosfiltfilt

    values, unit = run.log[role], "1" if stepped else log.units.get(role, "")
    rate = 1.0 / run.log.period
    if unit != "1" and 0.0 < log.stand.cutoff < 0.5 * rate and len(values) >= _SHORTEST:
        values = sosfiltfilt(butter(4, log.stand.cutoff, fs=rate, output="sos"), values)
    return on_clock(run.log.time, values, log.time, unit)


def validate_replay(
    logs: Sequence[tuple[str, Recording]],
    actuator: Actuator,
    *,
    fidelity: str = "low",
    transient: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Run the model on what the logs' inputs were and compare what came out.

    Parameters
    ----------
    logs : sequence of (str, Recording)
        Name and log, with the roles ``command`` and ``output_position`` at least.
    actuator : Actuator
        The model; what a log says that its stand fixed replaces its values.
    fidelity : str
        Of the runs.
    transient : float, optional
        Left out at the beginning [s]; default the actuator file's, else 0.
    progress : callable, optional
        As for `elevon.simulate`.

    Raises
    ------
    InputError
        A log without command, or with nothing to compare.
    SimulationError
        A run did not reach its end.
    """
    given, offsets = promised_transient(actuator, transient, 0.0), promised(actuator, "offsets")
    traces, errors = [], []
    for number, (name, recording) in enumerate(logs):
        share = part(progress, number / len(logs), (number + 1) / len(logs))
        log = Log.of(recording, name, clock="output_position")
        trace = _trace(log, actuator, fidelity, given, share)
        traces.append(trace)
        limits = promised(actuator, "limits", trace.measured)
        errors += trace.errors(log.units, limits, offsets)
    how = {name: "as logged" for name, _ in logs}
    return Validation(actuator.name, fidelity, given, tuple(errors), how, tuple(traces), offsets)


def _trace(
    log: Log, actuator: Actuator, fidelity: str, transient: float, progress: Progress | None
) -> ValidationTrace:
    late, experiment = log.after(transient), unit_experiment(log, actuator, fidelity)
    run = replayed(experiment, progress)
    roles = [role for role in experiment.shows if log.units.get(role) != "1"]
    simulated = {role: as_recorded(log, run, role) for role in roles}
    used = late.good & (log.time <= run.seconds)
    return ValidationTrace(log.name, log.time, {role: log[role] for role in roles}, simulated, used)
