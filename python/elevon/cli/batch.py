"""``elevon batch``: many runs from a plan file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from elevon.cli import interrupt
from elevon.cli.common import JsonOption, StrictOption
from elevon.cli.output import print_json, progress_bar, say

app = typer.Typer(rich_markup_mode=None)


@app.command()
def batch(
    plan: Annotated[Path, typer.Argument(metavar="PLAN.toml", help="The plan file.")],
    *,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the results; resumed if begun.")
    ],
    threads: Annotated[int | None, typer.Option(min=1, help="Threads; default one a core.")] = None,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
) -> int:
    """Run a plan of many simulations into a folder; an interrupted one goes on where it was."""
    from elevon.campaign import load_plan, resolve_plan, run_campaign

    read, document = load_plan(plan)
    planned = resolve_plan(read, document)
    with (
        interrupt.telling(lambda: _kept(out)),
        progress_bar(f"running {read.name}") as advance,
    ):
        result = run_campaign(
            read,
            planned,
            document.text,
            out,
            threads=threads,
            progress=advance,
            announce=say,
        )
    if json:
        print_json(_summary(result, out))
    else:
        _print(result, out)
    return 1 if result.manifest.status == "failed" else 0


def _kept(out: Path) -> str:
    from elevon.campaign import read_manifest
    from elevon.errors import InputError

    try:
        manifest = read_manifest(out)
    except InputError:
        return "nothing is kept; give the same command again to start over"
    return (
        f"{len(manifest.runs)} of {manifest.total} runs are kept in {out}; give the same command "
        "again to go on"
    )


def _summary(result: Any, out: Path) -> dict[str, Any]:
    manifest = result.manifest
    return {
        "status": manifest.status,
        "name": manifest.name,
        "runs": len(manifest.runs),
        "counts": result.counts,
        "skipped": result.skipped,
        "failed_runs": [run["run"] for run in manifest.runs if run["status"] == "diverged"],
        "sim_s": sum(run["sim_s"] for run in manifest.runs),
        "wall_s": result.wall_s,
        "blocks": len(manifest.blocks),
        "bytes": sum(file["bytes"] for block in manifest.blocks for file in block["files"]),
        "out": out,
    }


def _print(result: Any, out: Path) -> None:
    counts = ", ".join(f"{count} {status}" for status, count in result.counts.items())
    earlier = f" ({result.skipped} done before)" if result.skipped else ""
    typer.echo(f"{len(result.manifest.runs)} runs{earlier}: {counts}")
    for run in result.manifest.runs:
        if run["status"] == "diverged":
            typer.echo(f"run {run['run']}: {run['message']}")
    typer.echo(f"{result.wall_s:.3g} s, in {out}")
