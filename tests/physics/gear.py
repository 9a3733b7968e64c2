"""Short words for the landing-gear tests."""

from __future__ import annotations

from functools import cache
from typing import Any

import elevon

NAME = "pisa-landing-gear"
EXTENDED = "267 mm"

loaded = cache(elevon.Actuator.load)


def gear(
    *steps: tuple[float, str],
    duration: float,
    record: str = "all@1 kHz",
    start: str | float | None = None,
    fidelity: str = "low",
    faults: list[Any] | None = None,
    values: dict[str, Any] | None = None,
    load: dict[str, Any] | None = None,
) -> Any:
    """Run the gear; each step is a time and an action."""
    run = gear_run(*steps, duration=duration, start=start, faults=faults, values=values, load=load)
    return elevon.simulate(run.actuator, run.scenario, fidelity=fidelity, record=[record])


def gear_run(
    *steps: tuple[float, str],
    duration: float,
    start: str | float | None = None,
    faults: list[Any] | None = None,
    values: dict[str, Any] | None = None,
    load: dict[str, Any] | None = None,
) -> elevon.Run:
    """One run of a batch; each step is a time and an action."""
    data: dict[str, Any] = {
        "duration": duration,
        "command": {"mode": "gear", "steps": [{"time": t, "action": a} for t, a in steps]},
        "parameters": values or {},
        "fault": faults or [],
        "load": load or {},
    }
    if start is not None:
        data["initial"] = {"nut_position": start}
    return elevon.Run(loaded(NAME), elevon.Scenario.from_dict(data))


def gears(runs: list[elevon.Run], fidelity: str = "low") -> list[Any]:
    """Run gears side by side: a quarter of the time of one after the other."""
    record = "state,locked,nut_position,current_line@1 kHz"
    return elevon.simulate_batch(runs, fidelity=fidelity, record=[record])


def states(rec: Any) -> list[int]:
    """The states the control unit went through."""
    found: list[int] = []
    for value in rec["state"].values:
        if not found or found[-1] != int(value):
            found.append(int(value))
    return found


def value(path: str) -> float:
    """A number of the actuator file, SI."""
    return float(loaded(NAME).parameters.value(path))
