"""The figures of the Cranfield comparison, each with its protocol and its interval."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.diagnose.learning.fit import share_interval
from elevon.logs.formats.cranfield import DATA_DOI, PAPER_DOI
from elevon.progress import Progress
from elevon.report import Check, all_passed
from elevon.report.figures import new_figure
from elevon_cases.cranfield.data import (
    CONDITIONS,
    FAMILIES,
    FRICTION,
    FULL,
    MARKER,
    TRANSFER,
    CranfieldData,
    family,
    read_folder,
)
from elevon_cases.cranfield.judge import (
    Answers,
    Detection,
    chronological,
    detect,
    leave_load_out,
    leave_run_out,
    relative_to_healthy,
)

if TYPE_CHECKING:
    from matplotlib import figure as drawn


Words = npt.NDArray[np.str_]
Score = Callable[[npt.ArrayLike, npt.ArrayLike], float]
DRAWS = 400

THREE = ("normal", "backlash2", "lackLubrication2")
LIMITS = {
    "three_class_macro_f1_mean": ("mean macro-F1 of three classes at a load left out", 0.89),
    "three_class_macro_f1_worst": ("worst load's macro-F1 of three classes", 0.56),
    "four_family_grouped_accuracy_worst": ("worst load's accuracy of four families", 0.97),
}
"""Public figures of the first two: 0.885 and 0.556; of the third: 0.91 to 0.97."""
STRICT = "trained on the other loads; nothing of the tested load is used"
BASELINE = "as strict, plus healthy recordings of the tested load (other runs) as reference"
GROUPED = "within a load, each run left out in turn; whole recordings, never cycles"
LATER = "within a load, trained on the first half of the runs, tested on the later ones"


@dataclass(frozen=True, slots=True)
class Figure:
    """One score.

    Attributes
    ----------
    figure, protocol, load : str
        What it is; who was trained on what; the load in kgf, or ``mean`` or ``worst``.
    value, low, high : float
        The score and its 95 % interval.
    recordings : int
        Tested.
    """

    figure: str
    protocol: str
    load: str
    value: float
    low: float
    high: float
    recordings: int


@dataclass(slots=True)
class CranfieldResult:
    """All figures of one folder.

    Attributes
    ----------
    data : CranfieldData
        What was there.
    figures : list of Figure
        Scores with intervals.
    headline : dict
        The keys of the JSON; None where the folder does not hold what the figure needs.
    confusions : dict
        Of each figure: classes and counts.
    detections : list of Detection
        By condition.
    reliability : dict
        Of each figure: mean probability given to the answer, share of right answers.
    """

    data: CranfieldData
    figures: list[Figure] = field(default_factory=list)
    headline: dict[str, float | None] = field(default_factory=dict)
    confusions: dict[str, tuple[list[str], list[list[int]]]] = field(default_factory=dict)
    detections: list[Detection] = field(default_factory=list)
    reliability: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def missing(self) -> list[str]:
        """Figures with a limit that this folder does not allow."""
        return [name for name in LIMITS if self.headline.get(name) is None]

    @property
    def checks(self) -> list[Check]:
        """The figures with a limit, and the false alarms of healthy recordings."""
        checks = [
            Check(text, float(value), limit, "", at_least=True)
            for name, (text, limit) in LIMITS.items()
            if (value := self.headline.get(name)) is not None
        ]
        normal = next((d for d in self.detections if d.condition == "normal"), None)
        if normal is not None:
            low = share_interval(normal.hits, normal.count)[0]
            checks.append(Check("false-alarm rate, lower end of its interval", low, 0.05))
        return checks

    @property
    def status(self) -> str:
        """`pass` when every check was possible and passed."""
        return "pass" if all_passed(self.checks) and not self.missing else "fail"

    def markers(self) -> dict[str, float]:
        """Return each condition's correlation of current and tracking error at standstill."""
        values = self.data.table.select((MARKER,))[:, 0]
        return {
            name: float(values[self.data.condition == name].mean())
            for name in CONDITIONS
            if np.any(self.data.condition == name)
        }

    def to_dict(self) -> dict[str, object]:
        """Return what `--json` prints."""
        return {
            "status": self.status,
            "checks": [check.to_dict() for check in self.checks],
            **self.headline,
            "detection_rate": {d.condition: d.hits / d.count for d in self.detections},
            "detection": [d.to_dict() for d in self.detections],
            "rows": [
                {"figure": f.figure, "protocol": f.protocol, "load_kgf": f.load, "value": f.value,
                 "low": f.low, "high": f.high, "recordings": f.recordings}
                for f in self.figures
            ],
            "confusion": {
                name: {"classes": classes, "counts": counts}
                for name, (classes, counts) in self.confusions.items()
            },
            "reliability": {
                name: {"mean_probability": p, "share_right": right}
                for name, (p, right) in self.reliability.items()
            },
            "session_marker": self.markers(),
            "missing": self.missing,
            "present": self.data.present(),
            "skipped": self.data.skipped,
        }  # fmt: skip


def reproduce_cranfield(
    folder: Path, *, seed: int = 0, progress: Progress | None = None
) -> CranfieldResult:
    """Read a folder and compute every figure that it allows.

    Parameters
    ----------
    folder : path
        As `read_folder`.
    seed : int
        Of the intervals' draws; no classifier draws anything.
    progress : callable, optional
        As everywhere.

    Raises
    ------
    InputError, FormatError
        As `read_folder`.
    """
    return evaluate(read_folder(folder, progress=progress), seed=seed)


def evaluate(data: CranfieldData, *, seed: int = 0) -> CranfieldResult:
    """Compute every figure from features that are there already."""
    result = CranfieldResult(data)
    scorer = _Scorer(result, seed)
    present = [name for name in CONDITIONS if np.any(data.condition == name)]
    _load_out(scorer, data, present)
    grouped = leave_run_out(data, FULL)
    family_scores = scorer.add("four families", GROUPED, grouped, accuracy, families=True)
    thirteen = scorer.add("thirteen classes", GROUPED, grouped, accuracy)
    later = chronological(data, FULL)
    scorer.add("four families, later runs", LATER, later, accuracy, families=True)
    result.headline["four_family_grouped_accuracy_worst"] = family_scores[1]
    result.headline["thirteen_class_grouped_accuracy"] = thirteen[0]
    result.detections = detect(data)
    return result


def _load_out(scorer: _Scorer, data: CranfieldData, present: list[str]) -> None:
    headline = scorer.result.headline
    three = scorer.add("three classes", STRICT, leave_load_out(data, THREE, TRANSFER), macro_f1)
    headline["three_class_macro_f1_mean"], headline["three_class_macro_f1_worst"] = three
    every = leave_load_out(data, present, TRANSFER)
    four = scorer.add("four families", STRICT, every, macro_f1, families=True)
    headline["four_family_load_out_macro_f1"] = four[0]
    thirteen = scorer.add("thirteen classes", STRICT, every, macro_f1)
    headline["thirteen_class_load_out_macro_f1"] = thirteen[0]
    relative = relative_to_healthy(data, TRANSFER)
    if relative is not None:
        answers = leave_load_out(data, THREE, TRANSFER, values=relative)
        scorer.add("three classes", BASELINE, answers, macro_f1)
        answers = leave_load_out(data, present, TRANSFER, values=relative)
        scorer.add("four families", BASELINE, answers, macro_f1, families=True)
    for text, names in (
        ("three classes, start currents only", FRICTION),
        ("three classes, without start currents", TRANSFER[len(FRICTION) :]),
        ("three classes, session marker only", (MARKER,)),
    ):
        scorer.add(text, STRICT, leave_load_out(data, THREE, names), macro_f1)


@dataclass(slots=True)
class _Scorer:
    """Turns answers into figures with intervals."""

    result: CranfieldResult
    seed: int

    def add(
        self, name: str, protocol: str, answers: Answers | None, score: Score, *,
        families: bool = False,
    ) -> tuple[float | None, float | None]:  # fmt: skip
        """Add a row for each load, their mean and the worst; return mean and worst."""
        if answers is None:
            return None, None
        truth, named = answers.truth, answers.named
        if families:
            truth, named = _families(truth), _families(named)
        codes = np.unique(np.concatenate([truth, named]), return_inverse=True)[1]
        right, answer = codes[: len(truth)], codes[len(truth) :]
        loads = np.unique(answers.load)
        strata = np.unique(
            [f"{c} {x:g}" for c, x in zip(answers.truth, answers.load, strict=True)],
            return_inverse=True,
        )[1]

        def by_load(index: npt.NDArray[np.int64]) -> list[float]:
            at = answers.load[index]
            return [score(right[index[at == x]], answer[index[at == x]]) for x in loads]

        values = np.array(by_load(np.arange(len(right))))
        drawn = np.array([by_load(i) for i in resamples(strata, draws=DRAWS, seed=self.seed)])
        counts = [int((answers.load == x).sum()) for x in loads]
        total, lowest = sum(counts), int(values.argmin())
        spans = [_quantiles(column) for column in drawn.T]
        over = [_quantiles(drawn.mean(axis=1)), _quantiles(drawn.min(axis=1))]
        if score is accuracy:
            hits = [round(v * n) for v, n in zip(values, counts, strict=True)]
            spans = [share_interval(h, n) for h, n in zip(hits, counts, strict=True)]
            over = [share_interval(sum(hits), total), spans[lowest]]
        for load, value, span, count in zip(loads, values, spans, counts, strict=True):
            self._row(Figure(name, protocol, f"{load:g}", float(value), *span, count))
        mean, worst = float(values.mean()), float(values[lowest])
        self._row(Figure(name, protocol, "mean", mean, *over[0], total))
        self._row(Figure(name, protocol, "worst", worst, *over[1], total))
        self._keep(f"{name}: {protocol}", truth, named, None if families else answers.probability)
        return mean, worst

    def _row(self, figure: Figure) -> None:
        self.result.figures.append(figure)

    def _keep(
        self, key: str, truth: Words, named: Words, probability: npt.NDArray[np.float64] | None
    ) -> None:
        order = (*CONDITIONS, *FAMILIES)
        classes = sorted(set(truth.tolist()) | set(named.tolist()), key=order.index)
        self.result.confusions[key] = (classes, confusion(truth, named, classes))
        if probability is not None:
            self.result.reliability[key] = (float(probability.mean()), accuracy(truth, named))


def _quantiles(values: npt.NDArray[np.float64]) -> tuple[float, float]:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)


def _families(words: Words) -> Words:
    return np.array([family(str(word)) for word in words])


def macro_f1(truth: npt.ArrayLike, predicted: npt.ArrayLike) -> float:
    """Return the mean of F1 = 2 TP / (2 TP + FP + FN) over the classes that `truth` holds.

    Parameters
    ----------
    truth, predicted : array of int or str
        Of each recording.
    """
    right, answer = np.asarray(truth), np.asarray(predicted)
    scores = []
    for name in np.unique(right):
        of, called = right == name, answer == name
        scores.append(2.0 * np.count_nonzero(of & called) / (of.sum() + called.sum()))
    return float(np.mean(scores))


def accuracy(truth: npt.ArrayLike, predicted: npt.ArrayLike) -> float:
    """Return the share of recordings that are right."""
    return float(np.mean(np.asarray(truth) == np.asarray(predicted)))


def confusion(
    truth: npt.ArrayLike, predicted: npt.ArrayLike, classes: Sequence[str]
) -> list[list[int]]:
    """Count recordings: a row for each true class, a column for each answer."""
    right, answer = np.asarray(truth), np.asarray(predicted)
    return [[int(((right == a) & (answer == b)).sum()) for b in classes] for a in classes]


def resamples(
    strata: npt.ArrayLike, *, draws: int = 1000, seed: int = 0
) -> Iterator[npt.NDArray[np.int64]]:
    """Draw recordings again with replacement, within each stratum (Efron's bootstrap).

    Parameters
    ----------
    strata : array
        Such as the number of each condition and load; how many they have stays as it is.
    draws : int
        How often.
    seed : int
        Of the draws.

    Yields
    ------
    array of int
        Indices of the recordings of one draw.
    """
    keys = np.unique(np.asarray(strata), return_inverse=True)[1]
    order = np.argsort(keys, kind="stable")
    counts = np.bincount(keys)
    first = np.repeat(np.concatenate(([0], np.cumsum(counts)[:-1])), counts)
    size = np.repeat(counts, counts)
    random = np.random.default_rng(seed)
    for _ in range(draws):
        yield order[first + (random.random(len(order)) * size).astype(np.int64)]


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


def _matrix(classes: list[str], counts: list[list[int]]) -> drawn.Figure:
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
