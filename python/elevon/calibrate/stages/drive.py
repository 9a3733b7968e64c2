"""The stage of motions under a control unit's drive: motor, train, and what runs take off them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.block_drive import Motor, driving, motor_constants
from elevon.calibrate.stages.context import Context
from elevon.calibrate.stages.integral_by_current import GIVEN, gains_by_current
from elevon.calibrate.stages.integral_by_current import PATHS as BY_CURRENT
from elevon.calibrate.stages.moves import moves_of
from elevon.calibrate.stages.ripple import ripple_of
from elevon.calibrate.stages.runs import corrected, run_again, with_noise
from elevon.calibrate.stages.train import Constants, TrainBalance, torque_balance
from elevon.estimate import Estimate
from elevon.estimate.number import as_values
from elevon.logs.log import Log

_ROUNDS = 3  # of runs that correct the balances, at most
_NOISES = 4  # draws of a run's noise, over which its readings are averaged
_SETTLED = 0.25  # deviations: a change from which no further round is made


@dataclass(frozen=True)
class _Reading:
    """Numbers, why others are not among them, and the balances themselves."""

    levels: dict[str, Estimate]
    reasons: dict[str, str]
    motor: Motor
    balance: TrainBalance


@dataclass(frozen=True)
class _Reader:
    """The balances of logs, of a stand or of the model run again, with what they take as it is.

    Attributes
    ----------
    actuator, settled : Actuator
        First values, and with what the stages before have determined.
    friction : mapping of str to float
        Knots that a rig has determined.
    inertia : tuple of ndarray
        Places of the ram [m] and what turns and swings beside the motor's own inertia [kg m2].
    gains : bool
        Whether the unit's gains are read from the current as well.
    """

    actuator: Actuator
    settled: Actuator
    friction: Mapping[str, float]
    inertia: tuple[Floats, Floats]
    gains: bool

    def __call__(self, logs: Sequence[Log]) -> _Reading:
        """Return what the logs show."""
        parts = driving(logs, self.actuator)
        motor = motor_constants(parts, self.actuator)
        balance = torque_balance(parts, Constants(self.settled, motor, self.friction, self.inertia))
        levels, reasons = {**motor.levels, **balance.levels}, {**motor.reasons, **balance.reasons}
        if self.gains:
            values: dict[str, str | float] = {**as_values(motor.levels)}
            ready = self.settled.with_values(values, source="calibration")
            gains, missing = gains_by_current(logs, ready, motor)
            levels, reasons = levels | gains, reasons | missing
        return _Reading(levels, reasons, motor, balance)


def drive(ctx: Context) -> None:
    """Evaluate motor and train from motions; runs of the same motions correct them."""
    known = {p: v for p, v in as_values(ctx.levels).items() if p.startswith("friction.ffm_")}
    settled = ctx.settled()
    by_current = BY_CURRENT[0] not in ctx.levels
    inertia = _beside_motor(ctx.logs, settled)
    reader = _Reader(ctx.actuator, settled, known, inertia, by_current)
    first = reader(ctx.logs)
    ctx.add(first.levels, first.reasons)
    if by_current and BY_CURRENT[0] in first.levels:
        constants = () if "motor.emf_constant" in first.levels else ("motor.emf_constant",)
        ctx.stands_on(BY_CURRENT, (*GIVEN, *constants))
    residual = first.balance.residual
    ctx.facts |= {
        "motions_run_again": 0,
        "fidelity": None,
        "ripple_share": None,
        "torque_per_ampere": first.motor.torque,
        "balance_residual_n": None if np.isnan(residual) else residual,
    }
    if ctx.fidelity is not None:
        _correct(ctx, reader, first, ctx.fidelity)


def _correct(ctx: Context, reader: _Reader, first: _Reading, fidelity: str) -> None:
    """Take off what the balances misread in runs of the same motions."""
    again = _chosen(ctx, fidelity)
    for _ in range(_ROUNDS):
        if not again:
            return
        ran, before = ctx.settled(), as_values(ctx.levels)
        noisy = [with_noise(again, ctx.logs, seed) for seed in range(_NOISES)]
        ctx.add(corrected(first.levels, [reader(logs).levels for logs in noisy], ran))
        moved = [
            abs(ctx.levels[p].value - before[p]) / ctx.levels[p].std
            for p in first.levels.keys() & before.keys()
        ]
        if max(moved, default=0.0) < _SETTLED:
            return
        again = _run(ctx, str(ctx.facts["fidelity"]))


def _chosen(ctx: Context, fidelity: str) -> list[Log]:
    """Return the first runs, at the fidelity that the logs bear where none is given."""
    if fidelity != "auto":
        return _run(ctx, fidelity)
    again = _run(ctx, "high")
    if not again:
        return again
    ripple = ripple_of(ctx.logs, again)
    ctx.facts["ripple_share"] = ripple.share
    return again if ripple.fidelity == "high" else _run(ctx, ripple.fidelity)


def _run(ctx: Context, fidelity: str) -> list[Log]:
    again = run_again(ctx.logs, ctx.settled(), fidelity, ctx.progress_of_runs)
    ctx.facts |= {
        "fidelity": fidelity, "motions_run_again": ctx.facts["motions_run_again"] + len(again),
    }  # fmt: skip
    return again


def _beside_motor(logs: Sequence[Log], actuator: Actuator) -> tuple[Floats, Floats]:
    """Return places of the ram and what turns and swings beside the motor's own inertia there.

    The core says it: a run in which a rig moves the ram through its stroke.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import simulate

    stands = (log.stand.parameters for log in logs if moves_of(log))
    model = actuator.with_values(
        next((dict(item) for item in stands if item), {}), source="stand of the log"
    )
    stroke = model.parameters.value("lever.stroke")
    seconds = 0.5
    speed = {"kind": "constant", "value": 0.95 * stroke / seconds}
    scenario = Scenario.from_dict(
        {
            "duration": seconds,
            "command": {"mode": "gear"},
            "load": {"rig_speed": {"terms": [speed]}},
            "initial": {"nut_position": 0.01 * stroke},
        }
    )
    run = simulate(
        model, scenario, fidelity="low", record="output_position,equivalent_inertia@200 Hz"
    )
    total = np.asarray(run["equivalent_inertia"].values, dtype=np.float64)
    places = np.asarray(run["output_position"].values, dtype=np.float64)
    return places, total - model.parameters.value("motor.inertia")
