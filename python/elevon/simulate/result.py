"""What the core returns becomes a recording."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypedDict, TypeVar

import numpy as np
import numpy.typing as npt

from elevon.faults import find_record
from elevon.record_plan import ClockPlan
from elevon.recording import Channel, Clock, Recording
from elevon.scenario.compile import signal_records
from elevon.seam import CoreResult
from elevon.simulate.prepare import Prepared, Run

Value = TypeVar("Value")


def build_recording(
    run: Run,
    prepared: Prepared,
    fidelity: str,
    result: CoreResult,
    shared: dict[tuple[str, float, int], Clock],
) -> Recording:
    """Return one result of the core with names, units, labels and what is known about it.

    `shared` holds the clocks of earlier runs of the batch: the core gives runs that recorded at
    the same instants one array of time, and they get one clock.
    """
    channels: list[Channel] = []
    clocks: list[Clock] = []
    layout = _layout(prepared.actuator.wiring, fidelity, prepared.command_unit, prepared.plan)
    for index, plan in enumerate(prepared.plan):
        rows = result["clocks"][plan.name]
        key = (plan.name, plan.rate, id(rows["time"]))
        clock = shared.get(key) or shared.setdefault(key, Clock(plan.name, rows["time"], plan.rate))
        clocks.append(clock)
        rows["values"].flags.writeable = False
        columns = rows["values"].T
        channels.extend(
            Channel(name, unit, columns[column], clock, text)
            for column, (name, unit, text) in enumerate(layout.described[index])
        )
        if index == 0:
            channels.extend(_severities(prepared, clock, rows["values"][:, len(plan.signals) :]))
    return Recording(
        channels,
        clocks=clocks,
        meta=_meta(run, prepared, fidelity, result, layout),
        labels=fault_labels(prepared),
        final={name: result["final"][name] for name in layout.final},
    )


def final_values(values: Mapping[str, Value], recorded: Container[str]) -> dict[str, Value]:
    """Leave unrecorded energies out of last values by signal: the core does not sum them."""
    return {n: x for n, x in values.items() if n in recorded or not n.startswith("energy_")}


@dataclass(frozen=True)
class _Layout:
    """What the recordings of runs of one model and plan have in common."""

    #: Name, unit and text of the channels of each clock.
    described: tuple[tuple[tuple[str, str, str], ...], ...]
    #: Role to signal.
    roles: Mapping[str, str]
    #: The signals whose last value is given.
    final: tuple[str, ...]


@lru_cache(maxsize=256)
def _layout(wiring: str, fidelity: str, command_unit: str, plans: tuple[ClockPlan, ...]) -> _Layout:
    known = signal_records(wiring, fidelity)
    recorded = {name for plan in plans for name in plan.signals}

    def described(name: str) -> tuple[str, str, str]:
        unit = command_unit if name == "command" else known[name]["unit"] or "1"
        return name, unit, known[name]["text"]

    # Of several the last, since a sensor stands behind what it senses.
    played = {name: item["role"] for name, item in known.items() if name in recorded}
    return _Layout(
        tuple(tuple(described(name) for name in plan.signals) for plan in plans),
        {role: name for name, role in played.items() if role},
        tuple(final_values(known, recorded)),
    )


def _severities(
    prepared: Prepared, clock: Clock, values: npt.NDArray[np.float64]
) -> Iterator[Channel]:
    """The severity of each fault as it was applied, on the first clock."""
    for column, label in enumerate(fault_labels(prepared)):
        text = f"severity of {label['kind']}@{label['place']}"
        yield Channel(label["channel"], label["unit"], values[:, column], clock, text)


class FaultLabel(TypedDict):
    """One fault of a run: where its severity is recorded, and what it is."""

    channel: str
    kind: str
    place: str
    severity: float
    unit: str
    attributes: Mapping[str, float]
    profile: str


def fault_labels(prepared: Prepared) -> list[FaultLabel]:
    """Return the label of each fault of a run: channel, kind, place, severity, unit, profile."""
    wiring = prepared.actuator.wiring
    return [
        {
            "channel": f"fault_{index + 1}",
            "kind": fault["kind"],
            "place": fault["place"],
            "severity": fault["severity"],
            "unit": find_record(fault["kind"], fault["place"], wiring).unit or "1",
            "attributes": fault["attributes"],
            "profile": fault["profile"]["kind"],
        }
        for index, fault in enumerate(prepared.core["faults"])
    ]


def _meta(
    run: Run, prepared: Prepared, fidelity: str, result: CoreResult, layout: _Layout
) -> dict[str, Any]:
    from elevon import _core

    steps = int(result["steps"])
    return {
        "status": result["status"],
        "message": result["message"],
        "signal": result.get("diverged_signal", ""),
        "label": run.label,
        "actuator": prepared.actuator.name,
        "wiring": prepared.actuator.wiring,
        "fidelity": fidelity,
        "seed": int(run.seed),
        "number": int(run.number),
        "parameter_hash": prepared.actuator.hash,
        "version": _core.version(),
        "step_s": prepared.step,
        "steps": steps,
        "sim_s": float(result["time"]),
        "wall_s": float(result["wall_s"]),
        "ns_per_step": 1e9 * float(result["wall_s"]) / steps if steps else 0.0,
        "roles": layout.roles,
        "faults": [str(fault) for fault in run.scenario.fault],
        "scenario": run.scenario.to_dict(),
        **_features(prepared, result),
    }


def _features(prepared: Prepared, result: CoreResult) -> dict[str, Any]:
    """Features of the run, None where there is none; nothing where none were requested."""
    if not prepared.features:
        return {}
    values = {
        name: value if value - value == 0.0 else None
        for plan in prepared.features
        for name, value in plan.values(result).items()
    }
    units = {
        name: unit
        for plan in prepared.features
        for name, unit in zip(plan.names, plan.units, strict=True)
    }
    return {"features": values, "feature_units": units}
