"""The waveforms a command may have, evaluated on a time grid for fitting.

Names and meaning of the parameters are those of the core's catalogue (`elevon list waveforms`);
a contract test compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError, unknown

__all__ = ["WAVEFORMS", "evaluate", "waveform_parameters"]

FloatArray = npt.NDArray[np.float64]
_TAU = 2.0 * math.pi

#: Parameters of each waveform and their defaults (None: must be given), as in the core.
WAVEFORMS: dict[str, dict[str, float | None]] = {
    "constant": {"value": None},
    "step": {"initial": 0.0, "final": None, "time": 0.0},
    "ramp": {"initial": 0.0, "slope": None, "start": 0.0, "end": math.inf},
    "sine": {
        "amplitude": None,
        "frequency": None,
        "phase": 0.0,
        "bias": 0.0,
        "start": 0.0,
        "end": math.inf,
    },
    "chirp": {
        "amplitude": None,
        "start_frequency": 0.0,
        "end_frequency": None,
        "sweep_time": None,
        "phase": 0.0,
        "bias": 0.0,
        "start": 0.0,
        "repeat": 0.0,
    },
    "triangle": {
        "amplitude": None,
        "frequency": None,
        "phase": 0.0,
        "bias": 0.0,
        "start": 0.0,
        "end": math.inf,
    },
    "trapezoid": {
        "low": 0.0,
        "high": None,
        "rise": None,
        "hold_high": 0.0,
        "fall": None,
        "hold_low": 0.0,
        "start": 0.0,
        "repeat": 1.0,
    },
}


def waveform_parameters(kind: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return all parameters of a waveform, defaults filled in.

    Raises
    ------
    UnknownNameError
        Unknown waveform or parameter.
    InputError
        A parameter without default is missing.
    """
    if kind not in WAVEFORMS:
        raise unknown("waveform", kind, WAVEFORMS)
    known = WAVEFORMS[kind]
    for name in given:
        if name not in known:
            raise unknown("parameter", name, known, f"waveform {kind}")
    result: dict[str, float] = {}
    for name, default in known.items():
        value = given.get(name, default)
        if value is None:
            raise InputError(f"waveform {kind}: parameter {name!r} is missing")
        result[name] = float(value)
    return result


def evaluate(kind: str, given: Mapping[str, float], time: FloatArray) -> FloatArray:
    """Return the values of a waveform.

    Parameters
    ----------
    kind : str
        One of `WAVEFORMS`.
    given : mapping of str to float
        Parameters (SI); those left out take their default.
    time : ndarray, shape (n,)
        Seconds.

    Returns
    -------
    ndarray, shape (n,)
        In the unit of the parameters.
    """
    return _SHAPES[kind](waveform_parameters(kind, given), np.asarray(time, dtype=np.float64))


def _constant(p: Mapping[str, float], t: FloatArray) -> FloatArray:
    return np.full_like(t, p["value"])


def _step(p: Mapping[str, float], t: FloatArray) -> FloatArray:
    return np.where(t < p["time"], p["initial"], p["final"])


def _ramp(p: Mapping[str, float], t: FloatArray) -> FloatArray:
    return p["initial"] + p["slope"] * (np.clip(t, p["start"], p["end"]) - p["start"])


def _sine(p: Mapping[str, float], t: FloatArray) -> FloatArray:
    held = np.clip(t, p["start"], p["end"]) - p["start"]
    wave = np.sin(p["phase"] + _TAU * p["frequency"] * held)
    return np.asarray(p["bias"] + p["amplitude"] * wave, dtype=np.float64)


def _chirp(p: Mapping[str, float], t: FloatArray) -> FloatArray:
    tau = np.maximum(t - p["start"], 0.0)
    tau = tau % p["sweep_time"] if p["repeat"] else np.minimum(tau, p["sweep_time"])
    rate = (p["end_frequency"] - p["start_frequency"]) / p["sweep_time"]
    angle = p["phase"] + _TAU * (p["start_frequency"] + 0.5 * rate * tau) * tau
    return np.asarray(p["bias"] + p["amplitude"] * np.sin(angle), dtype=np.float64)


def _triangle(p: Mapping[str, float], t: FloatArray) -> FloatArray:
    held = np.clip(t, p["start"], p["end"]) - p["start"]
    turns = p["phase"] / _TAU + p["frequency"] * held
    shape = 1.0 - 4.0 * np.abs((turns + 0.25) % 1.0 - 0.5)
    return np.asarray(p["bias"] + p["amplitude"] * shape, dtype=np.float64)


def _trapezoid(p: Mapping[str, float], t: FloatArray) -> FloatArray:
    knots = np.cumsum([0.0, p["rise"], p["hold_high"], p["fall"], p["hold_low"]])
    tau = np.maximum(t - p["start"], 0.0)
    tau = tau % knots[-1] if p["repeat"] else np.minimum(tau, knots[-1])
    levels = [p["low"], p["high"], p["high"], p["low"], p["low"]]
    return np.asarray(np.interp(tau, knots, levels), dtype=np.float64)


_SHAPES: dict[str, Callable[[Mapping[str, float], FloatArray], FloatArray]] = {
    "constant": _constant,
    "step": _step,
    "ramp": _ramp,
    "sine": _sine,
    "chirp": _chirp,
    "triangle": _triangle,
    "trapezoid": _trapezoid,
}
