"""What a notebook shows of a calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from elevon.actuator import Actuator
from elevon.estimate import Estimate
from elevon.number_text import estimate_row
from elevon.report.cards import Html, badge, card, table


def calibration_card(
    before: Actuator,
    logs: Sequence[str],
    estimates: Sequence[Estimate],
    undetermined: Mapping[str, str],
) -> Html:
    """Return the HTML view: each number with its interval, then what the logs cannot tell."""
    rows = [estimate_row(item, before) for item in estimates]
    head = ["parameter", "before", "after", "low", "high", "unit", "holds for"]
    facts = [("", badge("ok")), ("from", ", ".join(logs)), ("intervals of", "90 %")]
    parts = [table(head, rows)]
    if undetermined:
        parts.append(table(["not determined", "reason"], undetermined.items()))
    return card(f"Calibration of {before.name}", facts, *parts)
