"""What the sharp corners of the paper's profiles cost: the same runs with corners rounded."""

from __future__ import annotations

from itertools import product

import numpy as np

from elevon.actuator import Actuator
from elevon.progress import Progress
from elevon.reproduce.nasa.profiles import MotionProfile, profile_scenario

ACCELERATION = 1.0
"""m/s2 at a rounded corner (ASSUMED): 4 A of the 20 A there are."""
DURATION = 8.0
SETTLE = 1.0


def corner_rows(actuator: Actuator, progress: Progress | None = None) -> list[dict[str, object]]:
    """Return peak and rms current and the tracking error, sharp and rounded, unloaded and loaded.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    cases = list(product(("trapezoidal", "triangular"), (0.0, 8500.0), (0.0, ACCELERATION)))
    runs = [
        Run(
            actuator,
            Scenario.from_dict(
                profile_scenario(MotionProfile(shape, 0.05, 0.06, DURATION, acceleration), load)
            ),
            label=f"{shape}, {load:g} N",
        )
        for shape, load, acceleration in cases
    ]
    record = "command,output_position,current_ref@2 kHz"
    rows = []
    recordings = simulate_batch(runs, fidelity="high", record=record, progress=progress)
    for (shape, load, acceleration), recording in zip(cases, completed(recordings), strict=True):
        late = recording["command"].time >= SETTLE
        current = recording["current_ref"].values[late]
        error = (recording["command"].values - recording["output_position"].values)[late]
        rows.append(
            {
                "profile": shape,
                "load_n": load,
                "acceleration_m_s2": acceleration,
                "peak_current_a": round(float(np.max(np.abs(current))), 2),
                "rms_current_a": round(float(np.sqrt(np.mean(current**2))), 3),
                "tracking_max_mm": round(1e3 * float(np.max(np.abs(error))), 3),
            }
        )
    return rows
