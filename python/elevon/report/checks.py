"""One checked number: what it is, what it may be at most, and whether it is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from elevon.plain import Plain


@dataclass(frozen=True, slots=True)
class Check(Plain):
    """A number held against its limit.

    Attributes
    ----------
    name : str
        What is checked, in words.
    value : float
        The number found.
    limit : float
        What it is held against.
    unit : str
        Unit of both, as shown.
    at_least : bool
        Whether `limit` is the smallest allowed value instead of the largest.
    ours : float, optional
        What the work itself found, where `value` is its distance from a printed number.
    ours_unit : str, optional
        Its unit, where that is not `unit`.
    """

    COMPUTED = ("passed",)

    name: str
    value: float
    limit: float
    unit: str = ""
    at_least: bool = False
    ours: float | None = None
    ours_unit: str | None = None

    @property
    def passed(self) -> bool:
        """Whether the value keeps its limit; a value that is not finite never does."""
        if not math.isfinite(self.value):
            return False
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    @property
    def word(self) -> str:
        """``pass`` or ``fail``."""
        return "pass" if self.passed else "fail"

    @property
    def digits(self) -> str:
        """The value as a table shows it."""
        return f"{self.value:.5g}"

    @property
    def bound(self) -> str:
        """The limit as a table shows it, with the side on which the value has to be."""
        side = "\N{GREATER-THAN OR EQUAL TO}" if self.at_least else "\N{LESS-THAN OR EQUAL TO}"
        return f"{side} {self.limit:.5g}"


def all_passed(checks: Iterable[Check]) -> bool:
    """Tell whether there is at least one check and none failed."""
    results = [check.passed for check in checks]
    return bool(results) and all(results)


def verdict(checks: Sequence[Check]) -> dict[str, object]:
    """Return ``status`` (``pass``, ``fail``) and ``checks``, as every reproduction prints them."""
    return {
        "status": "pass" if all_passed(checks) else "fail",
        "checks": [check.to_dict() for check in checks],
    }


class WithChecks(Protocol):
    """What has checks."""

    @property
    def checks(self) -> Sequence[Check]:
        """What it is held to."""


class CheckedResult(Plain):
    """A result that is judged: its JSON form begins with ``status`` and ``checks``."""

    if TYPE_CHECKING:

        @property
        def checks(self) -> Sequence[Check]:
            """What it is held to."""

    def to_dict(self, *, stored: bool = True) -> dict[str, Any]:
        """Return the JSON form, the verdict first."""
        return {**verdict(self.checks), **super().to_dict(stored=stored)}
