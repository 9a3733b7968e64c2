"""``elevon show``: one actuator with the source of every number, and its block diagram."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from elevon.cli import common
from elevon.cli.acting import check, chosen
from elevon.cli.output import print_table, say
from elevon.cli.shell import Answer, command
from elevon.plain import fields_of

app = typer.Typer(rich_markup_mode=None)


@command(app)
def show(
    actuator: str,
    *,
    settings: list[str] | None = None,
    svg: Path | None = None,
    schema: Path | None = None,
    changed: bool = False,
    notes: bool = False,
    fidelity: str | None = None,
    not_modelled: bool = False,
    force: bool = False,
) -> Answer:
    """Show an actuator: block diagram, parameters with units, sources, where they act; references.

    --fidelity and --not-modelled choose among the parameters.
    """
    from elevon.diagram import diagram_svg

    common.check_outputs([svg, schema], force=force)
    loaded = common.read_actuator(actuator, settings)
    check(fidelity, [loaded.wiring])
    parameters = _chosen(loaded, fidelity, not_modelled)
    if changed:
        parameters = _changed(actuator, parameters)
    if svg is not None:
        from elevon.files import write_text

        write_text(svg, diagram_svg(loaded.wiring), force=force)
        say(f"wrote {svg}")
    if schema is not None:
        _write_schema(schema, loaded.wiring, force=force)
    data = _as_json(loaded, svg, parameters)
    show_these = _print_changed if changed else _print
    return Answer(data, lambda: show_these(loaded, parameters, notes))


def _print(loaded: Any, parameters: list[Any], notes: bool) -> None:
    from elevon.diagram import diagram_text, diagrams

    typer.echo(f"{loaded.name}: {loaded.title}\n")
    if loaded.wiring in diagrams():
        typer.echo(diagram_text(loaded.wiring) + "\n")
    _print_parameters(loaded, parameters, notes)
    if loaded.references:
        typer.echo("")
        for key, text in loaded.references.items():
            typer.echo(f"{key}: {text}")


def _print_changed(loaded: Any, parameters: list[Any], notes: bool) -> None:
    typer.echo(f"{loaded.name}: {loaded.title}")
    design = [item for item in loaded.design.values() if item.confidence != "derived"]
    rows = [[item.path, item.text, item.confidence, item.source] for item in design]
    rows += [
        [p.path, p.text, p.confidence, p.source] + ([p.note] if notes else []) for p in parameters
    ]
    if rows:
        print_table(["number", "value", "confidence", "source"] + (["note"] if notes else []), rows)
    else:
        typer.echo("every value is derived by a rule or neutral")


def _changed(reference: str, parameters: list[Any]) -> list[Any]:
    """Return what the files state themselves, or the command line sets."""
    from elevon.parameters import load_set

    stated = load_set(reference).stated
    return [p for p in parameters if p.path in stated or p.confidence == "override"]


def _chosen(loaded: Any, fidelity: str | None, not_modelled: bool) -> list[Any]:
    from elevon.parameters import records

    known = records(loaded.wiring)
    every = loaded.parameters.values()
    return [each for each in every if chosen(known[each.path], fidelity, not_modelled)]


def _print_parameters(loaded: Any, parameters: list[Any], notes: bool) -> None:
    from elevon.parameters import records

    known = records(loaded.wiring)
    columns = ["parameter", "value", "confidence", "source", "acts"]
    rows = [
        [p.path, p.text, p.confidence, p.source, known[p.path].acts_text or "always"]
        + ([p.note] if notes else [])
        for p in parameters
    ]
    columns += ["note"] if notes else []
    print_table(columns, rows, optional=("acts", "note"))


def _write_schema(path: Path, wiring: str, *, force: bool) -> None:
    from json import dumps

    from elevon.files import write_text
    from elevon.parameters import json_schema
    from elevon.plain import plain

    write_text(path, dumps(plain(json_schema(wiring)), indent=2) + "\n", force=force)
    say(f"wrote {path}")


def _as_json(loaded: Any, svg: Path | None, parameters: list[Any]) -> dict[str, Any]:
    from elevon.parameters import records

    known = records(loaded.wiring)
    design = ("value", "text", "confidence", "source")
    stated = ("path", "value", "unit", "confidence", "source", "note", "old")
    return fields_of(loaded, "name", "title", "wiring", "hash", "references", file="path") | {
        "svg": svg,
        "design": {name: fields_of(item, *design) for name, item in loaded.design.items()},
        "parameters": [
            fields_of(p, *stated, shown="text")
            | fields_of(known[p.path], "text", "fidelities", "not_modelled", "when", si_unit="unit")
            for p in parameters
        ],
    }
