"""``elevon features``: features of a recording or a log."""

from __future__ import annotations

from pathlib import Path

import typer

from elevon.cli.output import answer, print_table, say
from elevon.cli.shell import Answer, command
from elevon.number_text import quantity_text

app = typer.Typer(rich_markup_mode=None)


@command(app)
def features(
    log: Path,
    *,
    wanted: str = "all",
    role: list[str] | None = None,
    pole_pairs: float | None = None,
    clock: str | None = None,
) -> Answer:
    """Compute features of a log, by the code that computes them while simulating."""
    from elevon.features import recording_features
    from elevon.logs.importing import import_log

    imported = import_log(log, sidecars=False)
    for finding in imported.report.findings:
        if finding.level == "warning":
            say(f"{log}: {finding.place}: {finding.text}")
    result = recording_features(
        imported.recording, wanted, roles=_roles(role), clock=clock, pole_pairs=pole_pairs
    )
    rows = [
        {"name": name, "value": value, "unit": result.units[name]}
        for name, value in result.values.items()
    ]

    def show() -> None:
        cells = [
            (name, *quantity_text(value, result.units[name], 6))
            for name, value in result.values.items()
        ]
        answer(f"{log}: {len(cells)} features at {result.rate:g} Hz")
        print_table(("feature", "value", "unit"), cells)

    data = {"features": rows, "signals": result.signals, "rate_hz": result.rate}
    return Answer(data, show)


def _roles(given: list[str] | None) -> dict[str, str]:
    from elevon.errors import InputError

    roles = {}
    for text in given or ():
        name, equals, channel = text.partition("=")
        if not equals or not channel:
            raise InputError(f"--role {text!r} is not of the form ROLE=CHANNEL")
        roles[name.strip()] = channel.strip()
    return roles
