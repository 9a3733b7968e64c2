"""How soon `elevon monitor` sees a fault that begins in a stream, and how often it alarms at none.

Benches are those of `diagnosis-limits`: unlike the model, each calibrated on a healthy log a test.
A healthy stream of 100 s is the baseline; other days' streams are watched, healthy ones and ones in
which a fault begins at a drawn instant.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.errors import ElevonWarning, InputError
from elevon.progress import Progress, part
from elevon.report import Check, verdict
from studies.common import Row, advance
from studies.diagnosis_limits.campaign import calibrated
from studies.diagnosis_limits.logs import STREAM, Trial, bench_logs
from studies.diagnosis_limits.plan import FAULTS, CampaignFault
from studies.diagnosis_limits.unit import BenchUnit, draw_unit

if TYPE_CHECKING:
    from elevon.diagnose.monitor import Monitor
    from elevon.logs.log import Log

__all__ = ["MonitorDelay", "Watched", "study_monitor_delay"]

HEALTHY = 8  # streams of each unit
LEVELS = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0)  # over the severity that diagnosis must isolate
LENGTH = 100.0  # s
ONSET = (40.0, 60.0)  # s: where a fault begins
OFTEN, SELDOM = 600.0, 3600.0  # s between false alarms: to count them, and as it comes
SEEN, WINDOWS = 0.95, 2.0  # at the full severity: share of alarms, and windows of delay
_BLOCK = 16


@dataclass(frozen=True)
class Watched(Row):
    """One stream.

    Attributes
    ----------
    name : str
        The stream.
    unit : int
        Of the bench.
    kind : str
        The fault; empty for a healthy stream.
    level, severity : float
        Over the limit of diagnosis, and in the catalogue's unit.
    early : bool
        An alarm before the onset; of a healthy stream, any.
    delay : float or None
        From the onset to the alarm [s].
    named : bool
        The likeliest cause is the fault.
    often : bool
        Of a healthy stream: an alarm at the shorter time between false alarms.
    """

    name: str
    unit: int
    kind: str
    level: float
    severity: float
    early: bool
    delay: float | None
    named: bool
    often: bool


@dataclass(frozen=True)
class _Planned:
    trial: Trial
    fault: CampaignFault | None
    level: float
    onset: float


@dataclass(frozen=True)
class MonitorDelay:
    """The streams and what follows from them."""

    seed: int
    units: int
    window: float
    streams: tuple[Watched, ...]

    @property
    def checks(self) -> list[Check]:
        """The figures with a limit."""
        healthy = [s for s in self.streams if not s.kind]
        alarms = sum(s.often for s in healthy)
        full = [s for s in self.streams if s.level == 1.0]
        late = [math.inf if s.delay is None else s.delay for s in full]
        return [
            Check("false alarms in an hour, set 6: lower end of the 95 % interval",
                  _rate(alarms, len(healthy))[0], 3600.0 / OFTEN, "1/h"),
            Check("share of alarms at the severities that diagnosis must isolate",
                  float(np.mean(np.isfinite(late))), SEEN, at_least=True),
            Check("median delay there", float(np.median(late)), WINDOWS * self.window, "s"),
        ]  # fmt: skip

    def rows(self) -> list[dict[str, Any]]:
        """Return the table: delay against severity of each fault."""
        out = []
        for fault in FAULTS:
            for level in LEVELS:
                streams = [s for s in self.streams if s.kind == fault.kind and s.level == level]
                delays = [s.delay for s in streams if s.delay is not None]
                out.append(
                    {
                        "fault": fault.kind,
                        "severity": level * fault.limit,
                        "streams": len(streams),
                        "alarms": len(delays),
                        "before_onset": sum(s.early for s in streams),
                        "delay_median": float(np.median(delays)) if delays else None,
                        "delay_largest": max(delays) if delays else None,
                        "named": sum(s.named for s in streams),
                    }
                )
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        checks = self.checks
        healthy = [s for s in self.streams if not s.kind]
        counts = {OFTEN: sum(s.often for s in healthy), SELDOM: sum(s.early for s in healthy)}
        return {
            **verdict(checks),
            "seed": self.seed,
            "units": self.units,
            "window": self.window,
            "healthy_streams": len(healthy),
            "healthy_seconds": LENGTH * len(healthy),
            "false_alarms": [
                {
                    "set_seconds": between,
                    "alarms": count,
                    "per_hour": 3600.0 * count / (LENGTH * len(healthy)),
                    "interval": list(_rate(count, len(healthy))),
                }
                for between, count in counts.items()
            ],
            "rows": self.rows(),
            "streams": [stream.to_dict() for stream in self.streams],
        }


def study_monitor_delay(
    *, seed: int = 0, units: int = 3, progress: Progress | None = None
) -> MonitorDelay:
    """Watch streams of the bench.

    Parameters
    ----------
    seed : int
        Of everything.
    units : int
        Benches; 39 streams each.
    progress : callable, optional
        As everywhere.

    Raises
    ------
    InputError
        Fewer than one unit.
    Interrupted
        `progress` returned False.
    """
    if units < 1:
        raise InputError(f"--units {units}: at least one unit")
    out: list[Watched] = []
    window = math.nan
    for number in range(units):
        share = part(progress, number / units, (number + 1) / units)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ElevonWarning)
            watched, window = _unit(seed, number, share)
        out += watched
    return MonitorDelay(seed, units, window, tuple(out))


def _unit(seed: int, number: int, progress: Progress | None) -> tuple[list[Watched], float]:
    from elevon.diagnose.monitor import Monitor

    unit = draw_unit(seed, number)
    actuator, _ = calibrated(unit, seed, part(progress, 0.0, 0.2))
    plan = _plan(seed, number)
    base = Trial(f"u{number}-base", STREAM, (), _key(seed, number))
    healthy = next(iter(_logs(unit, [base], None)))
    monitors = [
        Monitor(actuator, [healthy], false_alarm_time=time, longest=LENGTH)
        for time in (SELDOM, OFTEN)
    ]
    out = []
    for k in range(0, len(plan), _BLOCK):
        block = plan[k : k + _BLOCK]
        for item, log in zip(block, _logs(unit, [p.trial for p in block], None), strict=True):
            out.append(_watched(item, number, log, monitors))
        advance(progress, 0.2 + 0.8 * (k + len(block)) / len(plan), "monitor-delay")
    return out, monitors[0].width


def _logs(unit: BenchUnit, trials: list[Trial], progress: Progress | None) -> Iterator[Log]:
    with tempfile.TemporaryDirectory() as folder:
        yield from bench_logs(unit, trials, Path(folder), progress)


def _key(seed: int, number: int) -> int:
    return ((seed * 1000 + number) * 1000 + 500) * 10


def _plan(seed: int, number: int) -> list[_Planned]:
    """Return a unit's streams: healthy ones, and each fault at each level, either way in turn."""
    rng = np.random.default_rng([seed, 103, number])
    wanted: list[tuple[CampaignFault | None, float]] = [(None, 0.0)] * HEALTHY
    wanted += [(fault, level) for fault in FAULTS for level in LEVELS]
    out = []
    for k, (fault, level) in enumerate(wanted):
        onset = float(rng.uniform(*ONSET))
        texts: tuple[str, ...] = ()
        if fault is not None:
            sign = -1.0 if fault.both and (k + number) % 2 else 1.0
            place = fault.places[(k + number) % len(fault.places)]
            severity = sign * level * fault.limit
            texts = (f"{fault.kind}@{place}={severity!r}:step(time={onset!r} s)",)
        name = f"u{number}-{k:02d}"
        out.append(
            _Planned(Trial(name, STREAM, texts, _key(seed, number) + 1 + k), fault, level, onset)
        )
    return out


def _watched(item: _Planned, number: int, log: Log, monitors: list[Monitor]) -> Watched:
    seldom, often = (monitor.fresh() for monitor in monitors)
    seldom.feed_log(log)
    alarm = seldom.alarm
    if item.fault is None:
        often.feed_log(log)
        return Watched(item.trial.name, number, "", 0.0, 0.0, alarm is not None, None, False,
                       often.alarm is not None)  # fmt: skip
    early = alarm is not None and alarm.time <= item.onset
    seen = alarm is not None and not early
    delay = alarm.time - item.onset if alarm is not None and seen else None
    named = alarm is not None and seen and alarm.causes[0].kind == item.fault.kind
    severity = item.level * item.fault.limit
    return Watched(
        item.trial.name, number, item.fault.kind, item.level, severity, early, delay, named, False
    )


def _rate(alarms: int, streams: int) -> tuple[float, float]:
    """Return the exact 95 % interval of alarms in an hour of healthy streams (Poisson)."""
    from scipy.stats import chi2

    hours = LENGTH * max(streams, 1) / 3600.0
    low = 0.5 * float(chi2.ppf(0.025, 2 * alarms)) if alarms else 0.0
    return low / hours, 0.5 * float(chi2.ppf(0.975, 2 * alarms + 2)) / hours
