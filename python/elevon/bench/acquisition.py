"""The stand's recorder: channels by role, at any rate, behind an anti-alias filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.procedure import SensorStep
from elevon.bench.stand import ChannelSpec, Stand
from elevon.errors import InputError
from elevon.recording import Recording
from elevon.simulate import solver_step
from elevon.units import parse_quantity

LOAD_CHANNEL = "rig_force"
"""Channel of the role ``load``: force of the stand on the rod, positive opposes positive motion."""
_LEAST = 25e3  # Hz of the simulated channels before the filter, so that relays' ripple is filtered
_MOST = 3e6  # samples of a channel
_OVER = 4.0  # ... and this many times the log's rate
_CUTOFF = 0.4  # of the log's rate
_ORDER = 4
_FITTED = {"vibration": "vibration.model"}
_DIGITAL = ("command", "_ref")


def acquired(
    actuator: Actuator, fidelity: str, stand: Stand, rate: float, seconds: float
) -> tuple[dict[str, str], str]:
    """Return role to signal of what a stand records, and what a run keeps for it.

    Parameters
    ----------
    actuator, fidelity, stand
        What stands where, and how it is run.
    rate, seconds : float
        Of the log [Hz, s].
    """
    step = solver_step(actuator, fidelity)
    steps = internal_steps(rate, step, seconds)
    roles = acquired_signals(actuator, fidelity, stand)
    return roles, f"{','.join(dict.fromkeys(roles.values()))}@{1.0 / (steps * step):.12g} Hz"


def acquired_signals(actuator: Actuator, fidelity: str, stand: Stand) -> dict[str, str]:
    """Return role to signal, of the stand's channels that the model has; the sensor's, if any.

    A sensor that is not fitted has no channel: its recorder's noise would pass for a signal.
    """
    from elevon.scenario.compile import signal_records

    records = signal_records(actuator.wiring, fidelity)
    by_role = {item["role"]: name for name, item in records.items()}
    roles = [role for role in stand.channels if role != "load" and _fitted(actuator, role)]
    return {role: by_role[role] for role in roles if role in by_role}


def _fitted(actuator: Actuator, role: str) -> bool:
    path = _FITTED.get(role)
    known = actuator.parameters
    return path is None or path not in known or known[path].value != "off"


def internal_steps(rate: float, step: float, duration: float = 1.0) -> int:
    """Return the solver steps between the samples that the filter is given.

    A long run is sampled at less than 25 kHz, so that it stays within three million samples.

    Raises
    ------
    InputError
        The model's steps are too far apart for the rate.
    """
    steps = max(1, math.floor(1.0 / (max(_OVER * rate, min(_LEAST, _MOST / duration)) * step)))
    if 1.0 / (steps * step) < 2.0 * rate:
        raise InputError(
            f"rate of {rate:g} Hz: the model's steps of {step:g} s give {0.5 / step:g} Hz at most"
        )
    return steps


def acquire(
    run: Recording,
    roles: dict[str, str],
    load: tuple[Floats, Floats],
    stand: Stand,
    *,
    rate: float,
    seed: int,
    sensors: Sequence[SensorStep] = (),
) -> Recording:
    """Return what the recorder keeps of a run.

    Parameters
    ----------
    run : Recording
        On one clock, faster than the log.
    roles : dict of str to str
        From `acquired_signals`.
    load : tuple of ndarray
        Times [s] and force of the load actuator [N].
    stand : Stand
        Its channels.
    rate : float
        Hz; need be no whole number of steps.
    seed : int
        Of the channels' noise.
    sensors : sequence of SensorStep
        What is wrong with them.
    """
    wrong = {step.channel: step for step in sensors}
    clock = np.asarray(run.clock().time, dtype=np.float64)
    time = np.arange(math.floor(clock[-1] * rate + 1e-9) + 1, dtype=np.float64) / rate
    rng = np.random.default_rng([seed, 2])
    values, units = {}, {}
    for role, name in roles.items():
        channel = run[name]
        digital = channel.unit == "1" or role.endswith(_DIGITAL)
        raw = np.asarray(channel.values, dtype=np.float64)
        sampled = _last_written(clock, raw, time) if digital else _filtered(clock, raw, time, rate)
        sampled = _failed(sampled, wrong.get(role), channel.unit, time)
        values[name] = _sensed(sampled, stand.channels[role], channel.unit, rate, rng)
        units[name] = channel.unit
    names = dict(roles)
    if "load" in stand.channels:
        force = _failed(np.interp(time, *load), wrong.get("load"), "N", time)
        values[LOAD_CHANNEL] = _sensed(force, stand.channels["load"], "N", rate, rng)
        units[LOAD_CHANNEL] = "N"
        names["load"] = LOAD_CHANNEL
    meta = {"roles": names, "acquisition": _origin(clock, rate)}
    return Recording.build(time, values, units, clock="stand", rate=rate, meta=meta)


def _origin(clock: Floats, rate: float) -> dict[str, Any]:
    """What a reader must know of how the log came about."""
    internal = float(1.0 / np.median(np.diff(clock)))
    whole = abs(internal / rate - round(internal / rate)) < 1e-6
    return {
        "rate_hz": rate,
        "simulated_hz": internal,
        "resampled": not whole,
        "cutoff_hz": _CUTOFF * rate,
        "anti_alias": f"Butterworth, order {_ORDER}, in both directions, {_CUTOFF * rate:.6g} Hz; "
        "commands, set points, states and switches as they stood",
    }


def _last_written(clock: Floats, values: Floats, time: Floats) -> Floats:
    """What was written last: digital channels are not filtered."""
    at = np.searchsorted(clock, time + 1e-9, side="right") - 1
    return np.asarray(values[at.clip(0, len(values) - 1)], dtype=np.float64)


def _filtered(clock: Floats, values: Floats, time: Floats, rate: float) -> Floats:
    from scipy.signal import butter, sosfiltfilt

    fast = float(1.0 / np.median(np.diff(clock)))
    cutoff = _CUTOFF * rate
    if cutoff < 0.5 * fast and len(values) > 64:
        sections = butter(_ORDER, cutoff, fs=fast, output="sos")
        values = np.asarray(sosfiltfilt(sections, values), dtype=np.float64)
    return np.interp(time, clock, values)


def _failed(values: Floats, step: SensorStep | None, unit: str, time: Floats) -> Floats:
    """Return what a sensor passes on; its recorder's noise is added after it."""
    if step is None:
        return values
    late = time >= parse_quantity(step.at, "s", "at")
    if not late.any():
        return values
    wrong = step.gain * values + parse_quantity(step.offset, unit, "offset")
    if step.fault == "dead":
        wrong = np.zeros_like(values)
    elif step.fault == "stuck":
        wrong = np.full_like(values, values[int(np.argmax(late))])
    return np.where(late, wrong, values)


def _sensed(
    values: Floats, spec: ChannelSpec, unit: str, rate: float, rng: np.random.Generator
) -> Floats:
    """Add the channel's lag, then its noise."""
    lag = parse_quantity(spec.lag, "s", "lag")
    if lag > 0.0:
        from scipy.signal import lfilter

        share = 1.0 - math.exp(-1.0 / (rate * lag))
        start = [(1.0 - share) * values[0]]
        values = np.asarray(lfilter([share], [1.0, share - 1.0], values, zi=start)[0])
    noise = parse_quantity(spec.noise, unit, "noise")
    return values + noise * rng.standard_normal(len(values)) if noise > 0.0 else values
