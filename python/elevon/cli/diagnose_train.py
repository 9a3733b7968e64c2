"""`elevon diagnose-train`: train the surrogate that `elevon diagnose --method surrogate` asks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from elevon.cli.common import check_outputs, read_actuator
from elevon.cli.output import answer, print_table, progress_bar
from elevon.cli.shell import Answer, command

app = typer.Typer(rich_markup_mode=None)


@command(app)
def diagnose_train(
    *,
    actuator: str = "torino-rotary",
    out: Path,
    units: int = 240,
    low_units: int = 240,
    test_units: int = 48,
    rounds: int = 60,
    runs: Path | None = None,
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Simulate drawn units on the bench's tests, train, and write the surrogate."""
    from elevon.training.training import trained

    check_outputs([out], force=force)
    with progress_bar("runs and training") as advance:
        result = trained(
            read_actuator(actuator),
            units=units,
            low_units=low_units,
            test_units=test_units,
            rounds=rounds,
            seed=seed,
            folder=runs,
            progress=advance,
        )
    path = result.save(out, force=force)
    size = path.stat().st_size
    data = {"file": str(path), "bytes": size, **result.report}
    head = f"trained: {path}, {size / 1000:.0f} kB"
    return Answer(data, lambda: _print(head, result.report))


def _print(head: str, report: Any) -> None:
    answer(head)
    rows = [
        (
            name,
            what.replace("_", " "),
            s["runs"],
            f"{s['false_alarms']}/{s['healthy']}",
            f"{s['alarms']}/{s['faulty']}",
            f"{s['singles_first']}/{s['singles']}",
            f"{s['exactly_named']}/{s['runs']}",
            f"{s['covered']}/{s['severities']}",
        )
        for what in ("cross_validation", "test")
        for name, s in report.get(what, {}).items()
    ]
    print_table(
        ("test and view", "judged by", "runs", "false alarms", "alarms", "single named first",
         "all named", "within 90 %"),
        rows,
    )  # fmt: skip
    at = [
        (
            name,
            f"{s['severity']:.3g}",
            f"{s['alarms']}/{s['runs']}",
            f"{s['first']}/{s['runs']}",
            f"{s['isolated']}/{s['runs']}",
            f"{100.0 * s['median_error']:.1f} %",
            f"{s['covered']}/{s['runs']}",
        )
        for name, s in report.get("single_faults", {}).items()
    ]
    if at:
        print_table(
            ("test and fault, alone, one baseline", "severity, SI", "alarms", "named first",
             "and no other", "median error", "within 90 %"),
            at,
        )  # fmt: skip
