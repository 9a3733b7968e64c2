"""What is guessed of one column of a foreign log."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class GuessedColumn:
    """A column: its role and its unit, where they are known, and why."""

    name: str
    role: str | None = None
    unit: str | None = None
    sign: int = 1
    reasons: list[str] = field(default_factory=list)
