"""Calibration in closed loop: logs and datasheet numbers to an actuator file with intervals."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.closed_loop.exchange import exchanged
from elevon.calibrate.closed_loop.fit import (
    Fitted,
    Searched,
    as_given,
    choose,
    final_fit,
    search,
)
from elevon.calibrate.closed_loop.free import CURRENT_GAIN, STICK, STRUCTURES, in_set
from elevon.calibrate.closed_loop.intervals import Knowledge, Silence, known
from elevon.calibrate.closed_loop.predict import held_out_errors, traces_of, units_of
from elevon.calibrate.closed_loop.refine import refined
from elevon.calibrate.named import named
from elevon.calibrate.outcome import Calibration, by_path, log_facts
from elevon.calibrate.validation import SignalError
from elevon.errors import InputError, Interrupted, unknown
from elevon.estimate import Estimate, quantile
from elevon.logs.log import Log
from elevon.parameters.relations import static_following
from elevon.progress import Progress
from elevon.threads import one_blas_thread

#: What scales with the torque constant that the current is read by.
_SCALED = {
    "motor.inertia", "friction.dynamic", "friction.static", "friction.viscous", "load.constant",
    "control.pid_gain", "control.speed_gain",
}  # fmt: skip


@one_blas_thread()
def calibrate_loop(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    structure: str | None = None,
    free: Sequence[str] | None = None,
    transient: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Calibration:
    """Estimate what recorded demands and whatever was recorded of the motion determine.

    Parameters
    ----------
    logs : sequence of Log
        Demands and channels on one clock each.
    actuator : Actuator
        A servo with the numbers of its datasheets; what they do not say is a first guess.
    structure : str, optional
        ``cascade`` or ``pid``; default: whichever predicts held-out data better.
    free : sequence of str, optional
        Parameter paths to estimate, from the actuator file's values and under the actuator file's
        structure; all others stay as given. Default: everything, searched over all bandwidths, and
        ranked.
    transient : float, optional
        Seconds at the beginning of each log that do not count; default: none.
    seed : int
        Of the search's starts.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No log, an actuator that is no servo, a transient longer than a log, a path that the closed
        loop does not free, or nothing determined (of what was requested).
    Interrupted
        `progress` returned False.
    """
    begin = clock.perf_counter()
    _check(logs, actuator, structure)
    say = _Reporter(progress)
    logs = _late(logs, transient)
    if free is not None:
        searched = [as_given(actuator, logs, free)]
    else:
        searched = _searched(actuator, logs, structure, seed, say)
    chosen, why = choose(searched)
    servo = actuator
    if free is None:
        servo, chosen = refined(actuator, logs, chosen, check=say.go)
    fitted = final_fit(servo, logs, chosen, check=say.go, advance=lambda f: say(0.6 + 0.35 * f))
    fitted, unsettled = exchanged(fitted, actuator)
    validated = held_out_errors(fitted)
    estimates, missing = _settled(fitted, logs, actuator, unsettled, free)
    say(1.0)
    tried = {item.structure: item.held_out for item in searched if np.isfinite(item.held_out)}
    return Calibration(
        actuator=_with(servo, fitted, chosen.structure, missing),
        before=actuator,
        logs=log_facts(logs),
        parameters=by_path(estimates),
        undetermined=missing,
        facts={
            "structure": {"chosen": chosen.structure, "why": why, "held_out": tried},
            "agreement": agreement(fitted),
            "held_out": validated.errors,
            "logger": {p: v for p, v in fitted.values.items() if not in_set(p) or p == STICK},
        },
        promise=validated,
        wall_s=clock.perf_counter() - begin,
    )


#: A cascade's speed limit has no meaning as it was given for a PID.
_CASCADE = ("cascade", "control.speed_limit")


def _settled(
    fitted: Fitted,
    logs: Sequence[Log],
    actuator: Actuator,
    unsettled: Mapping[str, str],
    free: Sequence[str] | None,
) -> tuple[list[Estimate], dict[str, str]]:
    """What the logs determine (of what was requested), and what they do not."""
    estimates, missing = _estimates(*known(fitted), actuator)
    more = dict(unsettled)
    if free is None:
        more |= _ratios_only(estimates, logs, fitted)
    estimates = [item for item in estimates if item.path not in more]
    missing |= more
    if free is not None:
        estimates = _requested(estimates, missing, free)
    if not estimates:
        raise InputError("the logs determine no parameter: nothing in them moves enough")
    return estimates, missing


def _ratios_only(
    estimates: Sequence[Estimate], logs: Sequence[Log], fitted: Fitted
) -> dict[str, str]:
    """Why torques are not determined where neither current nor voltage was logged."""
    if any(log.has(role) for log in logs for role in ("torque_current", "torque_voltage")):
        return {}
    limit = fitted.model.actuator.parameters.value("control.current_limit")
    return {
        item.path: f"no current was logged: torques, inertia and gains are known by their ratios; "
        f"{item.value:.4g} {item.unit} if control.current_limit is {limit:g} A, as given"
        for item in estimates
        if item.path in _SCALED
    }


def _late(logs: Sequence[Log], transient: float | None) -> list[Log]:
    """Return the logs without their first seconds."""
    if transient is None:
        return list(logs)
    for log in logs:
        if not 0.0 <= transient < log.duration:
            raise InputError(f"transient of {transient:g} s: {log.name} lasts {log.duration:g} s")
    return [log.counting(log.time >= transient) for log in logs]


def _searched(
    actuator: Actuator,
    logs: Sequence[Log],
    structure: str | None,
    seed: int,
    say: _Reporter,
) -> list[Searched]:
    """Search one structure, or each."""
    tried = [structure] if structure else list(STRUCTURES)
    each = 0.6 / len(tried)

    def share(k: int) -> Callable[[float], None]:
        return lambda fraction: say(each * (k + fraction))

    return [
        search(
            actuator, logs, name, seed=seed, alone=len(tried) == 1, check=say.go, advance=share(k)
        )
        for k, name in enumerate(tried)
    ]


def _requested(
    estimates: Sequence[Estimate], missing: Mapping[str, str], free: Sequence[str]
) -> list[Estimate]:
    """Return what was requested, and what no actuator file holds."""
    for path in free:
        if path in missing:
            raise InputError(f"--free {path}: {missing[path]}")
    return [item for item in estimates if item.path in free or not item.in_set]


class _Reporter:
    """Progress that decides whether to go on."""

    def __init__(self, progress: Progress | None) -> None:
        self.progress = progress
        self.fraction = 0.0

    def __call__(self, fraction: float) -> None:
        self.fraction = max(self.fraction, fraction)
        if not self.go():
            raise Interrupted("calibration stopped")

    def go(self) -> bool:
        return self.progress is None or self.progress(self.fraction) is not False


def _check(logs: Sequence[Log], actuator: Actuator, structure: str | None) -> None:
    from elevon.parameters.records import records

    if not logs:
        raise InputError("calibration needs at least one log")
    if "control.pid_gain" not in records(actuator.wiring):
        raise InputError(f"{actuator.name}: the wiring {actuator.wiring!r} has no servo's loop")
    if structure is not None and structure not in STRUCTURES:
        raise unknown("structure", structure, STRUCTURES)


def _estimates(
    rows: Sequence[Knowledge], degrees: float, actuator: Actuator
) -> tuple[list[Estimate], dict[str, str]]:
    width = quantile(degrees)
    estimates, missing = [], {}
    by_path = {row.free.path: row for row in rows}
    for row in rows:
        path = row.free.path
        if row.reason:
            missing[path if path != STICK else "friction.static"] = row.reason
            continue
        seen = row
        if path == STICK:
            seen = _static(row, by_path["friction.dynamic"])
            path = "friction.static"
        number = Estimate(seen.value, seen.deviation, interval=seen.interval(width))
        given = ("control.torque_constant",) if path in _SCALED else ()
        estimates.append(
            named(
                number, path, actuator, given=given, source="simulation", unit=seen.free.unit,
                register=row.free.register,
            )
        )  # fmt: skip
    return estimates, missing


def _static(stick: Knowledge, dynamic: Knowledge) -> Knowledge:
    """Static friction from its share of the dynamic one; their deviations add."""
    from dataclasses import replace

    spread = stick.free.spread
    std = float(np.hypot(stick.std * spread, dynamic.std * dynamic.free.spread)) / spread
    free = replace(dynamic.free, path="friction.static", spread=spread, low=dynamic.free.low)
    return Knowledge(free, free.inner(stick.value * dynamic.value), std, "")


def _with(
    actuator: Actuator, fitted: Fitted, structure: str, missing: Mapping[str, str]
) -> Actuator:
    """Fitted values; what the logs do not feel stays as given."""
    values: dict[str, str | float] = {"control.structure": structure}
    for path, value in fitted.values.items():
        silent = isinstance(missing.get(path), Silence)
        if path == STICK:
            values["friction.static"] = value * fitted.values["friction.dynamic"]
        elif in_set(path) and (not silent or (structure, path) == _CASCADE):
            values[path] = value
    if CURRENT_GAIN in values:
        # The zero of the current loop's PI stays where it is.
        share = float(values[CURRENT_GAIN]) / actuator.parameters.value(CURRENT_GAIN)
        values["pwm.integral_gain"] = share * actuator.parameters.value("pwm.integral_gain")
    if "friction.dynamic" in values and "friction.static" not in values:
        values["friction.static"] = static_following(
            actuator.parameters, float(values["friction.dynamic"])
        )
    return actuator.with_values(values, source="calibration")


def agreement(fitted: Fitted) -> list[SignalError]:
    """Return the errors of a fit by log and channel."""
    units = units_of(fitted.model.actuator.wiring)
    traces = traces_of(fitted.model, fitted.values)
    return [row for trace in traces for row in trace.errors(units)]
