"""Many runs of one actuator in one batch: the healthy one and every variant of it.

A cell is a shipped actuator file at one fidelity, with some choices made otherwise and a load on
its output. Its variants go through the core together, in batches, so that a suite over every fault
and every parameter costs seconds; that a batch changes no bit is the contract of `test_actuators`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

import elevon
from elevon.errors import ElevonWarning, NotActingWarning
from elevon.parameters import records
from elevon.simulate.prepare import prepare
from tests.contract import shipped

Values = Mapping[str, Any]
#: Parameters that are choices, and what is chosen.
Choices = tuple[tuple[str, str], ...]
RATE = "1 kHz"


@dataclass(frozen=True)
class Variant:
    """What differs from the cell's healthy run."""

    name: str = "healthy"
    values: Values = field(default_factory=dict)
    faults: tuple[Values, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """One run: its status, every signal (severities apart), and what the labels state."""

    status: str
    message: str
    signals: Mapping[str, np.ndarray]
    severity: np.ndarray
    time: np.ndarray

    def differs(self, other: Outcome) -> list[str]:
        """Signals in which two runs are not the same to the bit; the status is one of them."""
        if self.status != other.status:
            return ["status"]
        return [
            name
            for name, values in self.signals.items()
            if values.tobytes() != other.signals[name].tobytes()
        ]


@dataclass(frozen=True)
class Cell:
    """An actuator at one fidelity, in one drive, under one load (SI, at its output).

    It swings, or with `onwards` it moves in the positive direction only, up to its stops; with
    `whole` it does what its actuator file does by default, under a supply so many times its own.
    """

    name: str
    fidelity: str
    choices: Choices = ()
    load: float = 0.0
    onwards: bool = False
    whole: float = 0.0

    @property
    def title(self) -> str:
        """The cell's name in the list of tests."""
        chosen = [f"{path.rpartition('.')[2]}={choice}" for path, choice in self.choices]
        push = [] if self.load == 0.0 else ["opposing" if self.load > 0.0 else "aiding"]
        return "-".join([self.name, self.fidelity, *chosen, *push])

    def actuator(self, values: Values | None = None) -> Any:
        """The actuator of this cell with some values changed."""
        chosen = shipped.actuator(self.name).with_values(dict(self.choices), request=False)
        return chosen.with_values(values or {})

    def scenario(
        self,
        faults: Sequence[Values] = (),
        duration: float | None = None,
        given: Sequence[str] = (),
    ) -> Any:
        """The short motion in which everything moves, under the cell's load.

        What the motion itself sets of the parameters `given` is left to theirs.
        """
        data = shipped.onwards(self.name) if self.onwards else shipped.motion(self.name)
        if self.whole:
            data = shipped.default(self.name, self.whole)
        initial = data.get("parameters", {})
        data["parameters"] = {path: value for path, value in initial.items() if path not in given}
        if self.load:
            data["load"] = {"output": {"terms": [{"kind": "constant", "value": self.load}]}}
            # A gear of several bodies starts amid its backlashes.
            pressed = {} if "gear.model" in given else self._pressed()
            data["initial"] = {**pressed, **data.get("initial", {})}
        if duration is not None:
            data["duration"] = duration
        return elevon.Scenario.from_dict({**data, "fault": list(faults)})

    def _pressed(self) -> dict[str, float]:
        """Where the load presses the parts together: no run begins with a crossing."""
        chosen = self.actuator().parameters
        if "backlash.total" not in chosen:
            return {}
        half = 0.5 * chosen.value("backlash.total")
        return {"motor_position": 0.0, "output_position": -half if self.load > 0 else half}

    def of(self, variant: Variant, duration: float | None = None) -> Any:
        """The run of a variant."""
        scenario = self.scenario(variant.faults, duration, tuple(variant.values))
        return elevon.Run(self.actuator(variant.values), scenario, 5, variant.name)

    def run(self, variants: Sequence[Variant], duration: float | None = None) -> list[Outcome]:
        """Every variant's outcome, from one batch; what has no effect is no matter here."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ElevonWarning)
            recordings = elevon.simulate_batch(
                [self.of(item, duration) for item in variants],
                fidelity=self.fidelity,
                record=f"all@{RATE}",
                threads=1,
            )
        return [_outcome(recording) for recording in recordings]

    def refused(self, variant: Variant) -> str:
        """Why the variant cannot run; empty: it can."""
        try:
            prepare(self.of(variant), self.fidelity, f"all@{RATE}")
        except elevon.InputError as error:
            return str(error)
        return ""

    def resting(self, variant: Variant) -> list[str]:
        """What the variant sets and the program says has no effect."""
        prepared = prepare(self.of(variant), self.fidelity, f"all@{RATE}")
        return [item.text for item in prepared.notices if item.category is NotActingWarning]

    def faults(self) -> list[tuple[str, str, dict[str, Any]]]:
        """Kind, place and record of every fault that this fidelity carries."""
        return [
            item for item in shipped.places(self.name) if self.fidelity in item[2]["fidelities"]
        ]


def _outcome(recording: Any) -> Outcome:
    channels = {channel.name: channel.values for channel in recording.channels}
    severity = channels.pop("fault_1", np.zeros(0))
    return Outcome(
        recording.status,
        recording.meta["message"],
        channels,
        severity,
        recording.channels[0].time,
    )


def fault(
    kind: str, place: str, record: Values, severity: float, profile: Values | None = None
) -> Values:
    """A fault with its obligatory attributes at zero."""
    needed = {a["name"]: 0.0 for a in record["attributes"] if a["default"] is None}
    counted = math.ceil(severity) if record["whole"] and math.isfinite(severity) else severity
    given = {"kind": kind, "place": place, "severity": counted, **needed}
    return given | {"profile": profile} if profile else dict(given)


def severe(record: Values) -> float:
    """A severity well inside the range but far from healthy."""
    top = record["maximum"]
    if record["unit"] in ("", "1", None) and top in (0.0, 1.0):
        return 1.0
    return min(0.5 * top, 1.0) if top > 0 else 0.5 * record["minimum"]


@cache
def drives(name: str) -> list[Choices]:
    """Own drive of an actuator file, then each other choice of each choice of the group ``drive``.

    A choice under which the set does not move (no drive) can show no fault.
    """
    actuator = shipped.actuator(name)
    others = [
        ((path, choice),)
        for path, record in records(actuator.wiring).items()
        for choice in record.choices or ()
        if path.startswith("drive.") and choice != actuator.parameters[path].value
    ]
    return [(), *(choices for choices in others if _moves(name, choices))]


def _moves(name: str, choices: Choices) -> bool:
    ways = []
    for chosen in ((), choices):
        cell = Cell(name, "low", chosen)
        if cell.refused(Variant()):
            return False
        ways.append(float(np.ptp(cell.run([Variant()])[0].signals["output_position"])))
    return ways[1] > 0.5 * ways[0]


@cache
def load(name: str) -> float:
    """A load at the output that the set feels and still moves, SI: searched by the reduced-order
    model.

    The largest power of two that leaves the way gone within 5 % of that under the smallest one, so
    that no actuator's strength stands here by hand. Any force takes the lost motion away.
    """
    powers = [2.0**k for k in range(-4, 17)]
    loads = [*powers, *(-force for force in powers)]
    ways = {}
    for force in loads:
        cell = Cell(name, "low", load=force)
        outcome = cell.run([Variant()])[0]
        way = outcome.signals["output_position"]
        ways[force] = np.max(np.abs(way - way[0])) if outcome.status == "ok" else 0.0
    felt = [
        force
        for force in powers
        if all(
            abs(ways[sign * force] / ways[sign * powers[0]] - 1.0) < 0.05 for sign in (1.0, -1.0)
        )
    ]
    return max(felt)
