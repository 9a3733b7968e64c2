"""Estimates that stand on positions and set points alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from elevon.calibrate.estimate import Estimate, quantile
from elevon.calibrate.kinematics import CommandFit, speed_limit, speed_sensor
from elevon.calibrate.log import BenchLog
from elevon.calibrate.play import PlayFit, fit_play

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["gain_estimate", "position_estimates"]

_OTHER = 0.005  # relative: a limit nearer the set's than this is the set's
_ROUNDED = 0.1  # counts: what rounding to counts may shift where every stroke turns alike
_TURNS = 0.2  # share of that in the encoder's gain
_FLAT = 0.25  # counts: the same where the user stands still in the play, long at one count
_LOOSE = 0.05  # relative deviation above which the position gain is not determined


def position_estimates(logs: Sequence[BenchLog], actuator: Actuator) -> list[Estimate]:
    """Return play, encoder, speed sensor and speed limit, as far as the logs tell them."""
    value = actuator.parameters.value
    count = encoder_count(actuator)
    found: list[Estimate] = []
    play = fit_play(logs, value("gear.ratio"), count)
    if play is not None:
        found += _play(play, count, actuator)
        found += [_initial(log, play, count, value("gear.ratio")) for log in logs if _told(log)]
    sensor = speed_sensor(logs)
    if sensor is not None:
        for name, unit in (("gain", "1"), ("offset", "rad/s")):
            number, std = sensor[name]
            found.append(
                _made(
                    f"sensor.speed_{name}",
                    number,
                    std,
                    math.inf,
                    unit=unit,
                    register="sensor",
                    old=None,
                    note="of the logged speed against the motor's angle",
                )
            )
    limit = speed_limit(logs)
    if limit is not None and abs(limit / value("control.speed_limit") - 1.0) > _OTHER:
        found.append(
            Estimate(
                "control.speed_limit",
                limit,
                1e-4 * limit,
                (limit * (1 - 2e-4), limit * (1 + 2e-4)),
                "rad/s",
                "controller",
                value("control.speed_limit"),
                "direct",
                (),
                "held flat in the log",
            )
        )
    return found


def encoder_count(actuator: Actuator) -> float:
    """One count of the user encoder [rad at the user]."""
    value = actuator.parameters.value
    counts = value("sensor.encoder.pulses") * value("sensor.encoder.edges")
    return 2.0 * math.pi / (counts * value("sensor.encoder.wheel_ratio"))


def _play(play: PlayFit, count: float, actuator: Actuator) -> list[Estimate]:
    value = actuator.parameters.value
    extra = value("play.extra")
    total, offset = play.play[0] - extra, play.offset[0] + 0.5 * count
    # The model's encoder truncates; one that rounds would sit half a count lower.
    offset_std = math.hypot(play.offset[1], count / math.sqrt(12.0))
    rounded = _ROUNDED * count
    total_std = math.hypot(play.play[1], rounded)
    resolver = value("sensor.resolver.offset") / value("gear.ratio")
    rows = [
        _made(
            "play.total",
            total,
            total_std,
            play.degrees,
            unit="rad",
            register="plant",
            old=value("play.total"),
            note=f"total, at the user{'; it floats: from the span' if play.floats else ''}",
            in_set=total >= 0.0,
        ),
        _made(
            "sensor.encoder.offset",
            offset + resolver,
            offset_std,
            math.inf,
            half=quantile(play.degrees) * math.hypot(play.offset[1], rounded) + 0.5 * count,
            unit="rad",
            register="sensor",
            old=value("sensor.encoder.offset"),
            note="encoder less motor over ratio, the play centred: only the difference is known",
        ),
    ]
    return rows if play.floats else [*rows, *_encoder(play, actuator, rounded)]


def _told(log: BenchLog) -> bool:
    return log.motor is not None and log.user is not None


def _initial(log: BenchLog, play: PlayFit, count: float, ratio: float) -> Estimate:
    """Where in the play the motor stood when a log began."""
    assert log.motor is not None
    assert log.user is not None
    seen = play.gain[0] * log.motor[0] / ratio + play.offset[0] - log.user[0]
    return _made(
        f"initial.lead[{log.name}]",
        float(seen),
        math.hypot(play.offset[1], count / math.sqrt(12.0)),
        math.inf,
        half=quantile(play.degrees) * math.hypot(play.offset[1], _ROUNDED * count) + 0.5 * count,
        unit="rad",
        register="initial",
        old=None,
        note="motor over ratio less user at the first sample; 0: the middle of the play",
    )


def _encoder(play: PlayFit, actuator: Actuator, rounded: float) -> list[Estimate]:
    """Delay and gain of the encoder against the motor's sensor."""
    # All counts between the turns tell the gain, only those at the turns are rounded alike.
    gain, std = play.gain[0], math.hypot(play.gain[1], _TURNS * rounded / play.reach)
    seen = abs(gain - 1.0) > max(3.0 * std, 1e-4)
    return [
        _made(
            "sensor.encoder_delay",
            play.delay[0],
            play.delay[1],
            play.degrees,
            unit="s",
            register="sensor",
            old=None,
            note="of the encoder behind the motor's sensor",
        ),
        _made(
            "sensor.encoder.gain",
            gain,
            std,
            play.degrees,
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
        One count of the encoder at the user [rad]: what rounding may shift counts like noise.
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
