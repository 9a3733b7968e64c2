"""The procedure of the paper's thermal fit (N 3.3) on a bench whose thermal values are hidden.

The paper fits its network to one hour on the sub-scale DEMA stand: it measures surface, nut and
air, averages over 1 s, and reports an error of the surface of 0.84 K at most and 0.42 K rms; it
prints neither the temperatures nor the parameters. So what can be checked is the procedure: a bench
with hidden values about those of the actuator file ``nasa-dema`` is measured in the same way, and
the fit has to recover them. The air warms meanwhile; the model is given what its thermocouple says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.report.checks import Check
from elevon_cases.nasa.profiles import MotionProfile, profile_scenario

DEMA = "nasa-dema"
"""The set: what of the small actuator is printed, and what is ASSUMED and why."""
LOW_STEP = {"low.step": 2e-3}
"""s; an hour of a closed position loop needs no finer one."""
FITTED = (
    "thermal.winding_to_surface",
    "thermal.housing_capacity",
    "thermal.convection",
    "screw.nut_capacity",
    "screw.nut_to_air",
)
SPREAD = 0.2
"""Hidden values differ from the actuator file's by a factor of this deviation (logarithm)."""
NOISE = 0.15
"""Of a thermocouple averaged over 1 s [K] (ASSUMED)."""
LOADS = (1000.0, 3000.0, 0.0, 4000.0)
"""N, a quarter of an hour each."""
HOUR = 3600.0
PRINTED = (0.84, 0.42)
"""K, largest and rms error of the surface (N 3.3)."""
AIR = ((0.0, 0.0), (600.0, 0.6), (1500.0, 0.9), (2400.0, 2.4), (3000.0, 2.8), (3600.0, 2.6))
"""s, K: how the laboratory's air warms over the hour (ASSUMED; Fig. 10 draws the paper's)."""
AIR_MEANS = 60.0
"""s over which the measured air is averaged before the model is given it."""
STEP = 0.02
ROUNDS = 3
RECORD = "surface_temperature,nut_temperature,winding_temperature@1 Hz"


@dataclass(frozen=True, slots=True)
class FitRow(Plain):
    """A hidden value and what the fit recovered, SI; the interval is that of surface and nut alone.

    What the air's thermocouple adds is not in it.
    """

    COMPUTED = ("interval",)

    parameter: str
    put_in: float
    recovered: float
    low: Annotated[float, WORKING]
    high: Annotated[float, WORKING]

    @property
    def interval(self) -> tuple[float, float]:
        """Both ends."""
        return self.low, self.high


@dataclass(frozen=True)
class DemaFit:
    """The hour as measured and as fitted, K; the winding is never measured.

    Attributes
    ----------
    rows : list of FitRow
        What was fitted.
    time : ndarray, shape (n,)
        s.
    measured, fitted : ndarray, shape (2, n) and (3, n)
        Surface and nut; and the winding.
    air : ndarray, shape (n,)
        As measured.
    steady : ndarray, shape (3, n)
        What the fitted values give if the air stays as it was at first.
    """

    rows: list[FitRow]
    time: Floats
    measured: Floats
    fitted: Floats
    air: Floats
    steady: Floats
    checks: list[Check]
    parameter_hash: str


def fit_dema(seed: int = 0, progress: Progress | None = None) -> DemaFit:
    """Measure a bench with hidden values for an hour and recover them.

    Parameters
    ----------
    seed : int
        Of the hidden values and of the thermocouples.
    progress : callable, optional
        As for `simulate_batch`.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    rng = np.random.default_rng([seed, 3])
    dema = Actuator.load(DEMA)
    nominal = dema.with_values(LOW_STEP)
    first = np.log([nominal.parameters.value(path) for path in FITTED])
    hidden = first + SPREAD * np.clip(rng.standard_normal(len(FITTED)), -2.0, 2.0)
    ambient = nominal.parameters.value("thermal.ambient")
    air = (np.array([time for time, _ in AIR]), ambient + np.array([rise for _, rise in AIR]))
    truth = _hours(nominal, [hidden], air, part(progress, 0.0, 0.1))[0]
    measured = truth[:2] + NOISE * rng.standard_normal(truth[:2].shape)
    seconds = np.arange(measured.shape[1], dtype=float)
    felt = np.interp(seconds, *air) + NOISE * rng.standard_normal(seconds.shape)
    known = _averaged(seconds, felt)
    logarithms = first
    for round_ in range(ROUNDS):
        span = part(progress, 0.1 + 0.27 * round_, 0.37 + 0.27 * round_)
        shifted = [logarithms, *(logarithms + STEP * row for row in np.eye(len(FITTED)))]
        runs = _hours(nominal, shifted, known, span)
        slopes = np.array([(run[:2] - runs[0][:2]).ravel() / STEP for run in runs[1:]]).T
        residual = (measured - runs[0][:2]).ravel()
        logarithms = logarithms + np.linalg.lstsq(slopes, residual, rcond=None)[0]
    variance = float(residual @ residual) / (residual.size - len(FITTED))
    deviation = np.sqrt(np.diag(variance * np.linalg.inv(slopes.T @ slopes)))
    rows = [
        FitRow(path, *(float(np.exp(x)) for x in (h, f, f - 1.96 * d, f + 1.96 * d)))
        for path, h, f, d in zip(FITTED, hidden, logarithms, deviation, strict=True)
    ]
    constant = (known[0][:1], known[1][:1])
    steady = _hours(nominal, [logarithms], constant, part(progress, 0.91, 1.0))[0]
    checks = _checks(rows, measured, (runs[0], steady), truth)
    return DemaFit(rows, seconds, measured, runs[0], felt, steady, checks, dema.parameters.hash)


def _averaged(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return middles and means of stretches of `AIR_MEANS`."""
    count = len(time) // int(AIR_MEANS)
    size = count * int(AIR_MEANS)
    return (time[:size].reshape(count, -1).mean(axis=1),
            values[:size].reshape(count, -1).mean(axis=1))  # fmt: skip


def _hours(
    nominal: Actuator,
    values: Sequence[Floats],
    air: tuple[Floats, Floats],
    progress: Progress | None,
) -> list[Floats]:
    """Surface, nut and winding [K] of an hour at 1 Hz under each set of logarithms.

    `air` has instants [s] and temperatures [K]; of a single instant the air stays.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    data = profile_scenario(MotionProfile("sinusoidal", 0.05, 0.06, HOUR))
    steps = [
        {"kind": "step", "final": after - before, "time": (i + 1) * HOUR / len(LOADS)}
        for i, (before, after) in enumerate(pairwise(LOADS))
    ]
    terms = [{"kind": "constant", "value": LOADS[0]}, *steps]
    data["load"] = {"output": {"terms": terms}}
    warm: dict[str, Any] = {"kind": "constant", "value": float(air[1][0])}
    if len(air[0]) > 1:
        warm = {"kind": "table", "times": air[0].tolist(), "values": air[1].tolist()}
    data["ambient"] = {"terms": [warm]}
    scenario = Scenario.from_dict(data)
    runs = [Run(nominal.with_values(_named(v)), scenario, label="thermal hour") for v in values]
    recordings = simulate_batch(runs, fidelity="low", record=RECORD, progress=progress)
    return [
        np.stack([recording[name].values for name in recording.names])
        for recording in completed(recordings, "thermal hour")
    ]


def _named(logarithms: Floats) -> Mapping[str, float]:
    return {path: float(np.exp(x)) for path, x in zip(FITTED, logarithms, strict=True)}


def _checks(
    rows: Sequence[FitRow], measured: Floats, runs: tuple[Floats, Floats], truth: Floats
) -> list[Check]:
    """The paper's two figures, and that they would not be kept if the air's rise were left out."""
    fitted, steady = runs
    error, without = measured[0] - fitted[0], measured[0] - steady[0]
    worst = max(abs(row.recovered / row.put_in - 1.0) for row in rows)
    winding = float(np.max(np.abs(fitted[2] - truth[2])))
    return [
        Check("fit of a hidden bench: largest error of the surface", float(np.abs(error).max()),
              PRINTED[0], "K"),
        Check("fit of a hidden bench: rms error of the surface",
              float(np.sqrt(np.mean(error**2))), PRINTED[1], "K"),
        Check("fit of a hidden bench: the same with the air as it was at first",
              float(np.abs(without).max()), PRINTED[0], "K", at_least=True),
        Check("fit of a hidden bench: largest error of a recovered value", 100.0 * worst, 5.0, "%"),
        Check("fit of a hidden bench: winding, which is not measured", winding, 1.0, "K"),
    ]  # fmt: skip
