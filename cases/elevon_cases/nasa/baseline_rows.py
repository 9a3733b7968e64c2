"""What `nasa-baseline` reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.progress import Progress
from elevon.report import Report
from elevon.report.checks import Check, verdict
from elevon.report.figures import new_figure
from elevon.units import to_si
from elevon_cases.nasa.profiles import LoadKind, MotionProfile, profile_scenario
from elevon_cases.page import BLUE, GREEN, GREY, ORANGE, RED, VIOLET, Column, table_of, with_end

if TYPE_CHECKING:
    from matplotlib.figure import Figure


DRIFT = 4.0
"""The laboratory warms by so much during a block [K] (ASSUMED): random order keeps it out of the
effects."""
MEASURES = {
    "rms_current_a": ("RMS current", "A", 3),
    "peak_current_a": ("Peak current", "A", 2),
    "tracking_rms_mm": ("Tracking RMS", "mm", 4),
    "tracking_max_mm": ("Tracking max", "mm", 3),
    "winding_rise_k": ("Winding rise in 30 s", "K", 3),
    "at_limit": ("Time at a limit", "1", 4),
}
"""What every run gives: title, unit, decimals."""


@dataclass(frozen=True, slots=True)
class BaselineRow:
    """One cell of the matrix over its replicates; statistics after the first 2 s.

    Attributes
    ----------
    profile, load : MotionProfile and float
        N, positive compressive.
    status, reason : str
        ``ok``, ``limited`` (requests more than there is, and runs), ``refused``, or how a run
        ended; and why.
    runs : tuple of tuple of float
        `MEASURES` of each replicate.
    """

    profile: MotionProfile
    load: float
    status: str
    reason: str = ""
    runs: tuple[tuple[float, ...], ...] = ()

    @property
    def direction(self) -> str:
        """Which way the load pushes."""
        if self.load == 0.0:
            return "none"
        return "compressive" if self.load > 0.0 else "tensile"

    def mean(self, name: str) -> float:
        """Return the mean of one of `MEASURES` over the replicates, NaN without any."""
        column = list(MEASURES).index(name)
        return float(np.mean([run[column] for run in self.runs])) if self.runs else float("nan")

    def scatter(self, name: str) -> float:
        """Return the standard deviation over the replicates, NaN with fewer than two."""
        column = list(MEASURES).index(name)
        values = [run[column] for run in self.runs]
        return float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")

    def to_dict(self) -> dict[str, object]:
        """Return one row of the command's JSON object, in the units of the columns."""
        numbers = {name: _rounded(self.mean(name), MEASURES[name][2]) for name in MEASURES}
        return {
            "profile": self.profile.name,
            "amplitude_mm": 1e3 * self.profile.amplitude,
            "rate_mm_s": 1e3 * self.profile.rate,
            "load_n": abs(self.load),
            "direction": self.direction,
            **numbers,
            "rms_current_scatter_a": _rounded(self.scatter("rms_current_a"), 4),
            "replicates": len(self.runs),
            "status": self.status,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class BaselineResult:
    """Everything `elevon reproduce nasa-baseline` reports.

    Attributes
    ----------
    rows : list of BaselineRow
        One a cell of the matrix.
    effects : dict
        Of each response, the effects of the factors and of their pairs.
    sheet : list of dict
        The runs in the order in which they were done: block, order, air temperature, cell.
    histories : list of HistoryFigure
        Figures 5, 6 and 7 of the paper.
    corners : list of dict
        Sharp against rounded corners.
    """

    rows: list[BaselineRow]
    checks: list[Check]
    load_kind: LoadKind
    seed: int
    replicates: int
    effects: dict[str, list[FactorEffect]] = field(default_factory=dict)
    sheet: list[dict[str, Any]] = field(default_factory=list)
    histories: list[HistoryFigure] = field(default_factory=list)
    corners: list[dict[str, Any]] = field(default_factory=list)
    meta: dict[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command."""
        effects = [
            {"response": name, "unit": MEASURES[name][1], "term": e.term, "effect": e.effect,
             "interval": [e.low, e.high], "p": e.p}
            for name, fitted in self.effects.items()
            for e in fitted
        ]  # fmt: skip
        return {
            **verdict(self.checks),
            "load_kind": self.load_kind,
            "rows": [row.to_dict() for row in self.rows],
            "effects": effects,
            "corners": self.corners,
            "runs": self.sheet,
            "seed": self.seed,
            "replicates": self.replicates,
            **self.meta,
        }


def _rounded(value: float, digits: int) -> float | None:
    """A number at the resolution of its column; None where there is none."""
    return None if np.isnan(value) else round(value, digits) + 0.0


def baseline_page(result: BaselineResult, date: str | None = None) -> Report:
    """Return the report: effects, current over load, histories, corners, every cell."""
    report = Report(
        "Nominal runs of the ballscrew actuator",
        "Every profile at both amplitudes and both rates under every load, "
        f"{result.replicates} times: each time another reassembly, in an order of its own, while "
        f"the laboratory warms by {DRIFT:g} K. Statistics after the first 2 s; tracking is command "
        "less position on the load's side of the joint.",
        date=date,
    )
    states = [row.status for row in result.rows]
    report.fact("Cells", str(len(states)), f"load: {result.load_kind}")
    runs = sum(len(row.runs) for row in result.rows)
    report.fact("Runs", str(runs), "replicates in blocks")
    limited, refused = (str(states.count(name)) for name in ("limited", "refused"))
    report.fact("Limited", limited, "ask for more than there is, and run")
    report.fact("Refused", refused, "ramps that cannot be followed")
    if result.effects:
        _add_effects(report, result.effects)
    report.section("Current against load").figure(
        _currents_figure(result.rows), "RMS phase current at 50 mm and 6 cm/s, each run."
    )
    if result.histories:
        section = report.section(
            "Time histories",
            "Figures 5, 6 and 7 of the paper as the model gives them. Their curves are drawn, not "
            "printed, so nothing is held against them.",
        )
        for item in result.histories:
            section.figure(_history_figure(item), f"Figure {item.figure}: {item.title}.")
    if result.corners:
        report.section(
            "Corners",
            "The paper draws sharp corners, which ask for infinite acceleration: the current limit "
            "of 20 A is then every peak. With the corners rounded the peak is that of the motion.",
        ).table(table_of(result.corners, _CORNERS, "Acceleration 0: sharp, as drawn."))
    caption = "Means over the replicates and the scatter between reassemblies."
    cells = table_of((row.to_dict() for row in result.rows), _CELLS, caption)
    report.section("All cells").table(cells)
    command = (
        f"nasa-baseline --load-kind {result.load_kind} --replicates {result.replicates} "
        f"--seed {result.seed}"
    )
    made = {"Parameter hash": result.meta["parameter_hash"], "Seed": result.seed,
            "Core": result.meta["version"]}  # fmt: skip
    return with_end(report, result.checks, command, made)


_CORNERS = (
    ("Profile", "profile"),
    ("Load [N]", "load_n", ".0f"),
    ("Acceleration [m/s2]", "acceleration_m_s2", ".1f"),
    ("Peak current [A]", "peak_current_a", ".2f"),
    ("RMS current [A]", "rms_current_a", ".3f"),
    ("Tracking max [mm]", "tracking_max_mm", ".3f"),
)
_CELLS = (
    ("Profile", "profile"),
    ("Amplitude [mm]", "amplitude_mm", ".0f"),
    ("Rate [mm/s]", "rate_mm_s", ".0f"),
    ("Load [N]", "load_n", ".0f"),
    ("Direction", "direction"),
    ("RMS current [A]", "rms_current_a", ".3f"),
    ("Peak current [A]", "peak_current_a", ".2f"),
    ("Tracking RMS [mm]", "tracking_rms_mm", ".4f"),
    ("Winding rise in 30 s [K]", "winding_rise_k", ".3f"),
    ("Scatter of the RMS [A]", "rms_current_scatter_a", ".4f"),
    ("Status", "status"),
)
_COLOURS = (GREY, BLUE, ORANGE, GREEN, RED)


def _add_effects(report: Report, effects: Mapping[str, Sequence[FactorEffect]]) -> None:
    section = report.section(
        "Effects",
        "Change from the low to the high level in the two-level part of the matrix (sinusoidal "
        "against triangular, 50 against 100 mm, 6 against 12 cm/s, 500 against 8500 N, tensile "
        "against compressive): least squares with one offset a block and all pairs of factors, "
        "95 % intervals, probabilities corrected over the terms (Holm).",
    )
    for name, rows in effects.items():
        title, unit, decimals = MEASURES[name]
        digits = f"+.{decimals}f"
        columns: tuple[Column, ...] = (
            ("Factor or pair", "term"),
            (f"Effect [{unit}]", "effect", digits),
            ("from", "low", digits),
            ("to", "high", digits),
            ("p", lambda row: "< 1e-4" if row.p < 1e-4 else f"{row.p:.2g}"),
        )
        section.table(table_of(rows, columns, title))


def _currents_figure(rows: Sequence[BaselineRow]) -> Figure:
    """Draw the current of each run at 50 mm and 6 cm/s over its load, by profile."""
    names = dict.fromkeys(row.profile.name for row in rows)
    with new_figure() as (figure, axes):
        for place, (name, colour) in enumerate(zip(names, _COLOURS, strict=False)):
            runs = [
                (row.load, run[0])
                for row in rows
                if row.profile.name == name
                and abs(row.profile.amplitude - 0.05) < 1e-9
                and abs(row.profile.rate - 0.06) < 1e-9
                for run in row.runs
            ]
            if runs:
                load, current = np.array(runs).T
                load = load / 1e3 + 0.06 * (place - 2)
                axes.plot(load, current, "o", ms=3, color=colour, label=name)
        axes.set(xlabel="Load, compressive positive [kN]", ylabel="RMS phase current [A]")
        axes.legend()
    return figure


def _history_figure(item: HistoryFigure) -> Figure:
    time, curves = item.time, item.curves
    above = {"fontsize": 8, "loc": "lower left", "bbox_to_anchor": [0.0, 1.0], "ncols": 2,
             "borderpad": 0.2}  # fmt: skip
    with new_figure(2, 2, height=4.4, sharex=True) as (figure, axes):
        (position, load), (current, warmth) = axes
        position.plot(time, 1e3 * curves["command"], color=GREY, label="command")
        reached = 1e3 * curves["output_position"]
        position.plot(time, reached, color=BLUE, label="position", lw=1)
        position.set(ylabel="Position [mm]")
        load.plot(time, 1e-3 * curves["joint_force"], color=VIOLET, lw=1)
        load.set(ylabel="Load cell [kN]")
        current.plot(time, curves["current_ref"], color=ORANGE, lw=1)
        current.set(ylabel="Current reference [A]", xlabel="Time [s]")
        for place, colour in (("winding", ORANGE), ("surface", BLUE)):
            warm = curves[f"{place}_temperature"] - 273.15
            warmth.plot(time, warm, color=colour, label=place)
        warmth.set(ylabel="Temperature [degC]", xlabel="Time [s]")
        for panel in (position, warmth):
            panel.legend(**above)
    return figure


RECORD = (
    "command,output_position,joint_force,current_ref,winding_temperature,surface_temperature@200 Hz"
)
POUND_FORCE = float(to_si(1.0, "lbf"))


@dataclass(frozen=True, slots=True)
class HistoryFigure:
    """One figure: time [s] and its curves by signal, SI.

    Attributes
    ----------
    figure : int
        Its number in the paper.
    title : str
        Its condition.
    """

    figure: int
    title: str
    time: Floats
    curves: dict[str, Floats]


def _conditions() -> list[tuple[int, str, dict[str, Any]]]:
    sine = MotionProfile("sinusoidal", 0.05, 0.06, 40.0)
    stepped = profile_scenario(sine)
    step = {"kind": "step", "initial": 500.0, "final": 4500.0, "time": 20.0}
    stepped["load"] = {"output": {"terms": [step]}}
    short = MotionProfile("sinusoidal", 0.05, 0.06, 20.0)
    opposed = profile_scenario(short, opposing=900.0 * POUND_FORCE)
    triangle = MotionProfile("triangular", 0.05, 0.06, 20.0)
    sprung = profile_scenario(triangle, 1725.0 * POUND_FORCE, "spring")
    return [
        (5, "sine, load stepping from 500 to 4500 N at 20 s", stepped),
        (6, "sine, opposing force of 900 lbf (4003 N)", opposed),
        (7, "triangle, spring of 1725 lbf (7673 N) at 50 mm", sprung),
    ]


def time_histories(actuator: Actuator, progress: Progress | None = None) -> list[HistoryFigure]:
    """Return the three figures, simulated at high fidelity.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    wanted = _conditions()
    runs = [
        Run(actuator, Scenario.from_dict(data), label=f"figure {number}")
        for number, _, data in wanted
    ]
    recordings = simulate_batch(runs, fidelity="high", record=RECORD, progress=progress)
    return [
        HistoryFigure(number, title, recording["command"].time,
                {name: recording[name].values for name in recording.names})
        for (number, title, _), recording in zip(wanted, completed(recordings), strict=True)
    ]  # fmt: skip


LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class TwoLevelFactor:
    """A factor and its two levels, as shown."""

    name: str
    low: str
    high: str


@dataclass(frozen=True, slots=True)
class FactorEffect:
    """Change of a response from a factor's low to its high level (of a pair: their interaction).

    Attributes
    ----------
    term : str
        Factor, or two of them joined by " x ".
    effect, low, high : float
        In the response's unit, with the interval.
    p : float
        Probability of so large an effect without any, corrected over the response's terms (Holm).
    """

    term: str
    effect: float
    low: float
    high: float
    p: float


def shuffled_blocks(runs: int, blocks: int, seed: int) -> npt.NDArray[np.int64]:
    """Return the order of the runs of each block, shape (blocks, runs); every block has its own."""
    return np.array([np.random.default_rng([seed, b]).permutation(runs) for b in range(blocks)])


def terms(factors: Sequence[TwoLevelFactor]) -> list[tuple[int, ...]]:
    """Return the factors' indices of every term: one, then two at a time."""
    places = range(len(factors))
    return [*((i,) for i in places), *combinations(places, 2)]


def model_matrix(
    factors: Sequence[TwoLevelFactor], levels: Floats, block: npt.NDArray[np.int64]
) -> Floats:
    """Return the columns of the model: blocks, then the terms.

    Parameters
    ----------
    factors : sequence of TwoLevelFactor
        In the order of the levels.
    levels : ndarray, shape (runs, factors)
        -1 or +1.
    block : ndarray of int, shape (runs,)
        Block of each run, from 0.
    """
    offsets = np.eye(int(block.max()) + 1)[block]
    columns = [np.prod(levels[:, list(term)], axis=1) for term in terms(factors)]
    return np.column_stack([offsets, *columns])


def fit_effects(
    factors: Sequence[TwoLevelFactor],
    levels: Floats,
    block: npt.NDArray[np.int64],
    response: Floats,
) -> list[FactorEffect]:
    """Return the effect of every term with its interval.

    Parameters
    ----------
    factors, levels, block
        As for `model_matrix`.
    response : ndarray, shape (runs,)
        Any unit.
    """
    from scipy.stats import t as student

    matrix = model_matrix(factors, levels, block)
    names = [" x ".join(factors[i].name for i in term) for term in terms(factors)]
    first = matrix.shape[1] - len(names)
    weights, *_ = np.linalg.lstsq(matrix, response, rcond=None)
    free = response.size - matrix.shape[1]
    variance = float(np.sum((response - matrix @ weights) ** 2)) / free
    spread = np.sqrt(variance * np.diag(np.linalg.inv(matrix.T @ matrix)))[first:]
    # From -1 to +1 is twice the slope.
    effect, spread = 2.0 * weights[first:], 2.0 * spread
    half = float(student.ppf(0.5 + 0.5 * LEVEL, free)) * spread
    p = _holm(2.0 * student.sf(np.abs(effect) / np.maximum(spread, np.finfo(float).tiny), free))
    return [
        FactorEffect(name, float(e), float(e - h), float(e + h), float(q))
        for name, e, h, q in zip(names, effect, half, p, strict=True)
    ]


def _holm(p: Floats) -> Floats:
    """Holm's correction of several probabilities."""
    order = np.argsort(p)
    scaled = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(scaled, 1.0)
    return corrected


def coverage(
    factors: Sequence[TwoLevelFactor],
    levels: Floats,
    block: npt.NDArray[np.int64],
    truth: Mapping[str, Any],
    *,
    campaigns: int = 400,
    seed: int = 0,
) -> tuple[float, float]:
    """Fit campaigns whose effects are known and count the intervals that hold them.

    Parameters
    ----------
    factors, levels, block
        The design, as for `model_matrix`.
    truth : mapping
        ``effects`` (one a term), ``block`` and ``scatter`` (standard deviations).
    campaigns, seed
        How many, and of the random numbers.

    Returns
    -------
    tuple of float
        Share of the intervals that hold their effect, and the mean error of the effects over
        their standard deviation.
    """
    rng = np.random.default_rng(seed)
    matrix = model_matrix(factors, levels, block)
    effects = np.asarray(truth["effects"], dtype=float)
    first = matrix.shape[1] - effects.size
    within, errors = [], []
    for _ in range(campaigns):
        offsets = truth["block"] * rng.standard_normal(first)
        scatter = truth["scatter"] * rng.standard_normal(block.size)
        response = matrix @ np.concatenate([offsets, 0.5 * effects]) + scatter
        fitted = fit_effects(factors, levels, block, response)
        within.append([f.low <= e <= f.high for f, e in zip(fitted, effects, strict=True)])
        errors.append([f.effect - e for f, e in zip(fitted, effects, strict=True)])
    error = np.array(errors)
    return float(np.mean(within)), float(np.abs(error.mean(axis=0) / error.std(axis=0)).max())
