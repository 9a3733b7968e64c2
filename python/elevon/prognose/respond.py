"""Tables of what severities do, from the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from elevon.prognose.grid import axis_points
from elevon.prognose.law import Law
from elevon.prognose.response import Response
from elevon.prognose.snapshots import correction
from elevon.prognose.tabulate import severity_grid, tabulate
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.mission import Mission

__all__ = ["respond"]


def respond(
    actuator: Actuator,
    mission: Mission,
    *,
    laws: Sequence[Law] | None = None,
    fidelity: str = "low",
    snapshots: bool = False,
    progress: Progress | None = None,
) -> Response:
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
        Correct the low fidelity's tables by runs at high fidelity, see `correction`.

    Raises
    ------
    InputError
        A fault the actuator has not, a requirement it cannot be asked, a mission it cannot do.
    """
    acting = tuple(mission.laws() if laws is None else laws)
    grid = severity_grid(acting, mission, axis_points(len(acting)))
    base = tabulate(actuator, mission, acting, grid, fidelity=fidelity, progress=progress)
    if not snapshots or fidelity == "high":
        return base
    return correction(actuator, mission, base, progress).of(base)
