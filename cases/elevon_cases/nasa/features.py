"""What a stand measures of one run, and which feature stands for which fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain, key
from elevon.recording import Recording
from elevon.report.checks import Check
from elevon_cases.nasa.profiles import MotionProfile, profile_scenario

RECORD = "motor_position,motor_speed,current_ref,joint_force@2 kHz"
SETTLE = 1.0
"""Statistics begin here [s]."""
RMS = "current reference, rms"
PEAK = "load cell, peak"
ORDERS = {
    "current reference, order 1": 1.0,
    "current reference, order 2": 2.0,
    "current reference, order 8": 8.0,
    "current reference, order 8.55": 8.552,
    "current reference, order 9": 9.0,
}
"""Lines of the current reference per motor turn: unbalance, channel mismatch, turn short, groove
spall, dynamic eccentricity (docs/explanation/theory/ballscrew.md)."""
FEATURES = (RMS, *ORDERS, PEAK)
UNITS = dict.fromkeys(FEATURES, "A") | {PEAK: "N"}
_ROOTED = np.array([name in ORDERS for name in FEATURES])
LEAST_SPEED = 10.0
LEAST_TURNS = 4.0


def features(recording: Recording) -> Floats:
    """Return every feature of one run in the order of `FEATURES`."""
    late = recording["current_ref"].time >= SETTLE
    value = {name: recording[name].values[late] for name in recording.names}
    lines = orders(
        value["motor_position"], value["motor_speed"], value["current_ref"], list(ORDERS.values())
    )
    rms = float(np.sqrt(np.mean(value["current_ref"] ** 2)))
    return np.array([rms, *lines, float(np.max(np.abs(value["joint_force"])))])


def compared(values: Floats) -> Floats:
    """Return the features in the scale in which groups are compared, shape (units, features).

    The amplitude of a line has no sign, so its scatter between healthy units leans to one side;
    that of its root is nearly normal, as the intervals want it.
    """
    return np.where(_ROOTED, np.sqrt(np.abs(values)), values)


def orders(angle: Floats, speed: Floats, signal: Floats, wanted: Sequence[float]) -> list[float]:
    """Return the amplitude of a signal at some orders of the shaft, median over the strokes.

    Parameters
    ----------
    angle, speed, signal : ndarray, shape (n,)
        rad, rad/s, any unit.
    wanted : sequence of float
        Lines per turn.

    Returns
    -------
    list of float
        Peak amplitudes in the signal's unit; NaN where no stroke is long enough.
    """
    moving = np.flatnonzero(np.abs(speed) > LEAST_SPEED)
    strokes = np.split(moving, np.flatnonzero(np.diff(moving) > 1) + 1)
    levels = [
        _stroke_orders(angle[stroke], signal[stroke], wanted)
        for stroke in strokes
        if stroke.size > 2 and abs(angle[stroke[-1]] - angle[stroke[0]]) > 2 * np.pi * LEAST_TURNS
    ]
    if not levels:
        return [float("nan")] * len(wanted)
    return [float(x) for x in np.median(np.array(levels), axis=0)]


def _stroke_orders(angle: Floats, signal: Floats, wanted: Sequence[float]) -> list[float]:
    """Least squares over one stroke: a slow cubic trend and a windowed line at each order."""
    turned = np.abs(angle - angle[0])
    # The first and the last turn hold the reversal's transient.
    inner = (turned > 2 * np.pi) & (turned < turned[-1] - 2 * np.pi)
    grid = np.linspace(turned[inner][0], turned[inner][-1], int(inner.sum()))
    rising = np.concatenate([[True], np.diff(turned) > 0])
    line = np.interp(grid, turned[rising], signal[rising])
    scaled = (grid - grid.mean()) / np.ptp(grid)
    line = line - np.polyval(np.polyfit(scaled, line, 3), scaled)
    window = np.hanning(grid.size)
    weight = 2.0 / window.sum()
    return [float(abs(np.sum(window * line * np.exp(-1j * k * grid))) * weight) for k in wanted]


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
