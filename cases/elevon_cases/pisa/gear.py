"""Strokes of the Pisa landing gear: the conditions of the thesis and what a stroke shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.progress import Progress
from elevon.recording import Recording

ACTUATOR = "pisa-landing-gear"
COMMANDED = 0.1
"""Time of the command [s]."""
ENDS = {"extend": 2.0, "retract": 0.0}
"""State of the control unit that ends a stroke: locked, retracted."""
RECORD = (
    "state,output_position,motor_speed,speed_ref,current_mean,current_peak,voltage_ref,"
    "supply_voltage,load_force@1 kHz"
)


WARMED = ("motor.winding_temperature", "lubricant.temperature")
"""What a temperature of the surroundings reaches."""
RELAXED = 40.0
"""Cycle that P allows in the critical condition [s]: twice that of the others."""


@dataclass(frozen=True, slots=True)
class Condition:
    """One condition of P Table 1.2; the requirement is on both strokes together.

    Attributes
    ----------
    name : str
        As printed.
    load_factor, supply : float
        N_z and V.
    requirement : float or None
        Cycle allowed [s].
    temperature : float or None
        Of winding and lubricant [K]; None: the actuator file's.
    """

    name: str
    load_factor: float
    supply: float
    requirement: float | None
    temperature: float | None = None

    @property
    def values(self) -> dict[str, float | str]:
        """Parameters that the condition sets beside load factor and supply."""
        if self.temperature is None:
            return {}
        return dict.fromkeys(WARMED, self.temperature)

    @property
    def constant_speed(self) -> bool:
        """Whether the set points are to be held.

        Where P doubles the cycle, it lets them go; of temperature it requires nothing.
        """
        required = self.requirement is not None and self.requirement < RELAXED
        return required and self.temperature is None


CONDITIONS = (
    Condition("nominal", 1.0, 28.0, 20.0),
    Condition("normal", 1.5, 22.0, 20.0),
    Condition("normal", 1.5, 30.3, 20.0),
    Condition("critical", 3.5, 20.5, RELAXED),
    Condition("critical", 3.5, 32.2, RELAXED),
    Condition("limit", 3.5, 14.0, None),
)
FIGURES = Condition("normal, as Figs. 3.11 to 3.16", 1.0, 22.0, 20.0)
"""What P 3.3.1 says of its own figures; Table 1.2, the abstract and 3.1 have 1.5 g at 22 V."""
TEMPERATURES = (
    Condition("nominal at -40 C", 1.0, 28.0, 20.0, 233.15),
    Condition("nominal at 70 C", 1.0, 28.0, 20.0, 343.15),
)
"""P names temperature among what defines a condition and leaves it out; the ends are ASSUMED
(DO-160, equipment outside the cabin), and so is what they do to the lubricant."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """One stroke to run: direction, load factor, supply voltage, further parameters."""

    action: str
    load_factor: float
    supply: float
    values: Mapping[str, float | str] | None = None


def run_strokes(
    strokes: Sequence[Stroke],
    *,
    fidelity: str,
    duration: float = 15.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> list[Recording]:
    """Simulate strokes, each from the end it starts at.

    Raises
    ------
    SimulationError
        A run tripped or diverged.
    """
    from elevon.actuator import Actuator
    from elevon.simulate import Run, completed, simulate_batch

    actuator = Actuator.load(ACTUATOR)
    runs = [
        Run(actuator, _scenario(stroke, duration), seed, _label(stroke), number)
        for number, stroke in enumerate(strokes)
    ]
    recordings = simulate_batch(runs, fidelity=fidelity, record=RECORD, progress=progress)
    return completed(recordings)


def stroke_time(recording: Recording, action: str) -> float:
    """Return the time in s from the command until the control unit sees the end; NaN if never."""
    state = recording["state"]
    after = (state.time > COMMANDED + 0.05) & (state.values == ENDS[action])
    return float(state.time[after][0]) - COMMANDED if np.any(after) else float("nan")


def _label(stroke: Stroke) -> str:
    return f"{stroke.action}, {stroke.load_factor:g} g, {stroke.supply:g} V"


def _scenario(stroke: Stroke, duration: float) -> Any:
    from elevon.scenario import Scenario

    data: dict[str, Any] = {
        "duration": duration,
        "command": {
            "mode": "gear",
            "steps": [{"time": COMMANDED, "action": stroke.action}],
        },
        "parameters": {
            "load.factor": stroke.load_factor,
            "inverter.supply_voltage": stroke.supply,
            **(stroke.values or {}),
        },
    }
    if stroke.action == "retract":
        data["initial"] = {"nut_position": "267 mm"}
    return Scenario.from_dict(data)
