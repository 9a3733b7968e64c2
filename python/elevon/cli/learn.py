"""`elevon learn`: classes, severities and how healthy days differ, from labelled logs or runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar
from elevon.cli.shell import Answer, command
from elevon.errors import InputError
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.diagnose.learning.model import LearnedModel

app = typer.Typer(rich_markup_mode=None)
_RATE = 0.05  # of false alarms, by default


@command(app, "strict", "details")
def learn(
    logs: Annotated[list[Path], Option(metavar="LOG")],
    *,
    labels: Path | None = None,
    out: Annotated[Path, Option(metavar="MODEL")],
    actuator: Annotated[str | None, Option(complete="actuators")] = None,
    pole_pairs: float | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    column_map: Path | None = None,
    settings: list[str] | None = None,
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Learn classes, severities and how healthy days differ, from labelled logs or a data set.

    Parameters
    ----------
    logs : list of path
        Drive logs, or one folder of a campaign.
    labels : path
        Table (CSV): log, label; unit, condition, severity, healthy, day.
    out : path
        Model to write (.npz).
    actuator : str
        Learn how healthy days differ, against this actuator.
    pole_pairs : float
        Of the motor; default: the actuator's.
    """
    from elevon.diagnose.learning.door import as_dataset
    from elevon.diagnose.learning.door import learn as run
    from elevon.diagnose.learning.labels import read_labels

    common.check_outputs([out], force=force)
    if actuator is None and settings:
        raise InputError("--set: goes with --actuator")
    unit = None if actuator is None else common.read_actuator(actuator, settings)
    options: dict[str, Any] = {"actuator": unit, "pole_pairs": pole_pairs, "seed": seed}
    data = as_dataset(logs)
    with progress_bar("learning") as advance:
        if data is not None:
            result = run(data, labels, **options, progress=advance)
        else:
            paths = common.without_companions(logs)
            known = None if labels is None else read_labels(labels, paths)
            read = common.read_logs(paths, column_map, loadcell, command)
            result = run(read, known, **options, progress=advance)
    path = result.save(out, force=force)
    return Answer({"file": path, **result.to_dict()}, lambda: _print(result, path))


def _print(result: LearnedModel, path: Path) -> None:
    answer(f"learnt: {', '.join(result.holds)} of {result.report['logs']} logs -> {path}")
    if result.classes is not None:
        _print_classes(result)
    if result.spread is None:
        return
    spread = result.report["spread"]
    far = sorted(spread["features"].items(), key=lambda row: -abs(row[1]["days"] - 1.0))
    rows = [(name, *(f"{x:.2f}" for x in values.values())) for name, values in far]
    columns = ("feature", "day to day", "low", "high", "mismatch", "low", "high")
    counts = ", ".join(f"{spread[n]} {n if spread[n] != 1 else n[:-1]}" for n in ("days", "units"))
    title = f"{counts}: deviations over those stated, with 90 % intervals"
    print_table(columns, rows, title=title)
    listed([result.spread.threshold_text(_RATE)])


def _print_classes(result: LearnedModel) -> None:
    rows = [
        (
            name if view == "absolute" else f"{name}, with a baseline",
            f"{r['right']}/{r['logs']}",
            f"{100.0 * r['interval'][0]:.0f} to {100.0 * r['interval'][1]:.0f} %",
            f"{r['false_alarms']}/{r['healthy']}",
            f"{r['missed']}/{r['faulty']}",
        )
        for view, report in _reports(result)
        for name, r in report["left_out"].items()
    ]
    print_table(("left out in turn", "right class", "95 %", "false alarms", "missed"), rows)
    sized = [
        (
            kind if view == "absolute" else f"{kind}, with a baseline",
            r["logs"], f"{r['low']:.3g}", f"{r['high']:.3g}", f"{r['error']:.2f}",
            f"{r['interval']:.2f}",
        )
        for view, report in _reports(result)
        for kind, r in report.get("severities", {}).items()
    ]  # fmt: skip
    if sized:
        title = "severities: errors of the root of the share in the largest, units left out"
        columns = ("kind", "logs", "lowest, SI", "highest, SI", "median error", "90 % within")
        print_table(columns, sized, title=title)
    lost = result.report.get("left_out_runs", {})
    listed([f"left out: {count} runs: {reason}" for reason, count in lost.items()])


def _reports(result: LearnedModel) -> list[tuple[str, dict[str, Any]]]:
    """Return what was counted without and with baselines."""
    views = [("absolute", dict(result.report))]
    return views + [(n, result.report[n]) for n in ("relative",) if n in result.report]
