"""A unit watched while it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import Cause
from elevon.diagnose.engine.candidates import chosen
from elevon.diagnose.monitor.cause import likely_causes
from elevon.diagnose.monitor.filter import ChangeFilter
from elevon.diagnose.monitor.reference import WindowReference, reference
from elevon.diagnose.monitor.threshold import AlarmThresholds, simulated
from elevon.diagnose.monitor.windows import (
    CHANNELS,
    cut,
    motion,
    of_samples,
    period,
    run_in,
    top_speed,
    window_features,
)
from elevon.errors import InputError
from elevon.logs.drive import drive_log
from elevon.plain import Plain, in_unit
from elevon.results import Result

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

FALSE_ALARM_TIME = 3600.0  # s
_WINDOWS = 40  # of a stream of unknown length, and the most that are simulated of a day
_DAYS = 10  # the most that are simulated
_LAST = 16  # windows back to which a change is sought
_SAME = 0.2  # relative difference of motion up to which a window is of the baselines' motion


@dataclass(frozen=True)
class MonitorStep(Plain):
    """One window.

    Attributes
    ----------
    log : str
        What it is a part of.
    start, end : float
        In the log or stream [s].
    ratio : float
        Log likelihood ratio of the likeliest change against none.
    statistic : float
        That over its threshold: an alarm above one.
    alarm : bool
        Whether it is above one.
    skipped : str
        Why the window was not used; empty where it was.
    """

    log: str
    start: float
    end: float
    ratio: float
    statistic: float
    alarm: bool
    skipped: str = ""


@dataclass(frozen=True)
class Alarm(Plain):
    """The first window whose statistic is above one.

    Attributes
    ----------
    log : str
        What the window is a part of.
    time : float
        Its end, in the log [s].
    since_log, since : str, float
        Where the fault most likely began: a window's start.
    delay : float
        Watched time from there to the alarm [s].
    opening : bool
        Whether it was there from the first window of a log on.
    statistic, ratio, threshold : float
        As of the window; the threshold is that of the ratio.
    causes : tuple of Cause
        Single faults, most probable first, given that one has begun.
    """

    log: str
    time: float
    since_log: str
    since: float
    delay: float
    opening: bool
    statistic: float
    ratio: float
    threshold: float
    causes: tuple[Cause, ...]


@dataclass(frozen=True)
class Monitoring(Result):
    """What a monitor has seen.

    Attributes
    ----------
    alarm : Alarm or None
        The first one.
    window, false_alarm_time : float
        Width of a window, and mean time between false alarms [s].
    thresholds : mapping of str to float
        Of the ratio, for what begins with a log (``opening``) and in it (``within``).
    steps : tuple of MonitorStep
        The windows.
    findings : tuple of str
        What the caller should know.
    seconds : float
        Time it took.
    """

    alarm: Alarm | None
    window: Annotated[float, in_unit("s")]
    false_alarm_time: Annotated[float, in_unit("s")]
    thresholds: Mapping[str, float]
    steps: tuple[MonitorStep, ...]
    findings: tuple[str, ...]
    seconds: Annotated[float, in_unit("s")] = field(default=0.0, compare=False)

    KIND: ClassVar = "monitoring"
    COMPUTED: ClassVar = ("status",)
    TABLE: ClassVar = "steps"
    BARS: ClassVar = ("end", "statistic")

    @property
    def status(self) -> str:
        """``quiet`` or ``alarm``."""
        return "quiet" if self.alarm is None else "alarm"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        used = [step for step in self.steps if not step.skipped]
        if self.alarm is None:
            return (
                f"No alarm in {len(used)} windows of {self.window:g} s: the statistic came to "
                f"{max(step.statistic for step in used):.2g} of its threshold."
            )
        return (
            f"Alarm at {self.alarm.time:g} s of {self.alarm.log}: statistic "
            f"{self.alarm.statistic:.3g} of its threshold; most likely since {self.alarm.since:g} "
            f"s of {self.alarm.since_log} ({self.alarm.delay:g} s watched since)."
        )


@dataclass
class Monitor:
    """Watches windows of a unit that repeats the motion of its baselines.

    Feed whole logs (`feed_log`), windows (`feed_window`) or samples as they come (`feed`); each
    gives the steps that became complete. `alarm` is None until the first one.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit, calibrated.
    baselines : sequence of Log
        Of the healthy unit in the motion that is watched; three windows at least.
    window : float, optional
        Width [s]: one period of the motion, or several. Default: the period of a noted sine.
    false_alarm_time : float
        Mean time between false alarms [s].
    faults : sequence of str, optional
        ``KIND@PLACE``; default: all candidates of diagnosis by the model.
    days : int
        Logs to come, or days on which the unit is watched without a stop.
    longest : float, optional
        Length of the longest of them [s]; default: forty windows. Thresholds are simulated for
        streams of that kind.

    Raises
    ------
    InputError
        Another wiring, no baseline, too few windows, a time or a width not above zero.
    """

    actuator: Actuator
    baselines: Sequence[Log]
    window: float | None = None
    false_alarm_time: float = FALSE_ALARM_TIME
    faults: Sequence[str] | None = None
    days: int = 1
    longest: float | None = None
    alarm: Alarm | None = field(init=False, default=None)
    steps: list[MonitorStep] = field(init=False, default_factory=list)
    findings: list[str] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self._check()
        self.baselines = [drive_log(log) for log in self.baselines]
        self._candidates = chosen(self.faults)
        self.width = period(self.baselines[0], self.window)
        self._reference = reference(self.actuator, self.baselines, self._candidates, self.width)
        self.thresholds = self._simulated()
        self._motion = motion(self.baselines[0])
        self._top = top_speed(self.baselines[0])
        self._warn()
        self._begin()

    def fresh(self) -> Monitor:
        """Return a monitor of the same unit that has seen nothing yet."""
        other = copy(self)
        other._begin()
        return other

    def _begin(self) -> None:
        self.alarm, self.steps = None, []
        spread, directions = self._reference.spread, self._reference.directions
        self._filter = ChangeFilter(spread, directions, streams=1, last=_LAST)
        self._used: list[MonitorStep] = []
        self._pending: dict[str, list[Floats]] = {}
        self._moves = False  # whether what the day begins with is past

    @property
    def reference(self) -> WindowReference:
        """What healthy windows show."""
        return self._reference

    def new_day(self) -> None:
        """Say that the unit was stopped: its temperatures and friction are another day's."""
        self._pending.clear()
        self._moves = False
        self._filter.new_day()

    def feed_log(self, item: Log) -> list[MonitorStep]:
        """Take a whole log, as a day of its own; return a step for each whole window."""
        self.new_day()
        item = drive_log(item)
        parts = cut(item, self.width, start=run_in(item, self._top) or 0.0)
        return [self.feed_window(part, start) for start, part in parts]

    def feed(self, samples: Mapping[str, Floats]) -> list[MonitorStep]:
        """Take samples as they come, in any number; return the steps that became complete.

        Parameters
        ----------
        samples : mapping of str to ndarray, shape (n,)
            ``time`` and the signals of the stream, SI: ``encoder_position``,
            ``resolver_position``, ``speed_ref``, ``motor_speed``, ``current_ref``,
            ``current_q_meas``; where there are any ``voltage_q_ref`` and ``brake_torque``.

        Raises
        ------
        InputError
            A signal is missing.
        """
        missing = [name for name in ("time", *CHANNELS) if name not in samples]
        if missing:
            raise InputError(f"stream: {', '.join(missing)} missing")
        for name, values in samples.items():
            self._pending.setdefault(name, []).append(np.asarray(values, dtype=np.float64))
        pending = {name: np.concatenate(parts) for name, parts in self._pending.items()}
        out, time = [], pending["time"]
        while len(time) and time[-1] >= time[0] + self.width:
            inside = time < time[0] + self.width - 0.5 * (time[1] - time[0])
            part = {name: values[inside] for name, values in pending.items()}
            item = of_samples(part, self.baselines[0].note, "stream")
            if not self._moves:
                lead = run_in(item, self._top)
                self._moves = lead is not None
                later = time >= time[0] + (self.width if lead is None else lead)
                pending = {name: values[later] for name, values in pending.items()}
                time = pending["time"]
                continue
            out.append(self.feed_window(item, float(time[0])))
            pending = {name: values[~inside] for name, values in pending.items()}
            time = pending["time"]
        self._pending = {name: [values] for name, values in pending.items()}
        return out

    def feed_window(self, item: Log, start: float = 0.0) -> MonitorStep:
        """Take one window, which begins at `start` [s]; return what it says."""
        step = self._step(item, start)
        self.steps.append(step)
        if step.alarm and self.alarm is None:
            self.alarm = self._alarm(step, opening=self._opening)
        return step

    def result(self) -> Monitoring:
        """Return what it has seen so far."""
        levels = {"opening": self.thresholds.opening, "within": self.thresholds.within}
        steps, findings = tuple(self.steps), tuple(self.findings)
        return Monitoring(self.alarm, self.width, self.false_alarm_time, levels, steps, findings)

    def _check(self) -> None:
        if self.actuator.wiring != "rotary":
            raise InputError(
                f"{self.actuator.name}: watching serves the wiring 'rotary' so far, "
                f"not {self.actuator.wiring!r}"
            )
        if not self.baselines:
            raise InputError("watching needs a baseline: a healthy log of the same motion")
        if not self.false_alarm_time > 0.0:
            raise InputError(
                f"mean time between false alarms {self.false_alarm_time:g} s: must be above zero"
            )

    def _simulated(self) -> AlarmThresholds:
        windows = _WINDOWS if self.longest is None else int(self.longest / self.width)
        return simulated(
            self._reference.spread,
            self._reference.directions,
            days=min(max(self.days, 1), _DAYS),
            windows=min(max(windows, 2), _WINDOWS),
            width=self.width,
            time=self.false_alarm_time,
            noise_degrees=self._reference.noise_degrees,
            last=_LAST,
        )

    def _warn(self) -> None:
        if self.thresholds.beyond:
            self.findings.append(
                f"a false alarm in {self.false_alarm_time:g} s is seldom for streams this short: "
                "the thresholds are drawn on from the tail of the simulated ones"
            )
        if self._reference.windows < 30:
            self.findings.append(
                f"the baselines have {self._reference.windows} windows: how windows scatter is "
                "partly assumed"
            )

    def _step(self, item: Log, start: float) -> MonitorStep:
        end = start + self.width
        if any(
            abs(a - b) > _SAME * max(abs(a), abs(b))
            for a, b in zip(motion(item), self._motion, strict=True)
        ):
            return MonitorStep(item.name, start, end, 0.0, 0.0, False, "not the baselines' motion")
        features = window_features(item, self.actuator)
        if features is None:
            return MonitorStep(
                item.name, start, end, 0.0, 0.0, False, "hardly any motion, or no samples"
            )
        self._filter.step(self._reference.deviation(features)[None, :])
        ratios = [float(r[0]) for r in self._filter.ratios()]
        levels = [self.thresholds.opening, self.thresholds.within]
        parts = [r / level for r, level in zip(ratios, levels, strict=True)]
        top = int(np.argmax(parts))
        self._opening = top == 0
        step = MonitorStep(item.name, start, end, ratios[top], parts[top], parts[top] > 1.0)
        self._used.append(step)
        return step

    def _alarm(self, step: MonitorStep, *, opening: bool) -> Alarm:
        change = self._filter.best(opening=opening)
        first = self._used[change.window]
        return Alarm(
            log=step.log,
            time=step.end,
            since_log=first.log,
            since=first.start,
            delay=self.width * (len(self._used) - change.window),
            opening=change.opening,
            statistic=step.statistic,
            ratio=step.ratio,
            threshold=self.thresholds.opening if opening else self.thresholds.within,
            causes=likely_causes(change, self._reference, self._candidates),
        )
