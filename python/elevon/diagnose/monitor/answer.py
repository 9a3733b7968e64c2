"""What watching a unit answers with: each window, the first alarm, the whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from elevon.diagnose.engine.answer import Cause
from elevon.diagnose.monitor.cutter import SampleCounts
from elevon.plain import Plain, in_unit
from elevon.results import Result


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
    samples : SampleCounts
        What came since the window before.
    """

    log: str
    start: float
    end: float
    ratio: float
    statistic: float
    alarm: bool
    skipped: str = ""
    samples: SampleCounts = field(default_factory=SampleCounts)


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
    whole : int
        Windows behind the one with the onset that `causes` rest on; 0: on the alarm's own.
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
    whole: int = 0


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
