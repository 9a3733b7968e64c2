"""What a calibration has to say in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from elevon.actuator import Actuator
from elevon.calibrate.dynamic import Dynamic
from elevon.calibrate.kinematics import CommandFit
from elevon.calibrate.plant import Torque
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression
from elevon.logs.log import Log
from elevon.parameters.relations import motor_torque_constant

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
        return [
            "no log moves in both directions long enough for a torque balance: friction and "
            "inertia come from model runs alone, or stay as they were"
        ]
    if plant.explained < _POOR:
        return [
            f"the torque balance explains only {100 * plant.explained:.0f} % of the "
            "current: something the model lacks moves it"
        ]
    return []


def _of_the_scale(torque: Torque, actuator: Actuator) -> list[str]:
    if torque.measured:
        return _convention(torque, actuator)
    return [
        "no load cell: the logs determine inertia, friction and speed gain only as ratios to "
        "the torque constant; motor.emf_constant is kept as given and the values scale "
        "with it"
    ]


def _of_brakes(logs: Sequence[Log]) -> list[str]:
    """Say what becomes of a brake whose torque nobody measured."""
    alone = "friction includes it"
    among_others = "its friction is not taken for the actuator's"
    what = among_others if len(logs) > 1 else alone
    return [
        f"{log.name}: the brake acted but its torque was not measured; {what}"
        for log in logs
        if log.brake.known in {"on", "force"}
    ]


def _of_model_runs(
    dynamic: Dynamic, actuator: Actuator, estimates: Sequence[Estimate]
) -> list[str]:
    says = []
    nominal = actuator.parameters["drive.kind"].value
    if dynamic.drive != nominal:
        says.append(f"drive.kind {dynamic.drive!r} explains the logs better than {nominal!r}")
    says += [
        f"{path} absorbs what the model lacks ({_percent(a, b)}): model runs want {a:.5g}, "
        f"the signals themselves say {b:.5g}"
        for path, a, b in dynamic.absorbed
    ]
    says += [f"{path}: the model runs end at its bound" for path in dynamic.at_bound]
    known = {item.path for item in estimates}
    says += [
        f"{path} is not determined: {why}"
        for path, why in dynamic.ranking.dropped.items()
        if path not in known
    ]
    if not dynamic.converged:
        says.append("the fit on model runs stopped before its tolerance was met")
    return says


def _percent(a: float, b: float) -> str:
    return f"{100.0 * (a / b - 1.0):+.1f} %"


def _convention(torque: Torque, actuator: Actuator) -> list[str]:
    ratio = torque.constant / motor_torque_constant(actuator.parameters)
    for factor, name in ((math.sqrt(2.0), "peak"), (1.0 / math.sqrt(2.0), "rms")):
        if abs(ratio / factor - 1.0) < _CONVENTION:
            return [
                f"the torque constant is {ratio:.3f} times the file's: the logged currents "
                f"may be {name} values taken for the other convention"
            ]
    return []


def amplitude_findings(commands: Sequence[CommandFit], estimates: Sequence[Estimate]) -> list[str]:
    """Name a constant amplitude factor between the bench and the model, and where it sits."""
    says = []
    backlash = next((item for item in estimates if item.path == "backlash.total"), None)
    if backlash is not None and "under load" in backlash.note:
        says.append(
            "the difference of the two positions holds both the backlash and the transmission's "
            f"compliance ({backlash.note}): backlash.total comes from the stretches that agree "
            "with each other; backlash.stiffness needs the loads that were hung, as a table of "
            "drops; encoder gain and delay cannot be determined"
        )
    elif backlash is not None and "floats" in backlash.note:
        says.append(
            "the output is not carried through the backlash by friction but moves within it on its "
            "own (its inertia is not small against its friction): backlash.total comes from the "
            "span of the two positions' difference and holds the compliance of the contacts; "
            "encoder gain and delay cannot be determined; a model whose output has no inertia will "
            "miss the output's position by up to half the backlash"
        )
    gain = next((item for item in estimates if item.path == "sensor.encoder.gain"), None)
    if gain is not None and abs(gain.value - 1.0) > max(_FACTOR, 3.0 * gain.std):
        says.append(
            f"amplitude factor {gain.value:.4f} between the encoder and the motor over the "
            "gear ratio: encoder gain (sensor.encoder.gain) or another gear ratio"
        )
    for fit in commands:
        if fit.factor is None:
            continue
        if abs(fit.factor - 1.0) > max(_FACTOR, 3.0 * (fit.amplitude_factor_std or 0.0)):
            says.append(
                f"{fit.log}: amplitude factor {fit.factor:.4f} between the command the "
                "bench followed and the one noted: the command is scaled, not the "
                "actuator"
            )
    return says
