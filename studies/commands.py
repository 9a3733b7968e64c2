"""`python -m studies`: what each study computes, writes and prints."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli.groups import NamingGroup
from elevon.cli.output import answer, say
from elevon.data import packaged_toml
from elevon_cases.case import (
    Options,
    Values,
    add_command,
    check_file,
    print_columns,
    read_cases,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elevon.progress import Progress
    from elevon.report import Report
    from studies.benchmark_set import BenchmarkScores
    from studies.fault_limits.limits import FaultLimits

__all__ = ["app", "fault_limits", "fault_limits_page", "independent"]

_LIMITS = ("actuator", "test", "kind", "place", "limit", "unit", "injected", "alarm", "named")


def _show_watched(values: Values, _result: Any) -> None:
    for row in values["false_alarms"]:
        low, high = row["interval"]
        answer(
            f"healthy, {values['healthy_seconds']:g} s, one false alarm set in "
            f"{row['set_seconds']:g} s: {row['alarms']}, {row['per_hour']:.2g} in an hour "
            f"({low:.2g} to {high:.2g})"
        )


def _show_inspected(values: Values, _result: Any) -> None:
    columns = ("fault", "severity", "inspections", "seen", "interval", "error_median", "others")
    print_columns(values["detection"], columns, "inspections that see a severity")
    for row in values["rows"]:
        text = ", ".join(f"{error:+.3g} at {severity:.3g}" for severity, error in row["offset"])
        answer(f"{row['fault']}: mean error {text} {row['unit']}")


def fault_limits(
    days: int,
    injected: int,
    fidelity: str,
    seed: int,
    *,
    actuator: Sequence[str] = (),
    folder: Path | None = None,
    progress: Progress | None = None,
) -> FaultLimits:
    """Return the limits of a plan of these numbers."""
    from studies.fault_limits.limits import LimitsPlan, study_fault_limits

    plan = LimitsPlan(days, injected, fidelity, seed)
    return study_fault_limits(plan, actuators=actuator, folder=folder, progress=progress)


def independent(
    units: int,
    healthy: int,
    switching: int,
    learned: int,
    seed: int,
    *,
    processes: int | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Any:
    """Return diagnosis judged by a plan of these numbers."""
    from studies.independent import Plan, study_independent

    plan = Plan(units, healthy, switching, seed, learned)
    return study_independent(plan, folder=folder, processes=processes, progress=progress)


def benchmark_set(
    set: Path,  # noqa: A002 - the option's name
    seed: int,
    *,
    size: str = "small",
    runs: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> BenchmarkScores:
    """Return the scores of a benchmark set that is made, or gone on with."""
    from elevon.progress import part
    from studies.benchmark_set import BenchmarkScores, make_benchmark, score_benchmark

    made = make_benchmark(
        set, size=size, runs=runs, seed=seed, threads=threads, progress=part(progress, 0.0, 0.6)
    )
    scores = score_benchmark(set, seed=seed, progress=part(progress, 0.6, 1.0))
    return BenchmarkScores(tuple(scores), made.failed)


def _save_independent(result: Any, options: Options) -> None:
    from elevon.files import write_text
    from studies.independent.table import independent_table

    if options["table"] is not None:
        names = ("units", "healthy", "switching", "learned", "seed")
        numbers = " ".join(f"--{name} {options[name]}" for name in names)
        text = independent_table(result, f"python -m studies independent {numbers}")
        write_text(options["table"], text, force=options["force"])
        say(f"table: {options['table']}")


def _save_table(result: Any, options: Options) -> None:
    from elevon.files import write_text
    from studies.fault_limits.table import limits_table

    if options["table"] is not None:
        text = limits_table(result, _again(options))
        write_text(options["table"], text, force=options["force"])
        say(f"table: {options['table']}")


def _again(options: Options) -> str:
    """What makes the same table again."""
    names = [f"--actuator {name}" for name in options.get("actuator") or ()]
    numbers = [f"--{key} {options[key]}" for key in ("days", "injected", "fidelity", "seed")]
    return " ".join(["python -m studies fault-limits", *names, *numbers])


def fault_limits_page(
    result: FaultLimits,
    days: int,
    injected: int,
    fidelity: str,
    seed: int,
    *,
    actuator: Sequence[str] = (),
    date: str | None = None,
) -> Report:
    """Return the report of the limits, with the command of these numbers."""
    from elevon.report import Report, ReportTable, provenance

    report = Report(
        "Detection limits",
        "Least severity of each fault that each standard test shows, one healthy log as baseline.",
        date=date,
    )
    report.section("Checks").checks(result.checks)
    rows = [[getattr(row, name) for name in (*_LIMITS, "reason")] for row in result.limits]
    text = [["-" if cell is None else str(cell) for cell in row] for row in rows]
    report.section("Limits").table(ReportTable((*_LIMITS, "reason"), text))
    options = {"days": days, "injected": injected, "fidelity": fidelity, "seed": seed}
    report.provenance(provenance(_again(options | {"actuator": actuator}), Seed=seed))
    return report


def _show_saved(values: Values, _result: Any) -> None:
    for name, (mean, low, high) in values["saved"].items():
        against = "the mean of all fixed orders" if name == "orders" else f"{name} order"
        answer(f"saved against {against}: {mean:.2f} tests ({low:.2f} to {high:.2f})")
    best = values["best_fixed_order"]
    answer(f"the fixed order that proves best here: {best['tests']:.2f} tests: {best['order']}")


def _show_judged(values: Values, _result: Any) -> None:
    columns = ("group", "method", "lives", "coverage90", "below1", "crps", "accuracy", "width")
    print_columns(values["rows"], columns, "remaining lives")
    for name, row in values["plan"].items():
        if isinstance(row, dict):
            text = ", ".join(f"{key} {value:.3g}" for key, value in row.items())
            answer(f"fleet, {name}: {text} (of a unit and a year)")


def _show_lives(values: Values, result: Any) -> None:
    columns = ("law", "histories", "accuracy", "coverage", "horizon", "unscented_accuracy",
               "unaided_accuracy")  # fmt: skip
    print_columns(values["summary"], columns)
    answer(*result.left_out)
    answer(f"{result.seconds:.0f} s; one update with its prediction {values['longest_s']:.2g} s")


def _check_table(options: Options) -> None:
    check_file(options["table"], options)


_STEPS: Mapping[str, Mapping[str, Callable[..., None]]] = {
    "independent": {"prepare": _check_table, "finish": _save_independent},
    "monitor-delay": {"show": _show_watched},
    "inspection-error": {"show": _show_inspected},
    "fault-limits": {"prepare": _check_table, "finish": _save_table},
    "next-test": {"show": _show_saved},
    "prognosis": {"show": _show_lives},
    "lives": {"show": _show_judged},
}

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    cls=NamingGroup,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Judge Elevon's own diagnosis and prognosis; exit code 1 when a check fails.",
)


@app.callback()
def _group() -> None:
    """Judge Elevon's own diagnosis and prognosis; exit code 1 when a check fails."""


for _study in read_cases(packaged_toml("studies", "commands.toml"), _STEPS):
    add_command(app, _study)
