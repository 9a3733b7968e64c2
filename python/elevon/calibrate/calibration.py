"""Parameters of an actuator from bench logs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.balance import controller_law, saturated_speed, torque_balance
from elevon.calibrate.dynamic import Dynamic, dynamic_stage
from elevon.calibrate.kinematics import KINEMATIC, CommandFit, command_fit
from elevon.calibrate.model_runs import SpeedRuns
from elevon.calibrate.outcome import Calibration, log_facts
from elevon.calibrate.plant import (
    Torque,
    accept,
    controller_estimates,
    missing,
    plant_estimates,
    shortened,
    static_estimate,
    torque_scale,
    undetermined,
    with_values,
)
from elevon.calibrate.positions import PER_LOG, gain_estimate, position_estimates
from elevon.calibrate.stages.context import Context, run_stages, stages_of
from elevon.calibrate.static import static_friction
from elevon.data import packaged_toml
from elevon.errors import InputError, unknown
from elevon.estimate import Estimate
from elevon.estimate.held_out import held_out as left_out
from elevon.estimate.regression import Regression
from elevon.logs.drive import drive_log
from elevon.logs.log import Log
from elevon.parameters.records import record_of
from elevon.parameters.relations import motor_torque_constant, static_following
from elevon.plain import Plain, in_unit, key
from elevon.progress import Progress, part
from elevon.threads import one_blas_thread

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
) -> list[str]:
    """Sentences on torque scale, brakes, drive and misfit."""
    return [
        *_of_the_balance(plant),
        *_of_the_scale(torque, actuator),
        *_of_brakes(logs),
        *([] if dynamic is None else _of_model_runs(dynamic, actuator)),
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


def _of_model_runs(dynamic: Dynamic, actuator: Actuator) -> list[str]:
    nominal = actuator.parameters["drive.kind"].value
    drives = [(dynamic.drive, nominal)] if dynamic.drive != nominal else []
    return [
        *(_TEXTS["drive"].format(*pair) for pair in drives),
        *(_TEXTS["absorbs"].format(p, 100.0 * (a / b - 1.0), a, b) for p, a, b in dynamic.absorbed),
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


_OFFSETS = ("sensor.current_offset",)
_LAST = 0.25  # of a single log that is kept from the fit


@dataclass(frozen=True)
class HeldOut(Plain):
    """Error on data kept from the fit.

    Attributes
    ----------
    log : str
        The log.
    span : str
        ``all`` of it, or its ``last quarter``.
    speed, current : float
        RMS error of the model runs [rad/s, A].
    speed_all, current_all : float
        The same with the values fitted to everything.
    """

    log: str
    span: str
    speed: Annotated[float, key("speed_rms"), in_unit("rad/s")]
    current: Annotated[float, key("current_rms"), in_unit("A")]
    speed_all: Annotated[float, key("speed_rms_all_data"), in_unit("rad/s")]
    current_all: Annotated[float, key("current_rms_all_data"), in_unit("A")]


def held_out(
    logs: Sequence[Log], before: Actuator, fitted: Actuator, progress: Progress | None
) -> tuple[HeldOut, ...]:
    """Refit without each log in turn, or without the last quarter of a single one."""
    parts, spans = list(logs), ["all"] * len(logs)
    if len(logs) == 1:
        late = logs[0].time > (1.0 - _LAST) * logs[0].duration
        parts, spans = [logs[0].counting(late), logs[0].counting(~late)], ["last quarter"]

    def judge(log: Log, values: dict[str, float], _share: Progress | None) -> HeldOut | None:
        return _errors(log, values, fitted)

    rows = left_out(parts, lambda others: _refitted(others, before, fitted), judge, progress)
    pairs = zip(spans, rows, strict=False)
    return tuple(replace(row, span=span) for span, (_, row) in pairs if row is not None)


def _refitted(some: Sequence[Log], before: Actuator, fitted: Actuator) -> dict[str, float]:
    """Values of the regressions on some logs, and the sensors' offsets."""
    plant = torque_balance(some)
    law = controller_law(some, 0.0 if plant is None else plant["lag"])
    if plant is None or law is None:
        raise InputError("the logs move too little for both regressions")
    torque = torque_scale(fitted, plant)
    estimates, followed = plant_estimates(before, plant, torque)
    estimates += controller_estimates(before, law, torque, [log.name for log in some])
    values = dict(followed) | {
        item.path: item.value for item in estimates if item.in_set and item.value > 0.0
    }
    dynamic = values.get("friction.dynamic", fitted.parameters.value("friction.dynamic"))
    values["friction.static"] = static_following(fitted.parameters, dynamic)
    values["control.torque_constant"] = torque.believed
    offsets = {i.path: i.value for i in estimates if i.path in _OFFSETS}
    return values | offsets


def _errors(log: Log, values: dict[str, float], fitted: Actuator) -> HeldOut | None:
    """RMS errors of speed and current, by these values and by those fitted to everything."""
    known = (fitted.validation or {}).get("offsets", {})
    offsets = {path: values[path] for path in _OFFSETS if path in values}
    offsets["sensor.speed_offset"] = known.get("motor_speed", 0.0)
    errors = []
    for (run,) in SpeedRuns(fitted, [log], tied=False).simulate([values | offsets, offsets]):
        if run is None:
            return None
        errors += [_rms(run.speed - log.speed, log.good), _rms(run.current - log.current, log.good)]
    return HeldOut(log.name, "", *errors)


def _rms(error: Floats, mask: Bools) -> float:
    return float(np.sqrt(np.mean(error[mask] ** 2)))


_DOUBTFUL = 0.2  # share of the current below which a regression explains nothing
_MODEL_RUNS = (0.35, 0.8)  # of the work: model runs


@dataclass(eq=False, kw_only=True)
class DriveContext(Context):
    """What the stages of a drive's logs share beside the estimates.

    Parameters
    ----------
    logs, used : sequence of Log
        The data, whole for positions and commands; and without what leads in, for balances.
    actuator : Actuator
        Values before.
    free : sequence of str or None
        Paths requested.
    per_log : sequence of str
        Of `elevon.calibrate.positions.PER_LOG`: estimated for each log.
    fidelity : str or None
        Of model runs; None: only where the regressions fail.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Attributes
    ----------
    plant, law : Regression or None
        The two regressions; None where one explains nothing.
    torque : Torque
        Where the scale of all torques comes from.
    followed : dict of str to float
        Values of other parameters that had to follow.
    commands : list of CommandFit
        Commands reconstructed.
    findings : list of str
        What the positions say in words.
    accepted : list of Estimate
        What the actuator file can hold, and what it has no place for.
    dynamic : Dynamic or None
        Identifiability and the fit of model runs.
    """

    used: Sequence[Log]
    free: Sequence[str] | None
    per_log: Sequence[str]
    torque: Torque = field(init=False)
    plant: Regression | None = field(default=None, init=False)
    law: Regression | None = field(default=None, init=False)
    followed: dict[str, float] = field(default_factory=dict, init=False)
    commands: list[CommandFit] = field(default_factory=list, init=False)
    findings: list[str] = field(default_factory=list, init=False)
    accepted: list[Estimate] = field(default_factory=list, init=False)
    dynamic: Dynamic | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.torque = torque_scale(self.actuator, None)

    def put(self, estimates: Iterable[Estimate]) -> None:
        """Take over estimates, the loose ones too."""
        self.levels |= {item.path: item for item in estimates}


def _positions(ctx: DriveContext) -> None:
    estimates, findings = position_estimates(ctx.logs, ctx.actuator, ctx.per_log)
    ctx.put(estimates)
    ctx.findings += findings


def _torque(ctx: DriveContext) -> None:
    ctx.plant = _explaining(torque_balance(ctx.used))


def _controller(ctx: DriveContext) -> None:
    plant = ctx.plant
    ctx.law = law = _explaining(controller_law(ctx.used, 0.0 if plant is None else plant["lag"]))
    if plant is not None and law is not None and "constant" in plant.names:
        ctx.plant = _sampled(plant, law, ctx.used)


def _explaining(regression: Regression | None) -> Regression | None:
    """Drop a regression that explains nothing: its coefficients are noise."""
    return regression if regression and regression.explained > _DOUBTFUL else None


def _sampled(plant: Regression, law: Regression, logs: Sequence[Log]) -> Regression:
    """Add to the deviations what a set point in the current's place may owe to its samples.

    Samples in step with the drive catch the derivative's spikes too often or too seldom. The
    controller's law shows how much of that goes with the motion; friction would take it up, the
    viscous part in one direction and the dry part in the other.
    """
    speeds = [log.speed[log.good] for log in logs]
    spread = float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
    gap = np.zeros(len(plant.names))
    gap[plant.names.index("viscous")] = law.std("motion")
    gap[plant.names.index("dry")] = -spread * law.std("motion")
    return replace(plant, covariance=plant.covariance + np.outer(gap, gap))


def _numbers(ctx: DriveContext) -> None:
    ctx.torque = torque_scale(ctx.actuator, ctx.plant)
    if ctx.plant is not None:
        estimates, ctx.followed = plant_estimates(ctx.actuator, ctx.plant, ctx.torque)
        ctx.put(estimates)
        static = static_friction(ctx.used, ctx.plant, ctx.torque.constant)
        dry = ctx.levels.get("friction.dynamic")
        least = None if dry is None else dry.value
        ctx.put(static_estimate(ctx.actuator, static, least, ctx.torque))
    if ctx.law is not None:
        names = [log.name for log in ctx.used]
        ctx.put(controller_estimates(ctx.actuator, ctx.law, ctx.torque, names))


def _command(ctx: DriveContext) -> None:
    limit, gain = ctx.value("control.speed_limit"), ctx.given_value("control.position_gain")
    fits = [command_fit(log, gain, limit) for log in ctx.logs]
    ctx.commands = [fit for fit in fits if fit is not None]
    pooled = gain_estimate(ctx.commands, ctx.actuator)
    ctx.put([] if pooled is None else [pooled])


def _runs(ctx: DriveContext) -> None:
    """Accept what the signals say, and fit the rest on model runs (a fidelity)."""
    free = ctx.free
    ctx.accepted = accepted = accept(list(ctx.levels.values()), free, ctx.actuator)
    direct = [p for p in free or () if p in KINEMATIC or p == "motor.emf_constant"]
    missing(direct, accepted, ctx.torque)
    if ctx.fidelity is not None or ctx.plant is None or ctx.law is None:
        # Branches that the signals do not show start from nothing.
        none = {item.path: 0.0 for item in accepted if item.in_set and item.value == 0.0}
        started = ctx.actuator.with_values({**ctx.followed, **none}, source="calibration")
        ctx.dynamic = dynamic_stage(
            ctx.used, started, accepted, free, fidelity=ctx.fidelity or "low",
            progress=part(ctx.progress, *_MODEL_RUNS),
        )  # fmt: skip
    if ctx.dynamic is not None:
        known = [path for path in ctx.levels if path not in (free or ())]
        known += [item.path for item in accepted]
        ctx.accepted += ctx.dynamic.estimates(ctx.actuator, known, free)
    missing(free, ctx.accepted, ctx.torque)
    if not any(item.in_set for item in ctx.accepted):
        raise InputError("the logs determine no parameter: nothing in them moves enough")


DRIVE_STAGES = stages_of("drive", {
    "positions": _positions, "torque balance": _torque, "controller's law": _controller,
    "numbers": _numbers, "command": _command, "model runs": _runs,
})  # fmt: skip


_RUN_IN = 1.0  # s at least before a log counts
_RUNS = 0.35  # of the work: where model runs begin
_SETTLED = 0.5  # s after the set point has left its limit for the first time


@one_blas_thread()
def calibrate(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    free: Sequence[str] | None = None,
    per_log: Sequence[str] = (),
    fidelity: str = "low",
    transient: float | None = None,
    hold_out: bool = True,
    model_runs: bool = True,
    progress: Progress | None = None,
) -> Calibration:
    """Estimate what the logs determine.

    Parameters
    ----------
    logs : sequence of Log
        Of a drive, as `elevon.read_log` reads them.
    actuator : Actuator
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Parameter paths to estimate; default: all that the logs determine.
    per_log : sequence of str
        Of `elevon.calibrate.positions.PER_LOG`: estimated for each log too, as ``PATH[LOG]``.
    fidelity : str
        Of the model runs: ``low`` or ``high``.
    transient : float, optional
        Seconds left out at the beginning of each log; default: until the set point has left its
        limit for the first time.
    hold_out : bool
        Whether to refit without each log in turn (without the end of a single log).
    model_runs : bool
        Whether to rank and fit on model runs too: for what the regressions cannot see, and to name
        what absorbs the model's misfit.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        No log, an unknown path, or a path requested that the logs do not determine.
    Interrupted
        `progress` returned False.
    """
    if not logs:
        raise InputError("calibration needs at least one log")
    logs = [drive_log(log) for log in logs]
    _check(actuator, logs, free, per_log, fidelity)
    skipped = {log.name: _run_in(log, transient) for log in logs}
    used = [log.counting(log.time >= skipped[log.name]) for log in logs]
    runs = fidelity if model_runs else None
    context = DriveContext(
        logs, actuator, used=used, free=free, per_log=per_log, fidelity=runs, progress=progress
    )
    run_stages(DRIVE_STAGES, context, 0.02, _RUNS)
    estimates, dynamic = context.accepted, context.dynamic
    fitted = with_values(actuator, estimates, context.followed, context.torque, dynamic)
    errors = held_out(used, actuator, fitted, part(progress, 0.8, 1.0)) if hold_out else ()
    not_taken = undetermined(list(context.levels.values()), estimates, free, dynamic)
    known = log_facts(
        logs, brake={log.name: log.brake.known for log in logs}, skipped_s=skipped,
        warnings={log.name: log.warnings for log in logs},
    )  # fmt: skip
    facts = {**_facts(context), **_of_runs(dynamic), "held_out": errors}
    return context.calibration(
        fitted, estimates, not_taken, logs=known, facts=facts, findings=_findings(context)
    )


def _facts(context: DriveContext) -> dict[str, object]:
    """What the signals say beside the estimates."""
    groups: dict[str, list[str]] = {}
    for item in context.accepted:
        name = "derived" if item.path.startswith("derived.") else item.register
        groups.setdefault(name, []).append(item.path)
    torque, plant, law = context.torque, context.plant, context.law
    return {
        "registers": groups,
        "torque_constant": {
            "value": torque.constant,
            "from_load_cell": torque.measured,
            "determined": "torque constant and inertia apart"
            if torque.measured
            else "only ratios to the torque constant",
        },
        "followed": context.followed,
        "explained": {
            "torque_balance": plant.explained if plant else None,
            "speed_controller": law.explained if law else None,
        },
        "commands": context.commands,
    }


def _of_runs(dynamic: Dynamic | None) -> dict[str, object]:
    """What the model runs say: which candidates the logs determine, and the fit."""
    ranking = None if dynamic is None else dynamic.ranking
    return {"identifiability": ranking, "simulation_fit": dynamic}


def _findings(context: DriveContext) -> tuple[str, ...]:
    """Everything the calibration has to say."""
    actuator, estimates = context.actuator, context.accepted
    return (
        *context.findings,
        *shortened(actuator, estimates),
        *plant_findings(context.used, context.plant, context.torque, context.dynamic, actuator),
        *amplitude_findings(context.commands, estimates),
    )  # fmt: skip


def _check(
    actuator: Actuator,
    logs: Sequence[Log],
    free: Sequence[str] | None,
    per_log: Sequence[str],
    fidelity: str,
) -> None:
    from elevon.simulate.prepare import check_fidelity

    if actuator.wiring != "rotary":
        raise InputError(
            f"{actuator.name}: drive logs calibrate the wiring 'rotary', not {actuator.wiring!r}"
        )
    check_fidelity(actuator.wiring, fidelity)
    names = [log.name for log in logs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two logs are named {name}; give them different names")
    for path in free or ():
        if record_of(actuator.wiring, path, "--free").choices is not None:
            raise InputError(f"--free {path}: is a choice, not a number")
    for path in per_log:
        if path not in PER_LOG:
            raise unknown("--per-log (what one bench changes between its logs)", path, PER_LOG)


def _run_in(log: Log, transient: float | None) -> float:
    """Seconds left out: until the set point has left its limit for the first time, 1 s at least."""
    if transient is not None:
        log.after(transient)
        return transient
    limit = 0.999 * saturated_speed(log)
    limited = np.abs(log.speed_ref) >= limit
    early = np.flatnonzero(limited[: len(limited) // 2])
    first = 0.0
    if early.size:
        after = np.flatnonzero(~limited[early[0] :])
        first = float(log.time[early[0] + after[0]]) + _SETTLED if after.size else 0.0
    return min(max(first, _RUN_IN), 0.5 * log.duration)
