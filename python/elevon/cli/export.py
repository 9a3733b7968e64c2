"""``elevon export``: an actuator for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from elevon.cli import completion
from elevon.cli.common import ActuatorArgument, FidelityOption, ForceOption
from elevon.cli.groups import NamingGroup
from elevon.cli.output import answer
from elevon.cli.shell import Answer, command

app = typer.Typer(
    rich_markup_mode=None,
    no_args_is_help=True,
    cls=NamingGroup,
    help="Write an actuator for other tools (docs/how-to/deploy.md).",
)

OutOption = Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="The file to write.")]
ModeOption = Annotated[
    str | None,
    typer.Option(help="What the command demands: position, speed, torque; a gear: its commands."),
]
SignalsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--signals",
        metavar="NAMES",
        help="Outputs beyond the drive log's: signals or groups, by commas; repeatable.",
        autocompletion=completion.signals,
    ),
]


@app.callback()
def export() -> None:
    """Write an actuator for other tools (docs/how-to/deploy.md)."""


@command(app)
def fmu(
    actuator: ActuatorArgument,
    *,
    out: OutOption,
    fidelity: FidelityOption = "high",
    version: Annotated[str, typer.Option(help="Of FMI: 2.0 or 3.0.")] = "3.0",
    mode: ModeOption = None,
    signals: SignalsOption = None,
    step: Annotated[
        str, typer.Option(help="Suggested communication step: a whole number of solver steps.")
    ] = "1 ms",
    platform: Annotated[
        str | None,
        typer.Option(help="As FMI 3.0 names it, such as x86_64-linux; this installation's."),
    ] = None,
    force: ForceOption = False,
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
    actuator: ActuatorArgument,
    *,
    out: OutOption,
    fidelity: FidelityOption = "high",
    mode: ModeOption = None,
    signals: SignalsOption = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="KIND@PLACE",
            help="Held by the equations from the start; repeatable.",
            autocompletion=completion.faults,
        ),
    ] = None,
    force: ForceOption = False,
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
