"""Tables of what severities do, from the model."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from elevon.errors import InputError
from elevon.prognose.grid import axis_points
from elevon.prognose.law import Law
from elevon.prognose.laws import laws_of
from elevon.prognose.response import ResponseTables
from elevon.prognose.snapshots import correction
from elevon.prognose.tabulate import severity_grid, tabulate
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.mission import Mission


def respond(
    actuator: Actuator,
    mission: Mission,
    *,
    laws: Sequence[Law] | None = None,
    fidelity: str = "low",
    snapshots: bool = False,
    progress: Progress | None = None,
) -> ResponseTables:
    """Run the mission and the requirements over a grid of severities.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    mission : Mission
        What is done and must hold.
    laws : sequence of Law, optional
        Those that act; default: the mission's.
    fidelity : str
        Of the runs.
    snapshots : bool
        Correct the reduced-order tables by runs of the switching model, see `correction`.

    Raises
    ------
    InputError
        A fault the actuator has not, a requirement it cannot be judged by, a mission it cannot do.
    """
    begin = clock.perf_counter()
    acting = tuple(mission.laws() if laws is None else laws)
    _check_laws(actuator, acting)
    grid = severity_grid(acting, mission, axis_points(len(acting)))
    made = tabulate(actuator, mission, acting, grid, fidelity=fidelity, progress=progress)
    if snapshots and fidelity != "high":
        made = correction(actuator, mission, made, progress).of(made)
    return replace(made, seconds=clock.perf_counter() - begin)


def _check_laws(actuator: Actuator, laws: Sequence[Law]) -> None:
    """Refuse a law whose fault the actuator has not, or has in another unit; name those it has."""
    from elevon.faults import catalogue

    records = catalogue(actuator.wiring)
    there = {f"{r.kind}@{place}": r.unit for r in records for place in r.places}
    for law in laws:
        unit = there.get(law.key)
        if unit == law.unit:
            continue
        why = (
            f"has no {law.key}" if unit is None else f"has its {law.key} in {unit}, not {law.unit}"
        )
        fit = ", ".join(laws_of(actuator.wiring))
        raise InputError(f"law {law.name}: {actuator.name} {why}; laws that fit it: {fit}")
