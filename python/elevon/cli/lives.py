"""`elevon predict`, `next-inspection`, `fleet` and `learn-growth`: how long units will last."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from elevon.cli import common
from elevon.cli.output import print_result
from elevon.cli.shell import REPORT, Answer, DoorCall, command, result_command

if TYPE_CHECKING:
    from elevon.prognose.fleet_growth import FleetGrowth

_RUNS = "model runs"

predict = result_command(
    "elevon.prognose.door:predict",
    "Predict the remaining useful life of the unit whose inspections are in HISTORY.",
    *REPORT, working=_RUNS,
)  # fmt: skip
next_inspection = result_command(
    "elevon.prognose.door:next_inspection",
    "Say until when the unit in HISTORY can go unseen at a risk, and with which test to look.",
    *REPORT, working=_RUNS,
)  # fmt: skip
fleet = result_command(
    "elevon.prognose.door:fleet",
    "Predict several units of one type and group their maintenance.",
    *REPORT, working=_RUNS,
)  # fmt: skip


@command(None, "strict", door="elevon.prognose.door:learn_growth", working="learning growth")
def learn_growth(call: DoorCall, *, out: Path, force: bool = False) -> Answer:
    """Learn growth, its spread from unit to unit and lives from a fleet's histories.

    Parameters
    ----------
    out : Path
        Growth to write (JSON).
    """
    common.check_outputs([out], force=force)
    result: FleetGrowth = call()
    path = result.save(out, force=force)
    data = {"file": str(path), **result.to_dict()}
    return Answer(data, lambda: print_result(result, file=path))
