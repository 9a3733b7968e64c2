"""Numbers of what a log shows by its roles: levels, regressions, events, features.

The same code reads a log and a run of the model, so nothing has to be unbiased. A number has a
kind, which says how well it repeats.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.engine.table import Feature, FeatureTable

if TYPE_CHECKING:
    from elevon.features.records import FeatureRecord


_OVER = 4  # samples of the model to one of the log, which are averaged: loggers filter, too
_NORMAL = 1.4826  # deviation over the median of the size, of Gaussian noise


def smoothed(values: Floats, width: int) -> Floats:
    """Return the means over `width` samples about each, mirrored at the ends."""
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="reflect")
    return np.convolve(padded, np.ones(width) / width, "valid")


def noise_deviation(values: Floats) -> float:
    """Return the deviation of what changes from sample to sample, by second differences."""
    return float(_NORMAL * np.median(np.abs(np.diff(values, 2))) / np.sqrt(6.0))


def lines(time: Floats, values: Floats, most: float) -> tuple[Floats, Floats]:
    """Return straight lines that miss no sample by more than `most` (Douglas and Peucker)."""
    corners = {0, len(time) - 1}
    open_parts = [(0, len(time) - 1)]
    while open_parts:
        first, last = open_parts.pop()
        if last - first < 2:
            continue
        inner = slice(first + 1, last)
        line = np.interp(time[inner], time[[first, last]], values[[first, last]])
        off = np.abs(values[inner] - line)
        worst = int(np.argmax(off))
        if off[worst] > most:
            middle = first + 1 + worst
            corners.add(middle)
            open_parts += [(first, middle), (middle, last)]
    at = np.array(sorted(corners))
    return time[at], values[at]


def averaged(values: Floats, over: int) -> Floats:
    """Return the means over `over` steps, an even number, about each sample but the ends."""
    if over == 1 or len(values) < 2 * over:
        return values
    half = over // 2
    total = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]))))
    out = values.copy()
    out[half:-half] = (total[over:] - total[:-over]) / over
    return out


def oversampling(rate: float, step: float) -> int:
    """Samples of the model to one of a log, an even number as far as its steps allow it."""
    steps = round(1.0 / (rate * step))
    return next((n for n in (_OVER, 2) if steps % n == 0), 1)


_FAMILIES = ("level", "friction", "transmission", "orders", "bands")
#: What levels say already, and what a single moment decides.
_LEFT_OUT = ("mean", "kurtosis", "peak", "moving")
_AGAIN = 16  # times that they are read with noise added


class CatalogueValue(NamedTuple):
    """A feature of a log, and its deviation by the channels' noise."""

    record: FeatureRecord
    value: float
    noise: float


def catalogue_values(
    channels: Mapping[str, Floats],
    rate: float,
    pole_pairs: float | None,
    noise: Mapping[str, float],
) -> list[CatalogueValue]:
    """Return the features.

    Parameters
    ----------
    channels : mapping of str to ndarray, shape (n,)
        Role to values; no states.
    rate : float
        Of the log [Hz].
    pole_pairs : float or None
        Of the motor, for orders of the electrical turn.
    noise : mapping of str to float
        Role to the deviation of its noise; none: it is not asked for.
    """
    from elevon import _core
    from elevon.features.plan import core_plan
    from elevon.features.records import wanted_records

    every = wanted_records(["all"], {r: r for r in channels}, rate, "features")[0]
    records = [
        r
        for r in every
        if r.family in _FAMILIES
        and not any(word in r.name.split("_") for word in _LEFT_OUT)
        and not (r.name.endswith("_rms") and not r.name.startswith("tracking"))
        and ("electrical" not in r.name or pole_pairs is not None)
    ]
    roles = sorted({role for r in records for role in r.roles})
    if not records:
        return []
    plan = core_plan([r.name for r in records], roles, rate=rate, pole_pairs=pole_pairs or 1.0)

    def read(columns: list[Floats]) -> Floats:
        return np.asarray(_core.features(plan, columns), dtype=np.float64)

    columns = [np.ascontiguousarray(channels[role]) for role in roles]
    values, deviations = read(columns), np.zeros(len(records))
    if noise:  # orders and bands know no sum of their noise: the log with as much noise again
        rng, sizes = np.random.default_rng(15), [noise.get(role, 0.0) for role in roles]
        more = [[s * rng.standard_normal(len(columns[0])) for s in sizes] for _ in range(_AGAIN)]
        rows = [read([x + n for x, n in zip(columns, each, strict=True)]) for each in more]
        deviations = np.std(np.where(np.isfinite(rows), rows, values), axis=0, ddof=1)
    rows_of = zip(records, values.tolist(), deviations.tolist(), strict=True)
    return [CatalogueValue(*row) for row in rows_of]


_APART = 0.4  # of a regressor that those before it do not make up
_BLOCKS = 12  # of a log, whose residuals count as independent of each other


class Slope(NamedTuple):
    """One slope.

    Attributes
    ----------
    value : float
        By least squares.
    size : float
        What it would be if y were of this column alone.
    noise : float
        Its deviation by what of the residual changes from sample to sample.
    misfit : float
        Its deviation by the residual as it stands, correlated within blocks of the log: a column
        that moves little on a day leaves its slope to what the columns do not explain.
    """

    value: float
    size: float
    noise: float = 0.0
    misfit: float = 0.0


def slopes(y: Floats, columns: Mapping[str, Floats], *, doubted: bool = False) -> dict[str, Slope]:
    """Return slopes of y, shape (n,), by least squares; with their deviations where `doubted`.

    Columns count in their order: one that those before it nearly make up is left out, since its
    slope would be chance.
    """
    names: list[str] = []
    basis: list[Floats] = []
    for name, x in columns.items():
        residual = x - sum((q * float(q @ x) for q in basis), np.zeros(len(x)))
        size = float(np.linalg.norm(residual))
        if size > _APART * float(np.linalg.norm(x)):
            names.append(name)
            basis.append(residual / size)
    if not names or len(y) < 4 * (len(names) + 1):
        return {}
    design = np.column_stack([columns[n] for n in names])
    norms = np.sqrt(np.mean(design**2, axis=0))
    scaled = design / norms
    values = np.linalg.lstsq(scaled, y, rcond=None)[0]
    errors = _errors(scaled, y - scaled @ values) if doubted else np.zeros((len(names), 2))
    sizes = float(np.sqrt(np.mean(y**2))) / norms
    rows = np.column_stack([values / norms, sizes, errors / norms[:, None]]).tolist()
    return {name: Slope(*row) for name, row in zip(names, rows, strict=True)}


def _errors(design: Floats, residual: Floats) -> Floats:
    """Deviations of slopes by noise, and by residuals correlated within blocks, shape (k, 2).

    The second is the covariance of a regression with clustered residuals (Liang and Zeger, 1986).
    """
    inverse = np.linalg.pinv(design.T @ design)
    noise = noise_deviation(residual) * np.sqrt(np.maximum(np.diag(inverse), 0.0))
    blocks = np.array_split(np.arange(len(residual)), _BLOCKS)
    pulls = np.array([residual[b] @ design[b] for b in blocks]) @ inverse
    return np.column_stack([noise, np.sqrt(np.sum(pulls**2, axis=0))])


_SLOW = 100.0  # Hz of the means that levels and regressions are made of
_PARTS = 6  # of a motion one way: what happens when
_BOTH = 0.1  # share of the time in each direction from which on a motion goes both ways
_MOVING = 0.2  # of the speed's size (95 %)
_FULL = 0.95  # of the largest set point: above it a loop is at its limit
_FEW = 24  # changes of a state whose instants count; more come from a fault
_DIGITAL = ("state", "switch", "hall", "brake_released", "locked", "fault_code")
_TEMPERATURES = ("temperature", "surface_temperature", "nut_temperature", "drive_temperature")
_TRAVEL = 0.02  # of the position's RMS: size of a lost motion where there is none


class _Kind(NamedTuple):
    """How well a number repeats, ASSUMED.

    Attributes
    ----------
    share, absolute : float
        Least deviation from day to day, of the number's size and in its unit.
    mismatch : float
        How far a healthy unit may deviate from the reduced-order model, over that, from logs of the
        switching model: what compliance and current loops do, the reduced-order model lacks.
    least : float
        Of its channel's size, the least size: below it nothing repeats.
    misfit : float
        Of a slope's deviation by its residual, the part that differs from log to log.
    """

    share: float
    absolute: float = 0.0
    mismatch: float = 10.0
    least: float = 0.0
    misfit: float = 0.0


#: Least deviations, beside what drawn days of the model show: counts, clocks, what the model has
#: not: amplifiers and sensors of ordinary class, filters, a control unit's millisecond.
_KINDS: Mapping[str, _Kind] = {
    "level": _Kind(0.01, least=0.1),
    "slope": _Kind(0.01, mismatch=30.0, least=0.1, misfit=1.0),
    "gain": _Kind(0.01),
    "offset": _Kind(0.02, mismatch=50.0, least=0.5),
    "small": _Kind(0.02, mismatch=100.0, least=0.1),
    "ripple": _Kind(0.05, mismatch=60.0, least=0.04, misfit=1.0),
    "band": _Kind(0.10, mismatch=30.0, least=0.02),
    "instant": _Kind(0.005, 0.01),
    "count": _Kind(0.0, 0.25, mismatch=3.0),
    "end": _Kind(0.0, 0.1, mismatch=3.0),
    "rise": _Kind(0.05, 0.5),
}
#: Of what a fault does to one number: the reduced-order model shows sizes, not waveforms.
_ERROR = 0.15


@dataclass(frozen=True)
class Numbers:
    """Numbers of one log.

    Attributes
    ----------
    values : mapping of str to float
        By name.
    kinds : mapping of str to str
        Name to kind: how well it repeats.
    sizes : mapping of str to float
        Name to the size of what it is measured in: a channel's RMS, a slope's own part of it.
    units : mapping of str to str
        Name to unit.
    noise : mapping of str to float
        Name to its deviation by what is in this log alone: noise, a slope's misfit.
    """

    values: dict[str, float]
    kinds: dict[str, str]
    sizes: dict[str, float]
    units: dict[str, str]
    noise: dict[str, float]

    def add(
        self, name: str, value: float, kind: str, *, size: float = 0.0, unit: str = "",
        noise: float = 0.0,
    ) -> None:  # fmt: skip
        """Keep a number that is finite."""
        if np.isfinite(value):
            self.noise[name] = float(noise)
            self.values[name] = float(value)
            self.kinds[name] = kind
            self.sizes[name] = float(size)
            self.units[name] = unit

    def add_slope(self, name: str, slope: Slope, kind: str, share: float, unit: str) -> None:
        """Keep a slope, of a size that is a share of its own part."""
        noise = float(np.hypot(slope.noise, _KINDS[kind].misfit * slope.misfit))
        self.add(name, slope.value, kind, size=share * slope.size, unit=unit, noise=noise)

    def table(self) -> FeatureTable:
        """Return the records of the numbers."""
        return {name: self._record(name) for name in self.values}

    def _record(self, name: str) -> Feature:
        kind = _KINDS[self.kinds[name]]
        repeats = (kind.share, kind.absolute)
        off = (kind.mismatch * kind.share, kind.mismatch * kind.absolute)
        least = kind.least * self.sizes[name]
        return Feature(name, self.units[name], "", repeats, off, _ERROR, least=least)


@dataclass(frozen=True)
class _Slow:
    """Means of a log over hundredths of a second; `noise` is that of the channels as logged."""

    time: Floats
    channels: Mapping[str, Floats]
    command: Floats
    speed: Floats | None
    forward: npt.NDArray[np.bool_]
    backward: npt.NDArray[np.bool_]
    units: Mapping[str, str]
    noise: Mapping[str, float]
    size: float = 1.0

    @property
    def doubted(self) -> bool:
        """Whether deviations are wanted."""
        return bool(self.noise)

    @property
    def both(self) -> bool:
        """Whether the motion goes both ways."""
        return bool(min(self.forward.mean(), self.backward.mean()) > _BOTH)

    def weights(self, way: float) -> Floats:
        """Return weights of a mean where the motion goes one way.

        They grow with the speed about the threshold, so that no single sample decides.
        """
        assert self.speed is not None
        weights = np.clip(way * self.speed / self.size - 0.5, 0.0, 1.0)
        return np.asarray(weights / weights.sum(), dtype=np.float64)


def numbers_of(
    channels: Mapping[str, Floats],
    command: Floats,
    time: Floats,
    units: Mapping[str, str],
    pole_pairs: float | None,
    *,
    noisy: bool = False,
) -> Numbers:
    """Return the numbers of a log, or of a model run on its instants.

    Parameters
    ----------
    channels : mapping of str to ndarray, shape (n,)
        Role to values.
    command, time : ndarray, shape (n,)
        What was commanded; s from the onset.
    units : mapping of str to str
        Role to unit.
    pole_pairs : float or None
        Of the motor, for orders of the electrical turn.
    noisy : bool
        Whether each number's deviation by what is in the log alone is wanted. What of a channel
        changes from sample to sample counts as its noise; ripple faster than the log's clock is
        among it, and repeats as little.
    """
    out = Numbers({}, {}, {}, {}, {})
    noise = _noise_of(channels, units) if noisy else {}
    slow = _slowed(channels, command, time, units, noise)
    analog = [r for r in channels if units[r] != "1" and not r.startswith(_DIGITAL)]
    for role in channels:
        if role in _TEMPERATURES:
            _rise(out, role, channels[role], noise.get(role, 0.0))
        elif role in analog:
            if role != "motor_position":  # no log says where its zero is
                _levels(out, role, slow, len(time) // len(slow.time))
        else:
            _events(out, role, channels[role], time)
    _current(out, slow)
    _voltage(out, slow)
    _loops(out, channels, slow)
    _ratios(out, slow)
    served = {r: v for r, v in channels.items() if units[r] != "1"}
    if units["command"] == units.get("output_position"):
        served["command"] = command
    _features(out, served, 1.0 / float(time[1] - time[0]), pole_pairs, slow)
    return out


def _noise_of(channels: Mapping[str, Floats], units: Mapping[str, str]) -> dict[str, float]:
    seen = {role: x for role, x in channels.items() if units[role] != "1" and len(x) > 3}
    return {role: noise_deviation(x) for role, x in seen.items()}


def _slowed(
    channels: Mapping[str, Floats],
    command: Floats,
    time: Floats,
    units: Mapping[str, str],
    noise: Mapping[str, float],
) -> _Slow:
    step = max(1, round(1.0 / (_SLOW * (time[1] - time[0]))))
    count = len(time) // step * step

    def mean(values: Floats) -> Floats:
        return np.asarray(values[:count].reshape(-1, step).mean(axis=1), dtype=np.float64)

    clock = mean(time)
    channels = {role: mean(v) for role, v in channels.items() if units[role] != "1"}
    speed = channels.get("motor_speed", channels.get("output_speed"))
    if speed is None and "output_position" in channels:
        speed = np.gradient(channels["output_position"], clock)
    if speed is None:
        none = np.zeros(len(clock), dtype=np.bool_)
        return _Slow(clock, channels, mean(command), None, none, none, units, noise)
    size = _MOVING * float(np.quantile(np.abs(speed), 0.95))
    ways = (speed > size, speed < -size)
    return _Slow(clock, channels, mean(command), speed, *ways, units, noise, size)


def _levels(out: Numbers, role: str, slow: _Slow, step: int) -> None:
    """Means by direction; of a motion one way, by its parts. Each is of `step` samples."""
    values, noise = slow.channels[role], slow.noise.get(role, 0.0) / np.sqrt(step)
    size = float(np.sqrt(np.mean(values**2)))

    def add(name: str, value: float, count: float) -> None:
        deviation = noise / np.sqrt(count)
        out.add(
            f"{role}: {name}", value, "level", size=size, unit=slow.units[role], noise=deviation
        )

    add("rms", size, len(values))
    if slow.both:
        for name, way in (("forwards", 1.0), ("backwards", -1.0)):
            weights = slow.weights(way)
            add(f"mean {name}", float(weights @ values), 1.0 / float(weights @ weights))
    else:
        for k, part in enumerate(np.array_split(values, _PARTS)):
            add(f"mean of part {k + 1}", part.mean(), len(part))
        last = values[-max(len(values) // 50, 1) :]
        add("last", last.mean(), len(last))


def _rise(out: Numbers, role: str, values: Floats, noise: float) -> None:
    part = max(len(values) // 50, 1)
    rise = values[-part:].mean() - values[:part].mean()
    out.add(f"{role}: rise", float(rise), "rise", unit="K", noise=noise * np.sqrt(2.0 / part))


def _events(out: Numbers, role: str, values: Floats, time: Floats) -> None:
    """How often a state changes, when last, what it is at the end; of one that ticks its mean."""
    turns = np.flatnonzero(np.diff(np.rint(values))) + 1
    out.add(f"{role}: changes", float(min(len(turns), _FEW)), "count")
    out.add(f"{role}: at the end", float(np.rint(values[-1])), "end")
    if len(turns) > _FEW:
        out.add(f"{role}: mean", float(np.mean(values)), "end")
    last = float(time[turns[-1]] if len(turns) else time[-1])
    out.add(f"{role}: last change", last, "instant", unit="s")


def _current(out: Numbers, slow: _Slow) -> None:
    """Current by direction, speed and acceleration."""
    if "torque_current" not in slow.channels or slow.speed is None:
        return
    moving = slow.forward | slow.backward
    columns = {"dry": np.sign(slow.speed)} if slow.both else {}
    columns |= {
        "constant": np.ones(len(slow.time)),
        "acceleration": np.gradient(slow.speed, slow.time),
        "speed": slow.speed,
    }
    current = slow.channels["torque_current"][moving]
    columns = {n: x[moving] for n, x in columns.items()}
    for name, slope in slopes(current, columns, doubted=slow.doubted).items():
        kind = "offset" if name == "constant" else "slope"
        out.add_slope(f"torque_current: by {name}", slope, kind, 1.0, "A")


def _voltage(out: Numbers, slow: _Slow) -> None:
    """Voltage by speed and current; the link's voltage by the current that is drawn."""
    channels = slow.channels
    moving = slow.forward | slow.backward
    if slow.speed is not None and {"torque_voltage", "torque_current"} <= channels.keys():
        columns = {"speed": slow.speed[moving], "current": channels["torque_current"][moving]}
        voltage = channels["torque_voltage"][moving]
        for name, slope in slopes(voltage, columns, doubted=slow.doubted).items():
            out.add_slope(f"torque_voltage: by {name}", slope, "slope", 0.2, "V")
    if {"supply_voltage", "supply_current"} <= channels.keys():
        columns = {"constant": np.ones(len(slow.time)), "current": channels["supply_current"]}
        voltage = channels["supply_voltage"]
        for name, slope in slopes(voltage, columns, doubted=slow.doubted).items():
            out.add_slope(f"supply_voltage: by {name}", slope, "gain", 0.02, "V")


def _loops(out: Numbers, channels: Mapping[str, Floats], slow: _Slow) -> None:
    """Gain of the position loop (set point by error) and of the speed loop (steps of both)."""
    channels = slow.channels
    if {"speed_ref", "output_position"} <= channels.keys() and np.ptp(channels["speed_ref"]) > 0.0:
        ref = channels["speed_ref"]
        free = np.abs(ref) < _FULL * np.abs(ref).max()
        error = slow.command - channels["output_position"]
        # The error by the set point: noise of the position is in the error.
        columns = {"set point": ref[free], "constant": np.ones(int(free.sum()))}
        for name, slope in slopes(error[free], columns, doubted=slow.doubted).items():
            kind = "gain" if name == "set point" else "offset"
            out.add_slope(f"position error: by {name}", slope, kind, 1.0, "s")
    target = "current_ref" if "current_ref" in channels else "torque_current"
    if {"speed_ref", "motor_speed", target} <= channels.keys():
        error = channels["speed_ref"] - channels["motor_speed"]
        columns = {"step": np.diff(error), "error": error[1:]}
        fitted = slopes(np.diff(channels[target]), columns, doubted=slow.doubted)
        if "step" in fitted:
            name = f"{target}: by step of speed error"
            out.add_slope(name, fitted["step"], "ripple", 0.2, "A s/rad")


def _ratios(out: Numbers, slow: _Slow) -> None:
    """Measured speed over the change of the measured position: gains of sensors."""
    channels = slow.channels
    pairs = (("motor_speed", "motor_position"), ("motor_position", "output_position"))
    moving = slow.forward | slow.backward
    for one, other in pairs:
        if one not in channels or other not in channels or not moving.any():
            continue
        y = channels[one] if one == "motor_speed" else np.gradient(channels[one], slow.time)
        x = np.gradient(channels[other], slow.time)
        if np.ptp(x[moving]) > 0.0:
            fitted = slopes(y[moving], {"rate": x[moving]}, doubted=slow.doubted)
            for slope in fitted.values():
                out.add_slope(f"{one}: by {other}", slope, "gain", 0.1, "")


def _features(
    out: Numbers, served: Mapping[str, Floats], rate: float, pole_pairs: float | None, slow: _Slow
) -> None:
    """Features of the catalogue, as far as the roles allow them."""
    for record, value, noise in catalogue_values(served, rate, pole_pairs, slow.noise):
        kind = {"orders": "ripple", "bands": "band"}.get(record.family, "level")
        kind = "offset" if record.name == "load_current" else kind
        if record.name == "lost_motion" or record.name.startswith("tracking"):
            kind = "small" if kind == "level" else kind
        size = _channel_size(record.name, record.family, served)
        out.add(record.name, value, kind, size=size, unit=record.unit_of(slow.units), noise=noise)


def _channel_size(name: str, family: str, served: Mapping[str, Floats]) -> float:
    """RMS of the channel that a feature is read from; of a lost motion a part of the amplitude."""
    main = {"friction": "torque_current", "transmission": "output_position"}.get(family)
    main = main or next((role for role in served if name.startswith(role)), None)
    if main is None or name in ("friction_loop_area", "transmission_slope"):
        return 0.0
    share = _TRAVEL if family == "transmission" else 1.0
    return share * float(np.sqrt(np.mean(served[main] ** 2)))
