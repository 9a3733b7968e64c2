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
_LOOSE = 0.05  # relative deviation above which the position gain is not determined


def position_estimates(logs: Sequence[BenchLog], actuator: Actuator) -> list[Estimate]:
    """Return play, encoder, speed sensor and speed limit, as far as the logs tell them."""
    value = actuator.parameters.value
    count = encoder_count(actuator)
    found: list[Estimate] = []
    play = fit_play(logs, value("gear.ratio"), count)
    if play is not None:
        found += _play(play, count, actuator)
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
    resolver = value("sensor.resolver.offset") / value("gear.ratio")
    rows = [
        _made(
            "play.total",
            total,
            play.play[1],
            play.degrees,
            unit="rad",
            register="plant",
            old=value("play.total"),
            note="total, at the user",
            in_set=total >= 0.0,
        ),
        _made(
            "sensor.encoder.offset",
            offset + resolver,
            offset_std,
            math.inf,
            unit="rad",
            register="sensor",
            old=value("sensor.encoder.offset"),
            note="encoder less motor over ratio, the play centred: only the difference is known",
        ),
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
    ]
    gain, std = play.gain
    seen = abs(gain - 1.0) > max(3.0 * std, 1e-4)
    rows.append(
        _made(
            "sensor.encoder.gain",
            gain,
            std,
            play.degrees,
            unit="1",
            register="sensor",
            old=value("sensor.encoder.gain"),
            note="encoder over motor and ratio",
            in_set=seen,
        )
    )
    return rows


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
) -> Estimate:
    half = quantile(degrees) * std
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


def gain_estimate(fits: Sequence[CommandFit], old: float) -> Estimate | None:
    """Position gain pooled over the commands; the logs' scatter counts where it is larger."""
    good = [fit for fit in fits if 0.0 < fit.gain_std < _LOOSE * fit.gain]
    if not good:
        return None
    weight = [1.0 / fit.gain_std**2 for fit in good]
    total = sum(weight)
    gain = sum(w * fit.gain for w, fit in zip(weight, good, strict=True)) / total
    chi = sum(w * (fit.gain - gain) ** 2 for w, fit in zip(weight, good, strict=True))
    spread = max(1.0, chi / max(len(good) - 1, 1))
    std = math.sqrt(spread / total)
    return _made(
        "control.position_gain",
        gain,
        std,
        max(len(good) - 1.0, 2.0),
        unit="1/s",
        register="controller",
        old=old,
        note=f"from the command's waveform in {', '.join(f.log for f in good)}",
    )
