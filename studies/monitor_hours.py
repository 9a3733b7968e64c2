"""How often `elevon monitor` alarms at healthy units, in hours made of recorded days' windows.

Each actuator is recorded by the switching model, its motor's days as diagnosis draws them. A stream
of an hour would take as long to simulate as all else here, so the windows of a recorded day are
drawn anew, with replacement, into many streams of that day: their noise, and what the day does to
them, are recorded; that a day drifts within an hour is not.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.diagnose.learning.fit import share_interval
from elevon.diagnose.monitor.filter import ChangeFilter
from elevon.errors import ElevonWarning, InputError
from elevon.report import Check, verdict
from elevon.threads import one_blas_thread
from studies.common import Row, student_interval
from studies.side_by_side import side_by_side

if TYPE_CHECKING:
    from elevon.arrays import Floats
    from elevon.bench.procedure import StandardTest
    from elevon.diagnose.monitor import Monitor
    from elevon.diagnose.monitor.windows import Windows
    from elevon.logs.log import Log
    from elevon.progress import Progress

__all__ = ["HealthyDay", "MonitorHours", "study_monitor_hours"]

OFTEN = 600.0  # s between false alarms that is set
_STREAMS = 400  # drawn of each day
_DAYS = 4  # of a stream of actions
_LAST = 16  # windows back to which a change is sought, as the monitor does
#: Actuator: seconds of a day, baselines, steps of the bench's procedure, its stand.
MOTIONS: dict[str, tuple[str, int, str, tuple[dict[str, Any], ...]]] = {
    "torino-rotary": ("60 s", 1, "", (
        {"kind": "trace", "command": {"terms": [
            {"kind": "sine", "amplitude": "7 deg", "bias": "10 deg", "frequency": "0.2 Hz"}]}},
    )),
    "nasa-ballscrew": ("30 s", 1, "load-actuator", (
        {"kind": "force", "opposing": "1500 N"},
        {"kind": "trace", "command": {"terms": [
            {"kind": "sine", "amplitude": "30 mm", "frequency": "0.5 Hz"}]}},
    )),
    "pisa-landing-gear": ("", 3, "", ()),
}  # fmt: skip


@dataclass(frozen=True)
class HealthyDay(Row):
    """One recorded healthy day (of actions: four), watched.

    Attributes
    ----------
    actuator : str
        Its file.
    windows : int
        That were recorded.
    hours : float
        Of the streams that were drawn of them.
    alarms : int
        Streams that alarmed.
    """

    actuator: str
    windows: int
    hours: float
    alarms: int


@dataclass(frozen=True)
class MonitorHours:
    """All days."""

    days: tuple[HealthyDay, ...]
    seed: int

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Each actuator: alarms in an hour, by Student's interval over its days."""
        out = []
        for name in dict.fromkeys(day.actuator for day in self.days):
            days = [day for day in self.days if day.actuator == name]
            mean, low, high = student_interval([day.alarms / day.hours for day in days])
            quiet = sum(day.alarms == 0 for day in days)
            out.append(
                {
                    "actuator": name, "days": len(days), "windows": sum(d.windows for d in days),
                    "hours": sum(d.hours for d in days), "alarms": sum(d.alarms for d in days),
                    "per_hour": mean, "interval": [max(low, 0.0), high],
                    "days_without": quiet, "days_interval": list(share_interval(quiet, len(days))),
                }
            )  # fmt: skip
        return out

    @property
    def checks(self) -> list[Check]:
        """The rate that was set, by the lower end of the interval over days."""
        return [
            Check(f"{row['actuator']}: alarms in an hour, lower end of 95 % over days",
                  row["interval"][0], 3600.0 / OFTEN)
            for row in self.rows
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        days = [day.to_dict() for day in self.days]
        return {**verdict(self.checks), "seed": self.seed, "rows": self.rows, "days": days}


def study_monitor_hours(
    *,
    seed: int = 0,
    days: int = 6,
    processes: int | None = None,
    progress: Progress | None = None,
) -> MonitorHours:
    """Record healthy days of three actuators and watch streams that are drawn of them.

    Raises
    ------
    InputError
        Fewer than two days.
    Interrupted
        `progress` returned False.
    """
    if days < 2:
        raise InputError(f"--days {days}: at least two")
    calls = {name: partial(_of_actuator, name, days, seed) for name in MOTIONS}
    rows = dict(side_by_side(calls, processes=processes, progress=progress))
    return MonitorHours(tuple(day for name in calls for day in rows[name]), seed)


@one_blas_thread()
def _of_actuator(name: str, days: int, seed: int) -> list[HealthyDay]:
    from elevon import Actuator
    from elevon.calibrate.door import turns
    from elevon.diagnose.monitor import Monitor
    from elevon.diagnose.monitor.by_positions import PositionWindows
    from elevon.diagnose.monitor.by_roles import RoleWindows
    from studies.fault_limits.standard import Day, day_logs

    actuator, (_, first, _, steps) = Actuator.load(name), MOTIONS[name]
    # Of actions a log is one window and a day: several days are a stream.
    each = 1 if steps else _DAYS
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        numbers = [Day((), 100_000 * seed + k) for k in range(first + each * days)]
        logs = day_logs(actuator, _test(name), numbers, "high")
        base, healthy = logs[:first], logs[first:]
        watch = Monitor(actuator, base, false_alarm_time=OFTEN, days=each)
        windows = (PositionWindows if turns(actuator) else RoleWindows)(actuator, base)
        parts = [healthy[k : k + each] for k in range(0, len(healthy), each)]
        seen = [_deviations(watch, windows, part) for part in parts]
    rng = np.random.default_rng([seed, 28])
    return [_watched(name, watch, rows, rng, daily=each > 1) for rows in seen]


def _test(name: str) -> StandardTest:
    from elevon import Actuator
    from elevon.bench.procedure import Procedure, StandardTest, standard_tests

    seconds, _, stand, steps = MOTIONS[name]
    if not steps:
        return standard_tests(Actuator.load(name))[0]
    made = [dict(step) for step in steps]
    made[-1] |= {"name": "stream", "duration": seconds}
    document = {"name": "stream", "step": made} | ({"stand": stand} if stand else {})
    return StandardTest("stream", Procedure.model_validate(document))


def _deviations(watch: Monitor, windows: Windows, logs: Sequence[Log]) -> Floats:
    """Windows of logs, whole in every number, shape (n, k), in the monitor's deviations."""
    read = (x for log in logs for x in windows.of(windows.ready(log)))
    rows = np.array([watch.reference.deviation(x) for x in read])
    return np.asarray(rows[np.isfinite(rows).all(axis=1)])


def _watched(
    name: str, watch: Monitor, rows: Floats, rng: np.random.Generator, *, daily: bool
) -> HealthyDay:
    """Draw streams of a day's windows and count those that alarm; `daily`: each window is a day."""
    spread, directions = watch.reference.spread, watch.reference.directions
    seen = ChangeFilter(spread, directions, streams=_STREAMS, last=_LAST)
    alarm = np.zeros(_STREAMS, dtype=np.bool_)
    for _ in range(len(rows)):
        if daily:
            seen.new_day()
        seen.step(rows[rng.integers(len(rows), size=_STREAMS)])
        opening, within = seen.ratios()
        alarm |= (opening > watch.thresholds.opening) | (within > watch.thresholds.within)
    hours = _STREAMS * len(rows) * watch.width / 3600.0
    return HealthyDay(name, len(rows), hours, int(alarm.sum()))
