"""From logs of an actuator with a control unit to a set: what they determine, what not and why."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.by_parts import Parts, PartsCalibration, go
from elevon.calibrate.gear import events, unit
from elevon.calibrate.gear.by_current import GIVEN
from elevon.calibrate.gear.by_current import PATHS as BY_CURRENT
from elevon.calibrate.gear.log import GearLog
from elevon.calibrate.gear.motor import Motor
from elevon.calibrate.gear.reading import Reader, Reading
from elevon.calibrate.gear.rig import RigTest, rig_tests
from elevon.calibrate.gear.ripple import Ripple, ripple_of
from elevon.calibrate.gear.runs import corrected, run_again, with_noise
from elevon.calibrate.gear.tables import (
    friction_knots,
    hanging_mass,
    harmonic_knots,
    hats,
    knots,
    per_travel,
)
from elevon.calibrate.gear.train import Balance
from elevon.calibrate.level import Level, as_values
from elevon.errors import InputError, unknown
from elevon.parameters.records import record_of
from elevon.progress import Progress
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["calibrate_gear"]
#: What no log of these roles shows, whatever was done.
_NEVER = {
    "motor.bearing_torque": "the rig shows it only within the whole train's friction (FFM)",
    "friction.breakaway_ratio": "the rig imposes the motion: nothing breaks away",
    "lock.stiffness": "the seat deflects by less than the position's noise",
    "lock.strength": "nothing broke",
    "lock.spring_force": "the sleeve's spring and the screw's efficiency slow the nut alike",
    "lock.travel": "the nut stops before it",
    "screw.efficiency_force": "its loss bends too little over the loads to tell it from both ends",
    "gear.efficiency_first": "only the product with the screw's efficiency shows",
    "gear.efficiency_second": "only the product with the screw's efficiency shows",
    "leg.inertia": "changes the torque as a hundredth of the motor's own inertia would",
}
_FIDELITIES = ("auto", "low", "high")
_ROUNDS = 3  # of runs that correct the balances, at most
_NOISES = 4  # draws of a run's noise, over which its readings are averaged
_SETTLED = 0.25  # deviations: a change from which no further round is made
_GIVEN = {
    "lock.engage_travel": ("proximity.delay",),
    "lock.release_travel": ("proximity.delay",),
    "motor.inertia": ("screw.inertia", "gear.inertia_first", "gear.inertia_second"),
    "screw.efficiency_unloaded": ("gear.efficiency_first", "gear.efficiency_second"),
    "screw.efficiency_loaded": ("screw.efficiency_force",),
}


@one_blas_thread()
def calibrate_gear(
    logs: Sequence[GearLog],
    actuator: Actuator,
    *,
    free: Sequence[str] | None = None,
    fidelity: str | None = "auto",
    progress: Progress | None = None,
) -> PartsCalibration:
    """Estimate what logs of an actuator with a control unit determine.

    Parameters
    ----------
    logs : sequence of GearLog
        Of the friction rig, of motions, or both.
    actuator : Actuator
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Paths to estimate; default: all that the logs determine.
    fidelity : {"auto", "low", "high"}, optional
        Of the runs of the logs' motions that correct the balances; ``auto``: the switching model
        where the logs have its ripple, else the reduced-order one. None: no runs are made.
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
    go(progress, 0.05)
    work = _Work(logs, actuator)
    work.rig()
    go(progress, 0.5)
    work.drive(fidelity, lambda f: progress is None or progress(0.5 + 0.4 * f))
    go(progress, 0.9)
    work.ends()
    estimates, undetermined = work.answer(free)
    values: dict[str, str | float] = {item.path: item.value for item in estimates}
    go(progress, 1.0)
    return PartsCalibration(
        actuator=actuator.with_values(values, source="calibration"),
        before=actuator,
        logs=tuple(logs),
        estimates=tuple(estimates),
        undetermined=undetermined,
        facts=work.facts(),
        wall_s=clock.perf_counter() - begin,
    )


class _Work(Parts):
    """The stages in their order; each uses what the ones before have determined."""

    def __init__(self, logs: Sequence[GearLog], actuator: Actuator) -> None:
        super().__init__(actuator, _GIVEN, _NEVER)
        self.logs = logs
        self.tests: list[RigTest] = []
        believed = 2.0 * actuator.parameters.value("motor.emf_constant")
        self.motor = Motor({}, {}, believed, 0.0, None, given=True)
        self.balance = Balance({}, {}, float("nan"))
        self.ran = 0
        self.fidelity: str | None = None
        self.ripple: Ripple | None = None

    def facts(self) -> dict[str, Any]:
        """Return what else is known: kinds of logs, torque of an ampere, residual at the ram."""
        kinds = {
            log.name: "rig" if log.rig else "motion" if log.moves else "rest" for log in self.logs
        }
        residual = self.balance.residual
        return {
            "kinds": kinds,
            "motions_run_again": self.ran,
            "fidelity": self.fidelity,
            "ripple_share": None if self.ripple is None else self.ripple.share,
            "torque_per_ampere": self.motor.torque,
            "balance_residual_n": None if np.isnan(residual) else residual,
        }

    def rig(self) -> None:
        """Run the friction rig's evaluation."""
        value = self.actuator.parameters.value
        pitch = 2.0 * np.pi * value("screw.lead")
        self.tests = rig_tests(
            self.logs, self.actuator, per_travel=per_travel(self.actuator), pitch=pitch
        )
        mass = hanging_mass([t for t in self.tests if t.kind != "brake"])
        why = "too few rig tests in both directions at different levels of friction"
        self.add({} if mass is None else {"screw.moving_mass": mass}, {"screw.moving_mass": why})
        weight = mass or Level(value("screw.moving_mass"), 0.1 * value("screw.moving_mass"))
        self.add(*friction_knots(self.tests, self.actuator, weight))
        self.add(*harmonic_knots(self.tests, self.actuator))
        self._detent()

    def _detent(self) -> None:
        detents = [t for t in self.tests if t.detent is not None and t.detent_std is not None]
        why = "no slow rig test with the motor connected shows it below the recorder's filter"
        if not detents:
            self.add({}, {"motor.detent_torque": why})
            return
        sizes = np.array([t.detent or 0.0 for t in detents]) / per_travel(self.actuator)
        deviations = np.array([t.detent_std or 0.0 for t in detents]) / per_travel(self.actuator)
        spread = float(np.std(sizes)) / np.sqrt(max(len(sizes) - 1, 1)) if len(sizes) > 1 else 0.0
        std = float(np.hypot(np.mean(deviations) / np.sqrt(len(sizes)), spread))
        self.add(
            {"motor.detent_torque": Level(float(np.mean(sizes)), std, max(len(sizes) - 1, 1))}, {}
        )

    def drive(self, fidelity: str | None, progress: Progress | None) -> None:
        """Evaluate the unit's gains, the motor and the train from motions; runs correct them."""
        self.add(*unit.gains(self.logs, self.actuator))
        points = unit.set_points(self.logs)
        why = "no motion with the set point of the speed recorded"
        paths = ("control.acceleration_limit", "control.speed_high", "control.speed_low")
        self.add(points, {path: why for path in paths if path not in points})
        known = {p: v for p, v in as_values(self.levels).items() if p.startswith("friction.ffm_")}
        settled = self.settled()
        inertia = beside_motor(self.logs, settled)
        open_ = BY_CURRENT[0] not in self.levels
        reader = Reader(self.actuator, settled, known, inertia, gains=open_)
        first = reader(self.logs)
        self.motor, self.balance = first.motor, first.balance
        self.add(first.levels, first.reasons)
        if open_ and BY_CURRENT[0] in first.levels:
            constants = () if "motor.emf_constant" in first.levels else ("motor.emf_constant",)
            self.given = {**self.given, **dict.fromkeys(BY_CURRENT, (*GIVEN, *constants))}
        if fidelity is not None:
            self._correct(reader, first, fidelity, progress)

    def _correct(
        self, reader: Reader, first: Reading, fidelity: str, progress: Progress | None
    ) -> None:
        """Take off what the balances misread in runs of the same motions."""
        again = self._chosen(fidelity, progress)
        for _ in range(_ROUNDS):
            if not again:
                return
            ran, before = self.settled(), as_values(self.levels)
            noisy = [with_noise(again, self.logs, seed) for seed in range(_NOISES)]
            detents = [reader(logs).levels for logs in noisy]
            self.add(corrected(first.levels, detents, ran), {})
            moved = [
                abs(self.levels[p].value - before[p]) / self.levels[p].std for p in first.levels
            ]
            if max(moved, default=0.0) < _SETTLED:
                return
            again = self._run(progress)

    def _chosen(self, fidelity: str, progress: Progress | None) -> list[GearLog]:
        """Return the first runs, at the fidelity that the logs bear where none is given."""
        self.fidelity = "high" if fidelity == "auto" else fidelity
        again = self._run(progress)
        if fidelity != "auto" or not again:
            return again
        self.ripple = ripple_of(self.logs, again)
        if self.ripple.fidelity == self.fidelity:
            return again
        self.fidelity = self.ripple.fidelity
        return self._run(progress)

    def _run(self, progress: Progress | None) -> list[GearLog]:
        again = run_again(self.logs, self.settled(), str(self.fidelity), progress)
        self.ran += len(again)
        return again

    def ends(self) -> None:
        """Evaluate the lock and the brake."""
        self.add(*events.lock_travels(self.logs, self.actuator))
        braked = [t for t in self.tests if t.kind == "brake"]
        mass = self.value("screw.moving_mass")
        friction = [self._friction(t) for t in braked]
        brake = events.brake_torque(braked, friction, mass, self.actuator)
        why = "no rig test against the set brake, and a stop is too short for its slope"
        self.add({} if brake is None else {"brake.torque": brake}, {"brake.torque": why})
        self.add(*events.brake_delays(self.logs, self.actuator))

    def _friction(self, test: RigTest) -> float:
        """Return the whole train's friction at a test's speed, without the brake [N]."""
        direction = "extension" if test.direction > 0.0 else "retraction"
        table = [self.value(f"friction.ffm_{direction}_{k}") for k in range(1, 9)]
        return float((hats(np.array([test.speed]), knots(self.actuator)) @ np.array(table))[0])


def beside_motor(logs: Sequence[GearLog], actuator: Actuator) -> tuple[Floats, Floats]:
    """Return places of the ram and what turns and swings beside the motor's own inertia there.

    The core says it: a run in which a rig moves the ram through its stroke.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import simulate

    stand = next((dict(log.stand) for log in logs if log.moves and log.stand), {})
    model = actuator.with_values(stand, source="stand of the log")
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
