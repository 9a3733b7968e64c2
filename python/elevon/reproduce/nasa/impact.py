"""The gap's impact on the load cell: the one claim of the paper about a profile and a fault."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain, key
from elevon.report.checks import Check
from elevon.reproduce.nasa.features import FEATURES, PEAK
from elevon.reproduce.nasa.profiles import MotionProfile, profile_scenario

Cells = Mapping[tuple[str, float], Mapping[str, Floats]]

GAP = "gap 0.5 mm"
GAP_FAULT = "adapter_gap@adapter=0.5 mm"
UNLOADED, LOADED = 0.0, 4500.0
"""N, opposing: where triangle and trapezoid are compared."""
COLUMN = FEATURES.index(PEAK)
LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Impact(Plain):
    """Excess of the load cell's peak under a gap over the healthy one, N, with its interval."""

    COMPUTED = ("interval_n",)

    profile: str
    load: Annotated[float, key("load_n")]
    excess: Annotated[float, key("excess_n")]
    low: Annotated[float, WORKING]
    high: Annotated[float, WORKING]

    @property
    def interval_n(self) -> tuple[float, float]:
        """Both ends."""
        return self.low, self.high


@dataclass(frozen=True, slots=True)
class ImpactTrace:
    """Load-cell force of the nominal actuator about a reversal."""

    profile: str
    load: float
    gap: bool
    time: Floats
    force: Floats


def _difference(healthy: Floats, faulty: Floats) -> tuple[float, float, float]:
    """Mean difference and its Welch interval."""
    from scipy.stats import ttest_ind

    interval = ttest_ind(faulty, healthy, equal_var=False).confidence_interval(LEVEL)
    return float(np.mean(faulty) - np.mean(healthy)), float(interval.low), float(interval.high)


def gap_impacts(cells: Cells) -> list[Impact]:
    """Return the gap's excess of every profile and load."""
    return [
        Impact(shape, load, *_difference(cell["healthy"][:, COLUMN], cell[GAP][:, COLUMN]))
        for (shape, load), cell in cells.items()
    ]


def impact_checks(cells: Cells) -> list[Check]:
    """Unloaded the triangle hits harder than the trapezoid (N 2.3), loaded the trapezoid.

    The units are the same in both profiles, so their differences are compared.
    """
    checks = []
    for load, stronger, weaker in (
        (UNLOADED, "triangular", "trapezoidal"),
        (LOADED, "trapezoidal", "triangular"),
    ):
        pair = [cells.get((shape, load), {}) for shape in (stronger, weaker)]
        if not all(GAP in cell for cell in pair):
            continue
        more = [pair[0][name][:, COLUMN] - pair[1][name][:, COLUMN] for name in ("healthy", GAP)]
        low = _difference(more[0], more[1])[1]
        name = f"gap at {load:g} N: impact, {stronger} less {weaker}, lower end of the interval"
        checks.append(Check(name, low, 0.0, "N", at_least=True))
    return checks


def gap_traces(actuator: Actuator) -> list[ImpactTrace]:
    """Return the load cell's force about the second reversal, with and without the gap."""
    from elevon.scenario import Scenario
    from elevon.simulate import Run, simulate_batch

    cases = [
        (shape, load, gap)
        for load in (UNLOADED, LOADED)
        for shape in ("triangular", "trapezoidal")
        for gap in (False, True)
    ]
    runs = []
    for shape, load, gap in cases:
        profile = MotionProfile(shape, 0.05, 0.06, 4.0)
        scenario = Scenario.from_dict(profile_scenario(profile, opposing=load))
        runs.append(Run(actuator, scenario.with_faults([GAP_FAULT]) if gap else scenario))
    recordings = simulate_batch(runs, fidelity="high", record="joint_force,command@4 kHz")
    traces = []
    for (shape, load, gap), recording in zip(cases, recordings, strict=True):
        time, command = recording["command"].time, recording["command"].values
        # The motion downwards begins where the command leaves its first peak.
        leaves = time[np.flatnonzero(command >= command.max() - 1e-9)[-1]]
        window = (time >= leaves - 0.05) & (time <= leaves + 0.15)
        force = recording["joint_force"].values[window]
        traces.append(ImpactTrace(shape, load, gap, time[window] - leaves, force))
    return traces
