"""Ctrl-C, and SIGTERM alike: noticed wherever it falls, told once.

Python raises `KeyboardInterrupt` between any two instructions, also where an exception is lost: in
a finaliser, in a weak reference's callback, in a library's start-up. So the signal is noted;
whoever reports progress requests it; an exception that Python reports as lost is raised again a
moment later. Nothing heavy is imported here: the first moments of a command count too.
"""

from __future__ import annotations

import _thread
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any, NoReturn

INTERRUPTED, TERMINATED = 130, 143
"""Exit codes after Ctrl-C and after SIGTERM, with which schedulers and shutdowns end a process."""
_LATER = 0.02  # s after which a lost exception is raised again: out of the place that lost it


@dataclass
class _Watch:
    """What is known of the command that runs."""

    installed: bool = False
    terminable: bool = False
    owner: bool = False
    noticed: bool = False
    code: int = INTERRUPTED
    closed: bool = False
    later: bool = False
    story: str = ""
    hook: Callable[[Any], Any] = sys.unraisablehook

    def note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002 - signal's form
        """Remember, and stop the work."""
        self.noticed = True
        if number == signal.SIGTERM:
            self.code = TERMINATED
        if not self.later:
            raise KeyboardInterrupt

    def lost(self, report: Any) -> None:
        """Take Python's report of an exception that could not be raised."""
        if issubclass(report.exc_type, KeyboardInterrupt) and self.noticed:
            _thread.start_new_thread(self._again, ())
        else:
            self.hook(report)

    def _again(self) -> None:
        time.sleep(_LATER)
        if not self.closed:
            signal.raise_signal(signal.SIGINT)

    def close(self, action: Any) -> None:
        """Let Ctrl-C do something else from now on, and SIGTERM with it."""
        self.closed = True
        signal.signal(signal.SIGINT, action)
        if self.terminable:
            usual = signal.SIG_IGN if action is signal.SIG_IGN else signal.SIG_DFL
            signal.signal(signal.SIGTERM, usual)


_watch = _Watch()


@contextmanager
def watched(*, owner: bool) -> Iterator[None]:
    """Watch for Ctrl-C while a command runs.

    Parameters
    ----------
    owner : bool
        Whether the process ends with the command: from its end on Ctrl-C is ignored, since there
        is nothing left to stop.
    """
    global _watch  # noqa: PLW0603 - signals belong to the process, so does this
    earlier, _watch = _watch, _Watch(owner=owner)
    # Whoever ignores the signal (nohup, a shell's background job) or handles it keeps doing so.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        with suppress(ValueError):  # not the main thread: signals do not come here
            signal.signal(signal.SIGINT, _watch.note)
            _watch.installed = True
            if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
                signal.signal(signal.SIGTERM, _watch.note)
                _watch.terminable = True
            _watch.hook, sys.unraisablehook = sys.unraisablehook, _watch.lost
    try:
        yield
    finally:
        if _watch.installed:
            _watch.close(signal.SIG_IGN if owner else signal.default_int_handler)
            sys.unraisablehook = _watch.hook
        _watch = earlier


def noticed() -> bool:
    """Whether Ctrl-C was pressed since the command began."""
    return _watch.noticed


def code() -> int:
    """Return the exit code of a command that was interrupted: 130, after SIGTERM 143."""
    return _watch.code


def check() -> None:
    """Stop the work if Ctrl-C was pressed and its exception was lost on the way."""
    if _watch.noticed:
        raise KeyboardInterrupt


@contextmanager
def postpone() -> Iterator[None]:
    """Let work end that must not be cut in the middle: Ctrl-C stops what is behind it."""
    _watch.later = True
    try:
        yield
    finally:
        _watch.later = False
    check()


def ignore() -> None:
    """Take no further Ctrl-C: what follows is short and must not be cut."""
    if _watch.installed:
        _watch.close(signal.SIG_IGN)


def story() -> str:
    """What the command said is kept; empty where it said nothing."""
    return _watch.story


@contextmanager
def telling(describe: Callable[[], str]) -> Iterator[None]:
    """Let a command say what is kept of its work if it is interrupted inside the block.

    Parameters
    ----------
    describe : callable
        Called after the interruption; returns what is kept and how to go on.
    """
    from elevon.errors import Interrupted

    try:
        yield
    except (KeyboardInterrupt, Interrupted):
        ignore()
        _watch.noticed = True
        _watch.story = describe()
        raise


def drop_output() -> None:
    """Let what is still waiting to be written on stdout go nowhere: it would be half an answer."""
    import os

    if _watch.owner:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def leave(status: int) -> NoReturn:
    """End an interrupted process with an exit code.

    Where the exception has passed through `exec` (so dataclasses are made), Python started with
    ``-m`` would end the process by the signal instead, although the exception was caught.
    """
    import atexit
    import os

    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    atexit._run_exitfuncs()
    os._exit(status)
