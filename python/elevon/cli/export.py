"""``elevon export``: an actuator for other tools."""

from __future__ import annotations

from pathlib import Path

from elevon.cli.groups import group
from elevon.cli.output import answer
from elevon.cli.shell import Answer, command

app = group("Write an actuator for other tools (docs/how-to/deploy.md).")


@command(app)
def fmu(
    actuator: str,
    *,
    out: Path,
    fidelity: str = "high",
    version: str = "3.0",
    mode: str | None = None,
    signals: list[str] | None = None,
    step: str = "1 ms",
    platform: str | None = None,
    force: bool = False,
) -> Answer:
    """Write an FMU for co-simulation: inputs, faults' severities, outputs, parameters."""
    from elevon.deploy import export_fmu

    made = export_fmu(
        actuator, out, fidelity=fidelity, version=version, mode=mode, signals=signals or (),
        step=step, platform=platform, force=force,
    )  # fmt: skip
    counts = {f"{role}s": made.count(role) for role in ("input", "output", "parameter")}
    about = {"file": str(made.path), "bytes": made.bytes, "version": version}
    texts = ", ".join(f"{count} {name}" for name, count in counts.items())
    text = f"wrote {made.path}: FMI {version}, {fidelity} fidelity, {texts}"
    return Answer({"status": "ok", **about, "fidelity": fidelity, **counts}, lambda: answer(text))


@command(app)
def run(
    actuator: str,
    *,
    out: Path,
    fidelity: str = "high",
    mode: str | None = None,
    signals: list[str] | None = None,
    fault: list[str] | None = None,
    force: bool = False,
) -> Answer:
    """Write the document that the C interface makes a run from."""
    from elevon.deploy import run_document
    from elevon.files import write_text

    document = run_document(actuator, fidelity=fidelity, mode=mode, signals=signals or ())
    written = write_text(out, document.text(fault or ()), force=force)
    names = {"outputs": list(document.signals), "inputs": list(document.units)}
    text = f"wrote {written}: {fidelity} fidelity, {len(document.signals)} outputs"
    data = {"status": "ok", "file": str(written), "fidelity": fidelity, **names}
    return Answer(data, lambda: answer(text))
