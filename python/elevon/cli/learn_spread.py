"""`elevon learn-spread`: what differs from day to day of healthy units, from their logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table, progress_bar
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.diagnose.engine.spread import LearnedSpread

app = typer.Typer(rich_markup_mode=None)
_RATE = 0.05  # of false alarms, by default


@command(app, "strict")
def learn_spread(
    logs: list[Path],
    *,
    actuator: str,
    out: Path,
    units: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    column_map: Path | None = None,
    settings: list[str] | None = None,
    force: bool = False,
) -> Answer:
    """Learn spread and model mismatch from healthy logs of one unit, or of several."""
    from elevon.diagnose.learning.log_table import log_table, looked_up
    from elevon.diagnose.learning.spread import learned_spread

    common.check_outputs([out], force=force)
    model = common.read_actuator(actuator, settings)
    logs = common.without_companions(logs)
    rows = None if units is None else looked_up(log_table(units, ("unit", "day")), logs, units)
    days = None if rows is None else [(row["unit"], row["day"]) for row in rows]
    data = common.read_logs(logs, column_map, loadcell, command)
    with progress_bar("learning the spread") as advance:
        result = learned_spread(data, model, days, advance)
    path = result.save(out, force=force)
    return Answer({"file": str(path), **result.to_dict()}, lambda: _print(result, path))


def _print(result: LearnedSpread, path: Path) -> None:
    counts = (("day", result.days), ("unit", result.units), ("log", result.logs))
    days, units, logs = (f"{count} {name}{'s' * (count != 1)}" for name, count in counts)
    answer(f"spread learnt: {days} of {units}, {logs} -> {path}")
    far = sorted(result.deviations().items(), key=lambda row: -abs(float(row[1][0]) - 1.0))
    rows = [(name, *(f"{x:.2f}" for x in values)) for name, values in far]
    columns = ("feature", "day to day", "low", "high", "mismatch", "low", "high")
    print_table(columns, rows, title="deviations over those stated, with 90 % intervals")
    answer(result.threshold_text(_RATE))
