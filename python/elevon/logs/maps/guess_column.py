"""What is guessed of one column of a foreign log."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class GuessedColumn:
    """A column: its role (empty: not known), its unit, and why."""

    name: str
    role: str = ""
    unit: str = ""
    sign: int = 1
    reasons: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, object]:
        """Return it as plain types."""
        return {
            "name": self.name,
            "role": self.role or None,
            "unit": self.unit or None,
            "sign": self.sign,
            "reasons": list(self.reasons),
        }
