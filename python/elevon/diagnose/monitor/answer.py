"""What watching a unit answers with: each window, the first alarm, the whole."""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from elevon.diagnose.engine.answer import Cause
from elevon.diagnose.monitor.cutter import DayPlace, SampleCounts
from elevon.errors import FormatError, InputError
from elevon.files import read_regular, write_bytes
from elevon.plain import Plain, in_unit
from elevon.results import Result, finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elevon.arrays import Floats
    from elevon.logs.log import Log


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


_MOST_BYTES = 2**29  # of a state's file, also of what it holds
_HEAD = "monitor"


@dataclass(frozen=True)
class MonitorState(Plain):
    """All that a monitor knows beyond its inputs.

    Attributes
    ----------
    inputs : mapping of str to str
        What the monitor was made of: a state serves no other one.
    day : int
        Number of the day.
    name : str
        Of the day; empty before its first sample.
    heading : str
        What the stream began with.
    roles : tuple of str
        The day's channels.
    place : DayPlace
        Where in its day the stream stands.
    pending, counts : SampleCounts
        Since the last window, and of all windows.
    skipped : mapping of str to int
        Windows left out, by the reason.
    windows : int
        Used so far.
    top : float
        The highest statistic.
    opening : bool
        Whether no window of the day was used.
    used : tuple of (int, MonitorStep)
        Windows back to which a change is sought.
    alarm : Alarm or None
        The first one.
    cause : (int, int) or None
        Of the filter of the alarm's cause: windows it has seen, and the first with the fault.
    """

    LAYOUT: ClassVar = 2

    inputs: Mapping[str, str]
    day: int
    name: str
    heading: str
    roles: tuple[str, ...]
    place: DayPlace
    pending: SampleCounts
    counts: SampleCounts
    skipped: Mapping[str, int]
    windows: int
    top: float
    opening: bool
    used: tuple[tuple[int, MonitorStep], ...]
    alarm: Alarm | None
    cause: tuple[int, int] | None = None


def digest_of(logs: Sequence[Log]) -> str:
    """Return the SHA-256 of what logs hold."""
    out = hashlib.sha256()
    for log in logs:
        out.update(repr((sorted(log.channels), log.note)).encode())
        for array in (log.time, *(log[role] for role in sorted(log.channels)), log.brake.level):
            out.update(f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return out.hexdigest()


def write_state(
    path: str | os.PathLike[str], state: MonitorState, arrays: Mapping[str, Floats]
) -> None:
    """Write a state, whole; the one that is there is replaced.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    head = {"layout": state.LAYOUT} | finite(state.to_dict(), words=True)
    text = json.dumps(head, allow_nan=False).encode()
    packed = io.BytesIO()
    np.savez(packed, **{_HEAD: np.frombuffer(text, dtype=np.uint8)}, **arrays)  # type: ignore[arg-type]
    write_bytes(path, packed.getvalue(), force=True)


def read_state(
    path: str | os.PathLike[str], inputs: Mapping[str, str]
) -> tuple[MonitorState, dict[str, Floats]]:
    """Read a state.

    Parameters
    ----------
    path : path
        What `write_state` wrote.
    inputs : mapping of str to str
        Of the monitor that goes on with it.

    Raises
    ------
    FormatError
        No such file, damaged, or of another layout.
    InputError
        Of another monitor: what differs is named.
    """
    place = os.fspath(path)
    members = _members(place)
    try:
        head: Any = json.loads(members.pop(_HEAD).tobytes())
    except (KeyError, ValueError, RecursionError) as error:
        raise FormatError(f"{place}: is no state of a monitor: {error}") from error
    if not isinstance(head, dict) or head.pop("layout", None) != MonitorState.LAYOUT:
        raise FormatError(f"{place}: is no state of a monitor of layout {MonitorState.LAYOUT}")
    state = MonitorState.from_dict(head, place)
    other = [name for name, value in inputs.items() if state.inputs.get(name) != value]
    if other:
        raise InputError(
            f"{place}: is the state of a monitor with another {other[0]}; give the inputs of the "
            "run that wrote it, or another --state"
        )
    return state, {name: np.asarray(values, dtype=np.float64) for name, values in members.items()}


def _members(place: str) -> dict[str, Any]:
    data = read_regular(place, _MOST_BYTES)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            size = sum(item.file_size for item in packed.infolist())
        if size > _MOST_BYTES:
            raise FormatError(f"{place}: expands to {size} bytes; the limit is {_MOST_BYTES}")
        with np.load(io.BytesIO(data), allow_pickle=False) as members:
            return {name: members[name] for name in members.files}
    except (OSError, ValueError, zipfile.BadZipFile, EOFError, KeyError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{place}: is no state of a monitor: {error}") from error
