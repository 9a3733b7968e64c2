"""One flow: every subsystem from what was measured at its input and at its output.

None waits for another: a controller that nobody knows leaves the mechanics as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.outcome import Calibration
from elevon.calibrate.stages.context import (
    Context,
    Stage,
    geared,
    motor_ratio,
    run_stages,
    stages_of,
)
from elevon.calibrate.subsystems.controller import (
    Controller,
    LawNumbers,
    SpeedEstimate,
    identify_controller,
    load_gain,
)
from elevon.calibrate.subsystems.electrics import (
    identify_electrics,
    identify_torque_constant,
    identify_transmission,
)
from elevon.calibrate.subsystems.mechanics import Mechanics, identify_mechanics
from elevon.calibrate.subsystems.record import (
    NAMES,
    NOT,
    ReportAxis,
    Subsystem,
    controller_of,
    electrics_of,
    mechanics_of,
    transmission_of,
)
from elevon.calibrate.subsystems.replay import bare, closed_loop, free_run, window_runs
from elevon.calibrate.subsystems.signals import (
    MOTIONS,
    DriveSignals,
    Effort,
    drive_signals,
    effort_of,
    evenly,
    excerpts,
    linear,
    with_scale,
)
from elevon.calibrate.validation import SignalError, Validation, ValidationTrace
from elevon.errors import InputError
from elevon.estimate import Estimate
from elevon.logs.log import Log
from elevon.parameters.records import record_of, wirings
from elevon.parameters.relations import static_following
from elevon.progress import Progress
from elevon.threads import one_blas_thread

#: Hz from which a log shows the law of a position or speed loop. ASSUMED: such loops of drives are
#: sampled at 0.5 to 4 kHz; at 100 Hz a law of 1 kHz explains half of its own effort
RESOLVED = 500.0
LONGEST = 60_000  # samples of a log that is run in closed loop
SETTLED = 0.05  # s at the beginning of a closed loop that are not compared


def identifiable(logs: Sequence[Log], actuator: Actuator) -> bool:
    """Return whether logs of a servo have an effort and a motion."""
    servo = "position" in wirings()[actuator.wiring]["modes"]
    moves = all(any(log.has(role) for role in MOTIONS) for log in logs)
    return bool(logs) and servo and moves and effort_of(logs, actuator, None) is not None


@dataclass(eq=False)
class MachineContext(Context):
    """What the identification of a machine knows as its stages go on.

    Attributes
    ----------
    scale : str or float or None
        Torque constant that the user states.
    subsystems : dict of str to Subsystem
        What is determined of each.
    estimates : list of Estimate
        What goes into the actuator file.
    values : dict of str to value
        Choices that go with them.
    inverse : Mechanics or None
        What the regression of the mechanics gave.
    commanded, controller : Controller or None
        The best law, and that law where it explains enough.
    """

    _: KW_ONLY
    scale: str | float | None = None
    subsystems: dict[str, Subsystem] = field(default_factory=dict, init=False)
    estimates: list[Estimate] = field(default_factory=list, init=False)
    values: dict[str, str | float] = field(default_factory=dict, init=False)
    inverse: Mechanics | None = field(default=None, init=False)
    commanded: Controller | None = field(default=None, init=False)
    controller: Controller | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        effort = effort_of(self.logs, self.actuator, self.scale)
        if effort is None:
            raise InputError("no effort was logged: a current, a torque, a force or a voltage")
        self.effort: Effort = effort
        self.actuator = with_scale(self.actuator, effort, self.scale)
        self.drives: list[DriveSignals] = evenly(
            [drive_signals(log, self.actuator, effort.role) for log in self.logs]
        )

    def settles(self, free: Sequence[str] | None) -> bool:
        """Return whether the subsystems leave nothing for a fit in closed loop.

        The law was found sample by sample, no command was logged, or the log is fast enough to show
        a law that there is. A slower log does not resolve the drive's samples: a fit of the whole
        loop may tell more.
        """
        if free is not None:
            return {*free} <= {item.path for item in self.estimates}
        if self.subsystems["mechanics"].status == NOT:
            return False
        if self.commanded is None or self.commanded.exact:
            return True
        return min(drive.rate for drive in self.drives) >= RESOLVED

    def without_controller(self, explained: float) -> None:
        """Note that a fit of the whole loop does not explain the effort either."""
        why = (
            "no structure explains 90 % of the effort on data held out; a fit of the whole loop "
            f"{100 * max(explained, 0.0):.0f} %"
        )
        self.subsystems["controller"] = replace(self.subsystems["controller"], reason=why)

    @cached_property
    def excerpts(self) -> list[DriveSignals]:
        """What is read of the logs: all but of long ones."""
        return [part for drive in self.drives for part in excerpts(drive)]

    def torques(self, drives: Sequence[DriveSignals]) -> list[DriveSignals]:
        """Return logs with their effort as the motor's torque [N m], where its scale is known."""
        return [replace(d, effort=self.effort.scale * d.effort) for d in drives]


def _mechanics(ctx: MachineContext) -> None:
    """Inertia, friction and constant load."""

    def own_motion(drive: DriveSignals, numbers: Mapping[str, float]) -> Floats:
        return free_run(drive, bare(ctx.actuator, numbers), drive.effort)[1]

    try:
        ctx.inverse = identify_mechanics(
            ctx.torques(ctx.excerpts), own_motion, geared=geared(ctx.actuator)
        )
    except InputError as error:
        ctx.subsystems["mechanics"] = Subsystem(NOT, reason=str(error))
        return
    part, written, missing, values = mechanics_of(ctx.inverse, ctx.actuator, ctx.effort)
    ctx.subsystems["mechanics"] = part
    ctx.estimates += written
    ctx.values |= values
    ctx.reasons |= missing


def _electrics(ctx: MachineContext) -> None:
    """Resistance, inductance, voltage constant."""
    cell = identify_torque_constant(ctx.excerpts, motor_ratio(ctx.actuator))
    result = identify_electrics(ctx.logs)
    part, written = electrics_of(result, cell, ctx.actuator, ctx.effort.unit)
    ctx.subsystems["electrics"] = part
    if "motor.emf_constant" not in {*ctx.effort.given} and ctx.scale is None:
        ctx.estimates += written
    else:
        ctx.estimates += [item for item in written if item.path != "motor.emf_constant"]


def _transmission(ctx: MachineContext) -> None:
    """Ratio, lost motion, error a turn."""
    result = identify_transmission(ctx.logs, ctx.actuator)
    ctx.subsystems["transmission"] = transmission_of(result, ctx.actuator)


def _thermal(ctx: MachineContext) -> None:
    """Nothing but the reason: thermal networks need long logs with temperatures."""
    warm = any(log.has("temperature") or log.has("surface_temperature") for log in ctx.logs)
    why = "no temperature was logged"
    if warm:
        why = "thermal networks are read beside the balances of a screw: torque, load, temperatures"
    ctx.subsystems["thermal"] = Subsystem(NOT, reason=why)


def _controller(ctx: MachineContext) -> None:
    """Structure and gains of the law, where one explains the effort."""
    result, why = identify_controller(ctx.excerpts)
    part, written, values = controller_of(result, why, ctx.actuator, ctx.effort)
    ctx.commanded = result
    ctx.controller = result if result is not None and result.identified else None
    ctx.subsystems["controller"] = part
    ctx.estimates += written
    ctx.values |= values


STAGES: tuple[Stage[MachineContext], ...] = stages_of("machine", {
    "mechanics": _mechanics, "electrics": _electrics, "transmission": _transmission,
    "thermal": _thermal, "controller": _controller,
})  # fmt: skip


@one_blas_thread()
def identify(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    scale: str | float | None = None,
    progress: Progress | None = None,
) -> MachineContext:
    """Return what logs determine of each subsystem.

    Parameters
    ----------
    logs : sequence of Log
        Of one machine, with an effort and a motion.
    actuator : Actuator
        Values before.
    scale : str or float, optional
        Torque at the motor, or force at a linear output, for one unit of the effort.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No effort, no motion, too few samples, a scale that cannot be.
    """
    context = MachineContext(logs, actuator, progress=progress, scale=scale)
    run_stages(STAGES, context, 0.02, 0.7)
    return context


def calibrate_machine(context: MachineContext, free: Sequence[str] | None = None) -> Calibration:
    """Return the calibration of a machine from its subsystems alone.

    Raises
    ------
    InputError
        Not what was requested, or nothing is determined.
    """
    for path in free or ():
        record_of(context.actuator.wiring, path, "--free")
    estimates = [item for item in context.estimates if free is None or item.path in free]
    present = {item.path for item in estimates}
    for path in free or ():
        if path not in present:
            why = context.reasons.get(path, "nothing in the logs speaks of it")
            raise InputError(f"--free {path}: {why}")
    if all(part.status == NOT for part in context.subsystems.values()):
        text = "; ".join(part.reason for part in context.subsystems.values())
        raise InputError(f"the logs determine no subsystem: {text}")
    values: dict[str, str | float] = {} if free is not None else dict(context.values)
    values |= {item.path: item.value for item in estimates}
    if "friction.dynamic" in values and "friction.static" not in values:
        dynamic = float(values["friction.dynamic"])
        values["friction.static"] = static_following(context.actuator.parameters, dynamic)
    fitted = context.actuator.with_values(values, source="calibration")
    validation = validate_subsystems(context, fitted)
    table = None if free is not None else law_table(context)
    if table is not None:
        fitted = replace(fitted, validation={**(fitted.validation or {}), "law": table})
    return context.calibration(
        fitted, estimates, {} if free is not None else context.reasons,
        findings=_findings(context), promise=validation, validation=validation,
        facts={"subsystems": {name: context.subsystems[name] for name in NAMES}},
    )  # fmt: skip


def _findings(context: MachineContext) -> tuple[str, ...]:
    texts = []
    for name in NAMES:
        part = context.subsystems[name]
        text = f"{name}: {part.status.replace('_', ' ')}"
        if name == "controller" and part.status != NOT:
            more = part.more
            text += (
                f", {more['structure']}, speed as {more['speed']}: explains "
                f"{100 * more['explained']:.4g} % of the effort on data held out"
            )
        texts.append(text + (f" ({part.reason})" if part.reason else ""))
    if context.inverse is not None:
        texts += list(context.inverse.findings)
    return tuple(texts)


def law_table(context: MachineContext) -> dict[str, object] | None:
    """Return an exact law of position as an actuator file keeps it."""
    result = context.controller
    if result is None or not result.exact or result.of != "position" or not context.effort.known:
        return None
    law = LawNumbers.of(result)
    table: dict[str, object] = {
        "structure": law.structure, "effort": context.effort.role, "scale": context.effort.scale,
        "gains": dict(law.gains), "constant": law.constant, "speed": law.speed.kind,
        "lag": law.speed.lag, "delay": law.delay, "period": law.period,
    }  # fmt: skip
    return table if law.limit is None else {**table, "limit": law.limit}


def law_of(table: Mapping[str, object]) -> LawNumbers:
    """Return the law that an actuator file keeps."""
    gains = table["gains"]
    assert isinstance(gains, Mapping)

    def number(name: str, default: float = 0.0) -> float:
        return float(str(table.get(name, default)))

    speed = SpeedEstimate(str(table["speed"]), number("lag"))
    limit = number("limit") if table.get("limit") is not None else None
    return LawNumbers(
        str(table["structure"]), {k: float(v) for k, v in gains.items()}, number("constant"), speed,
        int(number("delay")), number("period"), limit,
    )  # fmt: skip


def validate_machine(
    logs: Sequence[Log], actuator: Actuator, *, progress: Progress | None = None
) -> Validation:
    """Hold an actuator against logs, each subsystem driven by its measured input.

    Parameters
    ----------
    logs : sequence of Log
        With an effort and a motion.
    actuator : Actuator
        Calibrated: its ``[validation]`` table has thresholds, and the drive's law where known.
    progress : callable, optional
        Told the done fraction; returns False to stop.
    """
    promise = actuator.validation or {}
    table = promise.get("law")
    scale = None
    if isinstance(table, Mapping):
        unit = logs[0].units.get(str(table["effort"]), "") if logs else ""
        scale = f"{table['scale']} N m" + (f"/{unit}" if unit not in {"", "N m", "N"} else "")
    known = effort_of(logs, actuator, None)
    given = scale if known is not None and known.unit not in {"N m", "N"} else None
    context = MachineContext(logs, actuator, progress=progress, scale=given)
    law = law_of(table) if isinstance(table, Mapping) else None
    return validate_subsystems(context, actuator, law, promise.get("limits", {}))


def validate_subsystems(
    context: MachineContext,
    actuator: Actuator,
    law: LawNumbers | None = None,
    limits: Mapping[str, float] | None = None,
) -> Validation:
    """Return the errors of motion driven by the measured effort, and of the loop under its law."""
    if law is None and context.controller is not None and context.controller.of == "position":
        law = LawNumbers.of(context.controller) if context.controller.exact else None
    axis = ReportAxis.of(actuator, context.effort)
    unit = f"{axis.place}/s"
    names = {
        "open_loop_position": axis.place, "open_loop_speed": unit, "free_speed": unit,
        "closed_loop_position": axis.place, "closed_loop_effort": context.effort.unit,
    }  # fmt: skip
    errors: list[SignalError] = []
    traces, notes, ways = [], {}, {}
    for drive in context.torques(context.drives) if context.effort.known else []:
        way = ["driven by its measured effort"]
        measured, simulated, why = _driven(drive, actuator, law, context.effort, way)
        used = drive.good & (drive.time >= SETTLED)
        trace = ValidationTrace(drive.name, drive.time, measured, simulated, used)
        rows = []
        for name in simulated:
            one = replace(trace, used=used & np.isfinite(simulated[name]))
            one = replace(one, simulated={name: simulated[name]})
            rows += one.errors(names, limits)
        errors += rows
        traces.append(trace)
        ways[drive.name] = "; ".join(way)
        if why:
            notes[drive.name] = why
    return Validation(actuator.name, "low", SETTLED, tuple(errors), ways, tuple(traces), {}, notes)


def _driven(
    drive: DriveSignals,
    actuator: Actuator,
    law: LawNumbers | None,
    effort: Effort,
    ways: list[str],
) -> tuple[dict[str, Floats], dict[str, Floats], str]:
    """Return what a log has and what the plant, and the loop round it, show."""
    ratio = motor_ratio(actuator) if linear(actuator) else 1.0
    position, speed, why = drive.position, drive.speed, ""
    if position is None or speed is None:
        smooth, rate, _ = drive.derivatives(0.1 * drive.rate)
        position = smooth if position is None else position
        speed = rate if speed is None else speed
    place, moves = window_runs(drive, actuator, drive.effort)
    simulated = {"open_loop_position": place / ratio, "open_loop_speed": moves / ratio}
    measured = {"open_loop_position": position / ratio, "open_loop_speed": speed / ratio}
    try:
        simulated["free_speed"] = free_run(drive, actuator, drive.effort)[1] / ratio
        measured["free_speed"] = speed / ratio
    except InputError as error:
        why = str(error)
    if law is not None and drive.command is not None and len(drive.time) <= LONGEST:
        if abs(law.period - drive.period) > 0.01 * law.period:
            return measured, simulated, (
                f"the law was identified at {1.0 / law.period:.4g} Hz, the log has "
                f"{drive.rate:.4g} Hz: the closed loop is not run"
            )  # fmt: skip
        if "load" not in law.gains and drive.load is not None:
            own_signals = replace(drive, effort=drive.effort / effort.scale)
            gain = load_gain(own_signals)
            if gain is not None:
                law = replace(law, gains={**law.gains, "load": gain})
                ways.append(
                    f"the logged load acts on the controller's output: {gain:.4g} {effort.unit} a "
                    "unit, found in this log"
                )
        place, efforts = closed_loop(drive, actuator, law, effort.scale)
        simulated |= {"closed_loop_position": place / ratio, "closed_loop_effort": efforts}
        measured |= {
            "closed_loop_position": position / ratio,
            "closed_loop_effort": drive.effort / effort.scale,
        }
    return measured, simulated, why
