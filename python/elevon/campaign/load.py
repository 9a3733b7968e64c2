"""Read one run of a campaign back as a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from elevon.campaign.ends import last_values
from elevon.campaign.resolved import Resolved
from elevon.errors import InputError
from elevon.recording import Channel, Clock, Recording
from elevon.simulate.result import FaultLabel, fault_labels

if TYPE_CHECKING:
    from elevon.campaign.dataset import Dataset


def recorded(ds: Dataset, number: int) -> Recording:
    """Return one run of a data set; see `elevon.campaign.load_run`."""
    _check_done(ds, number)
    resolved = ds.resolved()
    prepared = resolved.prepared(number)
    labels = fault_labels(prepared)
    channels: list[Channel] = []
    clocks: list[Clock] = []
    for place, plan in enumerate(prepared.plan):
        frame = ds.clock(plan.name).to_arrow(runs=[number])
        clock = Clock(plan.name, frame["time"].to_numpy(), plan.rate)
        about = {f.name: f.metadata for f in frame.schema}
        clocks.append(clock)
        for name in plan.signals:
            unit, text = (about[name][key].decode() for key in (b"unit", b"text"))
            channels.append(Channel(name, unit, frame[name].to_numpy(), clock, text))
        if place == 0:
            channels.extend(_severities(labels, frame, clock))
    meta = _meta(ds, resolved, number)
    ends = ds.ends
    rows = [] if ends is None else ends.to_arrow(runs=[number]).to_pylist()
    final = last_values(rows[0]) if rows else {}
    return Recording(channels, clocks=clocks, meta=meta, labels=labels, final=final)


def _severities(labels: Sequence[FaultLabel], frame: Any, clock: Clock) -> list[Channel]:
    channels = []
    for label in labels:
        name = f"{label['kind']}@{label['place']}"
        values, text = frame[name].to_numpy(), f"severity of {name}"
        channels.append(Channel(label["channel"], label["unit"], values, clock, text))
    return channels


def _check_done(ds: Dataset, number: int) -> None:
    spans = [(item.data["first"], item.data["last"]) for item in ds.items]
    if not any(first <= number <= last for first, last in spans):
        done = sum(last - first + 1 for first, last in spans)
        raise InputError(
            f"{ds.folder}: run {number} is not there; {done} of {len(ds)} runs are done"
        )


def _meta(ds: Dataset, resolved: Resolved, number: int) -> dict[str, Any]:
    run = resolved.run(number)
    row = ds.runs.to_arrow(runs=[number]).to_pylist()[0]
    return {
        "status": row["status"],
        "message": row["reason"],
        "run": number,
        "label": run.label,
        "split": row["split"],
        "values": resolved.values(number),
        "actuator": run.actuator.name,
        "wiring": resolved.wiring,
        "fidelity": resolved.fidelity,
        "seed": run.seed,
        "number": number,
        "parameter_hash": run.actuator.hash,
        "version": ds.manifest.version,
        "sim_s": row["sim_s"],
        "steps": row["steps"],
        "faults": [str(fault) for fault in run.scenario.fault],
        "scenario": run.scenario.to_dict(),
    }
