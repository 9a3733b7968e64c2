"""Main effects and two-factor interactions of a response, with intervals."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt

from elevon.analysis.response import CampaignResponse
from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.plain import STORED, Plain
from elevon.report import Report, ReportTable, Section
from elevon.report.figures import COLOURS, new_figure
from elevon.results import Result
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Columns whose correlation differs from 0 or 1 by less than this are not, or wholly, aliased.
_EQUAL = 1e-9


@dataclass
class TermColumn:
    """One term of the model.

    Attributes
    ----------
    factors : tuple of int
        One, or two of an interaction.
    values : ndarray, shape (runs,)
        Coded -1 to +1.
    aliases : list
        Terms that have the same column, each with its sign.
    """

    factors: tuple[int, ...]
    values: Floats
    aliases: list[tuple[tuple[int, ...], float]] = field(default_factory=list)


def blocks_matrix(block: npt.NDArray[np.int64]) -> Floats:
    """Return the mean and the blocks as orthonormal columns."""
    indicators = (block[:, None] == np.unique(block)[None, :]).astype(np.float64)
    matrix: Floats = indicators / np.sqrt(indicators.sum(axis=0))
    return matrix


def separate(
    coded: Sequence[Floats], head: Floats
) -> tuple[list[TermColumn], list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Return the terms that can be estimated together.

    Parameters
    ----------
    coded : sequence of ndarray, shape (runs,)
        The factors.
    head : ndarray, shape (runs, blocks)
        Orthonormal: the mean and the blocks.

    Returns
    -------
    terms : list of Column
        Each with the terms it is aliased with.
    blocked : list of tuple
        Terms that are confounded with the blocks.
    partial : list of tuple
        Interactions that are left out: partly aliased with terms, too many to estimate together.
    """
    names = [(k,) for k in range(len(coded))]
    pairs = list(itertools.combinations(range(len(coded)), 2))
    terms: list[TermColumn] = []
    blocked: list[tuple[int, ...]] = []
    partial: list[tuple[int, ...]] = []
    for name in [*names, *pairs]:
        values = np.prod([coded[k] for k in name], axis=0)
        residual = values - head @ (head.T @ values)
        if np.linalg.norm(residual) < 1e-6 * np.linalg.norm(values):
            blocked.append(name)
        elif (same := _equal_columns(residual, terms, head)) is not None:
            same[0].aliases.append((name, same[1]))
        else:
            terms.append(TermColumn(name, values))
    whole = np.column_stack([head, *(term.values for term in terms)])
    if np.linalg.matrix_rank(whole) < whole.shape[1]:
        partial = [term.factors for term in terms if len(term.factors) > 1]
        terms = [term for term in terms if len(term.factors) == 1]
    return terms, blocked, partial


def _equal_columns(
    residual: Floats, terms: Sequence[TermColumn], head: Floats
) -> tuple[TermColumn, float] | None:
    for term in terms:
        other = term.values - head @ (head.T @ term.values)
        cosine = float(residual @ other / (np.linalg.norm(residual) * np.linalg.norm(other)))
        if abs(abs(cosine) - 1.0) < _EQUAL:
            return term, float(np.sign(cosine))
    return None


def further_contrasts(fitted: Floats, coded: Sequence[Floats]) -> list[Floats]:
    """Return contrasts that the model leaves: interactions of more factors, then any others.

    Parameters
    ----------
    fitted : ndarray, shape (runs, p)
        The model: mean, blocks, terms.
    coded : sequence of ndarray, shape (runs,)
        The factors.

    Returns
    -------
    list of ndarray, shape (runs,)
        Orthogonal to the model and to each other, of length sqrt(runs).
    """
    basis, _ = np.linalg.qr(fitted)
    further: list[Floats] = []
    orders = range(3, len(coded) + 1)
    words = itertools.chain.from_iterable(
        itertools.combinations(range(len(coded)), order) for order in orders
    )
    columns = (np.prod([coded[k] for k in word], axis=0) for word in words)
    unit = iter(np.eye(len(fitted)))
    for values in itertools.chain(columns, unit):
        if basis.shape[1] == len(fitted):
            break
        residual = values - basis @ (basis.T @ values)
        residual -= basis @ (basis.T @ residual)
        if (length := np.linalg.norm(residual)) > 1e-6 * np.linalg.norm(values):
            basis = np.column_stack([basis, residual / length])
            further.append(residual / length * np.sqrt(len(fitted)))
    return further


@dataclass(frozen=True)
class EffectEstimate(Plain):
    """One effect: the response's change from the lowest to the highest level.

    Attributes
    ----------
    term, name : str
        Letters, and the factors in full.
    effect, low, high : float
        Estimate and interval, in the response's unit; the interval is None where the design leaves
        nothing to judge it by.
    significant : bool or None
        Whether the interval leaves out zero.
    aliases : list of str
        Terms whose effects are in this number too, with their signs.
    """

    term: str
    name: str
    effect: float
    low: float | None
    high: float | None
    significant: bool | None
    aliases: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Effects(Result):
    """Effects of a campaign's factors on a response.

    Attributes
    ----------
    method : str
        ``replicates`` (t, pure error), ``lenth`` (unreplicated two-level design), ``residual`` (t,
        residual of the model) or ``none`` (nothing left to judge by).
    error, margin : float or None
        Standard error of an effect (of the first, where they differ) and half its interval.
    df : float or None
        Degrees of freedom of t; of Lenth's method a third of the contrasts.
    terms : list of Term
        Largest first.
    blocked, partial : list of str
        Terms confounded with the blocks; interactions partly aliased and left out.
    equal_repeats : bool
        The repeats of every point are equal: nothing random was simulated, they count as one run.
    folder : str
        The campaign's.
    """

    response: str
    unit: str
    runs: int
    left_out: list[int]
    level: float
    method: str
    error: float | None
    margin: float | None
    df: float | None
    mean: float
    factors: list[dict[str, Any]]
    terms: list[EffectEstimate]
    blocks: int
    with_blocks: list[str]
    blocked: list[str]
    partial: list[str]
    equal_repeats: bool
    folder: Annotated[str, STORED] = ""

    KIND: ClassVar = "effects"
    COMPUTED: ClassVar = ("status",)
    TABLE: ClassVar = "terms"
    BARS: ClassVar = ("name", "effect")
    status: ClassVar = "ok"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        moved = [term.name for term in self.terms if term.significant]
        what = f"{', '.join(moved)} move it" if moved else "no factor is seen to move it"
        return f"{self.response} [{self.unit}] in {self.runs} runs: {what}."

    def text_tables(self) -> list[ReportTable]:
        """Return the effects with their intervals, the largest first."""
        rows = [
            [t.term, t.name, f"{t.effect:.4g}", _interval_text(t), ", ".join(t.aliases)]
            for t in self.terms
        ]
        columns = ("term", "factors", "effect", "interval", "aliased with")
        return [ReportTable(columns, rows, f"by {self.method}")]

    @property
    def remarks(self) -> list[str]:
        """What the design could not tell apart."""
        texts = [
            f"{text}: {', '.join(names)}"
            for text, names in (
                ("confounded with the blocks", self.blocked),
                ("left out, partly aliased", self.partial),
            )
            if names
        ]
        return [*texts, EQUAL_REPEATS] if self.equal_repeats else texts

    def report(self, *, date: str | None = None) -> Report:
        """Return its page."""
        return effects_report(self, self.folder, date=date)


def _interval_text(term: EffectEstimate) -> str:
    if term.low is None:
        return "not known"
    return f"{term.low:.4g} to {term.high:.4g}{' *' if term.significant else ''}"


def effects_of(response: CampaignResponse, *, level: float = 0.95) -> Effects:
    """Estimate main effects and two-factor interactions by least squares.

    The model has the mean, the blocks and every term that can be separated; an effect is twice its
    coefficient with factors coded -1 to +1. Intervals: of a design with repeated points Student's t
    with the pure error of the repeats, unless these are equal (a simulation without noise); of an
    unreplicated orthogonal two-level design Lenth's pseudo standard error (R. V. Lenth,
    Technometrics 31(4), 1989); of others t with the model's residual, which then holds what the
    model lacks.

    Parameters
    ----------
    response : Response
        From `read_response`.
    level : float
        Of confidence, two-sided, each term by itself.

    Raises
    ------
    InputError
        Too few runs for the main effects.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"level = {level} must lie between 0 and 1")
    coded = [factor.coded for factor in response.factors]
    head = blocks_matrix(response.block)
    terms, blocked, partial = separate(coded, head)
    letters = [factor.letter for factor in response.factors]
    matrix = np.column_stack([head, *(term.values for term in terms)])
    if np.linalg.matrix_rank(matrix) < matrix.shape[1]:
        raise InputError(
            f"{response.name}: {len(response.values)} runs do not separate {len(letters)} factors "
            f"and {head.shape[1]} block(s) apart"
        )
    fit = _fit(matrix, head.shape[1], response)
    judged = _with_intervals(fit, response, coded, level)
    rows = [
        _effect_row(term, effect, margin, letters, response)
        for term, effect, margin in zip(terms, fit.effects, judged.margins, strict=True)
    ]
    return Effects(
        response=response.name,
        unit=response.unit,
        runs=len(response.values),
        left_out=response.left_out,
        level=level,
        method=judged.method,
        error=judged.error,
        margin=judged.margins[0] if rows else None,
        df=judged.df,
        mean=float(response.values.mean()),
        factors=[_describe_effects(factor) for factor in response.factors],
        terms=sorted(rows, key=lambda row: -abs(row.effect)),
        blocks=head.shape[1],
        with_blocks=response.with_blocks,
        blocked=[_term_text(name, letters) for name in blocked],
        partial=[_term_text(name, letters) for name in partial],
        equal_repeats=_equal_repeats(*_pure_error(response, coded), response),
    )


@dataclass(frozen=True)
class _Fit:
    matrix: Floats
    head: int
    effects: Floats
    #: Standard error of each effect over the standard deviation of a run.
    scale: Floats
    residual: Floats


@dataclass(frozen=True)
class _Judged:
    method: str
    error: float | None
    df: float | None
    margins: list[float | None]


def _fit(matrix: Floats, head: int, response: CampaignResponse) -> _Fit:
    solution, *_ = np.linalg.lstsq(matrix, response.values)
    inverse = np.linalg.pinv(matrix.T @ matrix)
    scale: Floats = np.asarray(2.0 * np.sqrt(np.diag(inverse)[head:]), dtype=np.float64)
    effects: Floats = np.asarray(2.0 * solution[head:], dtype=np.float64)
    return _Fit(matrix, head, effects, scale, response.values - matrix @ solution)


def _with_intervals(
    fit: _Fit, response: CampaignResponse, coded: list[Floats], level: float
) -> _Judged:
    """Judge the effects by repeats, by Lenth's method or by the residual."""
    spread, df = _pure_error(response, coded)
    if df >= 1 and not _equal_repeats(spread, df, response):
        return _student_intervals("replicates", spread, df, fit, level)
    if _orthogonal(fit, coded):
        return _lenth_intervals(fit, response, coded, level)
    df = len(_distinct_points(coded)[0]) - fit.matrix.shape[1]
    if df >= 1:
        return _student_intervals(
            "residual", float(np.sqrt(fit.residual @ fit.residual / df)), df, fit, level
        )
    return _Judged("none", None, None, [None] * len(fit.effects))


def _distinct_points(coded: list[Floats]) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return the different points, and which of them each run has."""
    points, number = np.unique(np.column_stack(coded).round(12), axis=0, return_inverse=True)
    return points, number.reshape(-1)


def _equal_repeats(spread: float, df: int, response: CampaignResponse) -> bool:
    """Return whether the runs of a point are equal to rounding: nothing random was simulated.

    Such repeats say nothing of how far an effect can be trusted; they count as one run.
    """
    return df >= 1 and spread <= 1e-9 * float(np.abs(response.values).max())


def _pure_error(response: CampaignResponse, coded: list[Floats]) -> tuple[float, int]:
    """Return the deviation of runs of one point, less the blocks, and its degrees of freedom."""
    points = _distinct_points(coded)[1]
    indicators = (points[:, None] == np.arange(points.max() + 1)).astype(np.float64)
    matrix = np.column_stack([blocks_matrix(response.block), indicators])
    df = len(points) - int(np.linalg.matrix_rank(matrix))
    if df < 1:
        return np.nan, 0
    residual = response.values - matrix @ np.linalg.lstsq(matrix, response.values)[0]
    return float(np.sqrt(residual @ residual / df)), df


def _student_intervals(method: str, spread: float, df: int, fit: _Fit, level: float) -> _Judged:
    from scipy.stats import t

    quantile = float(t.ppf(0.5 + 0.5 * level, df))
    errors = spread * fit.scale
    return _Judged(method, float(errors[0]), df, [quantile * float(e) for e in errors])


def _orthogonal(fit: _Fit, coded: list[Floats]) -> bool:
    """Return whether all factors have two levels and the terms' columns are orthogonal."""
    two = all(np.allclose(np.abs(column), 1.0) for column in coded)
    products = fit.matrix.T @ fit.matrix
    return two and np.allclose(products, np.diag(np.diag(products)), atol=1e-6 * len(fit.matrix))


def _lenth_intervals(
    fit: _Fit, response: CampaignResponse, coded: list[Floats], level: float
) -> _Judged:
    from scipy.stats import t

    further = further_contrasts(fit.matrix, coded)
    others = [2.0 * float(column @ response.values) / len(response.values) for column in further]
    contrasts = np.abs([*fit.effects, *others])
    first = 1.5 * float(np.median(contrasts))
    small = contrasts[contrasts < 2.5 * first]
    if not small.size:
        return _Judged("none", None, None, [None] * len(fit.effects))
    error, df = 1.5 * float(np.median(small)), len(contrasts) / 3.0
    margin = float(t.ppf(0.5 + 0.5 * level, df)) * error
    return _Judged("lenth", error, df, [margin] * len(fit.effects))


def _effect_row(
    term: TermColumn,
    effect: float,
    margin: float | None,
    letters: list[str],
    response: CampaignResponse,
) -> EffectEstimate:
    effect = float(effect)
    return EffectEstimate(
        _term_text(term.factors, letters),
        " x ".join(response.factors[k].name for k in term.factors),
        effect,
        effect - margin if margin is not None else None,
        effect + margin if margin is not None else None,
        abs(effect) > margin if margin is not None else None,
        [("-" if sign < 0 else "") + _term_text(name, letters) for name, sign in term.aliases],
    )


def _term_text(name: tuple[int, ...], letters: list[str]) -> str:
    parts = [letters[k] for k in name]
    return "".join(parts) if all(len(part) == 1 for part in parts) else ":".join(parts)


def _describe_effects(factor: Any) -> dict[str, Any]:
    return {
        "letter": factor.letter,
        "name": factor.name,
        "unit": factor.unit,
        "role": factor.role,
        "low": factor.levels[0],
        "high": factor.levels[-1],
    }


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
    section = report.section("Effects").table(_terms(effects.terms))
    _notes(section, effects)
    section.figure(pareto(effects), "Pareto chart; the line is the margin of the interval.")
    section.figure(half_normal(effects), "Half-normal plot; effects of noise alone lie on a line.")
    report.section("Factors").table(_factors(effects.factors))
    report.provenance(
        {"Command": f"elevon campaign effects {folder} --response {effects.response}"}
    )
    return report


def _terms(terms: Sequence[EffectEstimate]) -> ReportTable:
    """Return the table of the effects with their intervals."""
    rows = [
        [term.term, term.name, term.effect,
         *("not known" if end is None else end for end in (term.low, term.high)),
         ", ".join(term.aliases)]
        for term in terms
    ]  # fmt: skip
    return ReportTable(["Term", "Factors", "Effect", "Low", "High", "Aliased with"], rows)


def _notes(section: Section, effects: Effects) -> None:
    """Add what the design could not tell apart."""
    if effects.blocked:
        section.text(f"Confounded with the blocks: {', '.join(effects.blocked)}.")
    if effects.equal_repeats:
        section.text(f"Note: {EQUAL_REPEATS}.")
    if effects.partial:
        left_out = ", ".join(effects.partial)
        section.text(f"Left out, partly aliased with other terms: {left_out}.")
    if effects.with_blocks:
        section.text(f"Varied with the blocks: {', '.join(effects.with_blocks)}.")


def _factors(factors: Sequence[dict[str, Any]]) -> ReportTable:
    """Return the table of the factors and their levels in units that a person reads."""
    rows = []
    for factor in factors:
        unit = display_unit(factor["unit"])
        ends = (to_display(factor[end], unit) for end in ("low", "high"))
        rows.append([factor["letter"], factor["name"], *ends, unit])
    return ReportTable(["Letter", "Factor", "Low", "High", "Unit"], rows)


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
