"""`elevon learn`: classes of logs from labelled ones, without a model of the actuator."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table, progress_bar
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.diagnose.learning.classes import LearnedClasses

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict")
def learn(
    logs: list[Path],
    *,
    labels: Path,
    out: Path,
    pole_pairs: float | None = None,
    column_map: Path | None = None,
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Learn healthy and faulty from labelled logs of a motion that repeats."""
    from elevon.diagnose.learning.classify import learned_classes
    from elevon.diagnose.learning.door import labelled

    common.check_outputs([out], force=force)
    paths = common.without_companions(logs)
    known = labelled(labels, paths)
    with progress_bar("learning") as advance:
        data = common.read_logs(paths, column_map)
        result = learned_classes(data, known, pole_pairs=pole_pairs, seed=seed, progress=advance)
    path = result.save(out, force=force)
    return Answer({"file": str(path), **result.report}, lambda: _print(result, path))


def _print(result: LearnedClasses, path: Path) -> None:
    report = result.report
    answer(
        f"learnt: {report['logs']} logs, {len(result.classes)} classes, "
        f"{len(result.features)} features, {report['classifier']} -> {path}"
    )
    rows = [
        (
            name,
            f"{r['right']}/{r['logs']}",
            f"{100.0 * r['interval'][0]:.0f} to {100.0 * r['interval'][1]:.0f} %",
            f"{r['false_alarms']}/{r['healthy']}",
            f"{r['missed']}/{r['faulty']}",
        )
        for name, r in report["left_out"].items()
    ]
    print_table(
        ("left out in turn", "right class", "95 %", "false alarms", "missed"),
        rows,
    )  # fmt: skip
