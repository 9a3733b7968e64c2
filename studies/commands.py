"""`python -m studies`: what each study computes, writes and prints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.groups import NamingGroup
from elevon.cli.output import answer, say
from elevon.cli.reproduce.case import (
    Options,
    PublishedCase,
    Values,
    add_command,
    check_file,
    print_columns,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elevon.progress import Progress
    from elevon.report import Report
    from studies.fault_limits.limits import FaultLimits

__all__ = ["app", "fault_limits", "fault_limits_page", "independent"]

_LOGGED = Annotated[int, typer.Option("--runs", min=1, help="Units of the bench, 95 logs each.")]
_WATCHED = Annotated[int, typer.Option("--units", min=1, help="Benches, 39 streams each.")]
_FOREIGN = Annotated[int, typer.Option("--units", min=1, help="Units of the foreign bench.")]
_HEALTHY = Annotated[int, typer.Option("--healthy", min=4, help="Healthy logs of each test.")]
_SWITCHING = Annotated[
    int, typer.Option("--switching", min=0, help="Healthy logs of the screw and of the gear.")
]
_LEARNT = Annotated[
    int, typer.Option("--learned", min=0, help="Days of each test that a spread is learnt from.")
]
_INSPECTED = Annotated[int, typer.Option("--units", min=2, help="Benches, 40 inspections each.")]
_PAIRED = Annotated[int, typer.Option("--units", min=2, help="Units of every pair.")]
_FOLDER = Annotated[
    Path | None,
    typer.Option("--runs", metavar="DIR", help="Keeps what is finished, and goes on from there."),
]
_SEEDS = Annotated[int, typer.Option("--seeds", min=2, help="Logs of every fault.")]
_BUDGET = Annotated[int, typer.Option("--budget", min=40, help="Model runs of a search.")]
_PROCESSES = Annotated[
    int | None, typer.Option("--processes", min=1, help="Side by side; default: all processors.")
]
_HISTORIES = Annotated[int, typer.Option("--histories", min=3, help="Lives, over three faults.")]
_LIVES = Annotated[int, typer.Option("--lives", min=1, help="Lives of each form and fault.")]
_SPECIMENS = Annotated[int, typer.Option("--specimens", min=0, help="Virkler's cracks.")]
_MEASURED = Annotated[
    bool, typer.Option("--measured", help="Inspections measure the requirements, too.")
]
_ACTUATORS = Annotated[
    list[str] | None,
    typer.Option("--actuator", help="Set; repeatable. Default: one of each wiring."),
]
_DAYS = Annotated[int, typer.Option("--days", min=1, help="Healthy logs of each test.")]
_INJECTED = Annotated[
    int, typer.Option("--injected", min=0, help="Faults of each test that a log checks.")
]
_FIDELITY = Annotated[str, typer.Option("--fidelity", help="Of the logs: high or low.")]
_TABLE = Annotated[
    Path | None, typer.Option("--table", help="Markdown file for the limits of all tests.")
]
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
    from elevon.report import Report, ReportTable
    from elevon.reproduce.provenance import provenance

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


def _show_foreign(values: Values, _result: Any) -> None:
    columns = ("density", "form", "method", "lives", "accuracy", "coverage", "width", "off_law")
    print_columns(values["rows"], columns, "remaining lives, 50 to 90 % of life")


def _show_lives(values: Values, result: Any) -> None:
    columns = ("law", "histories", "accuracy", "coverage", "horizon", "unscented_accuracy",
               "unaided_accuracy")  # fmt: skip
    print_columns(values["summary"], columns)
    answer(*result.left_out)
    answer(f"{result.seconds:.0f} s; one update with its prediction {values['longest_s']:.2g} s")


_STUDIES = (
    PublishedCase(
        "diagnosis-limits",
        "Diagnose logs of benches that are unlike the model: false alarms, isolation, severity.",
        "making and diagnosing logs",
        "studies.diagnosis_limits.result:study_diagnosis_limits",
        ("group", "test", "fault", "severity", "logs", "detected", "isolated", "interval",
         "error_median", "coverage"),
        page="studies.diagnosis_limits.page:limits_report",
        options={"runs": (_LOGGED, 8)},
        names={"folder": "out", "units": "runs"},
    ),
    PublishedCase(
        "independent",
        "Diagnose logs of another program: false alarms, unknown causes, single faults.",
        "making and diagnosing logs",
        "studies.commands:independent",
        ("what", "hits", "logs", "share", "interval"),
        page="studies.independent.page:independent_report",
        options={
            "units": (_FOREIGN, 4),
            "healthy": (_HEALTHY, 17),
            "switching": (_SWITCHING, 60),
            "learned": (_LEARNT, 7),
            "processes": (_PROCESSES, None),
            "runs": (_FOLDER, None),
            "table": (_TABLE, None),
        },
        names={"folder": "runs"},
        prepare=lambda options: check_file(options["table"], options),
        finish=_save_independent,
    ),
    PublishedCase(
        "monitor-delay",
        "Watch streams in which a fault begins: delay against severity, and false alarms.",
        "making and watching streams",
        "studies.monitor_delay:study_monitor_delay",
        ("fault", "severity", "streams", "alarms", "before_onset", "delay_median",
         "delay_largest", "named"),
        "streams in which a fault begins",
        options={"units": (_WATCHED, 3)},
        show=_show_watched,
    ),
    PublishedCase(
        "inspection-error",
        "Inspect units by three logs each: the errors of backlash, friction and short.",
        "making and diagnosing inspections",
        "studies.inspection_error.result:study_inspection_error",
        ("fault", "relative", "absolute", "common_relative", "common_absolute",
         "stated_relative", "stated_absolute", "stated_over_scatter", "coverage"),
        "deviations, and what intervals state",
        options={"units": (_INSPECTED, 6), "runs": (_FOLDER, None)},
        names={"folder": "runs"},
        show=_show_inspected,
    ),
    PublishedCase(
        "fault-limits",
        "Detection limit of each fault in each standard test of each actuator.",
        "running and diagnosing the standard tests",
        "studies.commands:fault_limits",
        _LIMITS,
        page="studies.commands:fault_limits_page",
        options={
            "actuator": (_ACTUATORS, None),
            "days": (_DAYS, 10),
            "injected": (_INJECTED, 12),
            "fidelity": (_FIDELITY, "low"),
            "table": (_TABLE, None),
        },
        prepare=lambda options: check_file(options["table"], options),
        finish=_save_table,
    ),
    PublishedCase(
        "next-test",
        "Choose tests by expected information on ambiguous pairs; count them and a fixed order's.",
        "testing units",
        "studies.next_test:study_next_test",
        ("pair", "strategy", "units", "tests", "tests_interval", "certain", "right"),
        "tests until one condition has 95 %",
        options={"units": (_PAIRED, 24)},
        show=_show_saved,
    ),
    PublishedCase(
        "diagnosis-optimisers",
        "Diagnose by genetic algorithm, differential evolution, swarm, grey wolves, and by ours.",
        "searching",
        "studies.optimisers.study:study_optimisers",
        ("method", "fault", "logs", "error_percent_of_range", "error_interval",
         "evaluations", "seconds", "reached_our_error"),
        "severity error, model runs, processor time",
        options={
            "seeds": (_SEEDS, 4),
            "budget": (_BUDGET, 2000),
            "processes": (_PROCESSES, None),
            "runs": (_FOLDER, None),
        },
        names={"folder": "runs"},
    ),
    PublishedCase(
        "prognosis",
        "Predict the ends of units on the switching model, under laws unlike the filter's.",
        "run-to-failure histories",
        "studies.prognosis:study_prognosis",
        page="studies.prognosis.page:prognosis_report",
        options={
            "histories": (_HISTORIES, 60),
            "processes": (_PROCESSES, None),
            "measured": (_MEASURED, False),
        },
        show=_show_lives,
    ),
    PublishedCase(
        "foreign",
        "Predict lives whose growth no law describes, beside methods without a law.",
        "foreign growth",
        "studies.foreign:study_foreign",
        page="studies.foreign.page:foreign_report",
        options={
            "lives": (_LIVES, 7),
            "specimens": (_SPECIMENS, 68),
            "processes": (_PROCESSES, None),
        },
        show=_show_foreign,
    ),
)  # fmt: skip

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


for _study in _STUDIES:
    add_command(app, _study)
