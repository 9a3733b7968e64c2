"""`elevon campaign` and `elevon dataset`: many labelled runs from a plan, and what they left."""

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
    silent_after: Annotated[str, Option(metavar="QUANTITY")] = "30 s",
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
    silent_after : str
        Name a worker without a sign; twice as late others get its blocks.
    allow_outside : bool
        Let the plan read files outside its folder.
    """
    from elevon.campaign import load_plan, resolve_plan, run_campaign

    read, document = load_plan(plan)
    resolved = resolve_plan(read, document, allow_outside=allow_outside)
    silence = _silence(silent_after)
    work = partial(run_campaign, resolved, document.text, out, silent_after=silence)
    return _carried_out(work, out, f"running {read.name}", threads, _cluster(scheduler, cluster))


@command(app)
def resume(
    folder: Path,
    *,
    threads: int | None = None,
    scheduler: Annotated[str | None, Option(metavar="ADDRESS")] = None,
    cluster: Annotated[str | None, Option(metavar="local:N")] = None,
    silent_after: Annotated[str, Option(metavar="QUANTITY")] = "30 s",
) -> Answer:
    """Go on with a campaign from its folder; the plan file is not needed.

    Parameters
    ----------
    scheduler : str
        Of a Dask scheduler.
    cluster : str
        N Dask workers started here.
    silent_after : str
        Name a worker without a sign; twice as late others get its blocks.
    """
    from elevon.campaign import resume_campaign

    work = partial(resume_campaign, folder, silent_after=_silence(silent_after))
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


def _silence(text: str) -> float:
    from elevon.errors import InputError
    from elevon.units import parse_quantity

    seconds = parse_quantity(text, "s", "--silent-after")
    if not 1.0 <= seconds <= 86400.0:
        raise InputError(f"--silent-after {text}: is outside 1 s to 24 h")
    return seconds


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
    return Answer(_summary(result, out), lambda: _print_result(result, out), code)


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


def _print_result(result: Any, out: Path) -> None:
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
    return Answer(result, page=result.report)


datasets = group("Describe, verify, export, split a data set.")


@command(datasets)
def describe(folder: Path) -> Answer:
    """Say what is in a data set: runs, faults, distributions, columns."""
    from elevon.campaign import load_campaign
    from elevon.campaign.card import describe as described

    about = described(load_campaign(folder))
    return Answer(about, lambda: _print_about(about))


def _print_about(about: dict[str, Any]) -> None:
    typer.echo(f"{about['name']}: {about['actuator']}, {about['fidelity']} fidelity")
    typer.echo(f"{about['runs']} runs ({_counts(about['statuses'])}), {about['bytes']} bytes")
    if about["splits"]:
        typer.echo(f"parts: {_counts(about['splits'])}")
    rows = [[f["name"], f["unit"], f["runs"], *_ends(f)] for f in about["faults"]]
    print_table(["fault", "unit", "runs", "smallest", "largest"], rows)
    rows = [[v["name"], v["unit"], v["role"], *_ends(v)] for v in about["varied"]]
    print_table(["varied", "unit", "role", "smallest", "largest"], rows)
    for text in about["not_acting"]:
        typer.echo(f"has no effect: {text}")


@command(datasets)
def verify(folder: Path) -> Answer:
    """Check that every file is as written, every run there once, and nothing leaks: exit 0 or 1."""
    from elevon.campaign.verify import verify as verified
    from elevon.report import all_passed, verdict

    with progress_bar("verifying") as advance:
        checks = verified(folder, advance)
    passed = all_passed(checks)

    def show() -> None:
        wrong = sum(not c.passed for c in checks)
        answer(f"{folder}: {f'{wrong} of {len(checks)} checks fail' if wrong else 'whole'}")
        rows = [["pass" if c.passed else "FAIL", f"{c.value:.0f}", c.name] for c in checks]
        print_table(["", "count", "what is wrong"], rows)

    if not passed:
        say(
            f"elevon dataset repair {folder} rebuilds what it can prove; elevon campaign resume "
            f"{folder} simulates lost blocks again"
        )
    return Answer(verdict(checks), show, 0 if passed else 1)


@command(datasets)
def export(
    folder: Path,
    *,
    out: Annotated[Path, Option(metavar="DIR")],
    form: Annotated[str, Option("--format")] = "mat",
    runs: Annotated[str | None, Option(metavar="LIST")] = None,
    force: bool = False,
) -> Answer:
    """Write one file a run and a table of the runs, for MATLAB and other programs.

    Parameters
    ----------
    out : path
        Folder of the files.
    form : str
        mat, csv, nc or parquet.
    runs : str
        Such as 0-99,250; default all.
    """
    from elevon.campaign import load_campaign
    from elevon.campaign.export import export as exported
    from elevon.campaign.export import run_numbers

    ds = load_campaign(folder)
    numbers = None if runs is None else run_numbers(runs, len(ds))
    with progress_bar("writing") as advance:
        files = exported(ds, out.expanduser(), form, numbers, force=force, progress=advance)
    data = {
        "status": "ok",
        "runs": len(ds) if numbers is None else len(numbers),
        "files": files,
        "out": out,
    }
    return Answer(data, lambda: answer(f"{len(files)} files in {out}"))


@command(datasets)
def split(
    folder: Path,
    *,
    share: Annotated[list[str], Option(metavar="NAME=SHARE")],
    by: str | None = None,
    seed: Annotated[int, Option(min=0)] = 0,
) -> Answer:
    """Deal whole units or draws to parts anew; the samples stay as they are.

    Parameters
    ----------
    share : list of str
        A part; repeatable.
    by : str
        unit or draw; default unit where there are units.
    seed : int
        Seed of the dealing.
    """
    from elevon.campaign.folder import resplit

    counts = resplit(folder, _shares(share), by=by, seed=seed)
    return Answer(
        {"status": "ok", "splits": counts, "out": folder}, lambda: answer(_counts(counts))
    )


@command(datasets)
def repair(folder: Path) -> Answer:
    """Rebuild damaged manifest, plans, table and log from what is whole; simulates nothing."""
    from elevon.campaign.repair import repair as repaired

    done = repaired(folder.expanduser())
    return Answer(
        {"status": "ok", "done": done, "out": folder},
        lambda: answer("\n".join(done) if done else "nothing is damaged"),
    )


def _shares(texts: list[str]) -> dict[str, float]:
    from elevon.errors import InputError

    shares: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            equals = ""
        if not equals or not name.strip() or name.strip() in shares:
            raise InputError(f"--share {text!r} is not of the form NAME=SHARE, once a name")
        shares[name.strip()] = number
    return shares


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def _ends(item: dict[str, Any]) -> list[str]:
    if "counts" in item:
        return [_counts(item["counts"])[:60], ""]
    return [f"{item[key]:.6g}" if key in item else "" for key in ("min", "max")]
