"""The report of effects: Pareto chart and half-normal plot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.data import packaged_toml
from elevon.report import Report
from elevon.report.described import described
from elevon.report.figures import COLOURS, new_figure

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
    names = {"effects": effects, "methods": _METHODS, "equal_repeats": EQUAL_REPEATS,
             "pareto": pareto, "half_normal": half_normal}  # fmt: skip
    report = described(packaged_toml("elevon.analysis", "effects.toml"), names, date=date)
    report.provenance(
        {"Command": f"elevon campaign effects {folder} --response {effects.response}"}
    )
    return report


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
