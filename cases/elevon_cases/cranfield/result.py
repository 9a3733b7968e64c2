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
from elevon.report import Check, Report, all_passed
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
from elevon_cases.page import BLUE, Column, table_of, with_end

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


_HEADLINE = (
    ("Three classes", "three_class_macro_f1_mean", "mean macro-F1, load left out"),
    ("Worst load", "three_class_macro_f1_worst", "macro-F1 of the same"),
    ("Four families", "four_family_grouped_accuracy_worst", "worst load, runs left out"),
    ("Thirteen classes", "thirteen_class_grouped_accuracy", "mean of loads, runs left out"),
)


def cranfield_page(result: CranfieldResult, seed: int = 0, date: str | None = None) -> Report:
    """Return the report: scores, confusions, detection, sessions, what was there."""
    mean, worst = (result.headline.get(key) for _, key, _ in _HEADLINE[:2])
    lead = (
        "This folder does not hold what the comparison at a load left out needs."
        if mean is None or worst is None
        else "At a load that was never trained, healthy, backlash and lost lubrication are "
        f"distinguished with a macro-F1 of {mean:.3f} (worst load {worst:.3f}); which of it is the "
        "fault and which the session of its recording, these data cannot tell."
    )
    report = Report("Diagnosis of the Cranfield linear actuator", lead, date=date)
    for label, key, note in _HEADLINE:
        score = result.headline.get(key)
        report.fact(label, "not possible" if score is None else f"{score:.3f}", note)
    _add_scores(report, result)
    _add_detection(report, result)
    present: tuple[Column, ...] = (
        ("Condition", "condition"),
        ("Load [kgf]", "load_kgf"),
        ("Runs", lambda row: ", ".join(map(str, row["runs"]))),
    )
    section = report.section("What was there")
    section.table(table_of(result.data.present(), present, folded="Recordings used"))
    left_out = [
        *result.data.skipped,
        *(f"{name}: not possible here" for name in result.missing),
    ]
    if left_out:
        section.points(left_out)
    made = {"Data": f"doi {DATA_DOI}", "Paper": f"doi {PAPER_DOI}", "Seed": seed}
    return with_end(report, result.checks, f"cranfield --data FOLDER --seed {seed}", made)


def _interval(low: float, high: float) -> str:
    return f"{low:.3f} to {high:.3f}"


def _add_scores(report: Report, result: CranfieldResult) -> None:
    """Add every figure with its protocol, and who is taken for whom."""
    columns: tuple[Column, ...] = (
        ("Figure", "figure"),
        ("Protocol", "protocol"),
        ("Load [kgf]", "load"),
        ("Score", "value", ".3f"),
        ("95 % interval", lambda row: _interval(row.low, row.high)),
        ("Recordings", "recordings"),
    )
    caption = (
        "Macro-F1 where a load is left out, accuracy where runs are. Intervals of macro-F1 draw "
        "the tested recordings again (the classifiers stay; a load without an error has no width "
        "then); those of an accuracy are exact for recordings that are independent."
    )
    over_loads = [figure for figure in result.figures if figure.load in ("mean", "worst")]
    section = report.section("Scores").table(table_of(over_loads, columns, caption))
    section.table(table_of(result.figures, columns, caption, folded="Every load"))
    reliability: tuple[Column, ...] = (
        ("Answers", lambda item: item[0]),
        ("Mean probability given", lambda item: item[1][0], ".3f"),
        ("Share right", lambda item: item[1][1], ".3f"),
    )
    caption = "A calibrated classifier gives what it says the share with which it is right."
    section.table(table_of(result.reliability.items(), reliability, caption))
    section = report.section("Who is taken for whom")
    for name in _PROTOCOLS:
        if name in result.confusions:
            section.figure(_matrix(*result.confusions[name]), f"{name}; a row is what it was.")


def _add_detection(report: Report, result: CranfieldResult) -> None:
    """Add who is called faulty, and what the sessions of the recordings do to it."""
    columns: tuple[Column, ...] = (
        ("Condition", "condition"),
        ("Called faulty", "rate", ".3f"),
        ("95 % interval", lambda row: _interval(*row["interval"])),
        ("Recordings", "recordings"),
        ("Sessions allowed for", "rate_between_sessions", ".3f"),
    )
    report.section(
        "Healthy or not",
        "Each recording is held against the healthy ones at its load, itself left out, at a "
        "false-alarm rate of 5 %. The row 'normal' is the same figure healthy against healthy. All "
        "healthy recordings of a load come from one session; the last column allows for a "
        "difference between two sessions, as large as the scatter of spalling stages 1 to 5 "
        "(ASSUMED to differ by their session only; the published detection does not see them).",
    ).table(table_of((item.to_dict() for item in result.detections), columns))
    markers = result.markers()
    with new_figure(height=3.2) as (figure, axes):
        axes.bar(list(markers), list(markers.values()), color=BLUE)
        axes.set_ylabel("correlation at standstill")
        axes.tick_params(axis="x", rotation=60)
    report.section(
        "Drift and sessions",
        "Every condition was recorded in one go. Whatever drifted between two goes is therefore "
        "confounded with the condition, in every score above that has a condition in training and "
        "test. At standstill the current and the tracking error go together with one sign in some "
        "conditions and with the other in the rest. No fault of a screw at rest is known to us "
        "that would do this, so this number is used by no classifier; it is shown because it tells "
        "which conditions were recorded alike.",
    ).figure(figure, "Correlation of current and tracking error at standstill.")


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
