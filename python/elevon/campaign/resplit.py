"""Deal the runs of a finished data set to other parts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from elevon.campaign.folder import describe_anew, stage_tables
from elevon.campaign.resolved_file import LONGEST, RUNS, read_outcome, read_resolved
from elevon.campaign.split import split_index
from elevon.campaign.store import PLAN, read_manifest
from elevon.errors import InputError
from elevon.files import read_regular
from elevon.transaction import Transaction, settle
from elevon.worklog import locked, sweep


def resplit(
    folder: Path, shares: Mapping[str, float], *, by: str | None = None, seed: int = 0
) -> dict[str, int]:
    """Deal whole units, or whole draws, to parts; the samples stay as they are.

    Parameters
    ----------
    folder : path
        A finished campaign's folder.
    shares : mapping
        Part to its share; they add up to 1.
    by : str, optional
        ``unit`` or ``draw``; default ``unit`` where there is a population.
    seed : int
        Of the dealing.

    Returns
    -------
    dict
        Part to its number of runs.

    Raises
    ------
    InputError
        Shares that do not add up, a part that would be empty, a split that would leak, or a
        campaign that is not finished.
    """
    _check(shares)
    with locked(folder):
        sweep(folder)
        manifest = read_manifest(folder)
        manifest.check_writable(folder)
        settle(folder, manifest.files)
        if manifest.status == "running":
            raise InputError(f"{folder}: is not finished; elevon campaign resume {folder}")
        resolved = read_resolved(folder, manifest)
        population = bool((resolved.index.unit >= 0).all())
        noun = by or ("unit" if population else "draw")
        _check_noun(noun, population=population)
        split_index(resolved, {"shares": dict(shares), "by": noun, "seed": seed}, "--share")
        plan = read_regular(folder / PLAN, LONGEST).decode("utf-8")
        change = Transaction(folder)
        stage_tables(change, resolved, plan, read_outcome(folder / RUNS))
        manifest.split = resolved.split
        describe_anew(change, manifest)
    return {name: int((resolved.index.split == name).sum()) for name in shares}


def _check(shares: Mapping[str, float]) -> None:
    values = list(shares.values())
    if not values or min(values) < 0.0 or abs(sum(values) - 1.0) > 1e-9:
        raise InputError(f"--share: the shares are {values}; they must add up to 1")


def _check_noun(noun: str, *, population: bool) -> None:
    if noun not in {"unit", "draw"}:
        raise InputError(
            f"--by {noun} would leak: runs alike stand in two parts; valid: unit, draw"
        )
    if noun == "draw" and population:
        raise InputError("--by draw would leak: runs of one unit stand in two parts")
    if noun == "unit" and not population:
        raise InputError("--by unit: the campaign has no population")
