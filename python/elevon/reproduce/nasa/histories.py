"""Figures 5, 6 and 7 of the paper as the model gives them: time histories of nominal runs.

The paper draws its curves and prints no numbers of them; the conditions are those of its captions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.progress import Progress
from elevon.reproduce.nasa.profiles import MotionProfile, profile_scenario
from elevon.units import to_si

RECORD = (
    "command,output_position,joint_force,current_ref,winding_temperature,surface_temperature@200 Hz"
)
POUND_FORCE = float(to_si(1.0, "lbf"))


@dataclass(frozen=True, slots=True)
class HistoryFigure:
    """One figure: time [s] and its curves by signal, SI.

    Attributes
    ----------
    figure : int
        Its number in the paper.
    title : str
        Its condition.
    """

    figure: int
    title: str
    time: Floats
    curves: dict[str, Floats]


def _conditions() -> list[tuple[int, str, dict[str, Any]]]:
    sine = MotionProfile("sinusoidal", 0.05, 0.06, 40.0)
    stepped = profile_scenario(sine)
    step = {"kind": "step", "initial": 500.0, "final": 4500.0, "time": 20.0}
    stepped["load"] = {"output": {"terms": [step]}}
    short = MotionProfile("sinusoidal", 0.05, 0.06, 20.0)
    opposed = profile_scenario(short, opposing=900.0 * POUND_FORCE)
    triangle = MotionProfile("triangular", 0.05, 0.06, 20.0)
    sprung = profile_scenario(triangle, 1725.0 * POUND_FORCE, "spring")
    return [
        (5, "sine, load stepping from 500 to 4500 N at 20 s", stepped),
        (6, "sine, opposing force of 900 lbf (4003 N)", opposed),
        (7, "triangle, spring of 1725 lbf (7673 N) at 50 mm", sprung),
    ]


def time_histories(actuator: Actuator, progress: Progress | None = None) -> list[HistoryFigure]:
    """Return the three figures, simulated at high fidelity.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    wanted = _conditions()
    runs = [
        Run(actuator, Scenario.from_dict(data), label=f"figure {number}")
        for number, _, data in wanted
    ]
    recordings = simulate_batch(runs, fidelity="high", record=RECORD, progress=progress)
    return [
        HistoryFigure(number, title, recording["command"].time,
                {name: recording[name].values for name in recording.names})
        for (number, title, _), recording in zip(wanted, completed(recordings), strict=True)
    ]  # fmt: skip
