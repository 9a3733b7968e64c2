"""Predicted and measured strokes of the landing gear: the thesis's validation, in kind.

No signal of the rig was published, so the measured side is our virtual rig with a mismatch: colder
and more friction, another EMF constant, its own load control and sensors. As in the thesis the
model is tuned on some strokes first, and judged on the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.validation import Validation, ValidationTrace
from elevon.plain import Plain
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report.checks import Check, verdict
from elevon.reproduce.pisa_gear import ACTUATOR, CONDITIONS, Condition

SECONDS = {"extend": 14.0, "retract": 16.0}
DISPLAYED = ("output_position", "motor_speed", "torque_current")
"""What the thesis compares: position, speed, current."""
TUNED = ((1.0, 28.0), (1.5, 30.3))
"""Load factor and supply of the strokes that the model is tuned on; the others are held out."""
MEAN = 0.5
"""Seconds over which currents are compared as means: the software brake shorts the windings for
milliseconds, several times a second, and no model gives those instants (see the floor)."""
POSITION_LIMIT = 1.0
"""Percent of the range: the tolerance of a proximity switch (1.5 mm) and what a speed within its
limit leaves; ASSUMED, as the thesis prints none."""
SPEED_LIMIT = 5.0
"""Percent of the RMS; ASSUMED: what can be read off the thesis's figures."""
CURRENT_LIMIT = 9.96
"""Percent of the RMS: the largest error of a motor current that N prints for its stand. To it adds,
in squares, what the same actuator differs by from one stroke to its repetition."""
COLD = 283.15
"""Temperature of the lubricant on the rig [K]; the model's is 293.15."""


@dataclass(frozen=True, slots=True)
class StrokeSignalRow(Plain):
    """One signal of one stroke; percent of the measured RMS about its mean, and of its range.

    Attributes
    ----------
    stroke, signal, unit : str
        What.
    held_out : bool
        Whether the model was not tuned on it.
    rms : float
        RMS error, SI, sample by sample.
    percent_of_rms, percent_of_range : float
        The same, relative.
    judged_percent : float
        What is held to the limit: position over its range, speed over its RMS, current as means
        over `MEAN` over their RMS.
    before_percent : float
        The same of the model before it was tuned.
    floor_percent : float
        The same of an actuator that is the model itself: what repeating a stroke leaves.
    limit_percent : float
        Largest allowed.
    """

    stroke: str
    signal: str
    unit: str
    held_out: bool
    rms: float
    percent_of_rms: float
    percent_of_range: float
    judged_percent: float
    before_percent: float
    floor_percent: float
    limit_percent: float


@dataclass(frozen=True)
class ValidationResult:
    """Everything `elevon reproduce pisa-validation` reports."""

    validation: Validation
    before: Validation
    floor: Validation
    held_out: Mapping[str, bool]
    friction: Mapping[str, tuple[float, float]]
    fidelity: str
    seed: int
    parameter_hash: str

    @property
    def rows(self) -> list[StrokeSignalRow]:
        """One a stroke and compared signal."""
        errors = {(e.log, e.signal): e for e in self.validation.errors}
        sides = [_judged(side) for side in (self.validation, self.before, self.floor)]
        rows = []
        for stroke, held_out in self.held_out.items():
            for signal in DISPLAYED:
                error, key = errors[stroke, signal], (stroke, signal)
                now, before, floor = (side[key] for side in sides)
                rows.append(
                    StrokeSignalRow(
                        stroke, signal, error.unit, held_out, error.rms, error.of_rms,
                        error.of_range, now, before, floor, _limit(signal, floor),
                    )
                )  # fmt: skip
        return rows

    @property
    def traces(self) -> tuple[ValidationTrace, ...]:
        """Measured and simulated signals by stroke."""
        return self.validation.traces

    @property
    def checks(self) -> list[Check]:
        """All three signals of every stroke that is held out."""
        return [
            Check(f"{row.stroke}: {row.signal.replace('_', ' ')}", row.judged_percent,
                  row.limit_percent, "%")
            for row in self.rows
            if row.held_out
        ]  # fmt: skip

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command."""
        return {
            **verdict(self.checks),
            "measured": "virtual rig with a mismatch; no signals were published",
            "published": "the thesis draws measured and simulated curves and prints no error",
            "definition": "position: RMS error over its range; speed: over the measured speed's "
            f"RMS about its mean; current: the same of means over {MEAN:g} s",
            "friction_n": {path: list(pair) for path, pair in self.friction.items()},
            "rows": [row.to_dict() for row in self.rows],
            "fidelity": self.fidelity,
            "seed": self.seed,
            "parameter_hash": self.parameter_hash,
        }


def _limit(signal: str, floor: float) -> float:
    if signal == "output_position":
        return POSITION_LIMIT
    return SPEED_LIMIT if signal == "motor_speed" else float(np.hypot(CURRENT_LIMIT, floor))


def _judged(validation: Validation) -> dict[tuple[str, str], float]:
    """Percent by stroke and signal, as it is judged."""
    out = {
        (e.log, e.signal): e.of_range if e.signal == "output_position" else e.of_rms
        for e in validation.errors
    }
    for trace in validation.traces:
        means = [
            moving_mean(trace.time, side["torque_current"])
            for side in (trace.measured, trace.simulated)
        ]
        error = float(np.sqrt(np.mean((means[1] - means[0]) ** 2)))
        out[trace.log, "torque_current"] = 100.0 * error / float(np.std(means[0]))
    return out


def moving_mean(time: Floats, values: Floats) -> Floats:
    """Return the mean over `MEAN` about each sample that has it on both sides."""
    width = max(1, round(MEAN / float(np.median(np.diff(time)))))
    return np.convolve(values, np.full(width, 1.0 / width), mode="valid")


def reproduce_validation(
    *, fidelity: str = "high", seed: int = 0, progress: Progress | None = None
) -> ValidationResult:
    """Run both strokes of every condition but the limit on the rig, tune the model, predict each.

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
    from elevon.reproduce.pisa_tuning import KNOTS, tuned

    model = Actuator.load(ACTUATOR)
    logs = _logs(_unit(model), fidelity, seed, part(progress, 0.0, 0.6))
    names = [name for name, _ in logs]
    held_out = dict(zip(names, (key not in TUNED for key, _ in _strokes()), strict=True))
    used = [log for log in logs if not held_out[log[0]]]
    ready = tuned(used, model, part(progress, 0.6, 0.75))
    # Another seed of the rig, and the tuned model on it: a stroke and its repetition.
    repeated = _logs(ready, "low", seed + len(logs), part(progress, 0.75, 0.85))
    validation, before, floor = (
        validate_replay(measured, actuator, progress=part(progress, begin, begin + 0.05))
        for measured, actuator, begin in (
            (logs, ready, 0.85), (logs, model, 0.9), (repeated, ready, 0.95),
        )
    )  # fmt: skip
    paths = [f"friction.ffm_{way}_{k}" for way in ("extension", "retraction")
             for k in range(1, KNOTS + 1)]  # fmt: skip
    friction = {path: (model.parameters.value(path), ready.parameters.value(path))
                for path in paths}  # fmt: skip
    return ValidationResult(
        validation, before, floor, held_out, friction, fidelity, seed, model.hash
    )


def _strokes() -> list[tuple[tuple[float, float], tuple[Condition, str]]]:
    """Load factor and supply, condition and action, of every stroke with a requirement."""
    return [
        ((condition.load_factor, condition.supply), (condition, action))
        for condition in CONDITIONS
        if condition.requirement is not None
        for action in SECONDS
    ]


def _logs(
    unit: Actuator, fidelity: str, seed: int, progress: Progress | None
) -> list[tuple[str, Recording]]:
    """What the rig records of every stroke, by name."""
    strokes, logs = _strokes(), []
    for number, (_, (condition, action)) in enumerate(strokes):
        share = part(progress, number / len(strokes), (number + 1) / len(strokes))
        name = f"{action}, {condition.name}, {condition.load_factor:g} g, {condition.supply:g} V"
        logs.append((name, _log(unit, condition, action, fidelity, seed + number, progress=share)))
    return logs


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
    from elevon.simulate import completed

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
    completed([run], f"{action}, {condition.name}")
    return log
