"""Predicted and measured strokes of the landing gear: the thesis's validation, in kind.

No signal of the rig was published, so the measured side is our virtual rig with a mismatch: colder
and more friction, another EMF constant, its own load control and sensors. As in the thesis the
model is tuned on some strokes first, and judged on the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.validation import Validation, ValidationTrace
from elevon.errors import Interrupted
from elevon.plain import Plain
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report import Report
from elevon.report.checks import Check, verdict
from elevon.report.figures import new_figure
from elevon.units import display_unit, to_display
from elevon_cases.page import GREY, ORANGE, Column, sentence, table_of, with_end
from elevon_cases.pisa.gear import ACTUATOR, CONDITIONS, Condition

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
    from elevon.calibrate.validation import validate_replay

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


KNOTS = 8
SCALED = (4.0, 7.0)
"""Knots of the extension's friction (10 and 50 mm/s) whose factors are fitted; linear between."""
_PERIOD = 2e-3  # s between two samples of a run
_STEP = 0.05  # of a factor's logarithm: over the jitter of the software brake's instants
_SPEED = 10.0  # rad/s that count as one: the brake's saw-tooth about the set point
_ROUNDS = 6


def tuned(
    logs: Sequence[tuple[str, Recording]], model: Actuator, progress: Progress | None = None
) -> Actuator:
    """Return the model with what strokes of the rig show of it.

    Parameters
    ----------
    logs : sequence of (str, Recording)
        Extensions and retractions, by name.
    model : Actuator
        Before.
    progress : callable, optional
        As for `elevon.simulate`.
    """
    from elevon.calibrate.door import calibrate
    from elevon.logs.log import Log

    ready = [Log.of(recording, name, clock="output_position") for name, recording in logs]
    share = part(progress, 0.0, 0.5)
    driven = calibrate(ready, model, fidelity="low", progress=share).actuator
    return _extension_friction(logs, driven, part(progress, 0.5, 1.0))


def extension_friction(model: Actuator, logarithms: Floats) -> dict[str, float]:
    """Return the extension's friction [N] by path, scaled at the knots `SCALED`."""
    factors = np.exp(np.interp(np.arange(1, KNOTS + 1), SCALED, logarithms))
    paths = [f"friction.ffm_extension_{knot}" for knot in range(1, KNOTS + 1)]
    return {
        path: float(factor) * model.parameters.value(path)
        for path, factor in zip(paths, factors, strict=True)
    }


def _extension_friction(
    logs: Sequence[tuple[str, Recording]], model: Actuator, progress: Progress | None
) -> Actuator:
    from elevon.estimate.residual import fit_residual

    speeds = _speeds([log for log in logs if log[0].startswith("extend")], model)
    count = [0]

    def residual(point: Floats) -> Floats:
        count[0] += 1
        if progress is not None and not progress(min(count[0] / _ROUNDS, 1.0)):
            raise Interrupted("the tuning was stopped")
        return speeds([point])[0]

    def jacobian(point: Floats) -> Floats:
        rows = _STEP * np.eye(len(SCALED))
        runs = speeds([*(point + rows), *(point - rows)])
        ahead, back = runs[: len(SCALED)], runs[len(SCALED) :]
        return np.stack([(a - b) / (2.0 * _STEP) for a, b in zip(ahead, back, strict=True)], axis=1)

    fit = fit_residual(
        residual, np.zeros(len(SCALED)), jacobian=jacobian, loss="soft_l1", most=_ROUNDS,
        tolerance=1e-3,
    )  # fmt: skip
    values: dict[str, str | float] = dict(extension_friction(model, fit.x))
    return model.with_values(values, source="speed of the rig's extensions", request=False)


def _speeds(
    logs: Sequence[tuple[str, Recording]], model: Actuator
) -> Callable[[Sequence[Floats]], list[Floats]]:
    """Return what gives the errors of the extensions' speed, shape (n,), for points."""
    from elevon.calibrate.validation import as_recorded, unit_experiment
    from elevon.experiment.experiment import Variant
    from elevon.logs.log import Log

    ready = [Log.of(recording, name, clock="output_position") for name, recording in logs]
    tests = [(log, unit_experiment(log, model, "low", period=_PERIOD)) for log in ready]

    def errors(points: Sequence[Floats]) -> list[Floats]:
        variants = [Variant(extension_friction(model, point)) for point in points]
        by_log = [
            [(as_recorded(log, run, "motor_speed") - log["motor_speed"]) / _SPEED
             for run in test.run(variants)]
            for log, test in tests
        ]  # fmt: skip
        return [np.concatenate(parts) for parts in zip(*by_log, strict=True)]

    return errors


def validation_page(result: ValidationResult, date: str | None = None) -> Report:
    """Return the report: errors, what was tuned, every stroke."""
    report = Report(
        "Predicted and measured strokes of the Pisa landing gear",
        "The thesis draws measured and simulated position, speed and current and prints no error; "
        "its signals were not published. Measured here means our virtual rig with a mismatch that "
        "the model does not know (friction, temperature, EMF constant, efficiency, load control, "
        "sensors). The model is tuned on the strokes of two conditions, as the thesis tunes its "
        "own, and judged on the others. It shows the way, not how good the thesis's model is.",
        date=date,
    )
    caption = (
        "Percent of the measured signal's RMS about its mean, and of its range. Judged: position "
        f"over its range, speed over its RMS, current as means over {MEAN:g} s over their RMS. "
        "Repetition: the same actuator's strokes twice, which no model can be below: the software "
        "brake's pulses have other instants each time."
    )
    report.section("Errors").table(table_of(result.rows, _COLUMNS, caption))
    tuned: tuple[Column, ...] = (
        ("Friction", lambda item: item[0]),
        ("Before [N]", lambda item: item[1][0], ".0f"),
        ("Tuned [N]", lambda item: item[1][1], ".0f"),
    )
    report.section("What was tuned").table(table_of(result.friction.items(), tuned))
    signals = (
        ("output_position", "Position [mm]", 1e3),
        ("motor_speed", "Motor speed [rad/s]", 1.0),
        ("torque_current", "Current [A]", 1.0),
    )
    for trace in result.traces:
        with new_figure(3, 1, height=5.4, sharex=True) as (figure, panels):
            for axes, (signal, label, scale) in zip(panels, signals, strict=True):
                axes.plot(trace.time, scale * trace.measured[signal], color=GREY, lw=3.0)
                axes.plot(trace.time, scale * trace.simulated[signal], color=ORANGE, lw=1)
                axes.set_ylabel(label)
            panels[-1].set_xlabel("Time [s]")
        report.section(sentence(trace.log)).figure(figure, "Virtual rig (grey) and model (orange).")
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, f"pisa-validation --seed {result.seed}", made)


_COLUMNS: tuple[Column, ...] = (
    ("Stroke", "stroke"),
    ("Held out", "held_out"),
    ("Signal", lambda row: row.signal.replace("_", " ")),
    ("RMS error", lambda row: to_display(row.rms, display_unit(row.unit)), ".3g"),
    ("Unit", lambda row: display_unit(row.unit)),
    ("% of RMS", "percent_of_rms", ".3g"),
    ("% of range", "percent_of_range", ".3g"),
    ("Judged [%]", "judged_percent", ".3g"),
    ("Before tuning [%]", "before_percent", ".3g"),
    ("Repetition [%]", "floor_percent", ".3g"),
    ("Limit [%]", "limit_percent", ".3g"),
)
