"""The comparison of both fidelities repeated under loads that oppose and aid the motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.compare import Comparison, compare, default_scenario, default_start
from elevon.errors import InputError, SimulationError
from elevon.progress import Progress, part
from elevon.scenario import Scenario

LOADS = {"as given": 0.0, "opposing": 1.0, "aiding": -1.0}
"""Name of each run and the sign of its load along the motion."""
_RATE = 200.0  # Hz of the load's table
_AT_REST = 0.05
"""Share of the greatest speed below which the load fades: the direction of rest is none."""


def compare_loads(
    actuator: Actuator,
    scenario: Scenario | None = None,
    *,
    load: str | float | None = None,
    seed: int = 0,
    start: float | None = None,
    cutoff: float = 10.0,
    progress: Progress | None = None,
) -> dict[str, Comparison]:
    """Compare both fidelities on a scenario as it is, and with a load against and along its motion.

    The load acts on the output. Its direction is that of the motion without it (reduced-order
    model); it fades out below 5 % of the greatest speed.

    Parameters
    ----------
    load : quantity, optional
        Size of the load [N or N m at the output]; default the actuator file's ``[compare]``.
    actuator, scenario, seed, start, cutoff, progress
        As for `elevon.compare.compare`.

    Returns
    -------
    dict of str to Comparison
        ``as given``, ``opposing``, ``aiding``.

    Raises
    ------
    InputError, SimulationError
        As `compare`; nothing says how large the load is.
    """
    default = scenario is None
    base = default_scenario(actuator) if scenario is None else scenario
    start = default_start(actuator, base, default=default) if start is None else start
    size = load_size(actuator, load)
    times, direction = _direction(actuator, base, seed)
    results = {}
    for number, (name, sign) in enumerate(LOADS.items()):
        loaded = base if sign == 0.0 else _loaded(base, times, sign * size * direction)
        share = part(progress, number / len(LOADS), (number + 1) / len(LOADS))
        results[name] = compare(
            actuator, loaded, seed=seed, start=start, cutoff=cutoff, progress=share
        )
    return results


def load_size(actuator: Actuator, load: str | float | None = None) -> float:
    """Return the size of the load [N or N m]: as given, else as the actuator file says."""
    from elevon import _core
    from elevon.units import parse_quantity

    given = (actuator.compare or {}).get("load") if load is None else load
    if given is None:
        raise InputError(
            f"{actuator.name}: its set has no [compare] load; give one with --load, such as '500 N'"
        )
    unit = next(port["unit"] for port in _core.ports(actuator.wiring) if port["name"] == "output")
    size = parse_quantity(given, unit, "load")
    if size <= 0.0:
        raise InputError(f"load = {given} must be above 0")
    return size


def _direction(actuator: Actuator, scenario: Scenario, seed: int) -> tuple[Any, Any]:
    """Direction of the motion over time, between -1 and 1."""
    from elevon.simulate import simulate

    run = simulate(actuator, scenario, fidelity="low", record="output_speed@every", seed=seed)
    if run.status != "ok":
        raise SimulationError(f"compare: the motion ended as {run.status}", run.status)
    speed = run["output_speed"]
    times = np.arange(0.0, scenario.seconds, 1.0 / _RATE)
    values = np.interp(times, speed.time, speed.values)
    return times, np.tanh(values / (_AT_REST * max(float(np.abs(values).max()), 1e-12)))


def _loaded(scenario: Scenario, times: Any, values: Any) -> Scenario:
    """Return the scenario with one more load at the output."""
    data = scenario.to_dict()
    term = {"kind": "table", "times": times.tolist(), "values": values.tolist()}
    load = dict(data.get("load", {}))
    terms = list(load.get("output", {}).get("terms", []))
    return scenario.replaced(load={**load, "output": {"terms": [*terms, term]}})
