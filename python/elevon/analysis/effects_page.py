"""The report of effects: Pareto chart and half-normal plot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.analysis.effects import Effects

EQUAL_REPEATS = (
    "the repeats of each point are equal: nothing random was simulated (sensor noise, spread of "
    "units); they count as one run"
)
_METHODS = {
    "replicates": "Student's t with the pure error of repeated points",
    "lenth": "Lenth's pseudo standard error: the design is not replicated",
    "residual": "Student's t with the residual of the model, which holds what the model lacks",
    "none": "none: the design leaves nothing to judge the effects by",
}


def effects_report(effects: Effects, folder: str, *, date: str | None = None) -> Report:
    """Return the report of a campaign's effects on a response."""
    report = Report(
        f"Effects on {effects.response}",
        f"Change of the response [{effects.unit}] from the lowest to the highest level of each "
        f"factor. Intervals at {100 * effects.level:g} % for each term by itself: "
        f"{_METHODS[effects.method]}.",
        date=date,
    )
    report.fact("Runs", str(effects.runs), f"{len(effects.left_out)} left out")
    report.fact("Mean", f"{effects.mean:.4g} {effects.unit}")
    section = report.section("Effects")
    section.table(
        ReportTable(["Term", "Factors", "Effect", "Low", "High", "Aliased with"], _rows(effects))
    )
    for text in _confounded(effects):
        section.text(text)
    section.figure(pareto(effects), "Pareto chart; the line is the margin of the interval.")
    section.figure(half_normal(effects), "Half-normal plot; effects of noise alone lie on a line.")
    factors = []
    for item in effects.factors:
        unit = display_unit(item["unit"])
        ends = [to_display(item[name], unit) for name in ("low", "high")]
        factors.append([item["letter"], item["name"], *ends, unit])
    report.section("Factors").table(
        ReportTable(["Letter", "Factor", "Low", "High", "Unit"], factors)
    )
    report.provenance(
        {"Command": f"elevon campaign effects {folder} --response {effects.response}"}
    )
    return report


def _rows(effects: Effects) -> list[list[Any]]:
    blank = "not known"
    return [
        [
            term.term,
            term.name,
            term.effect,
            blank if term.low is None else term.low,
            blank if term.high is None else term.high,
            ", ".join(term.aliases),
        ]
        for term in effects.terms
    ]


def _confounded(effects: Effects) -> list[str]:
    texts = []
    if effects.blocked:
        texts.append(f"Confounded with the blocks: {', '.join(effects.blocked)}.")
    if effects.equal_repeats:
        texts.append(f"Note: {EQUAL_REPEATS}.")
    if effects.partial:
        texts.append(f"Left out, partly aliased with other terms: {', '.join(effects.partial)}.")
    if effects.with_blocks:
        texts.append(f"Varied with the blocks: {', '.join(effects.with_blocks)}.")
    return texts


def pareto(effects: Effects, most: int = 25) -> Figure:
    """Return the Pareto chart of the largest effects."""
    terms = effects.terms[:most][::-1]
    colours = [COLOURS["blue" if term.significant else "grey"] for term in terms]
    sizes = [abs(term.effect) for term in terms]
    with new_figure(height=0.8 + 0.26 * len(terms)) as (figure, axes):
        axes.barh([term.term for term in terms], sizes, color=colours)
        if effects.margin is not None:
            axes.axvline(effects.margin, color=COLOURS["red"], linestyle="--")
        axes.set_xlabel(f"magnitude of the effect on {effects.response} [{effects.unit}]")
    return figure


def half_normal(effects: Effects) -> Figure:
    """Return the half-normal plot."""
    from scipy.stats import norm

    terms = sorted(effects.terms, key=lambda term: abs(term.effect))
    quantiles = norm.ppf(0.5 + 0.5 * (np.arange(len(terms)) + 0.5) / len(terms))
    sizes = [abs(term.effect) for term in terms]
    with new_figure(height=4.2) as (figure, axes):
        axes.plot(sizes, quantiles, "o", color=COLOURS["blue"], markersize=4)
        for term, size, quantile in list(zip(terms, sizes, quantiles, strict=True))[-8:]:
            axes.annotate(term.term, (size, quantile), xytext=(4, 2), textcoords="offset points")
        if effects.error is not None:
            top = float(quantiles[-1])
            axes.plot([0.0, effects.error * top], [0.0, top], color=COLOURS["red"], linestyle="--")
        axes.set_xlabel(f"magnitude of the effect on {effects.response} [{effects.unit}]")
        axes.set_ylabel("half-normal quantile")
    return figure
