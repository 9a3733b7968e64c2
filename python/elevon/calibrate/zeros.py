"""Estimates that stand on positions and set points alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from elevon.calibrate.backlash import BacklashFit, fit_backlash
from elevon.calibrate.backlashes import backlashes_differ, differing_backlashes, pooled_backlash
from elevon.calibrate.estimate import Estimate, quantile
from elevon.calibrate.kinematics import CommandFit, speed_limit, speed_sensor
from elevon.calibrate.log import BenchLog

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["gain_estimate", "position_estimates"]

_OTHER = 0.005  # relative: a limit nearer the actuator file's than this is the actuator file's
_ROUNDED = 0.1  # counts: what rounding to counts may shift where every stroke turns alike
_TURNS = 0.2  # share of that in the encoder's gain
_FLAT = 0.25  # counts: the same where the output stands still in the backlash, long at one count
_LOOSE = 0.05  # relative deviation above which the position gain is not determined


def position_estimates(
    logs: Sequence[BenchLog], actuator: Actuator, per_log: Sequence[str] = ()
) -> tuple[list[Estimate], tuple[str, ...]]:
    """Return backlash, encoder, speed sensor, speed limit as far as the logs show, and words.

    Parameters
    ----------
    logs : sequence of BenchLog
        The data.
    actuator : Actuator
        Values before.
    per_log : sequence of str
        Of `elevon.calibrate.backlashes.PER_LOG`: estimated for each log.
    """
    estimates, findings = _backlash_estimates(logs, actuator, "backlash.total" in per_log)
    return [*estimates, *_speed_estimates(logs), *_limit_estimates(logs, actuator)], findings


def _backlash_estimates(
    logs: Sequence[BenchLog], actuator: Actuator, each: bool
) -> tuple[list[Estimate], tuple[str, ...]]:
    """Backlash and encoder; where backlashes differ the encoder alone, and each log's backlash."""
    value = actuator.parameters.value
    ratio, count = value("gear.ratio"), encoder_count(actuator)
    backlashes = differing_backlashes(logs, ratio, count)
    backlash = pooled_backlash(backlashes) if backlashes else fit_backlash(logs, ratio, count)
    if backlash is None:
        return [], ()
    estimates = _backlash(backlash, count, actuator)
    estimates += [_initial(log, backlash, count, ratio) for log in logs if _both_positions(log)]
    fitted = backlashes
    if each and not backlashes:
        fits = {log.name: fit_backlash([log], ratio, count) for log in logs}
        fitted = {name: fit for name, fit in fits.items() if fit is not None}
    if each:
        estimates += [_own_backlash(name, fit, count, actuator) for name, fit in fitted.items()]
    if not backlashes:
        return estimates, ()
    others = [item for item in estimates if item.path != "backlash.total"]
    return others, (backlashes_differ(backlashes, value("backlash.extra")),)


def _own_backlash(name: str, backlash: BacklashFit, count: float, actuator: Actuator) -> Estimate:
    """Backlash of one log."""
    total = _backlash(backlash, count, actuator)[0]
    return replace(total, path=f"backlash.total[{name}]", in_set=False, note="of this log alone")


def _speed_estimates(logs: Sequence[BenchLog]) -> list[Estimate]:
    """Gain and offset of the speed sensor."""
    sensor = speed_sensor(logs) or {}
    units = {"gain": "1", "offset": "rad/s"}
    return [
        _made(
            f"sensor.speed_{name}",
            number,
            std,
            math.inf,
            unit=units[name],
            register="sensor",
            old=None,
            note="of the logged speed against the motor's angle",
        )
        for name, (number, std) in sensor.items()
    ]


def _limit_estimates(logs: Sequence[BenchLog], actuator: Actuator) -> list[Estimate]:
    """Limit of the speed, where a log holds it and it is not the actuator file's."""
    old = actuator.parameters.value("control.speed_limit")
    limit = speed_limit(logs)
    if limit is None or abs(limit / old - 1.0) <= _OTHER:
        return []
    ends = (limit * (1 - 2e-4), limit * (1 + 2e-4))
    note = "held flat in the log"
    return [
        Estimate(
            "control.speed_limit",
            limit,
            1e-4 * limit,
            ends,
            "rad/s",
            "controller",
            old,
            "direct",
            (),
            note,
        )
    ]


def encoder_count(actuator: Actuator) -> float:
    """One count of the output encoder [rad at the output]."""
    value = actuator.parameters.value
    counts = value("sensor.encoder.pulses") * value("sensor.encoder.edges")
    return 2.0 * math.pi / (counts * value("sensor.encoder.wheel_ratio"))


def _backlash(backlash: BacklashFit, count: float, actuator: Actuator) -> list[Estimate]:
    value = actuator.parameters.value
    extra = value("backlash.extra")
    total, offset = backlash.backlash[0] - extra, backlash.offset[0] + 0.5 * count
    # The model's encoder truncates; one that rounds would sit half a count lower.
    offset_std = math.hypot(backlash.offset[1], count / math.sqrt(12.0))
    rounded = _ROUNDED * count
    total_std = math.hypot(backlash.backlash[1], rounded)
    resolver = value("sensor.resolver.offset") / value("gear.ratio")
    rows = [
        _made(
            "backlash.total",
            total,
            total_std,
            backlash.degrees,
            unit="rad",
            register="plant",
            old=value("backlash.total"),
            note=f"total, at the output{'; it floats: from the span' if backlash.floats else ''}",
            in_set=total >= 0.0,
        ),
        _made(
            "sensor.encoder.offset",
            offset + resolver,
            offset_std,
            math.inf,
            half=quantile(backlash.degrees) * math.hypot(backlash.offset[1], rounded) + 0.5 * count,
            unit="rad",
            register="sensor",
            old=value("sensor.encoder.offset"),
            note="encoder less motor over ratio, backlash centred: only the difference is known",
        ),
    ]
    return rows if backlash.floats else [*rows, *_encoder(backlash, actuator, rounded)]


def _both_positions(log: BenchLog) -> bool:
    return log.motor is not None and log.output is not None


def _initial(log: BenchLog, backlash: BacklashFit, count: float, ratio: float) -> Estimate:
    """Where in the backlash the motor stood when a log began."""
    assert log.motor is not None
    assert log.output is not None
    seen = backlash.gain[0] * log.motor[0] / ratio + backlash.offset[0] - log.output[0]
    return _made(
        f"initial.lead[{log.name}]",
        float(seen),
        math.hypot(backlash.offset[1], count / math.sqrt(12.0)),
        math.inf,
        half=quantile(backlash.degrees) * math.hypot(backlash.offset[1], _ROUNDED * count)
        + 0.5 * count,
        unit="rad",
        register="initial",
        old=None,
        note="motor over ratio less output at the first sample; 0: the middle of the backlash",
    )


def _encoder(backlash: BacklashFit, actuator: Actuator, rounded: float) -> list[Estimate]:
    """Delay and gain of the encoder against the motor's sensor."""
    # All counts between the turns determine the gain, only those at the turns are rounded alike.
    gain, std = backlash.gain[0], math.hypot(backlash.gain[1], _TURNS * rounded / backlash.reach)
    seen = abs(gain - 1.0) > max(3.0 * std, 1e-4)
    return [
        _made(
            "sensor.encoder_delay",
            backlash.delay[0],
            backlash.delay[1],
            backlash.degrees,
            unit="s",
            register="sensor",
            old=None,
            note="of the encoder behind the motor's sensor",
        ),
        _made(
            "sensor.encoder.gain",
            gain,
            std,
            backlash.degrees,
            unit="1",
            register="sensor",
            old=actuator.parameters.value("sensor.encoder.gain"),
            note="encoder over motor and ratio",
            in_set=seen,
        ),
    ]


def _made(
    path: str,
    number: float,
    std: float,
    degrees: float,
    *,
    unit: str,
    register: str,
    old: float | None,
    note: str,
    in_set: bool | None = None,
    half: float | None = None,
) -> Estimate:
    half = quantile(degrees) * std if half is None else half
    inside = old is not None if in_set is None else in_set
    return Estimate(
        path,
        number,
        std,
        (number - half, number + half),
        unit,
        register,
        old,
        "direct",
        (),
        note,
        inside,
    )


def gain_estimate(fits: Sequence[CommandFit], old: float, count: float) -> Estimate | None:
    """Position gain pooled over the commands; the logs' scatter counts where it is larger.

    Parameters
    ----------
    fits : sequence of CommandFit
        One a log.
    old : float
        Gain before [1/s].
    count : float
        One count of the encoder at the output [rad]: what rounding may shift counts like noise.
    """
    rounded = [math.hypot(fit.gain_std, _FLAT * count * fit.gain / fit.reach) for fit in fits]
    good = [
        (fit, std) for fit, std in zip(fits, rounded, strict=True) if 0.0 < std < _LOOSE * fit.gain
    ]
    if not good:
        return None
    total = sum(1.0 / std**2 for _, std in good)
    gain = sum(fit.gain / std**2 for fit, std in good) / total
    chi = sum(((fit.gain - gain) / std) ** 2 for fit, std in good)
    spread = max(1.0, chi / max(len(good) - 1, 1))
    return _made(
        "control.position_gain",
        gain,
        math.sqrt(spread / total),
        max(len(good) - 1.0, 2.0),
        unit="1/s",
        register="controller",
        old=old,
        note=f"from the command's waveform in {', '.join(fit.log for fit, _ in good)}",
    )
