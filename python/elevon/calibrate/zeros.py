"""Estimates that stand on positions and set points alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from elevon.actuator import Actuator
from elevon.calibrate.backlash import BacklashFit, fit_backlash
from elevon.calibrate.backlashes import (
    backlashes_differ,
    differing_backlashes,
    mean_backlash,
    pooled_backlash,
)
from elevon.calibrate.kinematics import CommandFit, speed_limit, speed_sensor
from elevon.calibrate.named import named
from elevon.estimate import Estimate, quantile
from elevon.estimate.number import weighted_mean
from elevon.logs.log import Log

_OTHER = 0.005  # relative: a limit nearer the actuator file's than this is the actuator file's
_ROUNDED = 0.1  # counts: what rounding to counts may shift where every stroke turns alike
_TURNS = 0.2  # share of that in the encoder's gain
_FLAT = 0.25  # counts: the same where the output stands still in the backlash, long at one count
_LOOSE = 0.05  # relative deviation above which the position gain is not determined


def position_estimates(
    logs: Sequence[Log], actuator: Actuator, per_log: Sequence[str] = ()
) -> tuple[list[Estimate], tuple[str, ...]]:
    """Return backlash, encoder, speed sensor, speed limit as far as the logs show, and words.

    Parameters
    ----------
    logs : sequence of Log
        The data.
    actuator : Actuator
        Values before.
    per_log : sequence of str
        Of `elevon.calibrate.backlashes.PER_LOG`: estimated for each log.
    """
    estimates, findings = _backlash_estimates(logs, actuator, "backlash.total" in per_log)
    return [
        *estimates,
        *_speed_estimates(logs, actuator),
        *_limit_estimates(logs, actuator),
    ], findings


def _backlash_estimates(
    logs: Sequence[Log], actuator: Actuator, each: bool
) -> tuple[list[Estimate], tuple[str, ...]]:
    """Backlash and encoder; where backlashes differ their mean, and each log's."""
    value = actuator.parameters.value
    ratio, count = value("gear.ratio"), encoder_count(actuator)
    backlashes = differing_backlashes(logs, ratio, count)
    backlash = pooled_backlash(backlashes) if backlashes else fit_backlash(logs, ratio, count)
    if backlash is None:
        return [], ()
    estimates = _backlash(backlash, count, actuator)
    estimates += [
        _initial(log, backlash, count, actuator)
        for log in logs
        if log.has("motor_position", "output_position")
    ]
    fitted = backlashes
    if each and not backlashes:
        fits = {log.name: fit_backlash([log], ratio, count) for log in logs}
        fitted = {name: fit for name, fit in fits.items() if fit is not None}
    if each:
        estimates += [_own_backlash(name, fit, count, actuator) for name, fit in fitted.items()]
    if not backlashes:
        return estimates, ()
    others = [item for item in estimates if item.path != "backlash.total"]
    mean = _backlash(mean_backlash(backlashes), count, actuator)
    total = [
        replace(item, note=f"{item.note}; mean of logs that differ")
        for item in mean
        if item.path == "backlash.total"
    ]
    return [*total, *others], (backlashes_differ(backlashes, value("backlash.extra")),)


def _own_backlash(name: str, backlash: BacklashFit, count: float, actuator: Actuator) -> Estimate:
    """Backlash of one log."""
    total = _backlash(backlash, count, actuator)[0]
    return replace(total, path=f"backlash.total[{name}]", in_set=False, note="of this log alone")


def _speed_estimates(logs: Sequence[Log], actuator: Actuator) -> list[Estimate]:
    """Gain and offset of the speed sensor."""
    return [
        named(Estimate(*pair), f"sensor.speed_{name}", actuator)
        for name, pair in (speed_sensor(logs) or {}).items()
    ]


def _limit_estimates(logs: Sequence[Log], actuator: Actuator) -> list[Estimate]:
    """Limit of the speed, where a log holds it and it is not the actuator file's."""
    path = "control.speed_limit"
    limit = speed_limit(logs)
    if limit is None or abs(limit / actuator.parameters.value(path) - 1.0) <= _OTHER:
        return []
    number = Estimate(limit, 1e-4 * limit, interval=(limit * (1 - 2e-4), limit * (1 + 2e-4)))
    return [named(number, path, actuator, "held flat in the log")]


def encoder_count(actuator: Actuator) -> float:
    """One count of the output encoder [rad at the output]."""
    value = actuator.parameters.value
    counts = value("sensor.encoder.pulses") * value("sensor.encoder.edges")
    return 2.0 * math.pi / (counts * value("sensor.encoder.wheel_ratio"))


def _backlash(backlash: BacklashFit, count: float, actuator: Actuator) -> list[Estimate]:
    value = actuator.parameters.value
    total, rounded = backlash.backlash[0] - value("backlash.extra"), _ROUNDED * count
    number = Estimate(total, math.hypot(backlash.backlash[1], rounded), backlash.degrees)
    floats = "; it floats: from the span" if backlash.floats else ""
    if backlash.beyond > 0.0:
        deflected = math.degrees(backlash.beyond)
        floats += f" without load; under load {deflected:.2g} deg more"
    # The model's encoder truncates; one that rounds would sit half a count lower.
    offset = (
        backlash.offset[0] + 0.5 * count + value("sensor.resolver.offset") / value("gear.ratio")
    )
    note = "encoder less motor over ratio, backlash centred: only the difference is known"
    rows = [
        named(
            number, "backlash.total", actuator, f"total, at the output{floats}",
            in_set=total >= 0.0,
        ),
        named(_counted(offset, backlash, count), "sensor.encoder.offset", actuator, note),
    ]  # fmt: skip
    return rows if backlash.floats else [*rows, *_encoder(backlash, actuator, rounded)]


def _counted(value: float, backlash: BacklashFit, count: float) -> Estimate:
    """A place between two positions, known to half a count of the encoder at best."""
    half = quantile(backlash.degrees) * math.hypot(backlash.offset[1], _ROUNDED * count)
    half += 0.5 * count
    std = math.hypot(backlash.offset[1], count / math.sqrt(12.0))
    return Estimate(value, std, interval=(value - half, value + half))


def _initial(log: Log, backlash: BacklashFit, count: float, actuator: Actuator) -> Estimate:
    """Where in the backlash the motor stood when a log began."""
    ratio = actuator.parameters.value("gear.ratio")
    seen = backlash.gain[0] * log.motor[0] / ratio + backlash.offset[0] - log.output[0]
    number = _counted(float(seen), backlash, count)
    return named(number, f"initial.lead[{log.name}]", actuator)


def _encoder(backlash: BacklashFit, actuator: Actuator, rounded: float) -> list[Estimate]:
    """Delay and gain of the encoder against the motor's sensor."""
    # All counts between the turns determine the gain, only those at the turns are rounded alike.
    gain, std = backlash.gain[0], math.hypot(backlash.gain[1], _TURNS * rounded / backlash.reach)
    return [
        named(Estimate(*backlash.delay, backlash.degrees), "sensor.encoder_delay", actuator),
        named(
            Estimate(gain, std, backlash.degrees), "sensor.encoder.gain", actuator,
            "encoder over motor and ratio", in_set=abs(gain - 1.0) > max(3.0 * std, 1e-4),
        ),
    ]  # fmt: skip


def gain_estimate(fits: Sequence[CommandFit], actuator: Actuator) -> Estimate | None:
    """Position gain pooled over the commands; the logs' scatter counts where it is larger.

    Parameters
    ----------
    fits : sequence of CommandFit
        One a log.
    actuator : Actuator
        Values before, and the count of the encoder: what rounding may shift counts like noise.
    """
    count = encoder_count(actuator)
    rounded = [math.hypot(fit.gain_std, _FLAT * count * fit.gain / fit.reach) for fit in fits]
    good = [
        (fit, std) for fit, std in zip(fits, rounded, strict=True) if 0.0 < std < _LOOSE * fit.gain
    ]
    if not good:
        return None
    gain, deviation = weighted_mean([(fit.gain, std) for fit, std in good])
    note = f"from the command's waveform in {', '.join(fit.log for fit, _ in good)}"
    number = Estimate(gain, deviation, max(len(good) - 1.0, 2.0))
    return named(number, "control.position_gain", actuator, note)
