"""The report of a comparison of the two fidelities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.data import packaged_toml
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from elevon.compare import Comparison
    from elevon.report import Report

_DISPLAYED = {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3), "rad/s": ("rpm", 30.0 / np.pi)}
_NAMES = {"position": "Output position", "speed": "Motor speed", "q_current": "Torque current"}


def compare_report(comparison: Comparison, actuator: str, *, date: str | None = None) -> Report:
    """Return the report of a comparison of an actuator named as on the command line."""
    from elevon.report.described import described

    values = comparison.to_dict()
    names = {"comparison": comparison, "values": values, "panels": panels(comparison)}
    report = described(packaged_toml("elevon.reproduce", "pages/compare.toml"), names, date=date)
    report.provenance(
        provenance(
            f"elevon compare {actuator} --out DIR",
            **{"Parameter hash": values["parameter_hash"], "Seed": values["seed"]},
            Faults=", ".join(values["faults"]) or "none",
        )
    )
    return report


def panels(comparison: Comparison) -> list[dict[str, object]]:
    """Return each signal of both models, in the units of the page."""
    drawn: list[dict[str, object]] = []
    for part, name in comparison.signals.items():
        unit = {"position": comparison.unit, "speed": "rad/s", "q_current": "A"}[part]
        text, scale = _DISPLAYED.get(unit, (unit, 1.0))
        high, low = scale * comparison.high[name], scale * comparison.low[name]
        label = f"{_NAMES[part]} [{text}]"
        drawn.append({"label": label, "time": comparison.time, "high": high, "low": low})
    return drawn


def page_values(_result: object) -> dict[str, object]:
    """Return what the page of the three cases has beside its result."""
    return {"panels": panels}
