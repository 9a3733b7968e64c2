"""Coverage of the mechanics' intervals on axes whose controller is known, and on others.

The axes are integrated here and share no code with the package: mass, viscous and Coulomb friction,
a constant load, a sampled drive that reads a position with noise. Four drives follow a law that
calibration knows by name; three follow one that no gain describes: a table of the error, gains
that change with the error, a notch behind the law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.subsystems.flow import identify
from elevon.errors import Interrupted
from elevon.logs.log import Log
from elevon.progress import Progress
from elevon.report.checks import Check, CheckedResult

__all__ = ["CoverageResult", "study_controllers"]

KNOWN, OTHERS = ("PD", "PID", "P-P", "P-PI"), ("table", "schedule", "notch")
NAMES = ("mass", "viscous", "coulomb", "offset")
TYPICAL = np.array([90.0, 200.0, 20.0, 3.0])
FORCE = 35.0  # N a volt
PERIOD, STEPS, DURATION, NOISE = 1e-3, 5, 12.0, 2e-6
_NOTCH = 60.0  # Hz


@dataclass(frozen=True)
class CoverageRow:
    """Fits of one kind of drive.

    Attributes
    ----------
    drives : str
        The laws.
    fits, intervals : int
        Fits, and the intervals that they gave.
    coverage : float
        Share of the intervals that hold the truth.
    interval : tuple of float
        Of 90 %, of that share: each fit counts once.
    width : dict of str to float
        Median width over the truth, by number.
    """

    drives: str
    fits: int
    intervals: int
    coverage: float
    interval: tuple[float, float]
    width: dict[str, float]


@dataclass(frozen=True)
class CoverageResult(CheckedResult):
    """What the fits of known and of other controllers give."""

    known: CoverageRow
    others: CoverageRow
    by_drive: tuple[CoverageRow, ...]
    seed: int

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One a group and drive."""
        return [vars(row) for row in (self.known, self.others, *self.by_drive)]

    @property
    def checks(self) -> list[Check]:
        """Both groups hold what they state; unknown controllers cost at most twice the width."""
        ratios = [self.others.width[name] / self.known.width[name] for name in NAMES]
        return [
            Check("coverage, known controllers", self.known.coverage, 0.85, "1", at_least=True),
            Check("coverage, known controllers, at most", self.known.coverage, 0.95, "1"),
            Check("coverage, other controllers", self.others.coverage, 0.85, "1", at_least=True),
            Check("width with other controllers over that with known", max(ratios), 2.0, "1"),
        ]


def study_controllers(
    *, fits: int = 210, seed: int = 0, progress: Progress | None = None
) -> CoverageResult:
    """Identify axes that are drawn anew and count the intervals that hold the truth.

    Parameters
    ----------
    fits : int
        Axes, over seven drives.
    seed : int
        Of axes, commands and noise.
    progress : callable, optional
        Told the done fraction; returns False to stop.
    """
    rng = np.random.default_rng([seed, 45])
    drives = np.resize([*KNOWN, *OTHERS], fits)
    truth = TYPICAL * np.exp(0.3 * rng.standard_normal((fits, 4)))
    truth[:, 3] *= rng.choice([-1.0, 1.0], fits)
    commands, seen, efforts = _logs(drives.tolist(), truth, rng)
    hits, widths = np.full((fits, 4), np.nan), np.full((fits, 4), np.nan)
    time: Floats = PERIOD * np.arange(len(commands), dtype=np.float64)
    for k in range(fits):
        if progress is not None and progress(k / fits) is False:
            raise Interrupted("study stopped")
        channels = {
            "command": commands[:, k], "output_position": seen[:, k],
            "torque_voltage": efforts[:, k],
        }  # fmt: skip
        units = {"command": "m", "output_position": "m", "torque_voltage": "V"}
        log = Log(f"axis {k}", time, channels, units)
        part = identify([log], _axis(rng), scale=f"{FORCE} N/V").subsystems["mechanics"]
        for j, name in enumerate(NAMES):
            item = part.parameters.get(name)
            if item is not None:
                low, high = item.interval
                hits[k, j] = low <= truth[k, j] <= high
                widths[k, j] = (high - low) / abs(truth[k, j])
    groups = {"known": KNOWN, "others": OTHERS} | {name: (name,) for name in (*KNOWN, *OTHERS)}
    rows = {name: _row(name, np.isin(drives, of), hits, widths) for name, of in groups.items()}
    return CoverageResult(rows.pop("known"), rows.pop("others"), tuple(rows.values()), seed)


def _row(name: str, chosen: Any, hits: Floats, widths: Floats) -> CoverageRow:
    """Count a group; each fit is one observation of the coverage."""
    some = hits[chosen]
    each = np.nanmean(some, axis=1)
    share = float(np.nanmean(some))
    half = 1.645 * float(np.nanstd(each, ddof=1)) / max(len(each), 1) ** 0.5 if len(each) > 1 else 1
    width = dict(zip(NAMES, np.nanmedian(widths[chosen], axis=0).tolist(), strict=True))
    ends = (max(share - half, 0.0), min(share + half, 1.0))
    return CoverageRow(name, len(some), int(np.isfinite(some).sum()), share, ends, width)


def _axis(rng: np.random.Generator) -> Actuator:
    """Return a linear axis as it is believed: 30 % off, one radian of the motor a metre."""
    nothing = dict.fromkeys(
        ("screw.preload", "screw.inertia", "load.mass", "load.damping", "load.friction",
         "backlash.total"), 0.0,
    )  # fmt: skip
    mass, viscous, dry, _ = TYPICAL * np.exp(0.3 * rng.standard_normal(4))
    return Actuator.load("nasa-ballscrew").with_values({
        **nothing, "screw.lead": 1.0, "screw.efficiency": 1.0, "screw.efficiency_aiding": 1.0,
        "motor.inertia": mass, "friction.static": dry, "friction.dynamic": dry,
        "friction.viscous": viscous, "backlash.model": "operator", "thermal.model": "off",
        "control.current_limit": 1e4, "motor.torque_limit": 1e6, "stop.upper": 1e3,
        "stop.lower": -1e3,
    })  # fmt: skip


def _logs(
    drives: Sequence[str], truth: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Return commands, positions as read and efforts, shape (n, fits): all axes step together."""
    count, time = len(drives), PERIOD * np.arange(round(DURATION / PERIOD))
    sizes = np.array([0.05, 0.02])[:, None] * rng.uniform(0.6, 1.4, (2, count))
    rates = np.array([0.5, 1.3])[:, None] * rng.uniform(0.8, 1.25, (2, count))
    waves = [a * np.sin(2.0 * np.pi * np.outer(time, f)) for a, f in zip(sizes, rates, strict=True)]
    commands = np.sum(waves, axis=0)
    mass, viscous, dry, offset = truth.T
    law = _Laws(drives)
    place, rate = np.zeros(count), np.zeros(count)
    seen, efforts = np.empty_like(commands), np.empty_like(commands)
    step = PERIOD / STEPS
    for k, wanted in enumerate(commands):
        seen[k] = place + NOISE * rng.standard_normal(count)
        efforts[k] = law(wanted, seen[k])
        push = FORCE * efforts[k] - offset
        for _ in range(STEPS):
            way = np.where(rate != 0.0, np.sign(rate), np.sign(push))
            after = rate + step * (push - viscous * rate - dry * way) / mass
            stuck = (rate == 0.0) & (np.abs(push) <= dry)
            after = np.where(stuck | (after * way < 0.0), 0.0, after)
            place = place + 0.5 * step * (rate + after)
            rate = after
    return commands, seen, efforts


class _Laws:
    """The drives' laws, side by side, from command and position as read to volts."""

    def __init__(self, drives: Sequence[str]) -> None:
        self.of = {name: np.array([d == name for d in drives]) for name in (*KNOWN, *OTHERS)}
        self.total, self.before = np.zeros(len(drives)), np.zeros((2, len(drives)))
        self.last = np.zeros(len(drives))
        self.inside, self.outside = np.zeros((2, len(drives))), np.zeros((2, len(drives)))

    def __call__(self, wanted: Floats, place: Floats) -> Floats:
        """Return the efforts of one tick."""
        error = wanted - place
        speed = (place - self.before[1]) / (2.0 * PERIOD)
        change = (error - self.last) / PERIOD
        self.before, self.last = np.array([place, self.before[0]]), error
        self.total = self.total + PERIOD * np.where(
            self.of["P-PI"], 160.0 * error - speed, error
        )  # fmt: skip
        cascade = 240.0 * (160.0 * error - speed)
        table = 40.0 * np.sign(error) * (0.1 + (np.abs(error) > 2e-3) + (np.abs(error) > 6e-3))
        fast = np.where(np.abs(error) > 5e-4, 2.0, 1.0)
        efforts = {
            "PD": 2.0e4 * error + 240.0 * change,
            "PID": 2.0e4 * error + 240.0 * change + 5.0e4 * self.total,
            "P-P": cascade, "P-PI": cascade + 240.0 * 8.0 * self.total, "table": table,
            "schedule": 120.0 * fast * (80.0 * error - speed), "notch": self._notched(cascade),
        }  # fmt: skip
        return np.asarray(np.select([self.of[name] for name in efforts], list(efforts.values())))

    def _notched(self, value: Floats) -> Floats:
        """Pass a value through a notch of a tenth of its depth, second order."""
        w = 2.0 * np.pi * _NOTCH * PERIOD
        zero, pole = 1.0 - 0.1 * w, 1.0 - 0.7 * w
        turn = np.cos(w)
        gain = (1.0 - 2.0 * pole * turn + pole**2) / (1.0 - 2.0 * zero * turn + zero**2)
        out = gain * (value - 2.0 * zero * turn * self.inside[0] + zero**2 * self.inside[1])
        out = out + 2.0 * pole * turn * self.outside[0] - pole**2 * self.outside[1]
        self.inside = np.array([value, self.inside[0]])
        self.outside = np.array([out, self.outside[0]])
        return np.asarray(out)
