"""The data card of a campaign folder: what is in it and how to read it."""

from __future__ import annotations

from pathlib import Path

from elevon.campaign.folder import Manifest
from elevon.campaign.plan import Plan

__all__ = ["data_card"]


def data_card(plan: Plan, manifest: Manifest, folder: Path) -> str:
    """Return the text of a campaign's data card (Markdown)."""
    varied = dict.fromkeys(name for run in manifest.runs for name in run["values"])
    statuses: dict[str, int] = {}
    splits: dict[str, int] = {}
    for run in manifest.runs:
        statuses[run["status"]] = statuses.get(run["status"], 0) + 1
        if run["split"]:
            splits[run["split"]] = splits.get(run["split"], 0) + 1
    lines = [
        f"# {plan.name}",
        "",
        plan.text or "Simulated runs of one actuator.",
        "",
        f"* Simulated with elevon {manifest.version}: {plan.actuator}, {plan.fidelity} fidelity.",
        f"* Runs: {_counts(statuses)}.",
        f"* Varied: {', '.join(varied) or 'nothing'}.",
        *([f"* Split by draw, never within a run: {_counts(splits)}."] if splits else []),
        "* `plan.toml` is the plan as given, `resolved.json` every run with all its values,",
        "  `manifest.json` what was done, with the SHA-256 of each file.",
        "* `runs/*.parquet`: columns `run`, `time` (s) and the channels; SI units in the field",
        "  metadata; `fault_N` is the severity of fault N as it was applied at that instant.",
        "",
        "```python",
        "from elevon.campaign import load_run",
        f'recording = load_run("{folder.name}", 0)',
        "```",
        "",
        "## Channels",
        "",
        *_channels(manifest, folder),
    ]
    return "\n".join(lines) + "\n"


def _counts(found: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in found.items())


def _channels(manifest: Manifest, folder: Path) -> list[str]:
    import pyarrow.parquet as pq

    lines = ["| channel | unit | clock | meaning |", "|---|---|---|---|"]
    for file in manifest.blocks[0]["files"]:
        for item in pq.read_schema(folder / file["file"]):
            if item.metadata and b"text" in item.metadata:
                unit, text = item.metadata[b"unit"].decode(), item.metadata[b"text"].decode()
                lines.append(f"| {item.name} | {unit} | {file['clock']} | {text} |")
    return lines
