"""`python -m studies`: what each study computes, writes and prints.

A study is a function: its signature and docstring give its command its options and help.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.groups import NamingGroup
from elevon.cli.output import answer, say
from elevon.option import Option
from elevon.progress import Progress, part
from elevon_cases.case import Options, PublishedCase, Values, add_command, check_file, print_columns

if TYPE_CHECKING:
    from elevon.report import Report
    from studies.fault_limits.limits import FaultLimits

__all__ = ["STUDIES", "app", "fault_limits_page"]

STUDIES: list[PublishedCase] = []

Folder = Annotated[Path | None, Option(metavar="DIR")]
Positive = Annotated[int, Option(min=1)]
Processes = Annotated[int | None, Option(min=1)]
Natural = Annotated[int, Option(min=0)]
Pairs = Annotated[int, Option(min=2)]


def study(title: str, **about: Any) -> Callable[[Callable[..., object]], Callable[..., object]]:
    """Return a decorator that makes a function a study; the rest is of `PublishedCase`."""

    def make(work: Callable[..., object]) -> Callable[..., object]:
        name = work.__name__.replace("_", "-")
        text = (work.__doc__ or "").partition("\n")[0]
        STUDIES.append(PublishedCase(name, text, title, work, **about))
        return work

    return make


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


def _save_independent(
    result: Any,
    *,
    units: int,
    healthy: int,
    switching: int,
    learned: int,
    seed: int,
    force: bool,
    table: Path | None = None,
) -> None:
    """Write the page of evidence.

    Parameters
    ----------
    table : path
        Markdown file for the limits of all tests.
    """
    from studies.independent.table import independent_table

    if table is not None:
        numbers = (
            f"--units {units} --healthy {healthy} --switching {switching} --learned {learned} "
            f"--seed {seed}"
        )
        text = independent_table(result, f"python -m studies independent {numbers}")
        _write_page(table, text, force=force)


def _save_table(
    result: Any,
    *,
    days: int,
    injected: int,
    fidelity: str,
    seed: int,
    force: bool,
    actuator: Sequence[str] = (),
    table: Path | None = None,
) -> None:
    """Write the page of evidence.

    Parameters
    ----------
    table : path
        Markdown file for the limits of all tests.
    """
    from studies.fault_limits.table import limits_table

    if table is not None:
        options = {"days": days, "injected": injected, "fidelity": fidelity, "seed": seed}
        text = limits_table(result, _again(options | {"actuator": actuator}))
        _write_page(table, text, force=force)


def _write_page(path: Path, text: str, *, force: bool) -> None:
    from elevon.files import write_text

    write_text(path, text, force=force)
    say(f"table: {path}")


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


@study(
    "making and diagnosing logs",
    columns=("group", "test", "fault", "severity", "logs", "detected", "isolated", "interval",
             "error_median", "coverage"),
    page="studies.diagnosis_limits.page:limits_report",
)  # fmt: skip
def diagnosis_limits(
    *, runs: Positive = 8, seed: int = 0, out: Folder = None, progress: Progress | None = None
) -> object:
    """Diagnose logs of benches that are unlike the model: false alarms, isolation, severity.

    Parameters
    ----------
    runs : int
        Units of the bench, 95 logs each.
    """
    from studies.diagnosis_limits.result import study_diagnosis_limits

    return study_diagnosis_limits(seed=seed, units=runs, folder=out, progress=progress)


@study(
    "making and diagnosing logs",
    columns=("what", "hits", "logs", "share", "interval"),
    page="studies.independent.page:independent_report",
    prepare=_check_table,
    finish=_save_independent,
)
def independent(
    *,
    units: Positive = 4,
    healthy: Annotated[int, Option(min=4)] = 17,
    switching: Natural = 60,
    learned: Natural = 7,
    processes: Processes = None,
    runs: Folder = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> object:
    """Diagnose logs of another program: false alarms, unknown causes, single faults.

    Parameters
    ----------
    units : int
        Units of the foreign bench.
    healthy : int
        Healthy logs of each test.
    switching : int
        Healthy logs of the screw and of the gear.
    learned : int
        Days of each test that a spread is learnt from.
    processes : int
        Side by side; default: all processors.
    runs : path
        Keeps what is finished, and goes on from there.
    """
    from studies.independent import Plan, study_independent

    plan = Plan(units, healthy, switching, seed, learned)
    return study_independent(plan, folder=runs, processes=processes, progress=progress)


@study("identifying axes", columns=("drives", "fits", "intervals", "coverage", "interval", "width"))
def controllers(
    *, fits: Annotated[int, Option(min=7)] = 210, seed: int = 0, progress: Progress | None = None
) -> object:
    """Identify axes under known and under other controllers: which intervals hold.

    Parameters
    ----------
    fits : int
        Axes, over seven drives.
    """
    from studies.controllers import study_controllers

    return study_controllers(seed=seed, fits=fits, progress=progress)


@study("making logs", columns=("what", "hits", "logs", "share", "interval"))
def learned(
    *,
    units: Annotated[int, Option(min=8)] = 16,
    processes: Processes = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> object:
    """Learn classes of labelled logs of another program; units left out and others judge.

    Parameters
    ----------
    units : int
        Of the foreign bench; a quarter is not learnt.
    processes : int
        Side by side; default: all processors.
    """
    from studies.learned import study_learned

    return study_learned(seed=seed, units=units, processes=processes, progress=progress)


@study(
    "making and watching streams",
    columns=("fault", "severity", "streams", "alarms", "before_onset", "delay_median",
             "delay_largest", "named"),
    table="streams in which a fault begins",
    show=_show_watched,
)  # fmt: skip
def monitor_delay(
    *, units: Positive = 3, seed: int = 0, progress: Progress | None = None
) -> object:
    """Watch streams in which a fault begins: delay against severity, and false alarms.

    Parameters
    ----------
    units : int
        Benches, 39 streams each.
    """
    from studies.monitor_delay import study_monitor_delay

    return study_monitor_delay(seed=seed, units=units, progress=progress)


@study(
    "recording and watching healthy days",
    columns=("actuator", "days", "windows", "hours", "alarms", "per_hour", "interval",
             "days_without"),
)  # fmt: skip
def monitor_hours(
    *, days: Pairs = 6, processes: Processes = None, seed: int = 0, progress: Progress | None = None
) -> object:
    """Watch healthy units of three actuators: alarms in hours made of recorded days' windows.

    Parameters
    ----------
    days : int
        Healthy days of each actuator.
    processes : int
        Side by side; default: all processors.
    """
    from studies.monitor_hours import study_monitor_hours

    return study_monitor_hours(seed=seed, days=days, processes=processes, progress=progress)


@study(
    "making and diagnosing inspections",
    columns=("fault", "relative", "absolute", "common_relative", "common_absolute",
             "stated_relative", "stated_absolute", "stated_over_scatter", "coverage"),
    table="deviations, and what intervals state",
    show=_show_inspected,
)  # fmt: skip
def inspection_error(
    *, units: Pairs = 6, runs: Folder = None, seed: int = 0, progress: Progress | None = None
) -> object:
    """Inspect units by three logs each: the errors of backlash, friction and short.

    Parameters
    ----------
    units : int
        Benches, 40 inspections each.
    runs : path
        Keeps what is finished, and goes on from there.
    """
    from studies.inspection_error.result import study_inspection_error

    return study_inspection_error(seed=seed, units=units, folder=runs, progress=progress)


@study(
    "running and diagnosing the standard tests",
    columns=_LIMITS,
    page="studies.commands:fault_limits_page",
    prepare=_check_table,
    finish=_save_table,
)
def fault_limits(
    *,
    actuator: Annotated[Sequence[str], Option(metavar="ACTUATOR")] = (),
    days: Positive = 10,
    injected: Natural = 12,
    fidelity: str = "low",
    seed: int = 0,
    out: Folder = None,
    progress: Progress | None = None,
) -> object:
    """Detection limit of each fault in each standard test of each actuator.

    Parameters
    ----------
    actuator : sequence of str
        Set; repeatable; default: one of each wiring.
    days : int
        Healthy logs of each test.
    injected : int
        Faults of each test that a log checks.
    fidelity : str
        Of the logs: high or low.
    """
    from studies.fault_limits.limits import LimitsPlan, study_fault_limits

    plan = LimitsPlan(days, injected, fidelity, seed)
    return study_fault_limits(plan, actuators=actuator, folder=out, progress=progress)


@study(
    "testing units",
    columns=("pair", "strategy", "units", "tests", "tests_interval", "certain", "right"),
    table="tests until one condition has 95 %",
    show=_show_saved,
)
def next_test(*, units: Pairs = 24, seed: int = 0, progress: Progress | None = None) -> object:
    """Choose tests by expected information on ambiguous pairs; count them and a fixed order's.

    Parameters
    ----------
    units : int
        Units of every pair.
    """
    from studies.next_test import study_next_test

    return study_next_test(seed=seed, units=units, progress=progress)


@study(
    "searching",
    columns=("method", "fault", "logs", "error_percent_of_range", "error_interval", "evaluations",
             "seconds", "reached_our_error"),
    table="severity error, model runs, processor time",
)  # fmt: skip
def diagnosis_optimisers(
    *,
    seeds: Pairs = 4,
    budget: Annotated[int, Option(min=40)] = 2000,
    processes: Processes = None,
    runs: Folder = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> object:
    """Diagnose by genetic algorithm, differential evolution, swarm, grey wolves, and by ours.

    Parameters
    ----------
    seeds : int
        Logs of every fault.
    budget : int
        Model runs of a search.
    processes : int
        Side by side; default: all processors.
    runs : path
        Keeps what is finished, and goes on from there.
    """
    from studies.optimisers.study import study_optimisers

    return study_optimisers(seed=seed, seeds=seeds, budget=budget, processes=processes,
                            folder=runs, progress=progress)  # fmt: skip


@study("run-to-failure histories", page="studies.prognosis.page:prognosis_report", show=_show_lives)
def prognosis(
    *,
    histories: Annotated[int, Option(min=3)] = 60,
    processes: Processes = None,
    measured: bool = False,
    seed: int = 0,
    out: Folder = None,
    progress: Progress | None = None,
) -> object:
    """Predict the ends of units on the switching model, under laws unlike the filter's.

    Parameters
    ----------
    histories : int
        Lives, over three faults.
    processes : int
        Side by side; default: all processors.
    measured : bool
        Inspections measure the requirements, too.
    """
    from studies.prognosis import study_prognosis

    return study_prognosis(histories=histories, seed=seed, processes=processes, folder=out,
                           measured=measured, progress=progress)  # fmt: skip


@study("remaining lives", page="studies.lives.result:lives_report", show=_show_judged)
def lives(
    *,
    lives: Annotated[int, Option(min=3)] = 300,
    by_law: Natural = 60,
    units: Natural = 200,
    public: Annotated[Sequence[str], Option(metavar="DIR")] = (),
    processes: Processes = None,
    runs: Folder = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> object:
    """Predict lives of growth drawn at random, by own laws, of fleets, and real ones.

    Parameters
    ----------
    lives : int
        Drawn at random.
    by_law : int
        By laws that the filter is told.
    units : int
        Of the fleet that is kept for five years.
    public : sequence of str
        Public set: CSVs and limit.txt; repeatable.
    processes : int
        Side by side; default: all processors.
    runs : path
        Keeps what is finished, and goes on from there.
    """
    from studies.lives import study_lives

    return study_lives(lives=lives, by_law=by_law, units=units, public=public or None, seed=seed,
                       processes=processes, folder=runs, progress=progress)  # fmt: skip


@study(
    "making and scoring the benchmark set",
    columns=("actuator", "part", "fault", "present", "runs", "auc", "auc_interval", "null", "age",
             "error", "error_interval"),
)  # fmt: skip
def benchmark_set(
    *,
    set: Annotated[Path, Option(metavar="DIR")],  # noqa: A002 - the option's name
    size: str = "small",
    runs: Processes = None,
    threads: Processes = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> object:
    """Make the benchmark set of three actuators, or go on with it; score what is learnt from it.

    Parameters
    ----------
    set : path
        Folder of the data set; resumed if begun.
    size : str
        small or full.
    runs : int
        About so many runs, in place of --size.
    threads : int
        Threads; default one a core.
    """
    from studies.benchmark_set import BenchmarkScores, make_benchmark, score_benchmark

    made = make_benchmark(
        set, size=size, runs=runs, seed=seed, threads=threads, progress=part(progress, 0.0, 0.6)
    )
    scores = score_benchmark(set, seed=seed, progress=part(progress, 0.6, 1.0))
    return BenchmarkScores(tuple(scores), made.failed)


@study(
    "running the campaign and learning",
    columns=("baselines", "runs", "false_alarms", "healthy", "alarms", "faulty", "single_first",
             "singles", "all_named", "brier", "covered", "severities"),
    table="units that were not learnt",
)  # fmt: skip
def learned_campaign(
    *,
    set: Annotated[Path, Option(metavar="DIR")],  # noqa: A002 - the option's name
    units: Annotated[int, Option(min=8)] = 100,
    judged: Annotated[int, Option(min=4)] = 30,
    fidelity: str = "high",
    threads: Processes = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> object:
    """Learn from a campaign of the rotary bench's sine; others judge classes, severities, time.

    Parameters
    ----------
    set : path
        Folder of the campaign; resumed if begun.
    units : int
        Units that are learnt from, 20 runs each.
    judged : int
        Units that judge.
    fidelity : str
        Of the runs: high or low.
    threads : int
        Threads; default one a core.
    """
    from studies.learned_campaign import study_learned_campaign

    return study_learned_campaign(set, units=units, judged=judged, fidelity=fidelity, seed=seed,
                                  threads=threads, progress=progress)  # fmt: skip


for _study in STUDIES:
    add_command(app, _study)
