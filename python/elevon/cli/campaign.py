"""``elevon campaign``: many labelled runs from a plan file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli import interrupt
from elevon.cli.groups import group
from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, DoorCall, command
from elevon.option import Option
from elevon.plain import fields_of

if TYPE_CHECKING:
    from elevon.analysis.effects import Effects
    from elevon.campaign.execute import CampaignResult

app = group("Run plans of many labelled simulations.")


@command(app)
def plan(
    plan: Annotated[Path, Option(metavar="PLAN")],
    *,
    threads: int | None = None,
    allow_outside: bool = False,
) -> Answer:
    """Check a plan and say what it will take; nothing is written.

    Parameters
    ----------
    plan : path
        The plan file (TOML).
    allow_outside : bool
        Let the plan read files outside its folder.
    """
    from elevon.campaign import load_plan, resolve_plan
    from elevon.campaign.check import check, estimate
    from elevon.simulate.batch import checked_threads

    read, document = load_plan(plan)
    resolved = resolve_plan(read, document, allow_outside=allow_outside)
    checked = check(resolved)
    need = estimate(resolved, checked, Path(), checked_threads(threads))
    data = {
        "status": "ok",
        **fields_of(resolved, "name", "responses", "design"),
        "runs": len(resolved),
        "blocks": need.blocks,
        "estimate": need,
        "columns": [
            fields_of(column, "name", "kind", "unit", "role") for column in resolved.columns
        ],
        "splits": _counted(resolved.index.split),
        "not_acting": checked.idle,
    }
    return Answer(data, lambda: _print_plan(resolved, need, checked.idle))


def _print_plan(resolved: Any, need: Any, idle: Sequence[str]) -> None:
    typer.echo(f"{resolved.name}: {need}")
    rows = [[c.name, c.kind, c.role, c.unit, _range(c)] for c in resolved.columns]
    print_table(["varied", "kind", "role", "unit", "values"], rows)
    for line in _design_lines(resolved.design):
        typer.echo(line)
    for part, count in _counted(resolved.index.split).items():
        typer.echo(f"split {part}: {count} runs")
    for text in idle:
        typer.echo(f"has no effect: {text}")


def _design_lines(design: dict[str, Any]) -> Iterator[str]:
    """Yield what a design cannot tell apart, and its power."""
    if "resolution" in design:
        generators = ", ".join(design.get("generators", []))
        yield f"resolution {design['resolution']}" + (
            f"; generators {generators}; I = {' = '.join(design['defining_words'])}"
            if generators
            else ""
        )
    for effect, others in design.get("aliases", {}).items():
        yield f"{effect} is aliased with {', '.join(others)}"
    if words := design.get("block_words"):
        yield f"blocks are confounded with {', '.join(words)}"
    for row in design.get("power", []):
        power = row["note"] if row["power"] is None else f"{row['power']:.3f} ({row['df']} df)"
        yield f"power of {row['term']}: {power}"


@command(app, "strict")
def run(
    plan: Annotated[Path, Option(metavar="PLAN")],
    *,
    out: Annotated[Path, Option(metavar="DIR")],
    threads: int | None = None,
    scheduler: Annotated[str | None, Option(metavar="ADDRESS")] = None,
    cluster: Annotated[str | None, Option(metavar="local:N")] = None,
    allow_outside: bool = False,
) -> Answer:
    """Run a plan into a folder; an interrupted one goes on where it was.

    Parameters
    ----------
    plan : path
        The plan file (TOML).
    out : path
        Folder of the results; resumed if begun.
    scheduler : str
        Of a Dask scheduler.
    cluster : str
        N Dask workers started here.
    allow_outside : bool
        Let the plan read files outside its folder.
    """
    from elevon.campaign import load_plan, resolve_plan, run_campaign

    read, document = load_plan(plan)
    resolved = resolve_plan(read, document, allow_outside=allow_outside)
    work = partial(run_campaign, resolved, document.text, out)
    return _carried_out(work, out, f"running {read.name}", threads, _cluster(scheduler, cluster))


@command(app)
def resume(
    folder: Path,
    *,
    threads: int | None = None,
    scheduler: Annotated[str | None, Option(metavar="ADDRESS")] = None,
    cluster: Annotated[str | None, Option(metavar="local:N")] = None,
) -> Answer:
    """Go on with a campaign from its folder; the plan file is not needed.

    Parameters
    ----------
    scheduler : str
        Of a Dask scheduler.
    cluster : str
        N Dask workers started here.
    """
    from elevon.campaign import resume_campaign

    work = partial(resume_campaign, folder)
    return _carried_out(work, folder, "going on", threads, _cluster(scheduler, cluster))


@command(app)
def status(folder: Path) -> Answer:
    """Say how far a campaign is."""
    state = _status(folder)
    line = (
        f"{state['name']}: {state['status']}, {state['done']} of {state['runs']} runs done, "
        f"{state['failed']} failed{', a process works on it' if state['active'] else ''}"
    )
    return Answer(state, lambda: answer(line))


def _status(folder: Path) -> dict[str, Any]:
    from elevon.campaign import load_campaign
    from elevon.campaign.store import work_log
    from elevon.worklog import is_locked

    ds = load_campaign(folder)
    log = work_log(folder, ds.manifest)
    if ds.manifest.status == "running":
        ended = [] if log is None else [s for i in log.items.values() for s in i.data["status"]]
    else:
        ended = ds.runs.to_arrow(["status"])["status"].to_pylist()
    counts = _counted(ended)
    return {
        **fields_of(ds.manifest, "status", "name"),
        "runs": len(ds),
        "done": len(ended),
        "failed": counts.get("diverged", 0) + counts.get("refused", 0),
        "counts": counts,
        "active": is_locked(folder),
        "out": folder,
    }


def _cluster(scheduler: str | None, cluster: str | None) -> str | None:
    from elevon.errors import InputError

    if scheduler is not None and cluster is not None:
        raise InputError("give either --scheduler or --cluster")
    for name, address in (("--scheduler", scheduler), ("--cluster", cluster)):
        if address is not None and not address.strip():
            raise InputError(f"{name} {address!r}: is no address")
    return cluster if scheduler is None else scheduler


def _how_far(out: Path) -> str:
    from elevon.errors import InputError

    try:
        state = _status(out)
    except InputError:
        return "nothing is kept; give the same command again to start over"
    return (
        f"{state['done']} of {state['runs']} runs are kept in {out}; give the same command "
        "again to go on"
    )


def _carried_out(
    work: Callable[..., CampaignResult],
    out: Path,
    title: str,
    threads: int | None,
    cluster: str | None,
) -> Answer:
    with interrupt.telling(lambda: _how_far(out)), progress_bar(title) as advance:
        result = work(threads=threads, cluster=cluster, progress=advance, announce=say)
    code = 1 if result.failed else 0
    return Answer(_summary(result, out), lambda: _print(result, out), code)


def _summary(result: Any, out: Path) -> dict[str, Any]:
    manifest = result.manifest
    fresh = manifest.total - result.skipped
    return {
        **fields_of(manifest, "status", "name", "not_acting", runs="total"),
        **fields_of(result, "counts", "skipped", "wall_s", "bytes", failed_runs="failed"),
        "failed": len(result.failed),
        "runs_per_hour": 3600.0 * fresh / result.wall_s,
        "bytes_per_run": result.bytes / manifest.total,
        "sim_s": sum(result.outcome["sim_s"]),
        "blocks": len(manifest.blocks),
        "out": out,
    }


def _print(result: Any, out: Path) -> None:
    counts = ", ".join(f"{count} {status}" for status, count in result.counts.items())
    earlier = f" ({result.skipped} done before)" if result.skipped else ""
    typer.echo(f"{result.manifest.total} runs{earlier}: {counts}")
    for number in result.failed[:20]:
        typer.echo(f"run {number}: {result.outcome['reason'][number]}")
    if len(result.failed) > 20:
        typer.echo(f"and {len(result.failed) - 20} more; see runs.parquet")
    typer.echo(f"{result.wall_s:.3g} s, in {out}")


def _counted(items: Any) -> dict[str, int]:
    return dict(Counter(str(item) for item in items if item))


def _range(column: Any) -> str:
    if not column.numeric:
        return ", ".join(dict.fromkeys(str(value) for value in column.values))[:60]
    return f"{column.values.min():.6g} to {column.values.max():.6g}"


@command(app, "report", "force", door="elevon.doors:effects")
def effects(door: DoorCall) -> Answer:
    """Say which factors move a response, and by how much: main effects and interactions."""
    result: Effects = door()
    return Answer(result, lambda: _print_effects(result), page=result.report)


def _print_effects(effects: Effects) -> None:
    from elevon.analysis.effects import EQUAL_REPEATS

    rows = [
        [t.term, t.name, f"{t.effect:.4g}", _interval(t), ", ".join(t.aliases)]
        for t in effects.terms
    ]
    answer(effects.headline, f"by {effects.method}")
    print_table(("term", "factors", "effect", "interval", "aliased with"), rows)
    for text, names in (
        ("confounded with the blocks", effects.blocked),
        ("left out, partly aliased", effects.partial),
    ):
        if names:
            typer.echo(f"{text}: {', '.join(names)}")
    if effects.equal_repeats:
        typer.echo(EQUAL_REPEATS)


def _interval(term: Any) -> str:
    if term.low is None:
        return "not known"
    return f"{term.low:.4g} to {term.high:.4g}{' *' if term.significant else ''}"
