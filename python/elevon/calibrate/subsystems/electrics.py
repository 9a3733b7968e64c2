"""Electrics from voltage to current, and transmission from motor to output: by regression."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.context import motor_ratio
from elevon.calibrate.subsystems.signals import FEWEST, REST_SPEED, DriveSignals, low_pass
from elevon.errors import InputError
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression, regressed
from elevon.logs.log import Log, bridged

VOLTAGE = ("resistance", "inductance", "emf", "drop")
_BAND = 0.1  # of the sampling rate: of voltage and current. ASSUMED: below the ripple's fold
_THIN = 4  # samples of one row
CELL_EXPLAINED = 0.9  # of the load cell's variance: below it the effort does not pass the cell
#: Share of a period by which voltage and current may be logged apart. ASSUMED
_APART = 0.5


@dataclass(frozen=True)
class Determination:
    """What logs determine of a subsystem.

    Attributes
    ----------
    numbers : mapping of str to Estimate
        By name, SI.
    explained : float
        Share of the output's variance explained; nan where nothing was regressed.
    reason : str
        Why there are none.
    """

    numbers: Mapping[str, Estimate]
    explained: float = float("nan")
    reason: str = ""


def identify_electrics(logs: Sequence[Log]) -> Determination:
    """Return resistance, inductance, voltage constant and drops from voltage and current."""
    serving = [
        log for log in logs
        if log.has("torque_voltage", "torque_current") and _speed_of(log) is not None
    ]  # fmt: skip
    if not serving:
        return Determination({}, reason="no voltage was logged beside the torque current")
    result = _voltage_balance(serving, 0.0)
    if not np.isfinite(result.covariance).all():
        return Determination({}, reason="voltage, current and speed do not vary apart")
    late = [_voltage_balance(serving, shift).value for shift in (-_APART, _APART)]
    gap = (late[1] - late[0]) / (2.0 * 3.0**0.5)
    result = result.open_to([result.value + gap])
    return Determination({name: result.estimate(name) for name in VOLTAGE}, result.explained)


def _speed_of(log: Log) -> Floats | None:
    """Return the motor's speed, from its angle where no speed was logged."""
    if log.has("motor_speed"):
        return bridged(log.time, log["motor_speed"])
    if log.has("motor_position"):
        return np.asarray(np.gradient(bridged(log.time, log["motor_position"]), log.time))
    return None


def _voltage_balance(logs: Sequence[Log], shift: float) -> Regression:
    rows, data, strokes = [], [], []
    for log in (item.on("torque_current") for item in logs):
        speed = _speed_of(log)
        assert speed is not None
        rate = 1.0 / log.period
        current, voltage = (bridged(log.time, log[r]) for r in ("torque_current", "torque_voltage"))
        voltage = np.interp(log.time + shift * log.period, log.time, voltage)
        smooth = low_pass(current, _BAND * rate, rate)
        one = [smooth, np.gradient(smooth, log.period), speed, np.sign(smooth)]
        table = np.column_stack([low_pass(c, _BAND * rate, rate) for c in (*one, voltage)])
        good = log.good & np.isfinite(table).all(axis=1)
        table, time, moves = (x[good][::_THIN] for x in (table, log.time, speed))
        rows.append(table[:, :4])
        data.append(table[:, 4])
        strokes.append((time, moves, log.period * _THIN))
    return regressed(VOLTAGE, rows, data, strokes, robust=False)


def identify_torque_constant(drives: Sequence[DriveSignals], per_output: float) -> Determination:
    """Return the torque for one unit of effort [N m], from a load cell at the output.

    What inertia and friction take between motor and cell is regressed beside it.

    Parameters
    ----------
    drives : sequence of DriveSignals
        The logs; those without a load cell do not count.
    per_output : float
        Motor's angle over the output's coordinate.
    """
    rows, data, strokes = [], [], []
    for drive in drives:
        if drive.load_cell is None or not float(np.ptp(drive.effort)) > 0.0:
            continue
        band = _BAND * drive.rate
        _, speed, acceleration = drive.derivatives(band)
        columns = (drive.effort, acceleration, speed, np.sign(speed), np.ones(len(speed)))
        table = np.column_stack(
            [low_pass(c, band, drive.rate) for c in (*columns, drive.load_cell)]
        )
        table = table[drive.good][::_THIN]
        rows.append(table[:, :5])
        data.append(table[:, 5] / per_output)
        strokes.append((drive.time[drive.good][::_THIN], speed[drive.good][::_THIN], drive.period))
    if not rows:
        return Determination({}, reason="no load cell was logged")
    names = ("torque_constant", "inertia", "viscous", "coulomb", "offset")
    result = regressed(names, rows, data, strokes)
    item = result.estimate("torque_constant")
    if not np.isfinite(item.std) or result.explained < CELL_EXPLAINED:
        return Determination({}, result.explained, "the load cell does not follow the effort")
    return Determination({"torque_constant": item}, result.explained)


def identify_transmission(logs: Sequence[Log], actuator: Actuator) -> Determination:
    """Return ratio, lost motion and the error a turn of the motor, from both positions."""
    serving = [
        log for log in logs
        if log.has("motor_position", "output_position") and len(log.time) >= FEWEST
    ]  # fmt: skip
    if not serving:
        return Determination({}, reason="not both positions, of motor and output, were logged")
    rows, data, strokes = [], [], []
    for number, log in enumerate(serving):
        good = log.good & np.isfinite(log.motor) & np.isfinite(log.output)
        motor, output, time = (
            x[good] for x in (log["motor_position"], log["output_position"], log.time)
        )
        speed = np.gradient(low_pass(motor, 0.1 / log.period, 1.0 / log.period), log.period)
        moving = np.abs(speed) > REST_SPEED * float(np.abs(speed).max())
        one = np.zeros((len(time), len(serving)))
        one[:, number] = 1.0
        table = np.column_stack([motor, -0.5 * np.sign(speed), np.cos(motor), np.sin(motor), one])
        rows.append(table[moving])
        data.append(output[moving])
        strokes.append((time[moving], speed[moving], log.period))
    names = ("slope", "lost", "cosine", "sine", *(f"zero_{k}" for k in range(len(serving))))
    try:
        result = regressed(names, rows, data, strokes)
    except (InputError, np.linalg.LinAlgError):
        return Determination({}, reason="the positions do not move together")
    slope = result["slope"]
    if not np.isfinite(result.covariance).all() or not slope:
        return Determination({}, reason="the positions do not move together")
    ratio = result.estimate("slope").inverted()
    turn = result.of(lambda b: float(np.hypot(b[2], b[3])))
    numbers = {"ratio": ratio, "lost_motion": result.estimate("lost"), "error_a_turn": turn}
    numbers["ratio_of_given"] = ratio.scaled(1.0 / motor_ratio(actuator))
    return Determination(numbers, result.explained)
