"""Regression coefficients as parameters of the model, and which of them the file accepts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.dynamic import Dynamic
from elevon.calibrate.model_runs import within_inertia
from elevon.calibrate.named import named
from elevon.calibrate.static import StaticFriction
from elevon.errors import InputError
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression
from elevon.parameters.records import record_of
from elevon.parameters.relations import (
    constant_is_tied,
    emf_constant,
    motor_torque_constant,
    static_following,
)

_TIED = 0.01  # relative: closer than this the controller is taken to know the motor
_SEEN = 3.0  # deviations from zero of a controller branch that exists
_GIVEN = ("motor.emf_constant",)


@dataclass(frozen=True)
class Torque:
    """The scale of every torque.

    Attributes
    ----------
    constant : float
        Torque constant [N m per peak A].
    relative : float
        Its relative deviation; 0 where it is given.
    measured : bool
        Whether a load cell gave it.
    tied : bool
        Whether the controller's own torque constant follows it.
    believed : float
        The controller's own constant [N m/A].
    """

    constant: float
    relative: float
    measured: bool
    tied: bool
    believed: float


def torque_scale(actuator: Actuator, plant: Regression | None) -> Torque:
    """Return the torque constant: from the load cell if there is one, else the actuator file's."""
    nominal = actuator.parameters.value("control.torque_constant")
    tied = constant_is_tied(actuator.parameters, _TIED)
    if plant is not None and "brake" in plant.names and plant["brake"] > _SEEN * plant.std("brake"):
        constant = 1.0 / plant["brake"]
        relative = plant.std("brake") / plant["brake"]
        return Torque(constant, relative, True, tied, constant if tied else nominal)
    return Torque(motor_torque_constant(actuator.parameters), 0.0, False, tied, nominal)


@dataclass
class _Sheet:
    """Estimates made of the torque balance, one after the other."""

    actuator: Actuator
    plant: Regression
    torque: Torque
    estimates: list[Estimate] = field(default_factory=list)

    def scale(self, b: Floats) -> float:
        """Torque constant of some coefficients [N m/A]."""
        if not self.torque.measured:
            return self.torque.constant
        return 1.0 / float(b[self.plant.names.index("brake")])

    def add(
        self,
        path: str,
        function: Callable[[Floats], float],
        note: str | None = None,
        *,
        scaled: bool = False,
    ) -> float:
        """Add a function of the coefficients (`scaled`: a torque) and return its value."""
        given = _GIVEN if scaled and not self.torque.measured else ()
        item = named(self.plant.of(function), path, self.actuator, note, given=given)
        self.estimates.append(item)
        return item.value


def plant_estimates(
    actuator: Actuator, plant: Regression, torque: Torque
) -> tuple[list[Estimate], dict[str, float]]:
    """Turn the torque balance into estimates.

    Returns
    -------
    (list of Estimate, dict)
        Estimates, and values of other parameters that had to follow (path to value).
    """
    sheet = _Sheet(actuator, plant, torque)
    scale, share = sheet.scale, actuator.parameters.value("motor.flux_fraction")
    if torque.measured:
        note = "from the load cell: torque constant over 1.5"
        sheet.add("motor.emf_constant", lambda b: emf_constant(scale(b), share), note)
        sheet.add("derived.torque_constant", scale)
    total = sheet.add("derived.inertia", lambda b: scale(b) * b[0], scaled=True)
    sheet.add("derived.inertia_per_torque", lambda b: float(b[0]))
    follow = _inertia(sheet, total)
    sheet.add("friction.dynamic", lambda b: scale(b) * b[2], scaled=True)
    sheet.add("friction.viscous", lambda b: scale(b) * b[1], scaled=True)
    _sensors(sheet)
    return sheet.estimates, follow


def _inertia(sheet: _Sheet, total: float) -> dict[str, float]:
    """The motor's own inertia carries the sum, unless the others alone exceed it."""
    value, scale = sheet.actuator.parameters.value, sheet.scale
    inertia = value("gear.inertia") + value("load.inertia") / value("gear.ratio") ** 2
    if total > 1.05 * inertia:
        note = "only its sum with gear.inertia (and the load's) is determined: the others are kept"
        sheet.add("motor.inertia", lambda b: scale(b) * b[0] - inertia, note, scaled=True)
        return {}
    share = value("motor.inertia") / (value("motor.inertia") + inertia)
    note = "the sum is less than the other inertias alone: all are scaled alike"
    sheet.add("motor.inertia", lambda b: share * scale(b) * b[0], note, scaled=True)
    factor = total / (value("motor.inertia") + inertia)
    return {path: factor * value(path) for path in ("gear.inertia", "load.inertia")}


def _sensors(sheet: _Sheet) -> None:
    """Offsets of the current's sensor and of the load cell; what lags behind what."""
    names, scale = sheet.plant.names, sheet.scale
    if "offset" in names:
        offset = names.index("offset")
        sheet.add("sensor.current_offset", lambda b: float(b[offset]))
    if "cell" in names:
        cell = names.index("cell")
        sheet.add("sensor.load_cell_offset", lambda b: scale(b) * float(b[cell]), scaled=True)
    if "constant" in names:
        sheet.add("derived.current_loop_lag", lambda b: -float(b[-1]))
        return
    sheet.add("sensor.current_lag", lambda b: float(b[-1]))
    if sheet.plant["lag"] > _SEEN * sheet.plant.std("lag"):
        note = "first-order filter of this lag"
        sheet.add("sensor.filter_cutoff", lambda b: 1.0 / (2.0 * np.pi * b[-1]), note)


def static_estimate(
    actuator: Actuator, static: StaticFriction | None, dynamic: float | None, torque: Torque
) -> list[Estimate]:
    """Static friction as an estimate; no less than the dynamic one, which it cannot be.

    Parameters
    ----------
    actuator : Actuator
        Values before.
    static : StaticFriction or None
        From `elevon.calibrate.static.static_friction`.
    dynamic : float or None
        Dynamic friction [N m], where it is estimated.
    torque : Torque
        Scale of every torque.
    """
    if static is None:
        return []
    number = Estimate(static.value, static.std, static.degrees)
    number = number.widened(torque.relative * static.value)
    least = 0.0 if dynamic is None else dynamic
    ends = number.interval[0], max(number.interval[1], least) + static.unseen
    number = replace(number, value=max(static.value, least), interval=ends)
    given = () if torque.measured else _GIVEN
    return [named(number, "friction.static", actuator, static.how, given=given)]


def controller_estimates(
    actuator: Actuator, law: Regression, torque: Torque, logs: Sequence[str]
) -> list[Estimate]:
    """Turn the controller's law into gain and times."""
    extra = torque.relative if torque.tied else 0.0
    given = () if torque.measured and torque.tied else ("control.torque_constant",)
    half = _half_tick(actuator)
    gain = law.of(lambda b: torque.believed * float(b[0] + half * b[1]))
    integral = law.of(lambda b: torque.believed * float(b[1]))
    gain, integral = (item.widened(extra * item.value) for item in (gain, integral))
    return [
        named(gain, "control.speed_gain", actuator, given=given),
        *_times(actuator, law, ", ".join(logs)),
        named(integral, "derived.integral_gain", actuator, given=given),
    ]


def _half_tick(actuator: Actuator) -> float:
    """Return by how much the drive's sum of errors is behind their integral [s].

    The error of a tick is added after it: half a tick's worth is missing, as of the gain.
    """
    return 0.5 * float(actuator.parameters.value("control.sample_time"))


def _times(actuator: Actuator, law: Regression, logs: str) -> list[Estimate]:
    """Integral and derivative time; zero where the logs show no such action."""
    value = actuator.parameters.value
    none = f"no {{}} action is seen in {logs}"
    paths = ("control.integral_time", "control.derivative_time")
    rows: list[Estimate] = []
    if law["integral"] > _SEEN * law.std("integral"):
        half = _half_tick(actuator)
        rows.append(named(law.of(lambda b: float(b[0] / b[1]) + half), paths[0], actuator))
    elif value(paths[0]) > 0.0:
        rows.append(named(Estimate(0.0, 0.0), paths[0], actuator, none.format("integral")))
    late = law.of(lambda b: float(b[2] / b[0]))
    if late.value > 0.0:
        rows.append(named(late, paths[1], actuator))
    elif value(paths[1]) > 0.0:
        nothing = Estimate(0.0, late.std, late.degrees)
        rows.append(named(nothing, paths[1], actuator, none.format("derivative")))
    return rows


#: Offsets of sensors, which no parameter holds: they go with the actuator file's promises on logs.
_OFFSETS = {
    "sensor.speed_offset": "motor_speed",
    "sensor.current_offset": "current_q_meas",
}
_BOUND = "the fit of the model runs ends at its bound: they do not say where it lies"
_LOOSEST = 0.25  # of the value, or of the one before: a larger deviation determines nothing


def accept(
    estimates: Sequence[Estimate], free: Sequence[str] | None, actuator: Actuator
) -> list[Estimate]:
    """Keep what was requested, what no actuator file holds, and only what it can hold."""
    accepted = []
    for item in estimates:
        if item.in_set and free is not None and item.path not in free:
            continue
        if item.in_set:
            record = record_of(actuator.wiring, item.path)
            low = item.value < record.minimum or (
                record.minimum_open and item.value == record.minimum
            )
            if low or item.value > record.maximum or not np.isfinite(item.std):
                continue
            # What is loose may still tell the value before wrong.
            scale = max(abs(item.value), abs(item.old or 0.0))
            if record.minimum >= 0.0 and item.std > _LOOSEST * scale:
                continue
        accepted.append(item)
    return accepted


def missing(free: Sequence[str] | None, estimates: Sequence[Estimate], torque: Torque) -> None:
    """Raise `InputError` for a path that was requested and is not estimated."""
    known = {item.path for item in estimates}
    for path in free or ():
        if path in known:
            continue
        if path == "motor.emf_constant" and not torque.measured:
            raise InputError(
                "--free motor.emf_constant: without a load cell the logs determine only the ratio "
                "of inertia and friction to the torque constant; add --loadcell, or leave it out"
            )
        raise InputError(
            f"--free {path}: nothing in the logs excites it enough; leave it out or add a log "
            "that does"
        )


def undetermined(
    every: Sequence[Estimate],
    accepted: Sequence[Estimate],
    free: Sequence[str] | None,
    dynamic: Dynamic | None,
) -> dict[str, str]:
    """Return path to why a number stays as given: too loose, outside the model, or not seen."""
    known = {item.path for item in accepted}
    missing = {
        item.path: f"{item.value:.4g} +- {item.std:.2g} {item.unit} is not determined by the "
        "signals, or not possible in the model"
        for item in every
        if item.in_set and item not in accepted and (free is None or item.path in free)
    }
    if dynamic is not None:
        missing |= dict.fromkeys(dynamic.at_bound, _BOUND)
        missing |= dynamic.ranking.dropped
    return {path: why for path, why in missing.items() if path not in known}


def with_values(
    actuator: Actuator,
    estimates: Sequence[Estimate],
    followed: Mapping[str, float],
    torque: Torque,
    dynamic: Dynamic | None,
) -> Actuator:
    """Return the actuator with what was estimated, and what has to follow from it."""
    values: dict[str, str | float] = dict(followed)
    values |= {item.path: item.value for item in estimates if item.in_set}
    if torque.measured and torque.tied and "motor.emf_constant" in values:
        values["control.torque_constant"] = torque.believed
    if dynamic is not None and dynamic.drive != actuator.parameters["drive.kind"].value:
        values["drive.kind"] = dynamic.drive
    if "friction.dynamic" in values and "friction.static" not in values:
        friction = float(values["friction.dynamic"])
        values["friction.static"] = static_following(actuator.parameters, friction)
    values |= within_inertia(actuator, values)
    offsets = {
        signal: item.value
        for item in estimates
        for path, signal in _OFFSETS.items()
        if item.path == path
    }
    fitted = actuator.with_values(values, source="calibration")
    return replace(fitted, validation={**(actuator.validation or {}), "offsets": offsets})


def shortened(actuator: Actuator, estimates: Sequence[Estimate]) -> list[str]:
    """Say so where the actuator file cannot hold the derivative time as estimated."""
    values: dict[str, str | float] = {item.path: item.value for item in estimates if item.in_set}
    if "control.derivative_time" not in within_inertia(actuator, values):
        return []
    return [
        "control.derivative_time is shortened in the file: as estimated, speed gain times it "
        "exceeds the inertia, which this controller without its filter cannot hold"
    ]
