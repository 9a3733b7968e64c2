"""`elevon calibrate`: an actuator's parameters from logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar, say
from elevon.cli.shell import Answer, command
from elevon.errors import InputError
from elevon.number_text import estimate_row

if TYPE_CHECKING:
    from elevon.calibrate.outcome import Calibration

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "details", "report", "date")
def calibrate(
    logs: list[Path],
    *,
    actuator: str,
    out: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    column_map: Path | None = None,
    free: list[str] | None = None,
    per_log: list[str] | None = None,
    fidelity: str | None = None,
    transient: float | None = None,
    settings: list[str] | None = None,
    force: bool = False,
) -> Answer:
    """Estimate what the logs determine, with intervals, and write it as a set."""
    from elevon.calibrate.door import calibrate as run
    from elevon.calibrate.drops import is_drop_table

    common.check_outputs([out], force=force)
    if out is not None and out.suffix.lower() != ".toml":
        raise InputError(f"--out {out}: a set is a TOML file; end the name in .toml")
    settings, constant = _scale(settings)
    model, paths = common.read_actuator(actuator, settings), _paths(free)
    table = len(logs) == 1 and is_drop_table(logs[0])
    given = logs if table else common.read_logs(logs, column_map, loadcell, command)
    with progress_bar("calibrating") as advance:
        result = run(
            given, model, paths, per_log=per_log or [], fidelity=fidelity, transient=transient,
            promise=out is not None, torque_constant=constant, progress=advance,
        )  # fmt: skip
        advance(1.0)
    if out is not None:
        say(f"set: {result.write_actuator(out, force=force)}")
    data = result.to_dict(stored=False) | {"out": None if out is None else str(out)}
    return Answer(data, lambda: _print(result), page=result.report)


def _scale(settings: list[str] | None) -> tuple[list[str], str | None]:
    """Take ``motor.torque_constant=VALUE`` out of the settings: the scale of the logs' effort."""
    head = "motor.torque_constant="
    given = [text for text in settings or () if text.replace(" ", "").startswith(head)]
    if len(given) > 1:
        raise InputError("--set motor.torque_constant is given twice")
    others = [text for text in settings or () if text not in given]
    return others, given[0].partition("=")[2].strip() if given else None


def _paths(free: list[str] | None) -> list[str] | None:
    """Split ``--free a,b``; auto or nothing: everything that the logs determine."""
    names = [name.strip() for text in free or () for name in text.split(",") if name.strip()]
    if not names or names == ["auto"]:
        return None
    if "auto" in names:
        raise InputError("--free auto stands alone: it frees what the logs can determine")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"--free {name} is given twice")
    return names


def _print(result: Calibration) -> None:
    answer(result.headline)
    rows = [estimate_row(item, result.before, item.register) for item in result.estimates]
    columns = ("parameter", "before", "after", "low", "high", "unit", "register", "holds for")
    print_table(columns, rows, optional=("register",))
    listed(result.remarks)
