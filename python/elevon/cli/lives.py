"""`elevon predict`, `next-inspection`, `fleet` and `learn-growth`: how long units will last."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table
from elevon.cli.shell import REPORT, Answer, DoorCall, command, printer
from elevon.number_text import count_text

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis
    from elevon.prognose.fleet import FleetPlan
    from elevon.prognose.fleet_growth import FleetGrowth
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


@command(None, "strict", door="elevon.prognose.door:learn_growth", working="learning growth")
def learn_growth(call: DoorCall, *, out: Path, force: bool = False) -> Answer:
    """Learn growth, its spread from unit to unit and lives from a fleet's histories.

    Parameters
    ----------
    out : Path
        Growth to write (JSON).
    """
    common.check_outputs([out], force=force)
    result = call()
    path = result.save(out, force=force)
    return Answer({"file": str(path), **result.to_dict()}, lambda: _learned(result, path))


def _learned(result: FleetGrowth, path: Path) -> None:
    answer(f"{result.headline} -> {path}")
    print_table(
        ("fault", "units", "follows the law", "median life", "spread", "drift"),
        [
            (
                key, str(item.units), f"{item.trust:.2f}", f"{item.life:.4g}",
                f"{item.spread:.2f}", "{:.2f} to {:.2f}".format(*item.free.drift),
            )
            for key, item in result.growth.items()
        ],
    )  # fmt: skip
    effects = [
        (key, name, f"{effect:+.3g}")
        for key, item in result.growth.items()
        for name, effect in item.covariates.items()
    ]
    if result.lives is not None:
        pairs = zip(result.lives.names[1:], result.lives.coefficients[1:], strict=True)
        effects += [("lives", name, f"{value:+.3g}") for name, value in pairs]
    if effects:
        print_table(("of", "covariate", "adds to the logarithm"), effects)
    listed(result.findings)
