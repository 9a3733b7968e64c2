"""What the core returns becomes a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.faults import find_record
from elevon.record_plan import ClockPlan
from elevon.recording import Channel, Clock, Recording
from elevon.scenario.compile import signal_records
from elevon.simulate.prepare import Prepared, Run


def build_recording(
    run: Run,
    prepared: Prepared,
    fidelity: str,
    result: Mapping[str, Any],
    shared: dict[tuple[str, float, int], Clock],
) -> Recording:
    """Return one result of the core with names, units, labels and what is known about it.

    `shared` holds the clocks of earlier runs of the batch: the core gives runs that recorded at
    the same instants one array of time, and they get one clock.
    """
    channels: list[Channel] = []
    clocks: list[Clock] = []
    for index, plan in enumerate(prepared.plan):
        rows = result["clocks"][plan.name]
        key = (plan.name, plan.rate, id(rows["time"]))
        clock = shared.get(key) or shared.setdefault(key, Clock(plan.name, rows["time"], plan.rate))
        clocks.append(clock)
        channels.extend(_channels(prepared, fidelity, plan, clock, rows["values"]))
        if index == 0:
            channels.extend(_severities(prepared, clock, rows["values"][:, len(plan.signals) :]))
    return Recording(
        channels,
        clocks=clocks,
        meta=_meta(run, prepared, fidelity, result),
        labels=fault_labels(prepared),
        final=final_values(prepared, result["final"]),
    )


def _channels(
    prepared: Prepared,
    fidelity: str,
    plan: ClockPlan,
    clock: Clock,
    values: npt.NDArray[np.float64],
) -> Iterator[Channel]:
    known = signal_records(prepared.actuator.wiring, fidelity)
    for column, name in enumerate(plan.signals):
        item = known[name]
        unit = prepared.command_unit if name == "command" else item["unit"] or "1"
        yield Channel(name, unit, values[:, column], clock, item["text"])


def _severities(
    prepared: Prepared, clock: Clock, values: npt.NDArray[np.float64]
) -> Iterator[Channel]:
    """The severity of each fault as it was applied, on the first clock."""
    for column, label in enumerate(fault_labels(prepared)):
        text = f"severity of {label['kind']}@{label['place']}"
        yield Channel(label["channel"], label["unit"], values[:, column], clock, text)


def final_values(prepared: Prepared, values: Mapping[str, float]) -> dict[str, float]:
    """Last values; the core sums energies only where they are recorded, so others are left out."""
    recorded = {name for plan in prepared.plan for name in plan.signals}
    return {
        name: value
        for name, value in values.items()
        if name in recorded or not name.startswith("energy_")
    }


def fault_labels(prepared: Prepared) -> list[dict[str, Any]]:
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


def _meta(run: Run, prepared: Prepared, fidelity: str, result: Mapping[str, Any]) -> dict[str, Any]:
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
        "roles": _roles(prepared, fidelity),
        "faults": [str(fault) for fault in run.scenario.fault],
        "scenario": run.scenario.to_dict(),
        **_features(prepared, result),
    }


def _features(prepared: Prepared, result: Mapping[str, Any]) -> dict[str, Any]:
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


def _roles(prepared: Prepared, fidelity: str) -> dict[str, str]:
    """Role to recorded signal; of several the last, since a sensor stands behind what it senses."""
    recorded = {name for plan in prepared.plan for name in plan.signals}
    known = signal_records(prepared.actuator.wiring, fidelity)
    played = {name: item.get("role") for name, item in known.items() if name in recorded}
    return {role: name for name, role in played.items() if role}
