"""Deal the runs of a finished data set to other parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from elevon.campaign.card import write_cards
from elevon.campaign.dataset import Dataset
from elevon.campaign.split import dealt
from elevon.campaign.store import (
    RUNS,
    plan_hash,
    read_manifest,
    read_outcome,
    read_resolved,
    write_runs,
)
from elevon.errors import InputError
from elevon.worklog import digest, locked

__all__ = ["resplit"]


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
        manifest = read_manifest(folder)
        if manifest.status == "running":
            raise InputError(f"{folder}: is not finished; elevon campaign resume {folder}")
        resolved = read_resolved(folder)
        population = bool((resolved.index.unit >= 0).all())
        noun = by or ("unit" if population else "draw")
        _check_noun(noun, population=population)
        groups = resolved.index.unit if noun == "unit" else resolved.index.draw
        split = dealt(groups, shares, seed, "--share", noun)
        resolved.index = replace(resolved.index, split=split)
        write_runs(folder, resolved, read_outcome(folder))
        manifest.plan_hash = plan_hash(resolved)
        manifest.files[RUNS] = digest(folder / RUNS)
        write_cards(Dataset(folder, manifest))
        manifest.write(folder)
    return {name: int((split == name).sum()) for name in shares}


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
