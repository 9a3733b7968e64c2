"""The landing gear's model tuned on strokes of the rig, as the thesis tunes its own.

P 4.1.1 has no friction above 10 mm/s: it sets those points so that the simulated strokes reach the
measured speeds. In retraction the motor drives and the balances of `elevon.calibrate` show them; in
extension the leg drives it, no current shows the friction, and the speed is what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import Interrupted
from elevon.progress import Progress, part
from elevon.recording import Recording

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
    from elevon.calibrate.replay import as_recorded, unit_experiment
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
