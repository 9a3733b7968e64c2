"""What a folder of the Cranfield data holds, named file by file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import ElevonError, FormatError, InputError, Interrupted, unknown
from elevon.logs.formats.cranfield import DATA_DOI, read_cranfield
from elevon.progress import Progress
from elevon.recording import Recording

CONDITIONS = (
    "normal", "backlash1", "backlash2", "lackLubrication1", "lackLubrication2",
    *(f"spalling{stage}" for stage in range(1, 9)),
)  # fmt: skip
FAMILIES = ("normal", "backlash", "lackLubrication", "spalling")
_PROFILE = "trap"


def family(condition: str) -> str:
    """Return the family of a condition: its name without the stage."""
    return condition.rstrip("0123456789")


@dataclass(frozen=True, slots=True)
class CranfieldData:
    """Features of every usable recording.

    Attributes
    ----------
    table : FeatureTable
        One row a recording.
    condition : array of str, (recordings,)
        Such as ``backlash1``.
    load : array, (recordings,)
        As the files state it [kgf]; the sign is its direction.
    run : array of int, (recordings,)
        Number of the recording within its condition and load.
    skipped : list of str
        What was left out, and why.
    """

    table: FeatureTable
    condition: npt.NDArray[np.str_]
    load: npt.NDArray[np.float64]
    run: npt.NDArray[np.int64]
    skipped: list[str]

    def present(self) -> list[dict[str, object]]:
        """Return the runs of each condition and load."""
        cells = sorted({(c, x) for c, x in zip(self.condition, self.load, strict=True)},
                       key=lambda cell: (CONDITIONS.index(cell[0]), cell[1]))  # fmt: skip
        return [
            {"condition": str(c), "load_kgf": float(x),
             "runs": sorted(self.run[(self.condition == c) & (self.load == x)].tolist())}
            for c, x in cells
        ]  # fmt: skip


def read_folder(folder: Path, *, progress: Progress | None = None) -> CranfieldData:
    """Read every condition of a folder.

    Parameters
    ----------
    folder : path
        Holds ``CONDITION.csv`` or ``CONDITION.csv.gz``; other files are named as skipped.
    progress : callable, optional
        As everywhere.

    Returns
    -------
    CranfieldData
        The trapezoidal recordings whose features exist.

    Raises
    ------
    InputError
        The folder is absent or holds no condition.
    FormatError
        A condition's file is damaged.
    """
    files, skipped = _files(folder)
    usable: list[tuple[Recording, FeatureTable]] = []
    for index, path in enumerate(files):
        usable += _usable(path, skipped)
        if progress is not None and not progress((index + 1) / len(files)):
            raise Interrupted("interrupted while reading")
    usable = _once(usable, skipped)
    if not usable:
        raise InputError(f"{folder}: no trapezoidal recording that can be used")
    meta = [recording.meta for recording, _ in usable]
    return CranfieldData(
        FeatureTable.joined([table for _, table in usable]),
        np.array([m["condition"] for m in meta]),
        np.array([float(m["load_kgf"]) for m in meta]),
        np.array([int(m["run"]) for m in meta]),
        skipped,
    )


def _files(folder: Path) -> tuple[list[Path], list[str]]:
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; the data are not part of this package, see doi {DATA_DOI}"
        )
    chosen: dict[str, Path] = {}
    skipped = []
    for path in sorted(folder.iterdir()):
        name = path.name.removesuffix(".gz").removesuffix(".csv")
        if not path.name.endswith((".csv", ".csv.gz")) or name not in CONDITIONS:
            skipped.append(f"{path.name}: not a table of one of the {len(CONDITIONS)} conditions")
        elif name in chosen:
            skipped.append(f"{path.name}: {chosen[name].name} holds the same condition")
        else:
            chosen[name] = path
    if not chosen:
        raise InputError(f"{folder}: holds none of {', '.join(CONDITIONS)} as .csv or .csv.gz")
    skipped += [f"{name}: absent" for name in CONDITIONS if name not in chosen]
    return [chosen[name] for name in CONDITIONS if name in chosen], skipped


def _usable(path: Path, skipped: list[str]) -> list[tuple[Recording, FeatureTable]]:
    usable = []
    for recording in read_cranfield(path):
        meta = recording.meta
        place = f"{path.name}, load {meta['load_kgf']:g}, run {meta['run']}"
        if meta["profile"] != _PROFILE:
            skipped.append(f"{place}: profile {meta['profile']!r}, not {_PROFILE!r}")
            continue
        try:
            table = feature_table([recording])
        except ElevonError as error:
            skipped.append(f"{place}: {error}")
        else:
            usable.append((recording, table))
    return usable


def _once(
    usable: list[tuple[Recording, FeatureTable]], skipped: list[str]
) -> list[tuple[Recording, FeatureTable]]:
    """Leave out a run that stands twice in a file: a copy in training would be a leak."""
    seen: set[tuple[object, ...]] = set()
    result = []
    for recording, table in usable:
        meta = recording.meta
        key = (meta["condition"], meta["load_kgf"], meta["run"])
        if key in seen:
            skipped.append(f"{key[0]}, load {key[1]:g}, run {key[2]}: a second part of this run")
            continue
        seen.add(key)
        result.append((recording, table))
    return result


LEAST_STROKE = 2.6
"""Shortest stroke that is used [s]: 1.6 s until the start has passed, then 1 s of steady motion."""
LEAST_HOLD = 2.4
"""Shortest rest that is used [s]: 1.4 s until the stop has passed, then 1 s of standstill."""
_STARTS = {"breakaway": (0.12, 0.28), "recovery_1": (0.28, 0.52), "recovery_2": (0.52, 0.88),
           "recovery_3": (0.88, 1.44)}  # fmt: skip
_STEADY, _BEFORE_STOP, _SETTLED, _BEFORE_START = 1.6, 0.08, 1.4, 0.04
_BANDS = {"drift": (0.3, 1.2), "slow": (1.2, 4.0), "screw": (4.0, 5.6), "fast": (5.6, 12.5)}
"""Of the ripple in steady motion [Hz]; the Cranfield screw turns at 4.8 Hz."""

FRICTION = ("breakaway_assisted", "breakaway_opposed", "recovery_assisted", "recovery_opposed")
"""Currents during the start above the steady one: what the load itself needs drops out."""
TRANSFER = (*FRICTION, "tracking_noise", "hold_noise", "tracking_slow", "tracking_screw",
            "current_slow", "current_screw")  # fmt: skip
"""What keeps its meaning from one load to another."""
MARKER = "hold_coupling"
"""Correlation of current and tracking error at standstill: tells sessions apart, no fault."""
_SAME_RATE = 0.02
_SIDES = ("assisted", "opposed")
_BOTH_WAYS = (
    "current", "slope", "breakaway", "recovery_1", "recovery_2", "recovery_3",
    "first_current", "peak_error", "noise_ratio",
    *(f"{signal}_{band}" for signal in ("tracking", "current") for band in _BANDS),
)  # fmt: skip
FULL = (
    *(f"{name}_{side}" for name in _BOTH_WAYS for side in _SIDES),
    "hold_current", "hold_noise", "hold_current_noise", "stop_current", "stop_error",
)  # fmt: skip
"""Everything, the level of the current included: for one load, where its level is known."""


@dataclass(frozen=True, slots=True)
class FeatureTable:
    """Features of many recordings.

    Attributes
    ----------
    names : tuple of str
        Of the columns.
    values : array, (recordings, features)
        Finite numbers.
    load : array, (recordings,)
        Mean load force of each recording, rounded to 1 N [N]; zero where none was recorded.
    rate : float
        Sample rate that all recordings share [Hz].
    """

    names: tuple[str, ...]
    values: Floats
    load: Floats
    rate: float

    def select(self, names: Sequence[str]) -> Floats:
        """Return the columns of some features; an unknown name is an error."""
        for name in names:
            if name not in self.names:
                raise unknown("feature", name, self.names)
        return self.values[:, [self.names.index(name) for name in names]]

    @classmethod
    def joined(cls, tables: Sequence[FeatureTable]) -> FeatureTable:
        """Put tables one below the other.

        Raises
        ------
        FormatError
            Their sample rates differ by over 2 %.
        InputError
            There is none.
        """
        if not tables:
            raise InputError("features: there is nothing to join")
        first = tables[0]
        for table in tables:
            if abs(table.rate / first.rate - 1.0) > _SAME_RATE:
                raise FormatError(
                    f"features at {table.rate:g} Hz and at {first.rate:g} Hz: noise and ripple of "
                    "different sample rates do not compare"
                )
        values = np.vstack([table.values for table in tables])
        return cls(first.names, values, np.concatenate([t.load for t in tables]), first.rate)


def feature_table(recordings: Sequence[Recording]) -> FeatureTable:
    """Compute the features of recordings of one sample rate.

    Parameters
    ----------
    recordings : sequence of Recording
        Each holds ``position_ref``, ``position`` [m], ``current`` [A] on one clock, and
        ``load_force`` [N] where the load is known.

    Returns
    -------
    FeatureTable
        One row a recording.

    Raises
    ------
    FormatError
        A channel is missing, no stroke can be used, or the sample rates differ.
    InputError
        No recording was given.
    """
    if not recordings:
        raise InputError("features: no recording was given")
    return FeatureTable.joined([_table(recording) for recording in recordings])


def _table(recording: Recording) -> FeatureTable:
    row = _features(recording)
    values = np.array([list(row.values())])
    return FeatureTable(tuple(row), values, np.array([_load(recording)]), _rate(recording))


def _name(recording: Recording) -> str:
    meta = recording.meta
    parts = [str(meta.get("log", "recording"))]
    parts += [f"{key} {meta[key]}" for key in ("load_kgf", "run") if key in meta]
    return ", ".join(parts)


def _rate(recording: Recording) -> float:
    time = recording.clock().time
    if len(time) < 3:
        raise FormatError(f"{_name(recording)}: {len(time)} samples: too short for any feature")
    return float(1.0 / np.median(np.diff(time)))


def _load(recording: Recording) -> float:
    if "load_force" not in recording:
        return 0.0
    values = np.asarray(recording["load_force"].values, dtype=np.float64)
    return float(np.round(np.nanmean(values))) if np.isfinite(values).any() else 0.0


def _features(recording: Recording) -> dict[str, float]:
    for name in ("position_ref", "position", "current"):
        if name not in recording:
            raise FormatError(f"{_name(recording)}: no channel {name!r}, which features need")
    period = 1.0 / _rate(recording)
    error = recording["position_ref"].values - recording["position"].values
    current = np.asarray(recording["current"].values, dtype=np.float64)
    strokes = find_strokes(recording)
    whole = [s for s in strokes if _finite(error, current, s.start, s.end)]
    if {stroke.direction for stroke in whole} != {-1, 1}:
        raise FormatError(
            f"{_name(recording)}: every stroke of one direction has samples that are not numbers"
        )
    hold = _hold(whole, error, current, period, recording)
    ways = [
        _one_way([s for s in whole if s.direction == way], error, current, period, hold)
        for way in (1, -1)
    ]
    sides = sorted(ways, key=lambda values: values["current"])
    row = {f"{name}_{side}": values[name] for side, values in zip(_SIDES, sides, strict=True)
           for name in values}  # fmt: skip
    return row | hold | _joined(sides, hold)


def _finite(error: Floats, current: Floats, start: int, end: int) -> bool:
    return bool(np.isfinite(error[start:end]).all() and np.isfinite(current[start:end]).all())


def _hold(
    strokes: list[StrokeSpan], error: Floats, current: Floats, period: float, recording: Recording
) -> dict[str, float]:
    """Standstill between strokes: its current, the noise of both sensors, how they go together."""
    skip, keep = round(_SETTLED / period), round(_BEFORE_START / period)
    rests = [
        slice(stroke.stop + skip, stroke.end - keep)
        for stroke in strokes
        if stroke.end - stroke.stop >= LEAST_HOLD / period
    ]
    if not rests:
        raise FormatError(
            f"{_name(recording)}: no rest of {LEAST_HOLD:g} s after a stroke, which the noise of "
            "the sensors is taken from"
        )
    stops = [s.stop for s in strokes if s.end - s.stop >= LEAST_HOLD / period]
    after = [slice(s + round(0.36 / period), s + round(0.72 / period)) for s in stops]
    peaks = [slice(s, s + round(1.0 / period)) for s in stops]
    level = float(np.mean([current[r].mean() for r in rests]))
    coupling = [float(np.corrcoef(error[r], current[r])[0, 1]) for r in rests]
    return {
        "hold_current": level,
        "hold_noise": _noise(error, rests),
        "hold_current_noise": _noise(current, rests),
        "stop_current": float(np.mean([current[r].mean() for r in after])) - level,
        "stop_error": float(np.mean([_peak(error[r]) for r in peaks])),
        MARKER: float(np.mean(coupling)),
    }


def _noise(values: Floats, parts: list[slice]) -> float:
    """Logarithm of the deviation of differences: blind to slow motion, the median over parts."""
    return float(np.log(np.median([np.std(np.diff(values[part])) for part in parts]) + 1e-12))


def _one_way(
    strokes: list[StrokeSpan], error: Floats, current: Floats, period: float, hold: dict[str, float]
) -> dict[str, float]:
    begin, end = round(_STEADY / period), round(_BEFORE_STOP / period)
    steady = [slice(stroke.start + begin, stroke.stop - end) for stroke in strokes]
    level = float(np.mean([current[part].mean() for part in steady]))
    row = {"current": level - hold["hold_current"]}
    for name, (first, last) in _STARTS.items():
        parts = [
            current[s.start + round(first / period) : s.start + round(last / period)]
            for s in strokes
        ]
        row[name] = float(np.mean([part.mean() for part in parts])) - level
    row["recovery"] = float(np.mean([row[f"recovery_{k}"] for k in (1, 2, 3)]))
    first_second = [slice(s.start, s.start + round(1.2 / period)) for s in strokes]
    row["peak_error"] = float(np.mean([_peak(error[part]) for part in first_second]))
    starts = [slice(s.start, s.start + max(1, round(0.16 / period))) for s in strokes]
    lowest = float(np.median([current[part].min() for part in starts]))
    row["first_current"] = lowest - hold["hold_current"]
    row["noise_ratio"] = _noise(error, steady) - hold["hold_noise"]
    row["slope"] = float(np.mean([_slope(current[part]) for part in steady]))
    for signal, values in (("tracking", error), ("current", current)):
        for band, power in _band_powers(values, steady, period).items():
            row[f"{signal}_{band}"] = power
    return row


def _peak(values: Floats) -> float:
    """Mean of the four largest magnitudes."""
    return float(np.sort(np.abs(values))[-4:].mean())


def _slope(values: Floats) -> float:
    """Change over half of a steady motion."""
    return float(np.polyfit(np.linspace(-1.0, 1.0, len(values)), values, 1)[0])


def _band_powers(values: Floats, parts: list[slice], period: float) -> dict[str, float]:
    """Logarithm of the mean power of the ripple about a parabola, in each band."""
    spectra = [_spectrum(values[part], period) for part in parts]
    powers: dict[str, float] = {}
    for band, (low, high) in _BANDS.items():
        means = [power[(frequency >= low) & (frequency < high)] for frequency, power in spectra]
        total = [float(mean.mean()) if mean.size else 0.0 for mean in means]
        powers[band] = float(np.log(np.mean(total) + 1e-15))
    return powers


def _spectrum(values: Floats, period: float) -> tuple[Floats, Floats]:
    count = len(values)
    base = np.arange(count) - 0.5 * (count - 1)
    residual = values - np.polyval(np.polyfit(base, values, 2), base)
    power: Floats = np.abs(np.fft.rfft(residual * np.hanning(count))) ** 2 / count
    return np.asarray(np.fft.rfftfreq(count, period), np.float64), power


def _joined(sides: list[dict[str, float]], hold: dict[str, float]) -> dict[str, float]:
    """What is not computed of each stroke apart."""
    mean = {name: float(np.mean([side[name] for side in sides])) for name in sides[0]}
    return {
        "tracking_noise": mean["noise_ratio"] + hold["hold_noise"],
        "tracking_slow": mean["tracking_slow"],
        "tracking_screw": mean["tracking_screw"],
        "current_slow": mean["current_slow"],
        "current_screw": mean["current_screw"],
    }


@dataclass(frozen=True, slots=True)
class StrokeSpan:
    """One motion in one direction.

    Attributes
    ----------
    start, stop : int
        Samples: the first whose reference has moved, and the first that no longer moves.
    end : int
        First sample that is no longer of the rest after it (the next motion, a gap, the end).
    direction : int
        1 or -1.
    """

    start: int
    stop: int
    end: int
    direction: int


def find_strokes(recording: Recording) -> list[StrokeSpan]:
    """Find the strokes in which the reference moves at one speed for long enough.

    Parameters
    ----------
    recording : Recording
        Holds ``position_ref`` [m].

    Returns
    -------
    list of Stroke
        In the order of time. A stroke does not cross a gap of the clock.

    Raises
    ------
    FormatError
        There is none of `LEAST_STROKE` in each direction: a sinusoid, a standstill, too short.
    """
    clock = recording.clock()
    reference = np.asarray(recording["position_ref"].values, dtype=np.float64)
    edges = [0, *(int(gap) + 1 for gap in clock.gaps), len(reference)]
    least = LEAST_STROKE / float(np.median(np.diff(clock.time)))
    strokes = [
        stroke
        for first, last in pairwise(edges)
        for stroke in _in_segment(reference, first, last)
        if stroke.stop - stroke.start >= least
    ]
    if {stroke.direction for stroke in strokes} != {-1, 1}:
        raise FormatError(
            f"{recording.meta.get('log', 'recording')}: no stroke of {LEAST_STROKE:g} s at one "
            "speed in each direction; these features need a trapezoidal motion with its return"
        )
    return strokes


def _in_segment(reference: Floats, first: int, last: int) -> list[StrokeSpan]:
    values = reference[first:last]
    if len(values) < 3 or not np.isfinite(values).all():
        return []
    steps = np.diff(values)
    largest = float(np.abs(steps).max())
    if largest == 0.0:
        return []
    # Of one speed: within 3 % of the largest. A sinusoid is there for a twelfth of its period only.
    signs = np.where(np.abs(steps) > 0.97 * largest, np.sign(steps), 0.0)
    signs = np.concatenate((signs[:1], signs))
    changes = np.flatnonzero(np.diff(signs) != 0) + 1
    bounds = [0, *changes.tolist(), len(signs)]
    parts = list(pairwise(bounds))
    return [
        StrokeSpan(first + a, first + b, first + _rest_end(signs, parts, index), int(signs[a]))
        for index, (a, b) in enumerate(parts)
        if signs[a] != 0
    ]


def _rest_end(signs: Floats, parts: list[tuple[int, int]], index: int) -> int:
    """Return where the rest after a part ends; the part's own end when it has none."""
    following = parts[index + 1] if index + 1 < len(parts) else None
    if following is None or signs[following[0]] != 0:
        return parts[index][1]
    return following[1]
