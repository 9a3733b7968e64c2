"""What the reduced-order model shows of a log's test, by the same roles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import of_a_magnet
from elevon.diagnose.roles.numbers import Numbers, numbers_of
from elevon.diagnose.roles.role_test import BEFORE, RoleTest, action_numbers
from elevon.diagnose.roles.series import averaged
from elevon.experiment import Experiment, Inputs, Variant, shown_by
from elevon.logs.log import Log, on_clock
from elevon.parameters.records import wirings
from elevon.simulate.prepare import solver_step

if TYPE_CHECKING:
    from elevon.actuator import Actuator

_OVER = 4  # samples of the model to one of the log, which are averaged: loggers filter, too
_ELASTIC = 1.0  # backlash.model: an elastic contact
_PUSHED = 0.1  # of the greatest load, of the fastest motion, and share of the time
_SET_POINT = "_ref"  # end of roles that a drive knows as numbers: nothing filters them


@dataclass(frozen=True)
class RoleUnit:
    """A unit of the replay.

    Attributes
    ----------
    values : mapping of str to float
        What differs from the actuator.
    faults : tuple of str
        As in ``--fault``.
    late : float
        Samples that it is seen to begin too late.
    phase : float
        Samples by which the recorder's instants precede those of the log: kinks and steps of
        the command fall between samples.
    number : int
        Of its random numbers; healthy days differ in them, faults do not.
    compliant : bool
        Whether its output deflects under the log's load, which the reduced-order model does not
        know.
    """

    values: Mapping[str, float]
    faults: tuple[str, ...] = ()
    late: float = 0.0
    phase: float = 0.0
    number: int = 0
    compliant: bool = True


def as_on_stand(actuator: Actuator, test: RoleTest) -> Actuator:
    """Return the actuator with what the log's stand set, its load over the stroke among it."""
    ready = of_a_magnet(actuator).with_values(dict(test.settings), source="stand of the log")
    if test.stroke is None:
        return ready
    return ready.with_values(test.stroke.settings(ready), source="load of the log")


def numbers_of_log(item: RoleTest, actuator: Actuator, channels: Mapping[str, Floats]) -> Numbers:
    """Return the numbers of a log, or of a model run on its instants."""
    known = actuator.parameters
    pairs = known.value("motor.pole_pairs") if "motor.pole_pairs" in known else None
    return numbers_of(channels, item.log["command"], item.log.time, item.log.units, pairs)


def numbers_by(item: RoleTest, actuator: Actuator, units: Sequence[RoleUnit]) -> Iterator[Numbers]:
    """Run units through a log's test; numbers of each by the log's roles."""
    for channels in channels_by(item, actuator, units):
        yield numbers_of_log(item, actuator, channels)


def channels_by(
    item: RoleTest, actuator: Actuator, units: Sequence[RoleUnit]
) -> Iterator[dict[str, Floats]]:
    """Run units through a log's test; what each shows by the log's roles, on its instants."""
    ready = as_on_stand(actuator, item)
    actions = action_numbers(actuator.wiring)
    deflection = deflection_under(item, ready)
    experiment = Experiment(
        item.log, ready, _inputs(item, actuator.wiring), _signals(item, actuator),
        rate=f"{_over(item.rate, solver_step(ready, 'low')) * item.rate:.12g} Hz",
    )  # fmt: skip
    variants = [
        Variant(u.values, u.faults, later=u.phase / item.rate, number=u.number) for u in units
    ]
    for unit, run in zip(units, experiment.run(variants), strict=True):
        late = unit.late if actions else unit.late + unit.phase
        shows = _channels(item, run.log, late / item.rate)
        if deflection is not None and unit.compliant and "output_position" in shows:
            shows["output_position"] = shows["output_position"] - deflection
        yield shows


def _inputs(item: RoleTest, wiring: str) -> Inputs:
    actions = action_numbers(wiring)
    times, values = item.command
    steps = tuple(
        (max(float(t) + BEFORE, 0.0), actions[int(n) % len(actions)])
        for t, n in zip(times, values, strict=True)
        if actions and t < item.seconds
    )
    load = item.load
    return Inputs(
        item.seconds + BEFORE + 2.0 / item.rate,
        wirings()[wiring]["modes"][0],
        None if actions else (times + BEFORE, values),
        steps,
        {} if load is None else {"output": (load[0] + BEFORE, load[1])},
        dict(item.initial),
    )


def driven(item: RoleTest, ready: Actuator) -> bool:
    """Whether a load drives the output of an elastic backlash over a tenth of the motion."""
    deflection = deflection_under(item, ready)
    if deflection is None:
        return False
    speed = np.gradient(item.log["command"], item.log.time)
    pushed = deflection * np.sign(speed) < -_PUSHED * np.abs(deflection).max()
    moving = np.abs(speed) > _PUSHED * np.abs(speed).max()
    return bool(np.mean(pushed[moving]) > _PUSHED)


def deflection_under(item: RoleTest, ready: Actuator) -> Floats | None:
    """Return how far the output stands back under the log's load, shape (n,): force by stiffness.

    The reduced-order model's backlash is rigid. None without a load, or where the unit's contact is
    rigid.
    """
    known = ready.parameters
    if (
        item.load is None
        or "backlash.model" not in known
        or known.value("backlash.model") != _ELASTIC
    ):
        return None
    return np.asarray(
        np.interp(item.log.time, *item.load) / known.value("backlash.stiffness"), dtype=np.float64
    )


def _channels(item: RoleTest, run: Log, late: float) -> dict[str, Floats]:
    """A run by role, on the log's instants; one that ended early shows its end on."""
    clock, at = run.time, item.log.time + BEFORE + late
    over = round(1.0 / (item.rate * (clock[1] - clock[0]))) if len(clock) > 1 else 1
    out = {}
    for role in run:
        values = np.nan_to_num(run[role])
        if len(clock) == 0:
            out[role] = np.zeros(len(at))
            continue
        state = item.log.units[role] == "1"
        filtered = values if state or role.endswith(_SET_POINT) else averaged(values, over)
        out[role] = on_clock(clock, filtered, at, item.log.units[role])
    return out


def _over(rate: float, step: float) -> int:
    """Samples of the model to one of a log, an even number as far as its steps allow it."""
    steps = round(1.0 / (rate * step))
    return next((n for n in (_OVER, 2) if steps % n == 0), 1)


def _signals(item: RoleTest, actuator: Actuator) -> dict[str, str]:
    """Role to the reduced-order model's signal, what a sensor shows before what is true."""
    known = shown_by(actuator.wiring, "low")
    return {role: known[role] for role in item.seen if role in known}
