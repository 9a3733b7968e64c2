"""``elevon campaign effects``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli.output import answer, print_table
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.analysis.effects import Effects


def add_to(app: typer.Typer) -> None:
    """Add the commands to ``elevon campaign``."""
    command(app, "report", "force")(effects)


def effects(
    folder: Path,
    *,
    response: str,
    level: float = 0.95,
) -> Answer:
    """Say which factors move a response, and by how much: main effects and interactions."""
    from elevon.doors import effects as run

    effects = run(folder, response, level=level)
    return Answer(effects, lambda: _print_effects(effects), page=effects.report)


def _print_effects(effects: Effects) -> None:
    from elevon.analysis.effects import EQUAL_REPEATS

    rows = [
        [t.term, t.name, f"{t.effect:.4g}", _interval(t), ", ".join(t.aliases)]
        for t in effects.terms
    ]
    answer(effects.headline, f"by {effects.method}")
    print_table(("term", "factors", "effect", "interval", "aliased with"), rows)
    for text, names in (
        ("confounded with the blocks", effects.blocked),
        ("left out, partly aliased", effects.partial),
    ):
        if names:
            typer.echo(f"{text}: {', '.join(names)}")
    if effects.equal_repeats:
        typer.echo(EQUAL_REPEATS)


def _interval(term: Any) -> str:
    if term.low is None:
        return "not known"
    return f"{term.low:.4g} to {term.high:.4g}{' *' if term.significant else ''}"
