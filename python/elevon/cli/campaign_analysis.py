"""``elevon campaign effects`` and ``elevon campaign surrogate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from elevon.cli.common import ForceOption, JsonOption, check_outputs
from elevon.cli.output import print_json, print_table

__all__ = ["add_to"]

FolderArgument = Annotated[Path, typer.Argument(metavar="DIR", help="The campaign's folder.")]
ResponseOption = Annotated[
    str, typer.Option("--response", metavar="R", help="A feature, or a number of runs.parquet.")
]
ReportOption = Annotated[
    Path | None, typer.Option("--report", metavar="FILE", help="Report to write (HTML).")
]


def add_to(app: typer.Typer) -> None:
    """Add the commands to ``elevon campaign``."""
    app.command()(effects)


def effects(
    folder: FolderArgument,
    *,
    response: ResponseOption,
    level: Annotated[float, typer.Option(help="Confidence of the intervals.")] = 0.95,
    report: ReportOption = None,
    force: ForceOption = False,
    json: JsonOption = False,
) -> int:
    """Say which factors move a response, and by how much: main effects and interactions."""
    from elevon.analysis import effects_of, read_response
    from elevon.campaign import load_campaign

    check_outputs([report], force=force)
    found = effects_of(read_response(load_campaign(folder), response), level=level)
    if report is not None:
        from elevon.analysis.effects_page import effects_report

        effects_report(found, str(folder)).save(report, force=force)
    if json:
        print_json({"status": "ok", **found.to_dict()})
        return 0
    rows = [
        [t.term, t.name, f"{t.effect:.4g}", _interval(t), ", ".join(t.aliases)] for t in found.terms
    ]
    title = f"{found.response} [{found.unit}], {found.runs} runs, {found.method}"
    print_table(("term", "factors", "effect", "interval", "aliased with"), rows, title=title)
    for text, names in (
        ("confounded with the blocks", found.blocked),
        ("left out, partly aliased", found.partial),
    ):
        if names:
            typer.echo(f"{text}: {', '.join(names)}")
    return 0


def _interval(term: Any) -> str:
    if term.low is None:
        return "not known"
    return f"{term.low:.4g} to {term.high:.4g}{' *' if term.significant else ''}"
