"""The compliance campaign of the Torino bench: what the forty printed drops say about stiffness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.drops import Slip, WeightDrop, find_slips, printed_drops
from elevon.errors import InputError
from elevon.estimate.regression import huber
from elevon.plain import fields_of
from elevon.report import Report
from elevon.report.checks import Check, verdict
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREY, ORANGE, RED, table_of, with_end

if TYPE_CHECKING:
    from matplotlib.figure import Figure


GUIDE_RADIUS_M = 0.08
"""Radius of the winding guide (160 mm across), thesis Table 5.1 set-up."""
NM_PER_RAD = 2.0 * GUIDE_RADIUS_M * 180.0 / math.pi
"""N m/rad for each N/deg, when the printed load hangs on EACH of the two cables (ASSUMED)."""
STANDARD_GRAVITY_FACTOR = 0.980665
"""True newtons for each printed newton: the table takes g = 10 m/s2."""
PUBLISHED_N_PER_DEG = 68.23
SLIPS_BY_HAND = frozenset({1, 3, 10, 14, 28, 29})
"""Rows found wrong in a number or a sign when the table was read by eye."""

_VARIANT = ("name", "rows", "load_on_loss_n_per_deg=load_on_loss",
            "loss_on_load_n_per_deg=loss_on_load", "theil_sen_n_per_deg=theil_sen",
            "r2")  # fmt: skip
_REPAIRED = tuple(f"{name}_repaired_deg={name}_deg" for name in ("motor", "encoder", "loss"))


@dataclass(frozen=True, slots=True)
class AngleColumns:
    """Both regressions over one reading of the table [N/deg]."""

    name: str
    rows: int
    load_on_loss: float
    loss_on_load: float
    theil_sen: float
    r2: float


@dataclass(frozen=True, slots=True)
class ComplianceResult:
    """Everything `elevon reproduce torino-compliance` reports; stiffnesses in N/deg."""

    printed: list[WeightDrop]
    repaired: list[WeightDrop]
    slips: list[Slip]
    variants: list[AngleColumns]
    robust_printed: ComplianceFit
    robust: ComplianceFit
    interval: tuple[float, float]
    deming: float
    curvature_p: float
    checks: list[Check]

    @property
    def rows_inconsistent(self) -> list[int]:
        """Rows wrong in a number or a sign, swapped columns alone not counted."""
        return sorted({slip.row for slip in self.slips if slip.kind != "swapped"})

    @property
    def rows_swapped(self) -> list[int]:
        """Rows whose motor and encoder columns are exchanged."""
        return sorted(slip.row for slip in self.slips if slip.kind == "swapped")

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command."""
        low, high = self.interval
        stiffness = self.robust.stiffness * NM_PER_RAD
        return {
            **verdict(self.checks),
            "load_on_loss_n_per_deg": self.variants[0].load_on_loss,
            "loss_on_load_n_per_deg": self.variants[0].loss_on_load,
            "robust_n_per_deg": self.robust.stiffness,
            "stiffness_nm_per_rad": stiffness,
            "interval_nm_per_rad": [low * NM_PER_RAD, high * NM_PER_RAD],
            "interval_level": 0.95,
            "rows_inconsistent": self.rows_inconsistent,
            "rows_swapped": self.rows_swapped,
            "loss_at_zero_load_deg": self.robust.offset,
            "first_drop_offset_deg": float(self.robust.group_offsets[0]),
            "alternatives_nm_per_rad": {
                "standard gravity instead of 10 m/s2": stiffness * STANDARD_GRAVITY_FACTOR,
                "printed load is the sum of both cables": stiffness / 2.0,
            },
            "deming_n_per_deg": self.deming,
            "robust_on_printed_rows_n_per_deg": self.robust_printed.stiffness,
            "curvature_p_value": self.curvature_p,
            "variants": [fields_of(v, *_VARIANT) for v in self.variants],
            "slips": [fields_of(slip, "row", "kind", "reason") for slip in self.slips],
            "rows": [
                fields_of(a, "row", "load_n", "motor_deg", "encoder_deg", "loss_deg")
                | fields_of(b, *_REPAIRED)
                for a, b in zip(self.printed, self.repaired, strict=True)
            ],
        }


def reproduce_compliance(*, seed: int = 0, resamples: int = 2000) -> ComplianceResult:
    """Estimate the transmission's stiffness from the forty printed drops.

    Parameters
    ----------
    seed : int
        Seed of the bootstrap.
    resamples : int
        Resamples of the bootstrap.

    Returns
    -------
    ComplianceResult
    """
    printed = printed_drops()
    repaired, slips = find_slips(printed)
    variants = _variants(printed, repaired, slips)
    load, loss = _columns(repaired)
    first = np.array([drop.drop == 1 for drop in repaired], dtype=int)
    robust = fit_compliance(load, loss, first)
    weight = np.unique(load, return_inverse=True)[1]
    interval = bootstrap_interval(load, loss, first, cluster=weight, seed=seed, resamples=resamples)
    load_sd = 0.05 / math.sqrt(3.0)  # loads are printed to 0.1 N
    return ComplianceResult(
        printed=printed,
        repaired=repaired,
        slips=slips,
        variants=variants,
        robust_printed=fit_compliance(*_columns(printed), first),
        robust=robust,
        interval=interval,
        deming=deming_stiffness(load, loss, load_sd, robust.scale),
        curvature_p=_curvature(load, loss, first),
        checks=_checks(variants, slips),
    )


def _variants(
    printed: Sequence[WeightDrop], repaired: Sequence[WeightDrop], slips: Sequence[Slip]
) -> list[AngleColumns]:
    load, loss = _columns(printed)
    fixed = _columns(repaired)[1]
    differences = np.array([abs(drop.encoder_deg - drop.motor_deg) for drop in printed])
    signed = np.array([drop.encoder_deg - drop.motor_deg for drop in printed])
    worst = int(np.argmax(loss))
    keep = np.arange(len(load)) != worst
    wrong = {slip.row for slip in slips if slip.kind != "swapped"}
    sound = np.array([drop.row not in wrong for drop in printed])
    return [
        _variant("as printed", load, loss),
        _variant("each loss from its own printed positions", load, differences),
        _variant(f"as printed, without row {worst + 1} ({loss[worst]:.2f} deg)",
                 load[keep], loss[keep]),
        _variant("encoder minus motor, swapped columns left swapped", load, signed),
        _variant("inconsistent rows left out", load[sound], loss[sound]),
        _variant("repaired", load, fixed),
    ]  # fmt: skip


def _variant(name: str, load: Floats, loss: Floats) -> AngleColumns:
    from scipy.stats import theilslopes

    slope = float(theilslopes(loss, load)[0])
    r2 = float(np.corrcoef(load, loss)[0, 1] ** 2)
    return AngleColumns(
        name, len(load), load_on_loss(load, loss), loss_on_load(load, loss), 1.0 / slope, r2
    )


def _curvature(load: Floats, loss: Floats, group: np.ndarray[Any, Any]) -> float:
    """Return the p value of the F test for a quadratic term in the load."""
    from scipy.stats import f as f_distribution

    straight = np.column_stack([load, np.ones_like(load), group])
    squares = [
        float(np.sum((loss - design @ np.linalg.lstsq(design, loss, rcond=None)[0]) ** 2))
        for design in (straight, np.column_stack([straight, load**2]))
    ]
    freedom = len(load) - 4
    return float(f_distribution.sf((squares[0] - squares[1]) / (squares[1] / freedom), 1, freedom))


def _checks(variants: Sequence[AngleColumns], slips: Sequence[Slip]) -> list[Check]:
    printed, single, repaired = variants[0], variants[1], variants[-1]
    rows_called_wrong = {slip.row for slip in slips if slip.kind != "swapped"}
    return [
        _against("load on loss, printed rows, from 68.16", printed.load_on_loss, 68.16, 0.005),
        _against("loss on load, printed rows, from 114.6", printed.loss_on_load, 114.6, 0.05),
        _against("published 68.23 from losses of the rows' own positions", single.load_on_loss,
                 PUBLISHED_N_PER_DEG, 0.005),
        _against("load on loss, repaired, from 85.7", repaired.load_on_loss, 85.7, 0.05),
        _against("loss on load, repaired, from 113.4", repaired.loss_on_load, 113.4, 0.05),
        Check("ratio of the two regressions less r squared",
              abs(printed.load_on_loss / printed.loss_on_load - printed.r2), 1e-9),
        Check("rows called wrong by only one of program and eye",
              len(rows_called_wrong ^ SLIPS_BY_HAND), 0,
              "rows"),
    ]  # fmt: skip


def _against(name: str, ours: float, printed: float, limit: float) -> Check:
    """Return a check of a slope against a printed one, to half a unit of its last digit."""
    return Check(name, abs(ours - printed), limit, "N/deg", ours=ours)


def _columns(drops: Sequence[WeightDrop]) -> tuple[Floats, Floats]:
    return (
        np.array([drop.load_n for drop in drops]),
        np.array([drop.loss_deg for drop in drops]),
    )


def compliance_page(result: ComplianceResult, seed: int = 0, date: str | None = None) -> Report:
    """Return the report of the forty drops."""
    low, high = (end * NM_PER_RAD for end in result.interval)
    stiffness = result.robust.stiffness * NM_PER_RAD
    report = Report(
        "Stiffness of the Torino transmission",
        f"Forty drops of a weight give {stiffness:.0f} N m/rad at the output shaft, 95 % interval "
        f"{low:.0f} to {high:.0f}. The published {PUBLISHED_N_PER_DEG} is the other regression.",
        date=date,
    )
    report.fact("Stiffness", f"{stiffness:.0f} N m/rad", f"{low:.0f} to {high:.0f}, 95 %")
    robust = f"{result.robust.stiffness:.1f} N/deg"
    report.fact("Robust fit", robust, "loss on load, repaired rows")
    report.fact("As published", f"{PUBLISHED_N_PER_DEG} N/deg", "load on loss; printed as N m/deg")
    wrong = f"{len(result.rows_inconsistent)} of {len(result.printed)}"
    report.fact("Rows wrong", wrong, f"and {len(result.rows_swapped)} with swapped columns")
    report.section(
        "What is wrong in the printed rows",
        "The encoder came back to the same few end positions and the motor never stopped twice at "
        "the same place: a motor column that holds an encoder position is a swapped column. All "
        "weights pull one way: a motor end of the other sign has lost its minus. And the printed "
        "loss is the distance between the two positions of its row, or it is not that row's.",
    ).table(
        table_of(result.slips, (("Row", "row"), ("Slip", "kind"), ("Evidence", "reason")))
    ).text(
        "Swapping columns changes no loss that is taken as a distance. It turns the sign of a loss "
        "taken as encoder minus motor, and ruins both regressions (fourth line of the next table)."
    )
    _add_regressions(report, result)
    _add_answer(report, result, low, high)
    return with_end(report, result.checks, "torino-compliance", {"Bootstrap seed": seed})


def _add_regressions(report: Report, result: ComplianceResult) -> None:
    """Add what each reading of the table gives by each estimator."""
    columns = (
        ("Rows used", "name"),
        ("Rows", "rows", "d"),
        ("Load on loss", "load_on_loss", ".2f"),
        ("Loss on load", "loss_on_load", ".2f"),
        ("Theil-Sen", "theil_sen", ".2f"),
        ("r squared", "r2", ".3f"),
    )
    report.section(
        "Which regression",
        "The load was set and is known to its printed digits; the scatter is in the measured "
        "angle. So the loss is regressed on the load and the stiffness is the inverse of that "
        "slope. Regressing the load on the loss gives a slope that is too small by the squared "
        f"correlation (here {result.variants[0].r2:.3f}), whatever the number of drops. Allowing "
        "errors in both, with the load's printed rounding against the angle's scatter, gives "
        f"{result.deming:.1f} N/deg: the load's own error does not matter.",
    ).table(
        table_of(
            result.variants,
            columns,
            "Stiffness in N/deg, by reading of the table and by estimator.",
        )
    ).text(
        f"The second line gives {result.variants[1].load_on_loss:.2f}: the published "
        f"{PUBLISHED_N_PER_DEG} was computed from the positions, and the losses of rows 3, 10 and "
        "14 were slips of the print only."
    ).figure(
        _fits_figure(result),
        "Loss against load: each repaired row (dots; a weight's first drop in orange), wrong "
        "losses as printed (crosses), and the fits.",
    )


def _add_answer(report: Report, result: ComplianceResult, low: float, high: float) -> None:
    fit, stiffness = result.robust, result.robust.stiffness * NM_PER_RAD
    report.section(
        "The answer",
        f"The first drop of each weight starts from elsewhere and loses {fit.group_offsets[0]:.3f} "
        "deg more; with that offset and Huber's weights the repaired rows give "
        f"{fit.stiffness:.1f} N/deg, that is {math.radians(stiffness):.1f} N m/deg or "
        f"{stiffness:.0f} N m/rad. Drawing whole weights with replacement gives {low:.0f} to "
        f"{high:.0f} N m/rad (95 %). {fit.offset:.3f} deg are lost already at no load: backlash "
        "and friction.",
        "A straight line is not the whole truth: a quadratic term is significant (p = "
        f"{result.curvature_p:.1g}), the transmission stiffens with load.",
    ).points(
        [
            "ASSUMED: the printed load hangs on each of the two cables of the 160 mm guide, so the "
            "torque is 0.16 m times the load. If it is the sum of both: "
            f"{stiffness / 2:.0f} N m/rad.",
            "The printed load is ten times the mass. In true newtons every stiffness is "
            f"{100 * (1 - STANDARD_GRAVITY_FACTOR):.1f} % lower: "
            f"{stiffness * STANDARD_GRAVITY_FACTOR:.0f} N m/rad.",
        ]
    )


def _fits_figure(result: ComplianceResult) -> Figure:
    fit, regression = result.robust, result.variants[0].load_on_loss
    changed = [a for a, b in zip(result.printed, result.repaired, strict=True)
               if (a.load_n, a.loss_deg) != (b.load_n, b.loss_deg)]  # fmt: skip
    first = [drop for drop in result.repaired if drop.drop == 1]
    later = [drop for drop in result.repaired if drop.drop != 1]
    load = np.array([0.0, 52.0])
    mean_load, mean_loss = (column.mean() for column in _columns(result.printed))
    robust = fit.offset + load / fit.stiffness
    published = mean_loss + (load - mean_load) / regression
    with new_figure(height=4.4) as (figure, axes):
        axes.plot(*_columns(changed), "x", color=GREY, label="printed, wrong")
        axes.plot(*_columns(later), "o", color=BLUE, ms=4.5, label="repaired")
        axes.plot(*_columns(first), "o", color=ORANGE, ms=4.5, label="first drops")
        axes.plot(load, robust, color=BLUE, label=f"robust, {fit.stiffness:.0f} N/deg")
        axes.plot(load, robust + fit.group_offsets[0], "--", color=ORANGE, lw=1.2)
        label = f"load on loss, {regression:.0f} N/deg"
        axes.plot(load, published, ":", color=RED, label=label)
        axes.set(xlabel="Load [N]", ylabel="Loss [deg]", xlim=(0, 52), ylim=(-0.05, 0.95))
        axes.legend(loc="upper left", ncols=2)
    return figure


@dataclass(frozen=True, slots=True)
class ComplianceFit:
    """Result of `fit_compliance`.

    Attributes
    ----------
    stiffness : float
        Load per loss, in the units of the data.
    offset : float
        Loss at zero load of the observations outside every group.
    group_offsets : ndarray, shape (g,)
        What each group loses beyond `offset`.
    residuals : ndarray, shape (n,)
        Measured less fitted loss.
    weights : ndarray, shape (n,)
        Weight each observation kept, in (0, 1].
    scale : float
        Robust standard deviation of the residuals.
    """

    stiffness: float
    offset: float
    group_offsets: Floats
    residuals: Floats
    weights: Floats
    scale: float


def load_on_loss(load: Floats, loss: Floats) -> float:
    """Slope of the least-squares line of load on loss (load per loss)."""
    return _slope(loss, load)


def loss_on_load(load: Floats, loss: Floats) -> float:
    """Inverse slope of the least-squares line of loss on load (load per loss)."""
    return 1.0 / _slope(load, loss)


def deming_stiffness(load: Floats, loss: Floats, load_sd: float, loss_sd: float) -> float:
    """Slope of the line that allows errors in both (Deming), for known standard deviations.

    Raises
    ------
    InputError
        A standard deviation is not positive.
    """
    if load_sd <= 0.0 or loss_sd <= 0.0:
        raise InputError(f"errors in both: needs positive deviations, got {load_sd} and {loss_sd}")
    x, y = (load - load.mean()) / load_sd, (loss - loss.mean()) / loss_sd
    difference, cross = float(y @ y - x @ x), float(x @ y)
    root = float(np.hypot(difference, 2.0 * cross))
    # Two forms of one root: the sum of numbers of one sign loses no digits.
    if difference >= 0.0:
        slope = (root + difference) / (2.0 * cross)
    else:
        slope = 2.0 * cross / (root - difference)
    return float(load_sd / (loss_sd * slope))


def fit_compliance(
    load: Floats, loss: Floats, group: npt.ArrayLike | None = None, *, robust: bool = True
) -> ComplianceFit:
    """Fit loss against load, with an offset a group.

    Parameters
    ----------
    load, loss : ndarray, shape (n,)
        Set loads and measured losses.
    group : array_like of int, shape (n,), optional
        0 for observations of the common offset, 1, 2, ... for groups with their own.
    robust : bool
        Huber's weights instead of plain least squares.

    Returns
    -------
    ComplianceFit

    Raises
    ------
    InputError
        Fewer observations than unknowns, values that are not finite, or one load only.
    """
    design = _design(load, group)
    if len(load) != len(loss) or not (np.isfinite(load).all() and np.isfinite(loss).all()):
        raise InputError(f"compliance: {len(load)} loads, {len(loss)} losses, all must be finite")
    if len(load) < design.shape[1] or np.linalg.matrix_rank(design) < design.shape[1]:
        raise InputError(
            f"compliance: {len(load)} observations do not determine {design.shape[1]} unknowns"
        )
    if robust:
        beta, residuals, weights = huber(design, loss)
    else:
        beta = np.asarray(np.linalg.lstsq(design, loss, rcond=None)[0], dtype=np.float64)
        residuals, weights = loss - design @ beta, np.ones(len(load))
    scale = 1.4826 * float(np.median(np.abs(residuals)))
    return ComplianceFit(1.0 / beta[0], float(beta[1]), beta[2:], residuals, weights, scale)


def bootstrap_interval(
    load: Floats,
    loss: Floats,
    group: npt.ArrayLike | None = None,
    *,
    cluster: npt.ArrayLike,
    level: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> tuple[float, float]:
    """Interval of the robust stiffness, drawing whole clusters of observations with replacement.

    Drops of one weight share its errors (how it hung, how friction settled): drawing single rows
    would count them as independent and give an interval that is too narrow.

    Parameters
    ----------
    load, loss, group
        As `fit_compliance`.
    cluster : array_like of int, shape (n,)
        Which observations belong together.
    level : float
        Share of the resamples inside the interval.
    resamples : int
        Number of resamples.
    seed : int
        Seed of the draws.

    Returns
    -------
    (float, float)
        Lower and upper end, in load per loss.
    """
    labels = np.asarray(cluster)
    groups = np.zeros(len(load), dtype=int) if group is None else np.asarray(group)
    members = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    random = np.random.default_rng(seed)
    slopes = []
    for _ in range(resamples):
        drawn = np.concatenate([members[k] for k in random.integers(0, len(members), len(members))])
        if np.ptp(load[drawn]) > 0.0:  # the same weight drawn each time determines no slope
            slopes.append(fit_compliance(load[drawn], loss[drawn], groups[drawn]).stiffness)
    tail = 50.0 * (1.0 - level)
    low, high = np.percentile(slopes, [tail, 100.0 - tail])
    return float(low), float(high)


def _slope(x: Floats, y: Floats) -> float:
    centred = x - x.mean()
    return float(centred @ y / (centred @ centred))


def _design(load: Floats, group: npt.ArrayLike | None) -> Floats:
    columns = [load, np.ones(len(load))]
    if group is not None:
        labels = np.asarray(group)
        columns += [(labels == label).astype(float) for label in np.unique(labels) if label != 0]
    return np.column_stack(columns)
