"""`elevon predict`, `elevon next-inspection` and `elevon fleet`: how long units will last."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.cli.output import answer, listed, print_table
from elevon.cli.shell import REPORT, printer
from elevon.number_text import count_text

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis
    from elevon.prognose.fleet import FleetPlan
    from elevon.prognose.next_inspection import NextInspection

_RUNS = "model runs"


@printer("elevon.prognose.door:predict", *REPORT, working=_RUNS)
def predict(result: Prognosis) -> None:
    """Predict the remaining useful life of the unit whose inspections are in HISTORY."""
    from elevon.prognose.page import severity_unit
    from elevon.units import to_display

    answer(result.headline)
    survival = [(f"{n:g}", f"{p:.3f}") for n, p in result.p_survive]
    print_table((f"next N {result.unit}", "probability of surviving"), survival)
    rows = []
    for item in result.reserve:
        unit = severity_unit(item.unit)
        now, end = (f"{to_display(x, unit):.4g}" for x in (item.value, item.threshold))
        rows.append((item.name, now, end, unit, f"{result.first[item.name]:.3f}"))
    print_table(("requirement", "now", "life ends at", "unit", "fails first"), rows)
    listed(result.findings)


@printer("elevon.prognose.door:next_inspection", *REPORT, working=_RUNS)
def next_inspection(result: NextInspection) -> None:
    """Say until when the unit in HISTORY can go unseen at a risk, and with which test to look."""
    answer(result.headline)
    rows = [
        (item.name, *("no end in sight" if use is None else count_text(use)
                      for use in (item.median, item.low, item.high)))
        for item in result.assumptions
    ]  # fmt: skip
    print_table(("assumed", "median", "low", "high"), rows, title=f"remaining {result.unit}")
    listed(result.findings)


@printer("elevon.prognose.door:fleet", *REPORT, working=_RUNS)
def fleet(plan: FleetPlan) -> None:
    """Predict several units of one type and group their maintenance."""
    answer(plan.headline)
    print_table(plan.HEADINGS, plan.cells(), title=f"{plan.unit} from now")
    listed(plan.findings)
