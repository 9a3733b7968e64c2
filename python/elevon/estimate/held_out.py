"""Data kept from a fit: which parts, and what values fitted to the rest say of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from elevon.errors import InputError, Interrupted
from elevon.progress import Progress, part

T = TypeVar("T")
M = TypeVar("M")
R = TypeVar("R")


def folds(items: Sequence[T]) -> list[tuple[list[T], list[T]]]:
    """Return pairs of what is kept and what is left out: each item once."""
    return [([*items[:k], *items[k + 1 :]], [items[k]]) for k in range(len(items))]


def held_out(
    items: Sequence[T],
    fit: Callable[[Sequence[T]], M],
    judge: Callable[[T, M, Progress | None], R],
    progress: Progress | None = None,
) -> Iterator[tuple[T, R | None]]:
    """Fit without each item in turn and judge it by the values of the others.

    Parameters
    ----------
    items : sequence
        Logs, or parts of one.
    fit : callable
        Items to a model; `InputError` where they determine too little.
    judge : callable
        The item left out, the model and progress to the answer.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Yields
    ------
    (item, answer or None)
        None where the others determine too little.

    Raises
    ------
    Interrupted
        `progress` returned False.
    """
    for k, (others, left) in enumerate(folds(items)):
        share = part(progress, k / len(items), (k + 1) / len(items))
        if share is not None and not share(0.0):
            raise Interrupted("stopped")
        try:
            answer = judge(left[0], fit(others), share)
        except InputError:
            yield left[0], None
        else:
            yield left[0], answer
