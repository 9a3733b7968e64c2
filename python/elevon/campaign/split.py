"""Deal runs to the parts of a data set: whole units or whole draws, never parts of one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.campaign.resolved import Resolved
from elevon.errors import InputError

Groups = npt.NDArray[np.int64]


def dealt(
    groups: Groups, shares: Mapping[str, float], seed: int, place: str, noun: str
) -> npt.NDArray[np.object_]:
    """Return the part of each run.

    Parameters
    ----------
    groups : ndarray, shape (runs,)
        Number of the unit or draw that each run belongs to.
    shares : mapping
        Part to its share; they add up to 1.
    seed : int
        Of the dealing.
    place, noun : str
        Where the shares stand, and what the groups are (``unit``, ``draw``); for the error.

    Raises
    ------
    InputError
        So few groups that a part would get none.
    """
    known, member = np.unique(groups, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(known))
    names, limits = list(shares), np.cumsum(list(shares.values()))
    part = np.searchsorted(limits, (np.arange(len(known)) + 0.5) / len(known), side="right")
    part = np.minimum(part, len(names) - 1)
    for number, name in enumerate(names):
        if shares[name] > 0.0 and number not in part:
            raise InputError(
                f"{place}: {name} = {shares[name]:g} of {len(known)} {noun}(s) is none; "
                f"a {noun} is never divided between two parts"
            )
    of_group = np.empty(len(known), dtype=np.int64)
    of_group[order] = part
    return np.array(names, dtype=object)[of_group[member]]


def split_index(resolved: Resolved, about: Mapping[str, Any], place: str = "split") -> None:
    """Deal the runs of a resolved plan to parts.

    Parameters
    ----------
    resolved : Resolved
        Changed: its index and its `split`.
    about : mapping
        ``shares``, ``by`` (``unit`` or ``draw``) and ``seed``; empty: no parts.
    place : str
        Where the shares stand; for the error.

    Raises
    ------
    InputError
        So few groups that a part would get none.
    """
    index = resolved.index
    parts: npt.NDArray[Any] = np.full(len(index.seed), "", dtype=object)
    if about:
        groups = index.unit if about["by"] == "unit" else index.draw
        parts = dealt(groups, about["shares"], about["seed"], place, about["by"])
    resolved.index = replace(index, split=parts)
    resolved.split = dict(about)


def leaks(groups: Sequence[object], split: Sequence[str]) -> list[object]:
    """Return the groups (units or draws) whose runs stand in more than one part."""
    first: dict[Any, str] = {}
    distinct: dict[Any, None] = {}
    for group, part in zip(groups, split, strict=True):
        if first.setdefault(group, part) != part:
            distinct[group] = None
    return list(distinct)
