"""An actuator with a control unit of its own held against logs: the recorded inputs, replayed.

Command, load and the stand's settings come from the log; everything else that the log shows and the
model has is compared, role by role.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.validation import SignalError, Validation, ValidationTrace
from elevon.errors import InputError, SimulationError, unknown

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress
    from elevon.recording import Recording
    from elevon.recording.channel import Channel
    from elevon.scenario import Scenario

__all__ = ["as_recorded", "replay_scenario", "validate_replay"]

_INPUTS = ("command", "load")
_SMOOTH = 0.5  # s over which the ram's imposed speed is taken from its position


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
    from elevon.progress import part

    promised = actuator.validation or {}
    limits, offsets = dict(promised.get("limits", {})), dict(promised.get("offsets", {}))
    given = float(promised.get("transient", 0.0)) if transient is None else transient
    traces, errors = [], []
    for number, (name, recording) in enumerate(logs):
        share = part(progress, number / len(logs), (number + 1) / len(logs))
        trace, units = _trace(name, recording, actuator, fidelity, given, progress=share)
        for signal in limits:
            if signal not in units:
                raise unknown("signal", signal, units, f"{actuator.name}: validation.limits")
        traces.append(trace)
        errors += [_error(trace, role, units[role], offsets, limits) for role in trace.simulated]
    how = {name: "as logged" for name, _ in logs}
    return Validation(actuator.name, fidelity, given, tuple(errors), how, tuple(traces), offsets)


def replay_scenario(
    recording: Recording, actuator: Actuator, name: str
) -> tuple[Actuator, Scenario]:
    """Return the actuator as the log's stand had it, and the scenario of the log's inputs.

    Raises
    ------
    InputError
        A role that is needed is missing.
    """
    from elevon.scenario import Scenario

    roles = recording.roles
    for role in ("command", "output_position"):
        if role not in roles:
            raise InputError(f"{name}: no channel has the role {role!r}; roles: {', '.join(roles)}")
    stand = _stand(recording)
    position = recording.role("output_position")
    time = np.asarray(position.time - position.time[0], dtype=np.float64)
    load: dict[str, Any] = {}
    if stand.get("rig_moves"):
        load["rig_speed"] = _table(time, _speed(time, np.asarray(position.values)))
    elif "load" in roles:
        channel = recording.role("load")
        load["output"] = _table(channel.time - position.time[0], channel.values)
    initial = dict(stand.get("initial", {})) or {"nut_position": float(position.values[0])}
    scenario = Scenario.from_dict(
        {
            "duration": float(time[-1]),
            "command": {"mode": "gear", "steps": _actions(recording, actuator.wiring)},
            "load": load,
            "initial": initial,
        },
        name,
    )
    values = dict(stand.get("parameters", {}))
    return actuator.with_values(values, source="stand of the log", place=name), scenario


def _stand(recording: Recording) -> Mapping[str, Any]:
    stand = recording.meta.get("stand")
    return stand if isinstance(stand, Mapping) else {}


def _actions(recording: Recording, wiring: str) -> list[dict[str, Any]]:
    """Return the actions commanded: a held number, one round higher when it is repeated."""
    from elevon.parameters.records import wirings

    actions: list[str] = wirings()[wiring]["actions"]
    channel = recording.role("command")
    values = np.rint(np.asarray(channel.values))
    changes = np.flatnonzero(np.diff(values)) + 1
    start = float(channel.time[0])
    return [
        {"time": float(channel.time[k]) - start, "action": actions[int(values[k]) % len(actions)]}
        for k in changes
    ]


def _table(time: Any, values: Any) -> dict[str, Any]:
    times, points = np.asarray(time).tolist(), np.asarray(values).tolist()
    return {"terms": [{"kind": "table", "times": times, "values": points}]}


def _speed(time: Floats, position: Floats) -> Floats:
    """Speed of a ram that is moved: the slope of its position over half a second."""
    from scipy.signal import savgol_filter

    period = float(np.median(np.diff(time)))
    width = max(5, 2 * round(0.5 * _SMOOTH / period) + 1)
    slope = savgol_filter(position, min(width, len(position) - 1 | 1), 1, deriv=1, delta=period)
    return np.asarray(slope, dtype=np.float64)


def _trace(
    name: str,
    recording: Recording,
    actuator: Actuator,
    fidelity: str,
    transient: float,
    *,
    progress: Progress | None,
) -> tuple[ValidationTrace, dict[str, str]]:
    from elevon.scenario.compile import signal_records
    from elevon.simulate import simulate

    ready, scenario = replay_scenario(recording, actuator, name)
    if not transient < scenario.seconds:
        raise InputError(f"transient of {transient:g} s: {name} lasts {scenario.seconds:g} s")
    names = {item["role"]: key for key, item in signal_records(actuator.wiring, fidelity).items()}
    roles = [
        role
        for role in recording.roles
        if role in names and role not in _INPUTS and recording.role(role).unit != "1"
    ]
    moved = bool(scenario.loads.rig_speed.terms)
    roles = [role for role in roles if moved or role != "load_cell"]
    if not roles:
        raise InputError(f"{name}: shows nothing that the model has; roles: {recording.roles}")
    signals = ",".join(dict.fromkeys(names[role] for role in roles))
    run = simulate(ready, scenario, fidelity=fidelity, record=f"{signals}@every", progress=progress)
    if run.status == "diverged":
        raise SimulationError(f"{name}: {run.meta['message']}", run.status)
    base = recording.role("output_position")
    time = np.asarray(base.time - base.time[0], dtype=np.float64)
    measured, simulated = {}, {}
    for role in roles:
        channel, model = recording.role(role), run[names[role]]
        measured[role] = np.interp(base.time, channel.time, channel.values)
        simulated[role] = np.interp(time, model.time, as_recorded(recording, model))
    units = {role: recording.role(role).unit for role in roles}
    used = (time >= transient) & (time <= float(run.meta["sim_s"]))
    return ValidationTrace(name, time, measured, simulated, used), units


def as_recorded(recording: Recording, model: Channel) -> Floats:
    """Return the model's channel through the filter that the log's recorder states, if any."""
    from scipy.signal import butter, sosfiltfilt

    values = np.asarray(model.values, dtype=np.float64)
    acquisition = recording.meta.get("acquisition")
    cutoff = float(acquisition.get("cutoff_hz", 0.0)) if isinstance(acquisition, Mapping) else 0.0
    rate = float(1.0 / np.median(np.diff(model.time)))
    if not 0.0 < cutoff < 0.5 * rate or len(values) < 64:
        return values
    sections = butter(4, cutoff, fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, values), dtype=np.float64)


def _error(
    trace: ValidationTrace,
    role: str,
    unit: str,
    offsets: Mapping[str, float],
    limits: Mapping[str, float],
) -> SignalError:
    mask = trace.used & np.isfinite(trace.measured[role])
    data = trace.measured[role][mask] - offsets.get(role, 0.0)
    error = trace.simulated[role][mask] - data
    rms, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
    spread, reach = float(np.std(data)), float(np.ptp(data))

    def percent(value: float, size: float) -> float:
        return 100.0 * value / size if size > 0.0 else float("nan")

    return SignalError(
        trace.log, role, unit, rms, largest, percent(rms, spread), percent(rms, reach),
        percent(largest, reach), limits.get(role),
    )  # fmt: skip
