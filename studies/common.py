"""What the studies share: a row that is noted and read back, progress that stops, an interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Self

import numpy as np

from elevon.errors import Interrupted
from elevon.progress import Progress

__all__ = ["Row", "advance", "student_interval"]


class Row:
    """Base of a frozen dataclass that stands in a log of finished work and in a result's rows."""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {item.name: _plain(getattr(self, item.name)) for item in fields(self)}  # type: ignore[arg-type]

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """Return what `to_dict` wrote; lists are tuples again."""
        return cls(**{name: _frozen(value) for name, value in data.items()})


def _plain(value: Any) -> Any:
    if isinstance(value, Row):
        return value.to_dict()
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def advance(progress: Progress | None, fraction: float, study: str) -> None:
    """Report the done fraction.

    Raises
    ------
    Interrupted
        `progress` returned False.
    """
    if progress is not None and progress(fraction) is False:
        raise Interrupted(f"{study} was stopped; what is finished is noted in its folder, if any")


def student_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Return the mean and its 95 % interval by Student's distribution; NaN ends of a single one."""
    from scipy.stats import t

    mean = float(np.mean(values))
    if len(values) < 2:
        return mean, math.nan, math.nan
    half = float(t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / math.sqrt(len(values)))
    return mean, mean - half, mean + half
