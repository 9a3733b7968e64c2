"""One flow for every actuator: stages in their order, each uses what the ones before determined."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence

from elevon.actuator import Actuator
from elevon.calibrate.outcome import Calibration, by_path, log_facts
from elevon.calibrate.stages import lock, loops, motor, rig, screw
from elevon.calibrate.stages.context import Context, run_stages, stages_of
from elevon.calibrate.stages.drive import drive
from elevon.calibrate.stages.heat import heat
from elevon.calibrate.stages.loops_by_current import loops_by_current
from elevon.calibrate.stages.moves import moves_of, rig_moves
from elevon.data import packaged_toml
from elevon.errors import InputError, unknown
from elevon.logs.log import Log
from elevon.parameters.records import record_of, records
from elevon.progress import Progress
from elevon.threads import one_blas_thread

_FIDELITIES = ("auto", "low", "high")
_UNIT = "control.gain_extension"  # an actuator with a control unit of its own has it
_PRELOAD = "screw.efficiency_aiding"  # a preloaded screw has it


STAGES = stages_of("parts", {
    "rig": rig.friction, "speed control": loops.unit_gains, "set points": loops.set_points,
    "drive": drive, "lock": lock.travels, "brake": lock.brake, "motor": motor.motor_constants,
    "load side": motor.load_side, "torque": screw.torque, "position loop": loops.position_loop,
    "speed loop": loops.speed_control, "loops by current": loops_by_current, "heat": heat,
})  # fmt: skip
_KINDS = {_UNIT: "unit", _PRELOAD: "preload"}


@one_blas_thread()
def calibrate_parts(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    free: Sequence[str] | None = None,
    fidelity: str | None = "auto",
    progress: Progress | None = None,
) -> Calibration:
    """Estimate each number from the signals that show it.

    Parameters
    ----------
    logs : sequence of Log
        Motions under drive, of a friction rig, or long ones with temperatures.
    actuator : Actuator
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Paths to estimate; default: all that the logs determine.
    fidelity : {"auto", "low", "high"}, optional
        Of the runs of the logs' motions that correct the balances of an actuator with a control
        unit; ``auto``: the switching model where the logs have its ripple, else the reduced-order
        one. None: no runs are made.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No log, an unknown fidelity, nothing determined, or a path requested that the logs do not
        determine.
    Interrupted
        `progress` returned False.
    """
    begin = clock.perf_counter()
    if not logs:
        raise InputError("calibration needs at least one log")
    if fidelity not in {None, *_FIDELITIES}:
        raise unknown("fidelity", str(fidelity), _FIDELITIES, "--fidelity")
    for path in free or ():
        record_of(actuator.wiring, path, "--free")
    context = Context(logs, actuator, fidelity=fidelity, progress=progress)
    _run(context)
    estimates, undetermined = context.answer(free)
    values: dict[str, str | float] = {item.path: item.value for item in estimates}
    context.go(1.0)
    return Calibration(
        actuator=actuator.with_values(values, source="calibration"),
        before=actuator,
        logs=log_facts(context.logs),
        parameters=by_path(estimates),
        undetermined=undetermined,
        facts=context.facts,
        wall_s=clock.perf_counter() - begin,
    )


def _run(context: Context) -> None:
    """Run the stages that serve this actuator."""
    known = records(context.actuator.wiring)
    for kind in (_KINDS[path] for path in _KINDS if path in known):
        unseen = packaged_toml("elevon.calibrate.stages", "unseen.toml")[kind]
        context.reasons |= unseen["never"]
        context.given |= {path: tuple(paths) for path, paths in unseen["given"].items()}
    if _UNIT in known:
        context.facts["kinds"] = {
            log.name: "rig" if rig_moves(log) else "motion" if moves_of(log) else "rest"
            for log in context.logs
        }
    run_stages(STAGES, context, 0.05, 0.95)
