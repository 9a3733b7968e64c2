"""Mechanics from measured effort and measured motion: the inverse model by regression.

The torque that a motion needs is linear in its numbers: inertia times acceleration, viscous
friction times speed, Coulomb friction in the direction of motion, a constant load. A transmission
loses a share of what passes through it, so that the effort is that torque over 1 - share where it
drives, and over 1 + share where it brakes: only samples that brake tell the share from the scale of
all the rest. Derivatives are taken within a band in which they are motion and not noise; effort and
regressors pass one filter and are thinned alike, so that the filter moves no number. The commanded
motion, or the model's own where none was commanded, is the instrument: the sensor's noise comes
back in the effort of a closed loop, and least squares alone would take it for friction and inertia
(Janot, Vandanjon, Gautier 2014: an instrumental variable approach for rigid industrial robots).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.calibrate.subsystems.signals import REST_SPEED, DriveSignals, useful_band
from elevon.errors import InputError
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression, regressed, with_deviations

LOSS = "load_loss"
NAMES = ("inertia", "viscous", "coulomb", "offset", LOSS)
REVERSING = NAMES[:4]
ONE_WAY = ("inertia", "viscous", "offset")
BANDS = (0.6, 1.6)  # of the band: other choices that no log settles. ASSUMED
ROUNDS = 2  # of runs of the model for an instrument
THINNED = 2.5  # bands that the thinned rate holds: 0.8 of its half is the band. ASSUMED
MOVING = 0.9  # of a filter's weight that must stem from samples in motion
#: Of a regressor's variance that the noiseless motion must explain. ASSUMED: with half of it, a
#: square command made an inertia that is half too large
INSTRUMENT = 0.9
OWN_INSTRUMENT = 0.5  # the same of the model's own motion, which has the effort's shape. ASSUMED
HAUSMAN = 2.0  # deviations between both estimates from which least squares counts as biased
#: Of a number: a deviation beyond which it is not determined. ASSUMED: at half the number the
#: interval of 90 % just leaves out zero
SHARE = 0.5
DISAGREE = 3.0  # deviations between two groups of logs that are reported
#: Terms beyond the model's: what else the residual is tried for.
EXTRAS = ("stribeck", "quadratic", "spring", "ripple_cos", "ripple_sin", "load")
BRAKING = 0.02  # of the samples, that must brake for the share that is lost to show. ASSUMED
#: The share that is lost where the logs do not show it. ASSUMED: gears and screws of actuators pass
#: on at least 0.7 of what they are given
MOST_LOST = 0.3
IMPOSSIBLE = 0.6  # a share beyond which the regression has followed something else. ASSUMED
LOSS_ROUNDS = 20  # of the linearised regression
DRAWN = 500  # samples of a log on the page
SEEN = 4.0  # deviations from which a further term is reported, ...
WORTH = 0.01  # ... and the share of the residual's variance that it explains


@dataclass(frozen=True, eq=False)
class InverseRows:
    """The inverse model's rows of one log, thinned.

    Attributes
    ----------
    name : str
        Of the log.
    time, speed, effort : ndarray, shape (n,)
        s, rad/s, torque [N m] or the effort's unit.
    columns, instrument : ndarray, shape (n, 5)
        Of the regressors `NAMES`, and of those that were commanded; None without a command.
    position : ndarray, shape (n,)
        rad.
    load : ndarray or None
        As logged.
    period : float
        s.
    commanded : bool
        Whether the instrument was commanded; else it is the model's own motion.
    loss : float
        Share that is lost where the columns are linearised.
    """

    name: str
    time: Floats
    speed: Floats
    position: Floats
    effort: Floats
    columns: Floats
    instrument: Floats | None
    load: Floats | None
    period: float
    commanded: bool = True
    loss: float = 0.0

    @property
    def strokes(self) -> tuple[Floats, Floats, float]:
        """Instants, speeds and period, for blocks of correlated residuals."""
        return self.time, self.speed, self.period

    @property
    def direction(self) -> int:
        """1 or -1 where the log moves in one direction only, else 0."""
        share = float(np.mean(self.speed > 0.0))
        return 1 if share > 0.98 else -1 if share < 0.02 else 0


@dataclass(frozen=True)
class Mechanics:
    """What effort and motion determine.

    Attributes
    ----------
    regression : Regression
        Of the names in `NAMES` (in `ONE_WAY`, where nothing reverses), for one unit of effort.
    band : float
        Hz.
    method : str
        ``instrument`` or ``least squares``.
    separate : mapping of str to Estimate triples
        Each log's numbers, and those of each direction where the logs move one way each.
    extras : mapping of str to Estimate
        Further terms that the residual shows.
    curve : ndarray, shape (k, 4)
        Speed [rad/s], friction and its deviation, samples, by bins of speed.
    residual : mapping of str to ndarray, shape (k, 5)
        By log: time, position, speed, measured and predicted effort; some of the samples.
    findings : tuple of str
        What to know.
    direction : int
        1 or -1 where nothing but one direction was logged.
    effort_rms : float
        Of the logs.
    top_speed : float
        Of the logs [rad/s].
    """

    regression: Regression
    band: float
    method: str
    separate: dict[str, dict[str, Estimate]] = field(default_factory=dict)
    extras: dict[str, Estimate] = field(default_factory=dict)
    curve: Floats = field(default_factory=lambda: np.empty((0, 4)))
    residual: dict[str, Floats] = field(default_factory=dict)
    findings: tuple[str, ...] = ()
    direction: int = 0
    effort_rms: float = 0.0
    top_speed: float = 0.0

    def estimate(self, name: str) -> Estimate | None:
        """Return a number, None where the logs do not have it."""
        return self.regression.estimate(name) if name in self.regression.names else None

    def determined(self, name: str) -> bool:
        """Return whether the data narrowed a number."""
        item = self.estimate(name)
        if item is None or not np.isfinite(item.std):
            return False
        if name == "offset":  # may be zero: the effort's size says what is little
            return item.std < SHARE * self.effort_rms
        return item.value > 0.0 and item.std < SHARE * item.value


def mechanics_rows(drive: DriveSignals, band: float, shift: float = 0.0) -> InverseRows:
    """Return the rows of a log within a band [Hz], the effort read `shift` seconds later."""
    position, speed, acceleration = drive.derivatives(band)
    effort = drive.effort
    if shift:
        effort = np.interp(drive.time + shift, drive.time, effort)
    moving = (np.abs(speed) > REST_SPEED * float(np.abs(speed).max())) & drive.good
    one, nothing = np.ones_like(speed), np.zeros_like(speed)
    columns = np.column_stack([acceleration, speed, np.sign(speed), one, nothing])
    noiseless = drive.noiseless(band)
    count = max(1, int(drive.rate / (THINNED * band)))
    both = [columns, effort[:, None], position[:, None], moving[:, None].astype(np.float64)]
    if noiseless is not None:
        rate, change = noiseless
        both.append(np.column_stack([change, rate, np.sign(rate), one, nothing]))
    load = drive.load
    if load is not None:
        both.append(load[:, None])
    table = _thinned(np.hstack(both), count, drive.rate)
    keep = _inside(table, drive, count) & (table[:, 7] > MOVING)
    table, time = table[keep], drive.time[::count][keep]
    instrument = table[:, 8:13] if noiseless is not None else None
    return InverseRows(
        drive.name, time, table[:, 1], table[:, 6], table[:, 5], table[:, :5], instrument,
        table[:, -1] if load is not None else None, drive.period * count,
        drive.model_speed is None,
    )  # fmt: skip


def _thinned(table: Floats, count: int, rate: float) -> Floats:
    """Return every `count`-th row behind one filter for all columns."""
    from scipy.signal import butter, sosfiltfilt

    if count == 1:
        return table
    sections = butter(4, 0.4 * rate / count, fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sections, table, axis=0)[::count])


def _inside(table: Floats, drive: DriveSignals, count: int) -> Bools:
    """Leave out the ends, where filters that run both ways have no past or no future."""
    edge = max(2, round(0.05 / (drive.period * count)))
    inside = np.zeros(len(table), dtype=np.bool_)
    inside[edge : len(table) - edge] = True
    return inside


#: Speed [rad/s] of the model with some numbers, driven by the effort of a log.
OwnMotion = Callable[[DriveSignals, Mapping[str, float]], Floats]


def identify_mechanics(
    drives: Sequence[DriveSignals], own_motion: OwnMotion | None = None, *, geared: bool = True
) -> Mechanics:
    """Estimate inertia, friction and constant load from the effort of logs.

    Parameters
    ----------
    drives : sequence of DriveSignals
        Of one machine.
    own_motion : callable, optional
        Runs the model on the effort of a log: the instrument where no motion was commanded.
    geared : bool
        Whether the effort passes a gear or a screw, which may lose a share of it.

    Raises
    ------
    InputError
        Nothing moves enough.
    """
    result = _identified(drives, geared)
    if own_motion is None or any(drive.noiseless(1.0) is not None for drive in drives):
        return result
    for _ in range(ROUNDS):
        numbers = {name: result.regression[name] for name in result.regression.names}
        if not (numbers["inertia"] > 0.0 and numbers["viscous"] >= 0.0):
            return result
        driven = [replace(drive, model_speed=own_motion(drive, numbers)) for drive in drives]
        result = _identified(driven, geared)
    return result


def _identified(drives: Sequence[DriveSignals], geared: bool) -> Mechanics:
    """Return the regression of the mechanics with its intervals.

    Raises
    ------
    InputError
        Nothing moves enough.
    """
    band = min(useful_band(drive) for drive in drives)
    every = [(drive, mechanics_rows(drive, band)) for drive in drives]
    every = [(drive, item) for drive, item in every if len(item.time) >= 4 * len(NAMES)]
    if not every:
        raise InputError("the mechanics: no log moves for long enough to be read")
    drives, rows = [drive for drive, _ in every], [item for _, item in every]
    names: tuple[str, ...] = REVERSING if _reverses(rows) else ONE_WAY
    regression, method, other = _regression(rows, names)
    if not np.isfinite(regression.covariance).all():
        raise InputError("the mechanics: the motion does not tell inertia from friction")

    def choices(fit: Regression) -> list[Floats]:
        """Other bands, and an effort that is held between samples: late by half a period."""

        def chosen(factor: float, shift: float = 0.0) -> Floats:
            varied = [mechanics_rows(drive, factor * band, shift) for drive in drives]
            varied = [item for item in varied if len(item.time) >= 4 * len(NAMES)]
            if not varied:
                return fit.value
            return _converged(varied, fit.names, method, fit.value)[1]

        half = 0.5 * drives[0].period
        late = 0.5 * (chosen(1.0, half) - chosen(1.0, -half))
        return [*(chosen(factor) for factor in BANDS), fit.value + late]

    rows, regression, lost = _with_loss(rows, regression, method, choices, geared)
    names = regression.names
    more = choices(regression)
    notes = []
    if lost > WORTH:
        more.append(regression.value * (1.0 - lost))
        notes.append(_open(lost))
    if method == "instrument" and other is not None and LOSS not in names:
        more.append(0.5 * (regression.value + other))
    extras, seen, moved = _extras(rows, regression)
    # In one direction further terms are the model's own sums: they say nothing of its numbers.
    regression = regression.open_to([*more, *moved] if "coulomb" in names else more)
    separate = _separate(rows, names, method)
    regression, findings = _between(regression, separate)
    return Mechanics(
        regression, band, method, separate, extras, _friction_curve(rows, regression),
        _residuals(rows, regression), (*findings, *notes, *seen, _confounded(names)),
        0 if "coulomb" in names else rows[0].direction,
        float(np.sqrt(np.mean(np.concatenate([item.effort**2 for item in rows])))),
        max(float(np.abs(item.speed).max()) for item in rows),
    )  # fmt: skip


def _reverses(rows: Sequence[InverseRows]) -> bool:
    directions = {item.direction for item in rows}
    return 0 in directions or len(directions) > 1


def _with_loss(
    rows: list[InverseRows],
    regression: Regression,
    method: str,
    choices: Callable[[Regression], list[Floats]],
    geared: bool,
) -> tuple[list[InverseRows], Regression, float]:
    """Return the regression with the share that is lost, where the samples that brake show one.

    Where they do not, the last is the root mean square of the shares that are possible: between
    none and `MOST_LOST`, as likely as the logs make them. It is 0 where nothing can be lost.
    """
    names = (*regression.names, LOSS)
    braking = np.mean(
        np.concatenate([_predicted(item, regression) * item.speed < 0.0 for item in rows])
    )
    share: Estimate | None = None
    if "coulomb" in names and braking > BRAKING:
        lossy = _converged(rows, names, method, np.append(regression.value, 0.0))[0]
        lossy_fit = _regression(lossy, names, method)[0]
        share = lossy_fit.open_to(choices(lossy_fit)).estimate(LOSS)
        if not np.isfinite(share.std) or not abs(share.value) < IMPOSSIBLE:
            share = None
        elif share.value > HAUSMAN * lossy_fit.std(LOSS):
            return lossy, lossy_fit, 0.0
    if not geared:
        return rows, regression, 0.0
    if share is None:
        return rows, regression, MOST_LOST / 3.0**0.5
    from scipy.stats import truncnorm

    ends = ((end - share.value) / share.std for end in (0.0, MOST_LOST))
    possible = truncnorm(*ends, loc=share.value, scale=share.std)
    return rows, regression, float(np.hypot(possible.mean(), possible.std()))


def _open(share: float) -> str:
    return (
        f"a loss that grows with the effort is not seen; one of {100 * share:.2g} % is possible "
        "and would take as much from inertia, friction and load: motions that brake with more "
        "than friction tell it"
    )


def _converged(
    rows: list[InverseRows], names: tuple[str, ...], method: str, start: Floats
) -> tuple[list[InverseRows], Floats]:
    """Return the rows linearised at the numbers that solve them, and these numbers."""
    if LOSS not in names:
        return rows, _solved(rows, names, method)
    value = start
    for _ in range(LOSS_ROUNDS):
        linearised = [_linearised(item, value) for item in rows]
        fresh = _solved(linearised, names, method)
        fresh[-1] = min(max(fresh[-1], -IMPOSSIBLE), IMPOSSIBLE)
        done = abs(fresh[-1] - value[-1]) < 1e-6
        value = fresh
        if done:
            break
    return [_linearised(item, value) for item in rows], value


def _linearised(item: InverseRows, value: Floats) -> InverseRows:
    """Return a log's rows about some numbers, the share that is lost last among them."""
    loss = float(value[-1])

    def about(table: Floats) -> Floats:
        torque, direction = table[:, :4] @ value[:4], table[:, 2]
        share = 1.0 - loss * direction * np.sign(torque)
        return np.column_stack([table[:, :4], direction * np.abs(torque / share)]) / share[:, None]

    instrument = None if item.instrument is None else about(item.instrument)
    return replace(item, columns=about(item.columns), instrument=instrument, loss=loss)


def _chosen(item: InverseRows, names: tuple[str, ...], instrument: bool = False) -> Floats:
    table = item.instrument if instrument else item.columns
    assert table is not None
    return table[:, [NAMES.index(name) for name in names]]


def _target(item: InverseRows, names: tuple[str, ...]) -> Floats:
    """Return the effort, with what the linearised loss's own column carries of it."""
    return item.effort + item.loss * item.columns[:, 4] if LOSS in names else item.effort


def _through(rows: Sequence[InverseRows], names: tuple[str, ...], stack: Floats) -> Floats:
    """Return the regressors as the noiseless motion explains them."""
    instrument = np.vstack([_chosen(item, names, instrument=True) for item in rows])
    size = np.maximum(np.linalg.norm(instrument, axis=0), 1e-300)
    weights = np.linalg.lstsq(instrument / size, stack, rcond=None)[0]
    return np.asarray((instrument / size) @ weights)


def _solved(rows: Sequence[InverseRows], names: tuple[str, ...], method: str) -> Floats:
    """Return the numbers alone."""
    stack = np.vstack([_chosen(item, names) for item in rows])
    through = _through(rows, names, stack) if method == "instrument" else stack
    scale = np.maximum(np.linalg.norm(through, axis=0), 1e-300)
    target = np.concatenate([_target(item, names) for item in rows])
    return np.asarray(np.linalg.lstsq(through / scale, target, rcond=None)[0] / scale)


def _regression(
    rows: Sequence[InverseRows], names: tuple[str, ...], method: str | None = None
) -> tuple[Regression, str, Floats | None]:
    """Return the regression, how it was done, and what the other way gives where both can be."""
    strokes = [item.strokes for item in rows]
    design = [_chosen(item, names) for item in rows]
    data = [_target(item, names) for item in rows]
    plain = regressed(names, design, data, strokes, robust=False)
    if method == "least squares" or any(item.instrument is None for item in rows):
        return plain, "least squares", None
    stack, target = np.vstack(design), np.concatenate(data)
    through = _through(rows, names, stack)
    strength = 1.0 - np.var(stack - through, axis=0) / np.maximum(np.var(stack, axis=0), 1e-300)
    moving = [k for k, name in enumerate(names) if name != "offset"]
    needed = INSTRUMENT if all(item.commanded for item in rows) else OWN_INSTRUMENT
    if method is None and not np.all(strength[moving] > needed):
        return plain, "least squares", None
    value = _solved(rows, names, "instrument")
    residual = target - stack @ value
    clean = with_deviations(names, value, through, residual, np.ones(len(target)), strokes=strokes)
    clean = replace(clean, explained=1.0 - float(np.var(residual) / np.var(target)))
    if method is None:
        gap = np.abs(clean.value - plain.value)
        if not np.any(gap > HAUSMAN * np.sqrt(np.diag(clean.covariance))):
            return plain, "least squares", clean.value
    return clean, "instrument", plain.value


def _separate(
    rows: Sequence[InverseRows], names: tuple[str, ...], method: str
) -> dict[str, dict[str, Estimate]]:
    """Return the numbers of each log alone, and of each direction where logs move one way.

    The share that is lost stays that of all.
    """
    names = tuple(name for name in names if name != LOSS)
    groups = {item.name: [item] for item in rows} if len(rows) > 1 else {}
    for sign, name in ((1, "forwards"), (-1, "backwards")):
        one_way = [item for item in rows if item.direction == sign]
        if one_way and len(one_way) < len(rows):
            groups[name] = one_way
    out = {}
    for name, items in groups.items():
        known = names if _reverses(items) else tuple(n for n in names if n != "coulomb")
        result = _regression(items, known, method)[0]
        if np.isfinite(result.covariance).all():
            out[name] = {part: result.estimate(part) for part in known}
    return out


def _between(
    regression: Regression, separate: dict[str, dict[str, Estimate]]
) -> tuple[Regression, list[str]]:
    """Widen by what differs from log to log, and say where two directions disagree."""
    findings = []
    names = [n for n in regression.names if n not in {"offset"}]
    for name in names:
        forwards, backwards = (separate.get(d, {}).get(name) for d in ("forwards", "backwards"))
        if forwards is None or backwards is None:
            continue
        gap = abs(forwards.value - backwards.value)
        if gap > DISAGREE * float(np.hypot(forwards.std, backwards.std)):
            findings.append(
                f"{name}: {forwards.value:.4g} forwards, {backwards.value:.4g} backwards: the "
                "directions disagree; a value for both describes neither"
            )
    covariance = regression.covariance.copy()
    for k, name in enumerate(regression.names):
        alone = [v[name].value for key, v in separate.items()
                 if name in v and key not in {"forwards", "backwards"}]  # fmt: skip
        if len(alone) > 1 and not (name == "offset" and "coulomb" not in separate):
            covariance[k, k] = max(covariance[k, k], float(np.var(alone, ddof=1)) / len(alone))
    return replace(regression, covariance=covariance), findings


def _extras(
    rows: Sequence[InverseRows], regression: Regression
) -> tuple[dict[str, Estimate], list[str], list[Floats]]:
    """Return further terms that the residual shows, their words, and the numbers beside each.

    What the model lacks moves its numbers: those of a model that has it are another choice.
    """
    names, result, texts, moved = regression.names, {}, [], []
    top = max(float(np.abs(item.speed).max()) for item in rows)
    for name in EXTRAS:
        columns = [c for item in rows if (c := _extra(name, item, top)) is not None]
        if len(columns) < len(rows):
            continue
        design = [
            np.column_stack([_chosen(item, names), column])
            for item, column in zip(rows, columns, strict=True)
        ]
        data = [_target(item, names) for item in rows]
        tried = regressed((*names, name), design, data, [r.strokes for r in rows], robust=False)
        if not np.isfinite(tried.covariance).all():
            continue
        item = tried.estimate(name)
        less = 1.0 - (1.0 - tried.explained) / max(1.0 - regression.explained, 1e-300)
        if abs(item.value) > SEEN * item.std and less > WORTH:
            result[name] = item
            size = f"{item.value:.4g} +- {item.std:.2g}"
            texts.append(f"{name}: {size} explains {100 * less:.0f} % of what is left")
            moved.append(tried.value[: len(names)])
    return result, texts, moved


def _extra(name: str, rows: InverseRows, top: float) -> Floats | None:
    """Return the column of a further term; None where the log cannot show it."""
    speed, direction = rows.speed, np.sign(rows.speed)
    if name == "load":
        return rows.load
    if name.startswith("ripple"):
        turns = float(np.ptp(rows.position)) / (2.0 * np.pi)
        wave = np.cos if name == "ripple_cos" else np.sin
        return np.asarray(wave(rows.position)) if turns >= 2.0 else None
    return {
        "stribeck": direction * np.exp(-((speed / (0.05 * top)) ** 2)),
        "quadratic": speed * np.abs(speed),
        "spring": rows.position,
    }[name]


def _confounded(names: tuple[str, ...]) -> str:
    """Say what looks alike in the logs, and what would tell it."""
    if "coulomb" not in names:
        return (
            "Coulomb friction and a constant load cannot be told apart: nothing reverses; a motion "
            "in both directions separates them"
        )
    return (
        "a constant load and a difference of friction by direction look alike: 'offset' holds "
        "both; the same motion under another known load, or with the axis turned over, separates "
        "them"
    )


def _predicted(item: InverseRows, regression: Regression) -> Floats:
    """Return the effort that the motion needs; rows are linearised where some of it is lost."""
    names = tuple(name for name in regression.names if name != LOSS)
    return np.asarray(_chosen(item, names) @ regression.value[: len(names)])


def _residuals(rows: Sequence[InverseRows], regression: Regression) -> dict[str, Floats]:
    """Return what a page draws of each log, every so many samples."""
    out = {}
    for item in rows:
        table = np.column_stack(
            [item.time, item.position, item.speed, item.effort, _predicted(item, regression)]
        )
        out[item.name] = table[:: max(1, len(table) // DRAWN)]
    return out


def _friction_curve(rows: Sequence[InverseRows], regression: Regression, bins: int = 24) -> Floats:
    """Return the effort less what inertia and constant load take, by bins of speed."""
    speed = np.concatenate([item.speed for item in rows])
    inertia = regression.names.index("inertia")
    offset = regression["offset"] if "coulomb" in regression.names else 0.0
    friction = np.concatenate(
        [
            item.effort
            - regression.value[inertia] * item.columns[:, 0]
            - offset * item.columns[:, 3]
            for item in rows
        ]
    )
    edges = np.unique(np.quantile(speed, np.linspace(0.0, 1.0, bins + 1)))
    place = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, len(edges) - 2)
    out = []
    for k in range(len(edges) - 1):
        part = friction[place == k]
        if len(part) > 2:
            out.append(
                [speed[place == k].mean(), part.mean(), part.std() / len(part) ** 0.5, len(part)]
            )
    return np.array(out).reshape(-1, 4)
