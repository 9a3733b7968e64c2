"""What a calibration has to say in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from elevon.actuator import Actuator
from elevon.calibrate.dynamic import Dynamic
from elevon.calibrate.kinematics import CommandFit
from elevon.calibrate.plant import Torque
from elevon.data import packaged_toml
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression
from elevon.logs.log import Log
from elevon.parameters.relations import motor_torque_constant

_TEXTS = packaged_toml("elevon.calibrate", "findings.toml")
_CONVENTION = 0.05  # relative: how near a factor must be to sqrt 2 to be named
_FACTOR = 0.002  # relative: a smaller amplitude factor is not worth a word
_POOR = 0.8  # explained share below which a regression is doubtful


def plant_findings(
    logs: Sequence[Log],
    plant: Regression | None,
    torque: Torque,
    dynamic: Dynamic | None,
    actuator: Actuator,
    *,
    estimates: Sequence[Estimate],
) -> list[str]:
    """Sentences on torque scale, brakes, drive and misfit."""
    return [
        *_of_the_balance(plant),
        *_of_the_scale(torque, actuator),
        *_of_brakes(logs),
        *([] if dynamic is None else _of_model_runs(dynamic, actuator, estimates)),
    ]


def _of_the_balance(plant: Regression | None) -> list[str]:
    if plant is None:
        return [_TEXTS["no_balance"]]
    return [_TEXTS["balance"].format(100 * plant.explained)] if plant.explained < _POOR else []


def _of_the_scale(torque: Torque, actuator: Actuator) -> list[str]:
    """Say where the scale of all torques comes from, and what that leaves open."""
    if not torque.measured:
        return [_TEXTS["no_load_cell"]]
    ratio = torque.constant / motor_torque_constant(actuator.parameters)
    names = ((math.sqrt(2.0), "peak"), (1.0 / math.sqrt(2.0), "rms"))
    near = [name for factor, name in names if abs(ratio / factor - 1.0) < _CONVENTION]
    return [_TEXTS["convention"].format(ratio, name) for name in near]


def _of_brakes(logs: Sequence[Log]) -> list[str]:
    """Say what becomes of a brake whose torque nobody measured."""
    what = _TEXTS["brake_among_others" if len(logs) > 1 else "brake_alone"]
    return [what.format(log.name) for log in logs if log.brake.unknown]


def _of_model_runs(
    dynamic: Dynamic, actuator: Actuator, estimates: Sequence[Estimate]
) -> list[str]:
    nominal, known = actuator.parameters["drive.kind"].value, {item.path for item in estimates}
    open_ = {p: why for p, why in dynamic.ranking.dropped.items() if p not in known}
    drives = [(dynamic.drive, nominal)] if dynamic.drive != nominal else []
    return [
        *(_TEXTS["drive"].format(*pair) for pair in drives),
        *(_TEXTS["absorbs"].format(p, 100.0 * (a / b - 1.0), a, b) for p, a, b in dynamic.absorbed),
        *(_TEXTS["bound"].format(path) for path in dynamic.at_bound),
        *(_TEXTS["open"].format(*item) for item in open_.items()),
        *([] if dynamic.converged else [_TEXTS["stopped"]]),
    ]


def amplitude_findings(commands: Sequence[CommandFit], estimates: Sequence[Estimate]) -> list[str]:
    """Name a constant amplitude factor between the bench and the model, and where it sits."""
    by_path = {item.path: item for item in estimates}
    says: list[str] = []
    backlash, gain = by_path.get("backlash.total"), by_path.get("sensor.encoder.gain")
    for words in ("under load", "floats"):
        if not says and backlash is not None and words in backlash.note:
            says.append(_TEXTS[words].format(backlash.note))
    if gain is not None and abs(gain.value - 1.0) > max(_FACTOR, 3.0 * gain.std):
        says.append(_TEXTS["encoder"].format(gain.value))
    return says + [
        _TEXTS["command"].format(fit.log, fit.factor)
        for fit in commands
        if fit.factor is not None
        and abs(fit.factor - 1.0) > max(_FACTOR, 3.0 * (fit.amplitude_factor_std or 0.0))
    ]
