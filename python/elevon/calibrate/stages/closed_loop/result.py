"""Calibration in closed loop: intervals, what is predicted of logs left out, the actuator file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.named import named
from elevon.calibrate.outcome import Calibration
from elevon.calibrate.stages.closed_loop.fit import (
    DECIDED,
    Fitted,
    Searched,
    as_given,
    choose,
    final_fit,
    parts_apart,
    refined,
    refitted,
    search,
)
from elevon.calibrate.stages.closed_loop.intervals import Knowledge, Silence, known
from elevon.calibrate.stages.closed_loop.log import (
    CHANNELS,
    CURRENT_GAIN,
    NAMES,
    STICK,
    STRUCTURES,
    in_set,
)
from elevon.calibrate.stages.closed_loop.model import LoopModel
from elevon.calibrate.stages.context import Context, run_stages, stages_of
from elevon.calibrate.validation import (
    SignalError,
    Validation,
    ValidationTrace,
    promised,
    promised_transient,
)
from elevon.errors import InputError, unknown
from elevon.estimate import Estimate, quantile
from elevon.estimate.free import outer
from elevon.estimate.lanes import Lanes, Point
from elevon.logs.log import Log
from elevon.parameters.relations import static_following
from elevon.progress import Progress
from elevon.threads import one_blas_thread

_ROUNDS = 4
TRANSIENT = 1.0  # s: what the first state of a drive decides


def units_of(wiring: str) -> dict[str, str]:
    """Return name to SI unit of what a log may show."""
    linear = wiring == "ballscrew"
    return {
        item.name: item.unit if linear else item.unit.replace("m", "rad", 1)
        for item in CHANNELS.values()
    }


def traces_of(model: LoopModel, values: Mapping[str, float]) -> list[ValidationTrace]:
    """Run one point on the logs of a model.

    Raises
    ------
    InputError
        A run leaves the finite numbers.
    """
    traces = []
    for log, run in zip(model.logs, model.simulate([values])[0], strict=True):
        if run is None:
            raise InputError(f"{log.name}: the model's run leaves the finite numbers")
        traces.append(ValidationTrace.of(log, run, NAMES))
    return traces


def predict(
    logs: Sequence[Log], actuator: Actuator, logger: Mapping[str, float] | None = None
) -> tuple[list[SignalError], list[ValidationTrace]]:
    """Run a servo on the demands of logs and compare.

    Parameters
    ----------
    logs : sequence of Log
        Held-out data.
    actuator : Actuator
        Calibrated; its own `control.structure` holds.
    logger : mapping of str to float, optional
        Delays and offsets of the logger, ``facts["logger"]`` of the calibration.

    Returns
    -------
    list of SignalError, list of ValidationTrace
        Errors by log and channel, and each log's channels as predicted.

    Raises
    ------
    InputError
        A run leaves the finite numbers.
    """
    model = LoopModel(actuator, logs, str(actuator.parameters["control.structure"].value))
    values = {path: value for path, value in (logger or {}).items() if path != STICK}
    traces = traces_of(model, values)
    units = units_of(actuator.wiring)
    return [row for trace in traces for row in trace.errors(units)], traces


def held_out_errors(fitted: Fitted, transient: float = TRANSIENT) -> Validation:
    """Refit without each log in turn (each half of a single one) and predict what was left out.

    The second half of a single log is predicted by its first, and the other way round.
    """
    model, free = fitted.model, fitted.lanes.free
    late = [log.counting(log.time >= transient) for log in model.logs]
    traces = []
    for others, left in parts_apart(late):
        x = refitted(model.on(others), free, fitted.x, _ROUNDS)
        traces += traces_of(model.on(left), outer(free, x))
    units = units_of(model.actuator.wiring)
    logger = {
        path.removeprefix("sensor."): value
        for path, value in fitted.values.items()
        if not in_set(path)
    }
    return Validation(
        model.actuator.name, "low", transient,
        tuple(row for trace in traces for row in trace.errors(units)),
        {log.name: "as logged" for log in model.logs}, tuple(traces), logger,
    )  # fmt: skip


def validate_loop(
    logs: Sequence[Log],
    actuator: Actuator,
    transient: float | None = None,
    logger: Mapping[str, float] | None = None,
) -> Validation:
    """Hold a servo against logs in its own closed loop on the recorded demand.

    Parameters
    ----------
    logs : sequence of Log
        Not those of the calibration.
    actuator : Actuator
        Its ``[validation]`` table has the thresholds, and the logger's delays and offsets.
    transient : float, optional
        Seconds left out; default: the actuator file's, else one.
    logger : mapping of str to float, optional
        The logger's delays, lags and offsets (`Validation.offsets`); default: the actuator file's.

    Raises
    ------
    InputError
        A transient longer than a log, a threshold of a channel that is none.
    """
    units = units_of(actuator.wiring)
    limits = promised(actuator, "limits", units)
    offsets = promised(actuator, "offsets") if logger is None else dict(logger)
    given = promised_transient(actuator, transient, TRANSIENT)
    late = [log.after(given) for log in logs]
    _, traces = predict(late, actuator, {f"sensor.{name}": v for name, v in offsets.items()})
    return Validation(
        actuator.name, "low", given,
        tuple(row for trace in traces for row in trace.errors(units, limits)),
        {log.name: "as logged" for log in logs}, tuple(traces), offsets,
    )  # fmt: skip


GAIN, TIME = "control.position_gain", "control.integral_time"
_EXCHANGE_ROUNDS = 8  # of the fit with the gains exchanged
_DEVIATIONS = 3.0  # between two pairs: from here on the logs prefer one
_WHOLE = 0.02  # of one: a feed-forward that is nearer counts as one


def exchanged(fitted: Fitted, given: Actuator) -> tuple[Fitted, dict[str, str]]:
    """Return the fit with both gains near to the actuator file's, and why they are unsettled.

    All else is fitted anew with both gains in each other's place. Where the logs are followed
    alike, the pair nearer to the values `given` is taken, and both are named with the other pair;
    else the pair that follows them better.
    """
    lanes = fitted.lanes
    paths = [item.path for item in lanes.free]
    feedforward = given.parameters.value("control.speed_feedforward")
    if fitted.model.structure != "cascade" or abs(feedforward - 1.0) > _WHOLE:
        return fitted, {}
    if GAIN not in paths or TIME not in paths:
        return fitted, {}
    here = lanes.point(fitted.x)
    # The friction, the delays and the lag are fitted to their pair: so must they be to the other.
    other = lanes.solve(_swapped(fitted)[None, :], rounds=_EXCHANGE_ROUNDS, central=True)[0]
    if not _alike(lanes, here, other):
        return (fitted if here.cost < other.cost else replace(fitted, x=other.x)), {}
    pairs = [outer(lanes.free, x) for x in (fitted.x, other.x)]
    if _distance(pairs[1], given) < _distance(pairs[0], given):
        fitted, pairs = replace(fitted, x=other.x), pairs[::-1]
    return fitted, _reasons(pairs[0], pairs[1])


def _alike(lanes: Lanes, one: Point, other: Point) -> bool:
    """Whether two fits follow the logs alike (Vuong, Econometrica 57(2), 1989, for blocks of time).

    Neither is the truth: a model that errs at corners of the command may prefer the wrong pair by
    many nats there. So the difference counts only beyond three deviations of its sum over blocks.
    """
    gap = lanes.costs(other.residual) - lanes.costs(one.residual)
    blocks = np.bincount(lanes.blocks(one.residual), gap)
    spread = float(np.sqrt(len(blocks)) * np.std(blocks))
    # A cost is twice a negative log-likelihood.
    return abs(other.cost - one.cost) < max(2.0 * DECIDED, _DEVIATIONS * spread)


def _swapped(fitted: Fitted) -> Floats:
    """The point with k_v/N and 1/T_i in each other's place."""
    lanes, values = fitted.lanes, fitted.values
    turns = fitted.model.per_output
    swap = {GAIN: turns / values[TIME], TIME: turns / values[GAIN]}
    x = np.array(fitted.x)
    for k, item in enumerate(lanes.free):
        if item.path in swap:
            x[k] = min(max(item.inner(swap[item.path]), lanes.low[k]), lanes.high[k])
    return x


def _distance(values: dict[str, float], given: Actuator) -> float:
    """How far a pair is from the actuator file's own, in logarithms."""
    total = 0.0
    for path in (GAIN, TIME):
        previous = given.parameters.value(path)
        total += abs(math.log(values[path] / previous)) if previous > 0.0 else 0.0
    return total


def _reasons(taken: dict[str, float], other: dict[str, float]) -> dict[str, str]:
    text = (
        "cannot be separated from {}: with control.speed_feedforward = 1 the logs are followed "
        f"alike with {GAIN} = {taken[GAIN]:.4g} and {TIME} = {taken[TIME]:.4g} s, and with "
        f"{other[GAIN]:.4g} and {other[TIME]:.4g} s; the pair nearer to the file is written"
    )
    return {GAIN: text.format(TIME), TIME: text.format(GAIN)}


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
    _check(logs, actuator, structure)
    late = list(logs) if transient is None else [log.after(transient) for log in logs]
    context = LoopContext(
        late, actuator, structure=structure, free=free, seed=seed,
        progress=progress,
    )  # fmt: skip
    run_stages(LOOP_STAGES, context, 0.0, 1.0)
    fitted = context.fitted
    given = actuator
    if any(item.in_set for item in context.estimates):
        given = _with(context.servo, fitted, context.chosen.structure, context.reasons)
    return context.calibration(given, context.estimates, context.reasons, promise=context.promise)


@dataclass(eq=False, kw_only=True)
class LoopContext(Context):
    """What a calibration in closed loop knows as its stages go on.

    Attributes
    ----------
    structure : str or None
        The only one tried.
    free : sequence of str or None
        Paths requested.
    seed : int
        Of the search's starts.
    servo : Actuator
        The model that is fitted: as given, with what a search leaves out.
    chosen : Searched
        The structure, and where its fit begins.
    fitted : Fitted
        The fit on whole logs.
    promise : Validation
        What values fitted to the other logs predict of each.
    unsettled : dict of str to str
        What the logs follow alike with two values, and why.
    estimates : list of Estimate
        What is determined.
    fraction : float
        Of the work, that was told last.
    """

    structure: str | None
    free: Sequence[str] | None
    seed: int
    servo: Actuator = field(init=False)
    chosen: Searched = field(init=False)
    fitted: Fitted = field(init=False)
    promise: Validation = field(init=False)
    unsettled: dict[str, str] = field(default_factory=dict, init=False)
    estimates: list[Estimate] = field(init=False)
    fraction: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self.servo = self.actuator

    def go(self, fraction: float) -> None:
        """Report progress, which never falls; stop where it says so."""
        self.fraction = max(self.fraction, fraction)
        super().go(self.fraction)

    def goes_on(self) -> bool:
        """Whether progress lets it go on."""
        return self.progress is None or self.progress(self.fraction) is not False


def _structure(ctx: LoopContext) -> None:
    """Search one structure, or each, and take the one that predicts what was left out."""
    if ctx.free is not None:
        searched = [as_given(ctx.actuator, ctx.logs, ctx.free)]
    else:
        searched = _searched(ctx)
    ctx.chosen, why = choose(searched)
    tried = {item.structure: item.held_out for item in searched if np.isfinite(item.held_out)}
    ctx.facts["structure"] = {"chosen": ctx.chosen.structure, "why": why, "held_out": tried}


def _fit(ctx: LoopContext) -> None:
    """Fit whole logs."""
    if ctx.free is None:
        ctx.servo, ctx.chosen = refined(ctx.actuator, ctx.logs, ctx.chosen, check=ctx.goes_on)
    ctx.fitted = final_fit(
        ctx.servo, ctx.logs, ctx.chosen, check=ctx.goes_on,
        advance=lambda fraction: ctx.go(0.6 + 0.35 * fraction),
    )  # fmt: skip


def _exchange(ctx: LoopContext) -> None:
    """Settle two gains that change places."""
    ctx.fitted, ctx.unsettled = exchanged(ctx.fitted, ctx.actuator)


def _hold_out(ctx: LoopContext) -> None:
    """Predict each log by values fitted to the others."""
    ctx.promise = held_out_errors(ctx.fitted)


def _numbers(ctx: LoopContext) -> None:
    """Say what is determined, with intervals, and what is not."""
    ctx.estimates, ctx.reasons = _settled(ctx)
    values = ctx.fitted.values
    ctx.facts |= {
        "agreement": agreement(ctx.fitted),
        "held_out": ctx.promise.errors,
        "logger": {p: v for p, v in values.items() if not in_set(p) or p == STICK},
    }


LOOP_STAGES = stages_of("loop", {
    "structure": _structure, "closed loop": _fit, "gains that change places": _exchange,
    "hold-out": _hold_out, "intervals": _numbers,
})  # fmt: skip
_CASCADE = ("cascade", "control.speed_limit")


def _settled(ctx: LoopContext) -> tuple[list[Estimate], dict[str, str]]:
    """What the logs determine (of what was requested), and what they do not."""
    estimates, missing = _estimates(*known(ctx.fitted), ctx.actuator)
    more = dict(ctx.unsettled)
    if ctx.free is None:
        more |= _ratios_only(estimates, ctx.logs, ctx.fitted)
    estimates = [item for item in estimates if item.path not in more]
    missing |= more
    if ctx.free is not None:
        estimates = _requested(estimates, missing, ctx.free)
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


def _searched(ctx: LoopContext) -> list[Searched]:
    """Search one structure, or each."""
    tried = [ctx.structure] if ctx.structure else list(STRUCTURES)
    each = 0.6 / len(tried)

    def share(k: int) -> Callable[[float], None]:
        return lambda fraction: ctx.go(each * (k + fraction))

    return [
        search(
            ctx.actuator, ctx.logs, name, seed=ctx.seed, alone=len(tried) == 1,
            check=ctx.goes_on, advance=share(k),
        )
        for k, name in enumerate(tried)
    ]  # fmt: skip


def _requested(
    estimates: Sequence[Estimate], missing: Mapping[str, str], free: Sequence[str]
) -> list[Estimate]:
    """Return what was requested, and what no actuator file holds."""
    for path in free:
        if path in missing:
            raise InputError(f"--free {path}: {missing[path]}")
    return [item for item in estimates if item.path in free or not item.in_set]


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
