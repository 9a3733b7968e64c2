"""``elevon dataset``: what is in a campaign's folder, whether it is whole, other forms of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from elevon.cli.groups import group
from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, command
from elevon.option import Option

app = group("Describe, verify, export, split a data set.")


@command(app)
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


@command(app)
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


@command(app)
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


@command(app)
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
    from elevon.campaign.resplit import resplit

    counts = resplit(folder, _shares(share), by=by, seed=seed)
    return Answer(
        {"status": "ok", "splits": counts, "out": folder}, lambda: answer(_counts(counts))
    )


@command(app)
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
