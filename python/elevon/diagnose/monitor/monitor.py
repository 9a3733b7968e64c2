"""A unit watched while it runs."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy, deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.door import turns
from elevon.diagnose.engine.candidates import chosen
from elevon.diagnose.monitor.answer import (
    Alarm,
    Monitoring,
    MonitorState,
    MonitorStep,
    digest_of,
    read_state,
    write_state,
)
from elevon.diagnose.monitor.by_positions import PositionWindows
from elevon.diagnose.monitor.by_roles import RoleWindows
from elevon.diagnose.monitor.cutter import CutWindow, DayPlace, SampleCounts, WindowCutter
from elevon.diagnose.monitor.filter import ChangeFilter
from elevon.diagnose.monitor.reference import WindowReference, likely_causes, reference
from elevon.diagnose.monitor.threshold import MOST, AlarmCause, for_days
from elevon.diagnose.monitor.windows import Day, Windows, by_role
from elevon.errors import InputError
from elevon.logs.brake import Brake

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.command.note import CommandNote
    from elevon.logs.log import Log

FALSE_ALARM_TIME = 3600.0  # s
_LAST = 16  # windows back to which a change is sought
_LISTED = 20_000  # windows that are kept for the result
_WHY = {
    "rest": "at rest: the motion that is watched has not begun",
    "gap": "no samples",
    "late": "late: the samples came after their windows were closed",
}


@dataclass
class Monitor:
    """Watches windows of a unit that repeats the motion of its baselines.

    Feed whole logs (`feed_log`) or samples as they come (`feed`, and `finish` at their end); each
    gives the steps that became complete. `alarm` is None until the first one.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit, calibrated.
    baselines : sequence of Log
        Of the healthy unit in the motion that is watched; three windows at least.
    window : float, optional
        Width [s]: one period of the motion, or several. Default: the period of a noted sine or of
        the logged command; what the baselines' first action takes.
    false_alarm_time : float
        Mean time between false alarms [s].
    faults : sequence of str, optional
        ``KIND@PLACE``; default: all candidates of diagnosis by the model.
    days : int
        Logs to come, or days on which the unit is watched without a stop.
    longest : float, optional
        Length of the longest of them [s]; default: that of the longest baseline. Thresholds are
        simulated for streams of that kind.
    note : CommandNote, optional
        What the operator knows of samples that are fed; default: as of the first baseline.

    Raises
    ------
    InputError
        No baseline, too few windows, a time or a width not above zero, no repetition.
    """

    actuator: Actuator
    baselines: Sequence[Log]
    window: float | None = None
    false_alarm_time: float = FALSE_ALARM_TIME
    faults: Sequence[str] | None = None
    days: int = 1
    longest: float | None = None
    note: CommandNote | None = None
    alarm: Alarm | None = field(init=False, default=None)
    steps: list[MonitorStep] = field(init=False, default_factory=list)
    findings: list[str] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self._check()
        self._candidates = chosen(self.faults, self.actuator)
        kind = PositionWindows if turns(self.actuator) else RoleWindows
        self._windows: Windows = kind(self.actuator, self.baselines, self.window)
        self.baselines, self.width = self._windows.baselines, self._windows.width
        self.note = self.note or self.baselines[0].note
        self._reference = reference(self._windows, self._candidates)
        if self.longest is None:
            self.longest = max(log.duration for log in self.baselines)
        self.thresholds = for_days(
            self._reference, self.width, _LAST,
            days=self.days, longest=self.longest, time=self.false_alarm_time,
        )  # fmt: skip
        self._warn()
        self._begin()

    def fresh(self) -> Monitor:
        """Return a monitor of the same unit that has seen nothing yet."""
        other = copy(self)
        other._begin()
        return other

    def _begin(self) -> None:
        self.alarm, self.steps = None, []
        self.day = 0
        self.heading = ""  # what a stream of lines began with, for whoever reads them on
        self.counts = SampleCounts()  # of all samples
        self.skipped: Counter[str] = Counter()  # windows left out, by the reason
        self.top = 0.0  # the highest statistic
        self._left_out = 0
        self._filter = self._new_filter()
        self._cause: AlarmCause | None = None
        self._used: dict[int, MonitorStep] = {}  # windows back to which a change is sought
        self._opening = False
        self._day: Day | None = None
        self._cutter: WindowCutter | None = None

    def _new_filter(self) -> ChangeFilter:
        spread, directions = self._reference.spread, self._reference.directions
        return ChangeFilter(spread, directions, streams=1, last=_LAST)

    @property
    def roles(self) -> tuple[str, ...]:
        """All that is read of a stream."""
        return self._windows.roles

    @property
    def reference(self) -> WindowReference:
        """What healthy windows show."""
        return self._reference

    def new_day(self) -> None:
        """Say that the unit was stopped: its temperatures and friction are another day's."""
        self._day = self._cutter = None
        self._filter.new_day()
        if self._cause is not None:
            self._cause.watch.new_day()

    def feed_log(self, item: Log) -> list[MonitorStep]:
        """Take a whole log, as a day of its own; return a step for each whole window."""
        self.new_day()
        item = self._windows.ready(item)
        day = self._windows.day(item)
        self._open(day)
        steps = self._take(item.time, day.table(item))
        return steps + self.finish()

    def feed(self, samples: Mapping[str, npt.ArrayLike]) -> list[MonitorStep]:
        """Take samples as they come, in any number; return the steps that became complete.

        Parameters
        ----------
        samples : mapping of str to array_like, shape (n,)
            ``time`` and channels by role (or by a signal that has it), SI, NaN where a value is
            missing: of a turning servo ``output_position``, ``motor_position``, ``speed_ref``,
            ``motor_speed``, ``torque_current`` or ``current_ref`` or both; where there are any
            ``torque_voltage`` and ``brake_torque``; of another actuator all `roles` of its
            baselines. The same ones throughout a day. Samples that are late or doubled
            are left out, those out of order are put in their place; all are counted in the steps.

        Raises
        ------
        InputError
            A channel is missing or unknown, or not there all day; no finite time stamp; lengths
            that differ.
        """
        time, channels = by_role(samples, self.roles)
        roles = self._windows.watched("stream", list(channels))
        if self._day is None:
            self.day += 1
            name = "stream" if self.day == 1 else f"stream, day {self.day}"
            self._open(Day(name, roles, self.note, Brake.none()))
        assert self._day is not None
        if roles != self._day.roles:
            raise InputError(
                f"{self._day.name}: began with {', '.join(self._day.roles)}, goes on with "
                f"{', '.join(roles)}; a day has the same channels throughout"
            )
        return self._take(time, np.column_stack([channels[role] for role in roles]))

    def leave_out(self, count: int) -> None:
        """Count samples that could not be read; the next step states them."""
        if self._cutter is None:
            self.counts += SampleCounts(unreadable=count)
        else:
            self._cutter.pending += SampleCounts(unreadable=count)

    def finish(self) -> list[MonitorStep]:
        """End the stream here; return the step of a last window that is whole."""
        return [] if self._cutter is None else self._stepped(self._cutter.finish())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write where the stream stands, whole; `resume` goes on from there without a gap.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        day, cutter = self._day, self._cutter
        state = MonitorState(
            self._inputs, self.day, day.name if day else "", self.heading, day.roles if day else (),
            cutter.place if cutter else DayPlace(), cutter.pending if cutter else SampleCounts(),
            self.counts, dict(self.skipped), self._filter.windows, self.top, self._opening,
            tuple(self._used.items()), self.alarm, self._cause.at if self._cause else None,
        )  # fmt: skip
        arrays = {} if cutter is None else cutter.stored()
        of_cause = self._cause.arrays() if self._cause else {}
        write_state(path, state, arrays | self._filter.arrays() | of_cause)

    def resume(self, path: str | os.PathLike[str]) -> None:
        """Go on from where `save` was called; `steps` begins anew.

        Raises
        ------
        InputError
            The file is of a monitor that was made of something else, or is none.
        """
        state, arrays = read_state(path, self._inputs)
        self._begin()
        self._filter.take_arrays(arrays, state.windows, os.fspath(path))
        if state.cause is not None:
            self._cause = AlarmCause.stored(
                self._new_filter(), arrays, state.cause, os.fspath(path)
            )
        self.day, self.counts, self.top = state.day, state.counts, state.top
        self.heading = state.heading
        self.skipped, self.alarm = Counter(state.skipped), state.alarm
        self._opening, self._used = state.opening, dict(state.used)
        if state.name:
            roles = self._windows.watched(os.fspath(path), state.roles)
            self._open(Day(state.name, roles, self.note, Brake.none()))
            assert self._cutter is not None
            self._cutter.take_stored(state.place, state.pending, arrays, os.fspath(path))

    @property
    def samples(self) -> SampleCounts:
        """What came so far; `taken` are those of whole windows."""
        return self.counts if self._cutter is None else self.counts + self._cutter.pending

    @property
    def windows(self) -> int:
        """How many windows were used."""
        return self._filter.windows

    @property
    def latest(self) -> float | None:
        """Time stamp of the stream's latest sample [s]; None before a day's first."""
        place = None if self._cutter is None else self._cutter.place
        return None if place is None or math.isnan(place.origin) else place.origin + place.last

    @property
    def origin(self) -> float | None:
        """Time stamp of the day's first sample [s], from which steps are counted."""
        place = None if self._cutter is None else self._cutter.place
        return None if place is None or math.isnan(place.origin) else place.origin

    @cached_property
    def _inputs(self) -> dict[str, str]:
        from elevon import __version__

        return {
            "version of elevon": __version__,
            "actuator": self.actuator.hash,
            "baseline": digest_of(self.baselines),
            "window": repr(self.width),
            "note": repr(self.note),
            "time between false alarms": repr(self.false_alarm_time),
            "list of faults": " ".join(c.key for c in self._candidates),
            "number of days": repr(self.days),
            "longest day": repr(self.longest),
        }

    def result(self) -> Monitoring:
        """Return what it has seen so far."""
        levels = {"opening": self.thresholds.opening, "within": self.thresholds.within}
        steps, findings = tuple(self.steps), tuple(self.findings)
        if self._left_out:
            findings = (*findings, f"the first {self._left_out} windows are not listed")
        return Monitoring(self.alarm, self.width, self.false_alarm_time, levels, steps, findings)

    def _open(self, day: Day) -> None:
        self._day, self._cutter = day, self._windows.cutter(day)

    def _take(self, time: Floats, table: Floats) -> list[MonitorStep]:
        assert self._cutter is not None
        return self._stepped(self._cutter.take(time, table))

    def _stepped(self, windows: Sequence[CutWindow]) -> list[MonitorStep]:
        return [self._listed(self._step(window)) for window in windows]

    def _listed(self, step: MonitorStep) -> MonitorStep:
        self.steps.append(step)
        if len(self.steps) > _LISTED:
            del self.steps[0]
            self._left_out += 1
        self.counts += step.samples
        self.top = max(self.top, step.statistic)
        if step.skipped:
            self.skipped[step.skipped] += 1
        if step.alarm and self.alarm is None:
            self.alarm = self._alarm(step, opening=self._opening)
        return step

    def _check(self) -> None:
        if not self.baselines:
            raise InputError("watching needs a baseline: a healthy log of the same motion")
        if not self.false_alarm_time > 0.0:
            raise InputError(
                f"mean time between false alarms {self.false_alarm_time:g} s: must be above zero"
            )
        if self.window is not None and not self.window > 0.0:
            raise InputError(f"window of {self.window:g} s: must be above zero")
        if self.longest is not None and not self.longest > 0.0:
            raise InputError(f"longest day of {self.longest:g} s: must be above zero")

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

    def _step(self, window: CutWindow) -> MonitorStep:
        assert self._day is not None
        step = MonitorStep(
            self._day.name, window.start, window.end, 0.0, 0.0, False, _WHY.get(window.why, ""),
            window.counts,
        )  # fmt: skip
        if step.skipped:
            return step
        features = self._windows.read(self._day, window)
        if isinstance(features, str):
            return replace(step, skipped=features)
        deviation = self._reference.deviation(features)[None, :]
        self._settle(deviation)
        before = deepcopy(self._filter) if self.alarm is None else self._filter
        self._filter.step(deviation)
        ratios = [float(r[0]) for r in self._filter.ratios()]
        levels = [self.thresholds.opening, self.thresholds.within]
        parts = [r / level for r, level in zip(ratios, levels, strict=True)]
        top = int(np.argmax(parts))
        self._opening = top == 0
        step = replace(step, ratio=ratios[top], statistic=parts[top], alarm=parts[top] > 1.0)
        if step.alarm and self.alarm is None:
            change = self._filter.best(opening=self._opening)
            self._cause = AlarmCause.behind(change, before, self._filter)
        self._used[self._filter.windows - 1] = step
        sought = {change.window for change in self._filter.changes}
        self._used = {number: s for number, s in self._used.items() if number in sought}
        return step

    def _settle(self, deviation: Floats) -> None:
        """Say the cause of an alarm anew, from whole windows behind the onset."""
        if self.alarm is None or self._cause is None:
            return
        change, whole = self._cause.step(deviation), self.alarm.whole + 1
        if change is not None:
            causes = likely_causes(change, self._reference, self._candidates)
            self.alarm = replace(self.alarm, causes=causes, whole=whole)
        if change is None or whole >= MOST:
            self._cause = None

    def _alarm(self, step: MonitorStep, *, opening: bool) -> Alarm:
        change = self._filter.best(opening=opening)
        first = self._used[change.window]
        return Alarm(
            log=step.log,
            time=step.end,
            since_log=first.log,
            since=first.start,
            delay=self.width * (self._filter.windows - change.window),
            opening=change.opening,
            statistic=step.statistic,
            ratio=step.ratio,
            threshold=self.thresholds.opening if opening else self.thresholds.within,
            causes=likely_causes(change, self._reference, self._candidates),
        )
