"""``elevon dataset make benchmark`` and ``elevon dataset score``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from elevon.cli.groups import group
from elevon.cli.output import answer, print_table, progress_bar
from elevon.cli.shell import Answer, command

_make = group("Make a documented data set.")


def add_to(app: typer.Typer) -> None:
    """Add the commands to ``elevon dataset``."""
    app.add_typer(_make, name="make")
    command(app)(score)


@command(_make)
def benchmark(
    *,
    out: Path,
    size: str = "small",
    runs: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    scores: bool = True,
) -> Answer:
    """Make the benchmark set: three actuators, faults that grow, a bench that does not match."""
    from elevon.benchmark import make_benchmark, score_benchmark

    with progress_bar("making the benchmark set") as advance:
        made = make_benchmark(
            out, size=size, runs=runs, seed=seed, threads=threads, progress=advance
        )
    rows = []
    if scores:
        with progress_bar("baseline scores") as advance:
            rows = [vars(row) for row in score_benchmark(out, progress=advance)]
    total = sum(item["runs"] for item in made.about["campaigns"])
    status = "failed" if made.failed else "ok"
    data = {"status": status, "runs": total, "failed": made.failed, **made.about, "scores": rows}
    line = f"{total} runs in {out}, {made.failed} failed"
    return Answer(data, lambda: _print(rows, line), 1 if made.failed else 0)


def score(
    folder: Path,
    *,
    seed: int = 0,
) -> Answer:
    """Score the baseline on a benchmark set: a random forest on the features, nothing tuned."""
    from elevon.benchmark import score_benchmark

    with progress_bar("baseline scores") as advance:
        rows = [vars(row) for row in score_benchmark(folder, seed=seed, progress=advance)]
    return Answer({"status": "ok", "scores": rows}, lambda: _print(rows))


def _print(rows: list[dict[str, Any]], *lines: str) -> None:
    answer(*lines)
    if not rows:
        return
    cells = [
        [
            row["actuator"],
            row["part"],
            row["fault"],
            f"{row['present']}/{row['runs']}",
            _number(row["auc"], row["auc_interval"]),
            _number(row["null"], None),
            _number(row["age"], None),
            _number(row["error"], row["error_interval"]),
        ]
        for row in rows
    ]
    titles = ("actuator", "part", "fault", "present", "AUC", "shuffled", "age", "severity error")
    print_table(titles, cells)


def _number(value: float | None, interval: list[float] | None) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" + (f" ({interval[0]:.2f} to {interval[1]:.2f})" if interval else "")
