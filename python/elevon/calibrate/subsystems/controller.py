"""The controller from command, measured motion and measured effort: by regression, no simulation.

A linear law of command and motion is linear in its gains. The speed that the drive computes from
its position (difference of two samples, difference of their means, a first-order filter behind it,
or a measured one) and its delay are found first, under the richest structure; then the simplest
structure is taken that predicts samples held out of its regression as well as the best.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from elevon.arrays import Bools, Floats, Ints
from elevon.calibrate.subsystems.signals import DriveSignals
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression, with_deviations

EXPLAINED = 0.90  # of the effort's variance, on data held out: below it is no controller
EXACT = (
    0.9995  # the law itself, sample by sample. ASSUMED: a hundredth of what a bench's noise leaves
)
SIMPLER = 1.10  # of the least variance left: as good. ASSUMED
FOLDS = 10  # alternating stretches, fitted and predicted in turn
DELAYS = (0, 1, 2, 3)  # samples
LAGS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # samples: time constants of a filtered speed
SATURATED_SAMPLES = 3  # samples at one value: a limit
LESS = 0.9  # of the variance left: a logged load that brings as much acts on the output. ASSUMED
SEEN = 4.0  # deviations of its gain
FINER = 10  # blocks of the covariance a stretch
_NEAR = 1e-3  # of the largest effort: at the limit
_LIMIT_MARGIN = 5  # samples beside a limit that do not count

#: The structures by their terms: what a position controller or a speed controller may be.
POSITION_LAWS: Mapping[str, tuple[str, ...]] = {
    "P": ("error",),
    "PI": ("error", "integral"),
    "PD": ("error", "derivative"),
    "P-P": ("error", "speed"),
    "PID": ("error", "integral", "derivative"),
    "PI-D": ("error", "integral", "speed"),
    "P-PI": ("error", "speed", "integral", "travel"),
    "PI-PI": ("error", "speed", "integral", "travel", "double"),
}
SPEED_LAWS: Mapping[str, tuple[str, ...]] = {
    "P": ("error",), "PI": ("error", "integral"), "PID": ("error", "integral", "derivative"),
}  # fmt: skip
FORWARD: tuple[tuple[str, ...], ...] = (
    (), ("speed_ahead",), ("speed_ahead", "acceleration_ahead"),
)  # fmt: skip


@dataclass(frozen=True)
class SpeedEstimate:
    """How a drive computes its speed: ``difference``, ``mean``, ``filtered`` or ``measured``."""

    kind: str
    lag: float = 0.0

    def of(self, drive: DriveSignals) -> Floats | None:
        """Return the speed at each sample of a log."""
        if self.kind == "measured":
            return drive.speed
        if drive.position is None:
            return None
        place, period = drive.position, drive.period
        step = np.diff(place, prepend=place[0]) / period
        if self.kind == "mean":
            return np.asarray(0.5 * (step + np.concatenate(([0.0], step[:-1]))))
        if self.kind == "filtered":
            from scipy.signal import lfilter

            keep = float(np.exp(-1.0 / self.lag))
            return np.asarray(lfilter([1.0 - keep], [1.0, -keep], step))
        return np.asarray(step)

    @property
    def text(self) -> str:
        """In words."""
        return {
            "difference": "difference of two samples",
            "mean": "difference of the mean of two samples",
            "measured": "as measured",
            "filtered": f"difference behind a filter of {self.lag:g} samples",
        }[self.kind]


SPEEDS = (
    SpeedEstimate("difference"), SpeedEstimate("mean"), SpeedEstimate("measured"),
    *(SpeedEstimate("filtered", lag) for lag in LAGS),
)  # fmt: skip


@dataclass(frozen=True)
class Controller:
    """A law that predicts the effort.

    Attributes
    ----------
    structure : str
        ``P-P``, ``PID``, ...; ``direct`` where the effort itself was commanded.
    of : str
        ``position``, ``speed`` or ``effort``: what is commanded.
    terms : tuple of str
        Of the regression, without constants.
    regression : Regression
        Of effort per term.
    speed : SpeedEstimate
        How the drive computes it.
    delay : int
        Samples.
    period : float
        s.
    limit : float or None
        Of the effort, where it was reached.
    held_out : float
        Share of the effort's variance explained on samples held out.
    disturbance : Estimate or None
        Effort a unit of the logged load that is added to the controller's output.
    tried : mapping of str to float
        Structure to `held_out`.
    """

    structure: str
    of: str
    terms: tuple[str, ...]
    regression: Regression
    speed: SpeedEstimate
    delay: int
    period: float
    limit: float | None
    held_out: float
    disturbance: Estimate | None = None
    tried: Mapping[str, float] = field(default_factory=dict)

    @property
    def identified(self) -> bool:
        """Whether it explains enough."""
        return self.held_out >= EXPLAINED

    @property
    def exact(self) -> bool:
        """Whether it is the law itself, sample by sample."""
        return self.held_out >= EXACT

    def gains(self) -> dict[str, Estimate]:
        """Return the gains by name: of the cascade where it is one, motor's coordinate."""
        result = self.regression
        if self.of == "effort":
            return {"gain": result.estimate("command")}
        out = {}
        place = {name: k for k, name in enumerate(result.names)}
        if self.of == "position" and "speed" in self.terms:
            out["position_gain"] = result.of(lambda b: b[place["error"]] / b[place["speed"]])
            out["speed_gain"] = result.estimate("speed")
            if "travel" in self.terms:
                out["integral_time"] = result.of(lambda b: b[place["speed"]] / b[place["travel"]])
            elif "integral" in self.terms:
                out["integral_gain"] = result.estimate("integral")
            if "speed_ahead" in self.terms:
                out["speed_feedforward"] = result.of(
                    lambda b: b[place["speed_ahead"]] / b[place["speed"]]
                )
        else:
            out["gain"] = result.estimate("error")
            if "integral" in self.terms:
                out["integral_time"] = result.of(lambda b: b[place["error"]] / b[place["integral"]])
            if "derivative" in self.terms:
                out["derivative_time"] = result.of(
                    lambda b: b[place["derivative"]] / b[place["error"]]
                )
            if "speed_ahead" in self.terms:
                out["speed_feedforward"] = result.estimate("speed_ahead")
        if "acceleration_ahead" in self.terms:
            out["acceleration_feedforward"] = result.estimate("acceleration_ahead")
        return out


def identify_controller(drives: Sequence[DriveSignals]) -> tuple[Controller | None, str]:
    """Return the law of logs and, where there is none to look for, why.

    The best law found is returned even where it explains too little: see `Controller.identified`.
    """
    direct = [d for d in drives if d.effort_ref is not None]
    tried: list[Controller] = []
    if len(direct) == len(drives):
        tried += _direct(drives)
    if all(d.command is not None and d.position is not None for d in drives):
        tried.append(_law(drives, "position", POSITION_LAWS))
    elif all(d.speed_ref is not None for d in drives):
        tried.append(_law(drives, "speed", SPEED_LAWS))
    if not tried:
        return None, "no command was logged that could explain the effort"
    return max(tried, key=lambda item: item.held_out), ""


def _direct(drives: Sequence[DriveSignals]) -> list[Controller]:
    """Return the law of a commanded effort, for the delay that suits best."""
    limit, out = _limit(drives), []
    for delay in DELAYS:
        each = [{"command": _late(d.effort_ref, delay)} for d in drives if d.effort_ref is not None]
        normal = _Normal.of(drives, each, limit)
        out.append((normal.held_out(("command",)), delay, normal))
    share, delay, normal = max(out, key=lambda item: item[0])
    result = normal.regression(("command",))
    period = drives[0].period
    return [
        Controller("direct", "effort", ("command",), result, SPEEDS[2], delay, period, limit, share)
    ]


def _law(
    drives: Sequence[DriveSignals], of: str, laws: Mapping[str, tuple[str, ...]]
) -> Controller:
    """Return the simplest law that predicts as well as the best."""
    limit = _limit(drives)
    rich = tuple(dict.fromkeys(term for terms in laws.values() for term in terms))
    rich = (*rich, *(FORWARD[-1] if of == "position" else ()))
    load = ("load",) if all(d.load is not None for d in drives) else ()
    best: tuple[float, SpeedEstimate, int, _Normal] | None = None
    for speed in SPEEDS:
        if any(speed.of(d) is None for d in drives):
            continue
        columns = [_columns(d, of, speed) for d in drives]
        for delay in DELAYS:
            late = [
                {name: v if name == "load" else _late(v, delay) for name, v in each.items()}
                for each in columns
            ]
            normal = _Normal.of(drives, late, limit)
            share = normal.held_out((*rich, *load))
            if best is None or share > best[0]:
                best = share, speed, delay, normal
    assert best is not None
    _, speed, delay, normal = best
    if load and not _adds(normal, rich):
        load = ()
    result = []
    for forward in FORWARD if of == "position" else ((),):
        for name, terms in laws.items():
            every = (*terms, *forward, *load)
            label = name + (" + feed-forward" if forward else "")
            result.append((len(every), normal.held_out(every), label, name, (*terms, *forward)))
    least = min(1.0 - item[1] for item in result)
    good = [item for item in result if 1.0 - item[1] <= SIMPLER * least]
    _, share, _, name, terms = min(good, key=lambda item: (item[0], -item[1]))
    regression = normal.regression((*terms, *load))
    tried: dict[str, float] = {}
    for _, share, label, *_ in result:
        tried[label] = max(share, tried.get(label, -np.inf))
    return Controller(
        name, of, terms, regression, speed, delay, drives[0].period, limit, share,
        regression.estimate("load") if load else None, tried,
    )  # fmt: skip


def load_gain(drive: DriveSignals) -> float | None:
    """Return the effort that a unit of the logged load adds to a controller's output, if it does.

    The law of the log itself tells it from what else moves the effort.
    """
    if drive.load is None or drive.command is None or drive.position is None:
        return None
    result, _ = identify_controller([drive])
    if result is None or result.disturbance is None or not result.exact:
        return None
    return result.disturbance.value


def _adds(normal: _Normal, terms: tuple[str, ...]) -> bool:
    """Return whether a unit of the logged load adds to the controller's output."""
    without, with_load = normal.held_out(terms), normal.held_out((*terms, "load"))
    item = normal.regression((*terms, "load")).estimate("load")
    return 1.0 - with_load < LESS * (1.0 - without) and abs(item.value) > SEEN * item.std


def _columns(drive: DriveSignals, of: str, speed: SpeedEstimate) -> dict[str, Floats]:
    """Return the terms of a law at each sample."""
    moves, period = speed.of(drive), drive.period
    assert moves is not None
    load = {} if drive.load is None else {"load": drive.load}
    if of == "speed":
        assert drive.speed_ref is not None
        error = drive.speed_ref - moves
        return load | {
            "error": error, "integral": np.cumsum(error) * period,
            "derivative": np.diff(error, prepend=error[0]) / period,
        }  # fmt: skip
    assert drive.command is not None
    assert drive.position is not None
    error = drive.command - drive.position
    integral = np.cumsum(error) * period
    ahead = np.diff(drive.command, prepend=drive.command[0]) / period
    return load | {
        "error": error, "integral": integral, "speed": -moves,
        "derivative": np.diff(error, prepend=error[0]) / period,
        "travel": -(drive.position - drive.position[0]), "double": np.cumsum(integral) * period,
        "speed_ahead": ahead, "acceleration_ahead": np.diff(ahead, prepend=ahead[0]) / period,
    }  # fmt: skip


def _late(values: Floats, delay: int) -> Floats:
    return values if delay == 0 else np.concatenate((np.full(delay, values[0]), values[:-delay]))


def _limit(drives: Sequence[DriveSignals]) -> float | None:
    """Return the effort that was share as the largest; None where none was."""
    top = max(float(np.abs(d.effort).max()) for d in drives)
    for drive in drives:
        at = np.abs(drive.effort) >= (1.0 - _NEAR) * top
        if (
            at.sum() >= SATURATED_SAMPLES
            and np.convolve(at, np.ones(SATURATED_SAMPLES), mode="valid").max() >= SATURATED_SAMPLES
        ):
            return top
    return None


def _free(drive: DriveSignals, limit: float | None) -> Bools:
    """Return the samples at which the law acts without a limit."""
    good = drive.good.copy()
    good[: 2 * max(DELAYS)] = False
    if limit is not None:
        at = np.abs(drive.effort) >= (1.0 - _NEAR) * limit
        good &= np.convolve(at, np.ones(2 * _LIMIT_MARGIN + 1), mode="same") < 0.5
    return good


@dataclass(frozen=True, eq=False)
class _Normal:
    """The terms of a law on the samples that count, and their products by stretches of time.

    Every structure is a choice of columns: its regression on half of the stretches and what it
    leaves on the others follow from the products alone.
    """

    names: tuple[str, ...]
    table: Floats  # shape (n, k): terms and constants of the logs, then the effort
    size: Floats  # norms of the columns
    block: Ints
    products: Floats  # shape (blocks, k, k), of the scaled columns

    @classmethod
    def of(
        cls,
        drives: Sequence[DriveSignals],
        columns: Sequence[Mapping[str, Floats]],
        limit: float | None,
    ) -> _Normal:
        terms, parts, blocks = tuple(columns[0]), [], []
        constants = tuple(f"constant_{k}" for k in range(len(drives)))
        for number, (drive, each) in enumerate(zip(drives, columns, strict=True)):
            good = _free(drive, limit)
            one = np.zeros((len(drive.time), len(drives)))
            one[:, number] = 1.0
            rows = np.column_stack([*each.values(), one, drive.effort])[good]
            parts.append(rows)
            at = np.linspace(0, FOLDS, len(rows), endpoint=False).astype(np.int64)
            blocks.append(at + number * FOLDS)
        table, block = np.vstack(parts), np.concatenate(blocks)
        size = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
        scaled = table / size
        edges = np.flatnonzero(np.diff(block, prepend=-1))
        stretches = np.split(scaled, edges[1:])
        products = np.array([piece.T @ piece for piece in stretches])
        return cls((*terms, *constants), table, size, block, products)

    def _places(self, terms: tuple[str, ...]) -> list[int]:
        constants = [k for k, name in enumerate(self.names) if name.startswith("constant_")]
        return [*(self.names.index(name) for name in terms), *constants]

    def held_out(self, terms: tuple[str, ...]) -> float:
        """Return the share of the effort's variance explained on stretches held out."""
        at, last, left = self._places(terms), len(self.names), 0.0
        for parity in (0, 1):
            fit = self.products[parity::2].sum(axis=0)
            others = self.products[1 - parity :: 2].sum(axis=0)
            gains = np.linalg.lstsq(fit[np.ix_(at, at)], fit[at, last], rcond=1e-13)[0]
            left += others[last, last] - 2.0 * gains @ others[at, last]
            left += gains @ others[np.ix_(at, at)] @ gains
        effort = self.table[:, last]
        spread = float(np.var(effort)) * len(effort) / self.size[last] ** 2
        return float(1.0 - max(left, 0.0) / spread) if spread > 0.0 else 0.0

    def regression(self, terms: tuple[str, ...]) -> Regression:
        """Return the gains on all samples."""
        at, last = self._places(terms), len(self.names)
        whole = self.products.sum(axis=0)
        value = np.linalg.lstsq(whole[np.ix_(at, at)], whole[at, last], rcond=1e-13)[0]
        value = value * self.size[last] / self.size[at]
        design = self.table[:, at]
        residual = self.table[:, last] - design @ value
        count = len(self.block)
        fine = np.arange(count) * max(len(self.products), 1) * FINER // max(count, 1)
        names = tuple(self.names[k] for k in at)
        weight = np.ones(count)
        return with_deviations(names, value, design, residual, weight, strokes=fine)


@dataclass(frozen=True)
class LawNumbers:
    """A law of position in numbers: what an actuator file keeps of it.

    Attributes
    ----------
    structure : str
        ``P-P``, ``PID``, ...
    gains : mapping of str to float
        Effort per term.
    constant : float
        Effort.
    speed : SpeedEstimate
        How the drive computes it.
    delay : int
        Samples.
    period : float
        s.
    limit : float or None
        Of the effort.
    """

    structure: str
    gains: Mapping[str, float]
    constant: float
    speed: SpeedEstimate
    delay: int
    period: float
    limit: float | None

    @classmethod
    def of(cls, item: Controller) -> LawNumbers:
        """Return the numbers of an identified controller."""
        names, values = item.regression.names, item.regression.value
        constants = [k for k, name in enumerate(names) if name.startswith("constant_")]
        gains = {name: item.regression[name] for name in names if not name.startswith("constant_")}
        return cls(
            item.structure, gains, float(np.mean(values[constants])), item.speed, item.delay,
            item.period, item.limit,
        )  # fmt: skip


class SampledLaw:
    """A controller of position, sample by sample: what it reads, and the effort it asks for.

    Parameters
    ----------
    numbers : LawNumbers
        The law.
    command : ndarray, shape (n,)
        rad.
    load : ndarray, optional
        What acts on the controller's output, as logged.
    """

    def __init__(self, numbers: LawNumbers, command: Floats, load: Floats | None = None) -> None:
        self.numbers, self.command, self.load = numbers, command, load
        self._steps: deque[float] = deque([0.0, 0.0], maxlen=2)
        self._waiting: deque[float] = deque(maxlen=numbers.delay + 1)
        self._last = self._first = np.nan
        self._error = self._integral = self._double = self._slow = 0.0

    def __call__(self, k: int, seen: Floats) -> float:
        """Return the effort at a sample, from position [rad] and speed [rad/s] there."""
        place, period, item = float(seen[0]), self.numbers.period, self.numbers
        if k == 0:
            self._last = self._first = place
            self._error = float(self.command[0]) - place
        step = (place - self._last) / period
        self._last = place
        self._steps.append(step)
        if item.speed.lag:
            keep = float(np.exp(-1.0 / item.speed.lag))
            self._slow = keep * self._slow + (1.0 - keep) * step
        speed = {
            "difference": step, "mean": 0.5 * (self._steps[0] + self._steps[1]),
            "filtered": self._slow, "measured": float(seen[1]),
        }[item.speed.kind]  # fmt: skip
        error = float(self.command[k]) - place
        change, self._error = (error - self._error) / period, error
        self._integral += error * period
        self._double += self._integral * period
        before, earlier = float(self.command[max(k - 1, 0)]), float(self.command[max(k - 2, 0)])
        ahead = (float(self.command[k]) - before) / period
        terms = {
            "error": error, "integral": self._integral, "speed": -speed, "derivative": change,
            "travel": self._first - place, "double": self._double, "speed_ahead": ahead,
            "acceleration_ahead": (ahead - (before - earlier) / period) / period, "load": 0.0,
        }  # fmt: skip
        effort = item.constant + sum(gain * terms[name] for name, gain in item.gains.items())
        if item.limit is not None:
            effort = min(max(effort, -item.limit), item.limit)
        self._waiting.append(effort)
        added = 0.0 if self.load is None else item.gains.get("load", 0.0) * float(self.load[k])
        return self._waiting[0] + added
