"""What one repetition of a mission does to the actuator, from the signals of its run."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.prognose.laws import LAWS
from elevon.prognose.requirement import RunSignals

if TYPE_CHECKING:
    from elevon.prognose.mission import Mission
    from elevon.recording import Recording

_RATE = 400.0  # Hz
_ROLES = (
    "command",
    "output_position",
    "motor_speed",
    "torque_current",
    "temperature",
    "surface_temperature",
    "locked",
)
_NAMES = ("motor_torque", "friction_torque", "energy_friction", "energy_efficiency")
_AGEING = LAWS["insulation"].coefficients["activation"].value  # K


@lru_cache(maxsize=16)
def _signals(wiring: str, fidelity: str) -> dict[str, str]:
    """Role, or name where a signal has no role, to the signal that is recorded."""
    from elevon import _core

    there = _core.signals(wiring, fidelity)
    out: dict[str, str] = {}
    for role in _ROLES:
        name = next((s["name"] for s in there if s["role"] == role), None)
        if name is not None:
            out[role] = name
    return {**out, **{n: n for n in _NAMES if any(s["name"] == n for s in there)}}


def recorded_signals(wiring: str, fidelity: str) -> str:
    """Return the recording plan of a run."""
    return ",".join(dict.fromkeys(_signals(wiring, fidelity).values())) + f"@{_RATE:g} Hz"


def run_signals(recording: Recording, wiring: str, fidelity: str) -> RunSignals:
    """Return the signals of a run by role."""
    names = _signals(wiring, fidelity)
    first = recording[next(iter(names.values()))]
    return RunSignals(
        np.asarray(first.time, dtype=np.float64),
        {role: np.asarray(recording[name].values) for role, name in names.items()},
        recording.status == "ok",
    )


def exposure(run: RunSignals, mission: Mission) -> dict[str, float]:
    """Return the drivers of a mission, keys of `DRIVERS`, for one of its units of use."""
    step = np.diff(run.time, append=run.time[-1])
    speed = run["motor_speed"]
    travel = np.abs(speed) * step
    torque = np.abs(run["motor_torque"])
    travelled = float(travel.sum())
    cubic = float((torque**3 @ travel) / travelled) if travelled > 0.0 else 0.0
    winding = run["temperature"]
    out = {
        "hours": float(mission.hours),
        "friction_work": mission.repeats * _friction_work(run, step),
        "shaft_travel": mission.repeats * travelled,
        "torque_cubic_mean": float(np.cbrt(cubic)),
        "winding_temperature": _ageing_mean(winding),
    }
    surface = run.signals.get("surface_temperature", winding)
    return {**out, "surface_temperature": float(surface.mean())}


def _friction_work(run: RunSignals, step: Floats) -> float:
    if "friction_torque" in run.signals:
        return float(np.abs(run["friction_torque"] * run["motor_speed"]) @ step)
    parts = [run[name] for name in ("energy_friction", "energy_efficiency") if name in run.signals]
    return float(sum(part[-1] - part[0] for part in parts))


def _ageing_mean(kelvin: Floats) -> float:
    """Temperature at which insulation ages as it does over the course given."""
    return float(-_AGEING / np.log(np.mean(np.exp(-_AGEING / np.maximum(kelvin, 1.0)))))
