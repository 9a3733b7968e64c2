"""What each fault changes in the high and in the low fidelity model.

A fault is looked for in a few features that a bench sees: the level and the ripple of the
quadrature current and voltage, the ripple of the speed, the position error, the lost motion. Each
fault is shown in the feature in which the switching model's change stands highest above its floor:
the change that the same switching model shows when nothing but its step differs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.compare import RATES, compared_rate, filtered
from elevon.data import read_table
from elevon.errors import InputError, SimulationError
from elevon.faults import Fault, find_record
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.scenario import Scenario

ROTARY_FAULTS = tuple(row["fault"] for row in read_table("fault_sensitivity"))
"""One severity of each line of the catalogue (ASSUMED, see the table)."""

RECORD = (
    "command,output_position,encoder_position,motor_position,motor_speed,current_q,voltage_q_meas"
)
SLOW_HZ, FAST_HZ = 2.0, 50.0
"""A feature's level is below the first cut-off, its ripple between the two."""
FLOORS = 3.0
"""A change smaller than this many floors is not seen."""


@dataclass(frozen=True, slots=True)
class Sensitivity(Plain):
    """One fault: the change it makes in one feature.

    Attributes
    ----------
    fault, feature : str
        The fault as written; the feature and its unit.
    high, low : float
        Faulty less healthy; NaN for a model that does not have the fault.
    floor : float
        Change of the healthy switching model when only its step differs.
    reason : str
        Why the reduced-order model cannot have the fault, from the catalogue; else empty.
    """

    COMPUTED = ("ratio", "verdict")

    fault: str
    feature: str
    high: float
    low: float
    floor: float
    reason: Annotated[str, WORKING] = ""

    @property
    def ratio(self) -> float:
        """Low over high."""
        return self.low / self.high if self.high != 0.0 else math.nan

    @property
    def verdict(self) -> str:
        """What the two changes say, in words."""
        if self.reason:
            return self.reason
        if abs(self.high) <= FLOORS * self.floor:
            return "not seen by the switching model in this scenario"
        if self.ratio >= 0.5:
            return "seen by both"
        if abs(self.ratio) < 1e-6:
            return "not in the reduced-order model: only the ripple of relays changes"
        return (
            "wrong sign in the reduced-order model"
            if self.ratio < 0.0
            else "too weak in the reduced-order model"
        )


def fault_sensitivity(
    actuator: Actuator,
    scenario: Scenario,
    *,
    faults: Sequence[str] | None = None,
    start: float = 10.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> list[Sensitivity]:
    """Run healthy and faulty, at both fidelities, and compare the changes.

    Parameters
    ----------
    actuator : Actuator
        What breaks.
    scenario : Scenario
        What it is asked; its own faults are in every run.
    faults : sequence of str, optional
        Faults in the grammar of the command line; by default one of each kind.
    start : float
        What came before is left out [s].
    seed : int
        Of every run.
    progress : callable, optional
        As for `simulate_batch`.

    Returns
    -------
    list of Sensitivity
        In the order of the faults.

    Raises
    ------
    InputError
        The scenario ends before `start`, or as `simulate_batch`.
    """
    if scenario.seconds <= start:
        raise InputError(f"faults: the scenario lasts {scenario.seconds:g} s, not over {start:g} s")
    from elevon.simulate.acting import together

    parsed = [Fault.parse(text) for text in _default(actuator, faults)]
    in_low = [fault for fault in parsed if _low_has(actuator.wiring, fault)]
    other_step = actuator.with_values(
        {"solver.step": 0.5 * actuator.parameters.value("solver.step")}
    )
    spans = [part(progress, *span) for span in ((0.0, 0.05), (0.05, 0.95), (0.95, 1.0))]
    run = _Runner(actuator, scenario, start, seed)
    every = [(scenario, name) for name in RATES]
    every += [(scenario.with_faults([fault]), "high") for fault in parsed]
    every += [(scenario.with_faults([fault]), "low") for fault in in_low]
    with together((actuator, case_scenario, fidelity) for case_scenario, fidelity in every):
        return _rows(run, other_step, parsed, in_low, spans)


def _rows(
    run: _Runner,
    other_step: Actuator,
    parsed: Sequence[Fault],
    in_low: Sequence[Fault],
    spans: Sequence[Progress | None],
) -> list[Sensitivity]:
    floor_run = replace(run, actuator=other_step)([], "high", spans[0])[0]
    healthy, *broken = run(parsed, "high", spans[1])
    healthy_low, *broken_low = run(in_low, "low", spans[2])
    low = dict(zip((str(fault) for fault in in_low), broken_low, strict=True))
    floors = {name: abs(floor_run[name] - value) for name, value in healthy.items()}
    return [
        _strongest(
            str(fault),
            (healthy, features_broken),
            (healthy_low, low.get(str(fault))),
            floors,
            find_record(fault.kind, fault.place, run.actuator.wiring).not_modelled.get("low", ""),
        )
        for fault, features_broken in zip(parsed, broken, strict=True)
    ]


@dataclass(frozen=True)
class _Runner:
    """Runs the healthy actuator and a list of faults; returns the features of each."""

    actuator: Actuator
    scenario: Scenario
    start: float
    seed: int

    def __call__(
        self, faults: Sequence[Fault], fidelity: str, progress: Progress | None
    ) -> list[dict[str, float]]:
        from elevon.simulate import Run, simulate_batch

        scenarios = [self.scenario, *(self.scenario.with_faults([fault]) for fault in faults)]
        labels = ["healthy", *(str(fault) for fault in faults)]
        runs = [
            Run(self.actuator, item, self.seed, label)
            for item, label in zip(scenarios, labels, strict=True)
        ]
        record = f"{RECORD}@{compared_rate(self.actuator, fidelity)}"
        recordings = simulate_batch(runs, fidelity=fidelity, record=record, progress=progress)
        ratio = self.actuator.parameters.value("gear.ratio")
        return [features(recording, ratio, self.start) for recording in recordings]


def features(recording: Recording, ratio: float, start: float) -> dict[str, float]:
    """Return the features of one run, by name with unit.

    Parameters
    ----------
    recording : Recording
        With the signals of `RECORD`.
    ratio : float
        Gear ratio.
    start : float
        What came before is left out [s].

    Returns
    -------
    dict
        Of a run that tripped, only ``drive tripped [1]`` is not NaN.

    Raises
    ------
    SimulationError
        The run diverged.
    """
    if recording.status == "diverged":
        raise SimulationError(f"{recording.meta['label']}: {recording.meta['message']}")
    tripped = recording.status == "tripped"
    grid = np.arange(start, max(float(recording.clock().time[-1]), start + 0.01), 1.0 / 400.0)

    def value(name: str) -> Floats:
        return np.asarray(np.interp(grid, recording[name].time, recording[name].values))

    values = {}
    for name, label, unit in (
        ("current_q", "q current", "A"),
        ("voltage_q_meas", "q voltage", "V"),
        ("motor_speed", "speed", "rad/s"),
    ):
        slow, fast = (filtered(recording, name, grid, hertz) for hertz in (SLOW_HZ, FAST_HZ))
        values[f"{label}, mean size [{unit}]"] = float(np.mean(np.abs(slow)))
        values[f"{label}, ripple [{unit}]"] = float(np.std(fast - slow))
    error = np.degrees(value("command") - value("encoder_position"))
    values["position error, RMS [deg]"] = float(np.sqrt(np.mean(error**2)))
    lost = np.degrees(value("motor_position") / ratio - value("encoder_position"))
    values["lost motion [deg]"] = float(np.ptp(lost))
    if tripped:
        values = dict.fromkeys(values, math.nan)
    return values | {"drive tripped [1]": float(tripped)}


def _low_has(wiring: str, fault: Fault) -> bool:
    return "low" in find_record(fault.kind, fault.place, wiring).fidelities


def _default(actuator: Actuator, faults: Sequence[str] | None) -> Sequence[str]:
    if faults is not None:
        return faults
    if actuator.wiring != "rotary":
        raise InputError(f"faults: name them; there is no default list for {actuator.wiring!r}")
    from elevon.simulate.acting import own_faults

    # One that changes nothing in this actuator is refused as a run.
    acting = {(record.kind, place) for record in own_faults(actuator) for place in record.places}
    parsed = {text: Fault.parse(text) for text in ROTARY_FAULTS}
    return [text for text, fault in parsed.items() if (fault.kind, fault.place) in acting]


def _strongest(
    fault: str,
    high: tuple[Mapping[str, float], Mapping[str, float]],
    low: tuple[Mapping[str, float], Mapping[str, float] | None],
    floors: Mapping[str, float],
    not_modelled: str,
) -> Sensitivity:
    """Choose the feature in which the switching model's change stands highest above the floor."""
    changes = {name: high[1][name] - value for name, value in high[0].items()}
    smallest = {name: max(floor, 1e-3 * abs(high[0][name])) for name, floor in floors.items()}

    def height(name: str) -> float:
        size = abs(changes[name]) / max(smallest[name], 1e-12)
        return -1.0 if math.isnan(size) else size

    name = max(changes, key=height)
    if low[1] is None:
        reason = f"not in the reduced-order model: {not_modelled}"
        return Sensitivity(fault, name, changes[name], math.nan, floors[name], reason)
    return Sensitivity(fault, name, changes[name], low[1][name] - low[0][name], floors[name])
