"""What the page of `elevon reproduce cranfield` says and draws beside the rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.logs.formats.cranfield import DATA_DOI, PAPER_DOI
from elevon.report.figures import new_figure
from elevon.reproduce.cranfield.result import GROUPED, STRICT, CranfieldResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PROTOCOLS = (f"three classes: {STRICT}", f"four families: {GROUPED}", f"four families: {STRICT}",
          f"thirteen classes: {GROUPED}", f"thirteen classes: {STRICT}")  # fmt: skip


_HEADLINE = ("three_class_macro_f1_mean", "three_class_macro_f1_worst",
             "four_family_grouped_accuracy_worst", "thirteen_class_grouped_accuracy")  # fmt: skip


def page_values(result: CranfieldResult) -> dict[str, object]:
    """Return what the page says beside the rows: headline, confusions, what was left out."""
    return {
        "mean": result.headline.get("three_class_macro_f1_mean"),
        "worst": result.headline.get("three_class_macro_f1_worst"),
        "headline": {
            key: "not possible" if (score := result.headline.get(key)) is None else f"{score:.3f}"
            for key in _HEADLINE
        },
        "confusions": [(name, result.confusions[name]) for name in _PROTOCOLS
                       if name in result.confusions],
        "matrix": _matrix,
        "left_out": [*result.data.skipped,
                     *(f"{name}: not possible here" for name in result.missing)],
        "data_doi": DATA_DOI,
        "paper_doi": PAPER_DOI,
    }  # fmt: skip


def _matrix(classes: list[str], counts: list[list[int]]) -> Figure:
    table = np.array(counts, dtype=np.float64)
    share = table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)
    size = 2.2 + 0.42 * len(classes)
    with new_figure(width=size + 1.4, height=size) as (figure, axes):
        axes.grid(visible=False)
        axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.6)
        for (row, column), value in np.ndenumerate(table):
            if value:
                axes.text(column, row, f"{value:.0f}", ha="center", va="center", color="black")
        axes.set_xticks(range(len(classes)), classes, rotation=60, ha="right")
        axes.set_yticks(range(len(classes)), classes)
        axes.set_xlabel("answer")
    return figure
