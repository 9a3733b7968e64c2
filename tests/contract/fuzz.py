"""Runs with numbers nobody would choose, drawn from the core's records: every parameter, every
fault, every waveform and every profile of every shipped actuator.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

import elevon
from elevon import _core
from elevon.simulate.prepare import prepare_named, solver_step
from tests.contract import shipped

#: Steps of a run: enough for control ticks, fault edges and several samples.
STEPS = 1200
#: Steps between two samples.
EVERY = 40
EXTREMES = (0.0, 5e-324, 1e-300, 1e-12, 1e-3, 1.0, 1e3, 1e6, 1e12, 1e50, 1e300, 1.7e308)
NUMBERS = tuple(sign * value for value in EXTREMES for sign in (1.0, -1.0))
NO_NUMBERS = (math.nan, math.inf, -math.inf)


@cache
def loaded(name: str) -> elevon.Actuator:
    """A shipped actuator file, read once."""
    return elevon.Actuator.load(name)


@cache
def takes_actions(name: str) -> bool:
    """Is the actuator commanded by actions?"""
    return shipped.takes_actions(name)


@dataclass(frozen=True)
class Case:
    """One run: an actuator at a fidelity with some of its numbers replaced."""

    name: str
    fidelity: str
    parameters: dict[str, Any] = field(default_factory=dict)
    faults: tuple[dict[str, Any], ...] = ()
    command: dict[str, Any] | None = None
    duration: float | None = None

    def __str__(self) -> str:
        changed = {**self.parameters, "fault": self.faults, "command": self.command}
        return f"{self.name} {self.fidelity}: { {k: v for k, v in changed.items() if v} }"

    def run(self) -> elevon.Run:
        """The run of this case; raises `InputError` where it cannot be."""
        actuator = loaded(self.name).with_values(self.parameters)
        duration = self.duration or STEPS * solver_step(actuator, self.fidelity)
        data: dict[str, Any] = {"duration": duration, "fault": list(self.faults)}
        data["command"] = self.command or default_command(self.name)
        return elevon.Run(actuator, elevon.Scenario.from_dict(data), seed=7)

    def record(self) -> str:
        """All signals, at a rate that every step of this actuator divides."""
        actuator = loaded(self.name).with_values(self.parameters)
        return f"all@{1.0 / (EVERY * solver_step(actuator, self.fidelity))!r} Hz"


def default_command(name: str) -> dict[str, Any]:
    """Something that moves from the start on."""
    if takes_actions(name):
        return {"mode": "gear", "steps": [shipped.step(0.0, "extend")]}
    return {"mode": "position", "terms": [{"kind": "step", "final": 0.02}]}


def outcome(case: Case, healthy: Sequence[elevon.Recording]) -> str:
    """What became of a case: ``refused``, or the status of its run; raises on anything unclear.

    The healthy run beside it in the batch must have the bits of `healthy`, which ran without it.
    """
    try:
        run = case.run()
        prepare_named(run, case.fidelity, case.record(), named=False)
        good = Case(case.name, case.fidelity).run()
        record = Case(case.name, case.fidelity).record()
        batch = simulate([good, run], case, record)
    except elevon.InputError as error:
        if not str(error).strip():
            raise AssertionError(f"{case}: refused without a word") from error
        return "refused"
    batch_record, recording = batch
    assert same(batch_record, healthy[0]), f"{case}: its neighbour is not what it is alone"
    status = str(recording.meta["status"])
    message = str(recording.meta.get("message", ""))
    assert "panicked" not in message, f"{case}: {message}"
    assert status in {"ok", "tripped", "diverged"}, f"{case}: {status}"
    if status == "diverged":
        assert message, case
    for signal in recording.names:
        values = recording[signal].values
        assert np.all(np.isfinite(values)), f"{case}: {status}, yet {signal} has {values}"
        if status != "diverged":
            assert math.isfinite(recording.final.get(signal, 0.0)), f"{case}: {status}, {signal}"
    return status


def simulate(runs: list[elevon.Run], case: Case, record: str) -> list[elevon.Recording]:
    """Run a batch; where a step is not the healthy one, each run for itself with its own rate."""
    single_record = case.record()
    if single_record == record:
        return elevon.simulate_batch(runs, fidelity=case.fidelity, record=record)
    single = [(runs[0], record), (runs[1], single_record)]
    return [
        elevon.simulate_batch([run], fidelity=case.fidelity, record=rate)[0] for run, rate in single
    ]


def same(one: elevon.Recording, other: elevon.Recording) -> bool:
    """Equal in every bit of every channel."""
    return one.names == other.names and all(
        np.array_equal(one[name].values, other[name].values) for name in one.names
    )


def values(record: dict[str, Any]) -> list[Any]:
    """What to try of one parameter: extremes, its own limits, both sides of its default."""
    if record["choices"]:
        return [*record["choices"], "none of them"]
    limits = [x for x in (record["minimum"], record["maximum"]) if math.isfinite(x)]
    usual = record["default"] or 1.0
    near = [factor * usual for factor in (-1.0, 1e-3, 0.5, 2.0, 1e3)]
    return list(dict.fromkeys([*NUMBERS, *NO_NUMBERS, *limits, *near]))


def parameter_cases() -> Iterator[Case]:
    """Every parameter at every value, alone."""
    for name, fidelity in actuators():
        for record in _core.parameters(loaded(name).wiring):
            for value in values(record):
                yield Case(name, fidelity, {record["path"]: value})


def fault_cases() -> Iterator[Case]:
    """Every fault at every place: severities, attributes and profiles at their extremes."""
    for name, fidelity in actuators():
        for record in _core.faults(loaded(name).wiring):
            if fidelity in record["fidelities"]:
                for place in record["places"]:
                    for fault in faults(record, place):
                        yield Case(name, fidelity, faults=(fault,))


def faults(record: dict[str, Any], place: str) -> Iterator[dict[str, Any]]:
    """One fault in its many forms."""
    low, high = record["minimum"], record["maximum"]
    base = {"kind": record["kind"], "place": place}
    inside = 0.5 * (max(low, -1e3) + min(high, 1e3))
    for severity in dict.fromkeys([*NUMBERS, *NO_NUMBERS, low, high, inside]):
        yield {**base, "severity": severity}
    for attribute in record["attributes"]:
        for value in (*NUMBERS, *NO_NUMBERS):
            yield {**base, "severity": inside, attribute["name"]: value}
    for profile in profiles():
        yield {**base, "severity": inside, "profile": profile}


def profiles() -> list[dict[str, Any]]:
    """Every profile: short and inside the run, then each of its numbers at the extremes."""
    tried = []
    for record in _core.profiles():
        plain = {p["name"]: p["default"] or 1e-3 for p in record["parameters"]}
        points = {"times": [0.0, 1e-3], "values": [0.0, 1.0]} if record["kind"] == "table" else {}
        tried.append({"kind": record["kind"], **plain, **points})
        for parameter in plain:
            for value in (*NUMBERS, *NO_NUMBERS):
                tried.append({"kind": record["kind"], **plain, parameter: value})
    return tried


def command_cases() -> Iterator[Case]:
    """Every waveform as a command, each of its numbers at the extremes."""
    for name, fidelity in actuators():
        if takes_actions(name):
            continue
        for record in _core.waveforms():
            plain = {
                p["name"]: 1e-3 if p["default"] is None else p["default"]
                for p in record["parameters"]
                if p["default"] is None or math.isfinite(p["default"])
            }
            points = (
                {"times": [0.0, 1e-3], "values": [0.0, 1.0]} if record["kind"] == "table" else {}
            )
            for parameter in plain:
                for value in (*NUMBERS, *NO_NUMBERS):
                    term = {"kind": record["kind"], **plain, **points, parameter: value}
                    yield Case(name, fidelity, command={"mode": "position", "terms": [term]})


def mixed_cases(count: int, seed: int) -> Iterator[Case]:
    """Several parameters and a fault at once, drawn within their ranges where these are finite."""
    draw = np.random.default_rng(seed)
    known = {pair: _core.parameters(loaded(pair[0]).wiring) for pair in actuators()}
    broken = {pair: shipped.places(pair[0]) for pair in actuators()}
    pairs = list(known)
    for _ in range(count):
        pair = pairs[draw.integers(len(pairs))]
        chosen = draw.choice(len(known[pair]), size=draw.integers(1, 5), replace=False)
        parameters = {known[pair][i]["path"]: drawn(known[pair][i], pair[0], draw) for i in chosen}
        kind, place, record = broken[pair][draw.integers(len(broken[pair]))]
        top = min(record["maximum"], 1e3)
        fault = {"kind": kind, "place": place, "severity": float(top * draw.random())}
        faulty = pair[1] in record["fidelities"] and draw.random() < 0.5
        yield Case(*pair, parameters, (fault,) if faulty else ())


def drawn(record: dict[str, Any], name: str, draw: np.random.Generator) -> Any:
    """A value of a parameter: its own times ten to some power, mostly a small one."""
    if record["choices"]:
        return record["choices"][draw.integers(len(record["choices"]))]
    nominal = loaded(name).parameters.value(record["path"]) or 1.0
    return float(nominal * 10.0 ** (draw.normal() * draw.choice([0.3, 1.0, 4.0, 30.0])))


def actuators() -> list[tuple[str, str]]:
    """Every shipped actuator file in each of its fidelities."""
    return [(name, fidelity) for name in shipped.names() for fidelity in shipped.fidelities(name)]
