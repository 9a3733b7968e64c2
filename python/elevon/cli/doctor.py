"""`elevon doctor`: the first look at a log: columns, data, fit, verdict."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar, say
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.doctor import Examination

app = typer.Typer(rich_markup_mode=None)
_FILES = ("doctor.html", "doctor.json", "map.toml")


@command(app, "strict", "details", "force")
def doctor(
    logs: list[Path],
    *,
    actuator: str,
    baseline: list[Path] | None = None,
    column_map: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    out: Path | None = None,
    settings: list[str] | None = None,
    force: bool = False,
) -> Answer:
    """Look at logs for the first time: columns, data, the model's fit, the verdict."""
    from elevon.doctor.door import doctor as run

    if out is not None:
        common.check_outputs([out / name for name in _FILES], force=force)
    model = common.read_actuator(actuator, settings)
    paths = common.without_companions(logs)
    with progress_bar("looking") as advance:
        result = run(
            paths, model, common.without_companions(baseline or []), map=column_map,
            loadcells=common.one_each("--loadcell", loadcell, len(paths)),
            notes=common.one_each("--command", command, len(paths), shared=True),
            progress=advance,
        )  # fmt: skip
    if out is not None:
        for path in result.write(out, force=force):
            say(f"wrote {path}")
    return Answer(result, lambda: _print(result, out), 1 if result.failed else 0)


def _print(result: Examination, out: Path | None) -> None:
    answer(result.headline)
    rows = [(c.log, c.check, "ok" if c.ok else "look", c.text) for c in result.checks]
    print_table(("log", "data", "", "what was seen"), rows)
    if result.columns_by == "guess":
        columns = [
            (c.name, c.role or "?", c.unit, c.why)
            for c in result.columns
            if c.log == result.columns[0].log
        ]
        print_table(("column", "guessed as", "unit", "why"), columns)
    if result.fit is not None:
        fit = [
            (e.log, e.signal, f"{e.of_range:.3g}", "" if e.limit is None else f"{e.limit:.3g}")
            for e in result.fit.errors
        ]
        print_table(("log", "model beside it", "% of range", "threshold %"), fit)
    listed([f"no {name}: {text}" for name, text in result.reasons.items()])
    if out is None:
        answer("one page of all this: --out DIR")
