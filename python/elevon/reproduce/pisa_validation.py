"""Predicted and measured strokes of the landing gear: the thesis's validation, in kind.

No signal of the rig was published, so the measured side is our virtual rig with a mismatch: colder
and more friction, another EMF constant, its own load control and sensors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.validation import Validation, ValidationTrace
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report.checks import Check, verdict
from elevon.reproduce.pisa_gear import ACTUATOR, CONDITIONS, Condition

SECONDS = {"extend": 14.0, "retract": 16.0}
DISPLAYED = ("output_position", "motor_speed", "torque_current")
"""What the thesis compares: position, speed, current."""
POSITION_LIMIT = 2.0
"""Percent of range allowed to the position: a hundredth of a stroke and the timing; ASSUMED."""
COLD = 283.15
"""Temperature of the lubricant on the rig [K]; the model's is 293.15."""


@dataclass(frozen=True)
class ValidationResult:
    """Everything `elevon reproduce pisa-validation` reports."""

    validation: Validation
    fidelity: str
    seed: int
    parameter_hash: str

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One a stroke and compared signal."""
        return [
            {"stroke": error.log, "signal": error.signal, "unit": error.unit, "rms": error.rms,
             "max": error.largest, "percent_of_rms": error.of_rms,
             "percent_of_range": error.of_range, "published": None}
            for error in self.validation.errors
            if error.signal in DISPLAYED
        ]  # fmt: skip

    @property
    def traces(self) -> tuple[ValidationTrace, ...]:
        """Measured and simulated signals by stroke."""
        return self.validation.traces

    @property
    def checks(self) -> list[Check]:
        """The position of every stroke."""
        return [
            Check(f"{row['stroke']}: position", row["percent_of_range"], POSITION_LIMIT, "%")
            for row in self.rows
            if row["signal"] == "output_position"
        ]

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command."""
        return {
            **verdict(self.checks),
            "measured": "virtual rig with a mismatch; no signals were published",
            "published": "the thesis draws measured and simulated curves and prints no error",
            "percent_of_rms": "RMS error over the measured signal's RMS about its mean",
            "rows": self.rows,
            "fidelity": self.fidelity,
            "seed": self.seed,
            "parameter_hash": self.parameter_hash,
        }


def reproduce_validation(
    *, fidelity: str = "high", seed: int = 0, progress: Progress | None = None
) -> ValidationResult:
    """Run both strokes of every condition but the limit on the rig, and predict each.

    Parameters
    ----------
    fidelity : str
        Of the virtual rig; the prediction is at low fidelity.
    seed : int
        Of the rig and its sensors.
    progress : callable, optional
        As for `elevon.simulate`.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.calibrate.replay import validate_replay

    model = Actuator.load(ACTUATOR)
    unit = _unit(model)
    strokes = [
        (condition, action)
        for condition in CONDITIONS
        if condition.requirement is not None
        for action in SECONDS
    ]
    logs = []
    for number, (condition, action) in enumerate(strokes):
        share = part(progress, 0.9 * number / len(strokes), 0.9 * (number + 1) / len(strokes))
        name = f"{action}, {condition.name}, {condition.load_factor:g} g, {condition.supply:g} V"
        logs.append((name, _log(unit, condition, action, fidelity, seed + number, progress=share)))
    validation = validate_replay(logs, model, progress=part(progress, 0.9, 1.0))
    return ValidationResult(validation, fidelity, seed, model.hash)


def _unit(model: Actuator) -> Actuator:
    """Return the actuator on the rig: what the model does not know."""
    value = model.parameters.value
    values: dict[str, float | str] = {
        "lubricant.temperature": COLD,
        "motor.emf_constant": 0.98 * value("motor.emf_constant"),
        "screw.efficiency_loaded": value("screw.efficiency_loaded") - 0.01,
        "friction.breakaway_ratio": 1.3,
    }
    for kind in ("ff", "ffm"):
        for way in ("extension", "retraction"):
            # Another law: the fall with speed at first is twice as deep.
            first = value(f"friction.{kind}_{way}_1")
            for knot in range(1, 9):
                path = f"friction.{kind}_{way}_{knot}"
                values[path] = max(value(path) + min(0.0, value(path) - first), 0.5 * first)
    return model.with_values(values, source="unit on the virtual rig", request=False)


def _log(
    unit: Actuator,
    condition: Condition,
    action: str,
    fidelity: str,
    seed: int,
    *,
    progress: Progress | None,
) -> Recording:
    """Return what the rig records of one stroke."""
    from elevon.bench.loaded import loaded_setups, run_loaded
    from elevon.bench.procedure import Procedure
    from elevon.bench.stand import stand_of
    from elevon.documents import Document, validated
    from elevon.errors import SimulationError

    stroke = unit.parameters.value("lever.stroke")
    positions = np.linspace(0.0, stroke, 9).tolist()
    forces = [-condition.load_factor * unit.parameters.value(f"load.force_{k}") for k in range(9)]
    trace: dict[str, Any] = {
        "kind": "trace",
        "name": "stroke",
        "duration": SECONDS[action],
        "command": {"mode": "gear", "steps": [{"time": 0.1, "action": action}]},
    }
    if action == "retract":
        trace["initial"] = {"nut_position": "267 mm"}
    steps = [
        {"kind": "force", "positions": positions, "forces": forces},
        {"kind": "settings", "parameters": {"inverter.supply_voltage": condition.supply}},
        trace,
    ]
    data = {"name": "stroke", "step": steps}
    procedure = validated(Procedure, data, Document("pisa-validation", "", {}))
    (setup,) = loaded_setups(procedure, unit, stand_of(unit.wiring), seed=seed)
    log, run = run_loaded(setup, fidelity, progress)
    if run.status != "ok":
        raise SimulationError(f"{action}, {condition.name}: {run.meta['message']}", run.status)
    return log
