"""`elevon export` and `elevon safety`: an actuator for other tools, its control unit's hazards."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from elevon.cli import common
from elevon.cli.groups import group
from elevon.cli.output import answer, print_table, say
from elevon.cli.shell import Answer, DoorCall, command
from elevon.files import write_text
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.deploy.document import RunDocument
    from elevon.deploy.fmu import FmuFile
    from elevon.safety.campaign import SafetyResult

export = group("Write an actuator for other tools (docs/how-to/deploy.md).")


@command(export, door="elevon.deploy:export_fmu")
def fmu(door: DoorCall) -> Answer:
    """Write an FMU for co-simulation: inputs, faults' severities, outputs, parameters."""
    made: FmuFile = door()
    version, fidelity = door.options["version"], door.options["fidelity"]
    counts = {f"{role}s": made.count(role) for role in ("input", "output", "parameter")}
    texts = ", ".join(f"{count} {name}" for name, count in counts.items())
    text = f"wrote {made.path}: FMI {version}, {fidelity} fidelity, {texts}"
    about = {"file": str(made.path), "bytes": made.bytes, "version": version, "fidelity": fidelity}
    return Answer({"status": "ok", **about, **counts}, lambda: answer(text))


@command(export, door="elevon.deploy:run_document")
def run(
    door: DoorCall,
    *,
    out: Annotated[Path, Option(("--out", "-o"))],
    fault: Annotated[list[str] | None, Option(metavar="KIND@PLACE")] = None,
    force: bool = False,
) -> Answer:
    """Write the document that the C interface makes a run from.

    Parameters
    ----------
    out : path
        The file to write.
    fault : list of str
        Held by the equations from the start; repeatable.
    """
    document: RunDocument = door()
    written = write_text(out, document.text(fault or ()), force=force)
    fidelity = door.options["fidelity"]
    names = {"outputs": list(document.signals), "inputs": list(document.units)}
    text = f"wrote {written}: {fidelity} fidelity, {len(document.signals)} outputs"
    data = {"status": "ok", "file": str(written), "fidelity": fidelity, **names}
    return Answer(data, lambda: answer(text))


@command(None, "date", door="elevon.safety:safety", working="safety campaign")
def safety(door: DoorCall, *, out: Path | None = None, force: bool = False) -> Answer:
    """Run every failure, pairs and triples of them in every situation; list the hazards left.

    Parameters
    ----------
    out : path
        Folder for report.html and result.json.
    """
    import json

    from elevon.safety.page import safety_report

    pages = [] if out is None else [out / "report.html", out / "result.json"]
    common.check_outputs(pages, force=force)
    model = common.read_actuator(door.options["actuator"], door.options["settings"])
    result: SafetyResult = door(actuator=model)
    values = result.to_dict()
    if out is not None:
        page = safety_report(result, model, date=door.options["date"])
        say(f"report: {page.save(pages[0], force=force)}")
        write_text(pages[1], json.dumps(values, indent=1) + "\n", force=force)
    code = 0 if values["status"] == "pass" else 1
    return Answer(values, lambda: _print_hazards(values), code)


def _print_hazards(values: dict[str, Any]) -> None:
    answer(
        f"{values['status'].upper()}: {values['unsafe']} of {values['runs']} situations "
        "show a hazard"
    )
    rows = [
        [item["name"], *(str(item[key]) for key in ("rows", "listed", "single")),
         f"{item['per_hour']:.1e}"]
        for item in values["hazards"]
    ]  # fmt: skip
    print_table(["hazard", "rows", "listed", "by one failure", "per hour"], rows, title="hazards")
