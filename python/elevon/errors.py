"""The exception family, and the nearest valid names that every message offers.

Every error raised on purpose is an `ElevonError`. Its `exit_code` is what the command line returns:
2 for anything the caller can correct in the input, 1 for a failure of the work itself.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import ClassVar

_LONGEST_QUOTE = 60


class ElevonError(Exception):
    """Base of every error raised on purpose by Elevon.

    Attributes
    ----------
    exit_code : int
        Exit status of the command line for this error.
    """

    exit_code: ClassVar[int] = 1


class InputError(ElevonError, ValueError):
    """Something the caller gave is wrong: a name, a value, a unit, a file."""

    exit_code: ClassVar[int] = 2


class UnknownNameError(InputError, LookupError):
    """A name that does not exist: actuator, parameter path, signal, key, file ending.

    Attributes
    ----------
    name : str
        The name as given.
    nearest : list of str
        The nearest valid names, best first; may be empty.
    """

    def __init__(self, message: str, name: str = "", near: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.name = name
        self.nearest = list(near)


class ArgumentTypeError(InputError, TypeError):
    """An argument of another kind than the function takes; the message says what it expects."""


class NotActingError(InputError):
    """A parameter or fault was set where it has no effect, and the caller wants that refused."""


class UnitError(InputError):
    """A unit that does not exist, or is of the wrong kind for its place."""


class RangeError(InputError):
    """A number outside its limits, or not finite."""


class QuestionError(InputError):
    """A log leaves open what its columns are; the text names the option that answers it."""


class FormatError(InputError):
    """A file whose content is not what its ending promises."""


class DamageError(FormatError):
    """A file that is not as it was written: its checksum or its description says so."""


class VersionError(FormatError):
    """A file of our own whose layout this version does not read."""


class BudgetError(InputError):
    """A run that would take longer than it may.

    Attributes
    ----------
    estimate_s : float
        Processor time that it would take, in s.
    bytes : int
        Memory of its recording.
    """

    def __init__(self, message: str, estimate_s: float = float("nan"), memory: int = 0) -> None:
        super().__init__(message)
        self.estimate_s = estimate_s
        self.bytes = memory

    def to_dict(self) -> dict[str, object]:
        """Return the JSON form."""
        return {
            "status": "refused",
            "estimate_s": self.estimate_s,
            "bytes": self.bytes,
            "option": "--budget",
            "message": str(self),
        }


class OutputError(InputError, OSError):
    """An output that cannot be written."""


class OutputExistsError(OutputError):
    """An output that exists already and may not be replaced; the message says how it can be."""

    def __init__(self, text: str) -> None:
        super().__init__(f"{text}; use force (--force) to replace it")


class BusyError(InputError):
    """Another process works in the folder, or another thread in the session."""


class SimulationError(ElevonError):
    """A run that could not be completed: it diverged or tripped.

    Attributes
    ----------
    status : str
        `diverged`, `tripped`; `failed` where a foreign model did.
    """

    def __init__(self, message: str, status: str = "diverged") -> None:
        super().__init__(message)
        self.status = status


class ForeignModelError(SimulationError):
    """A foreign FMU refused a call, or put out no number; its own words are quoted."""

    def __init__(self, message: str) -> None:
        super().__init__(message, "failed")


class DivergedError(SimulationError):
    """A run that left the finite numbers.

    Attributes
    ----------
    time : float
        When, in simulated s.
    signal : str
        Which signal.
    runs : tuple of int
        Of a batch: which runs; time and signal are those of the first.
    """

    def __init__(
        self,
        message: str,
        time: float = float("nan"),
        signal: str = "",
        runs: Iterable[int] = (),
    ) -> None:
        super().__init__(message, "diverged")
        self.time = time
        self.signal = signal
        self.runs = tuple(runs)


class Interrupted(ElevonError):  # noqa: N818 - an interruption is wanted, it is no error
    """The work was stopped by the caller before its end."""

    exit_code: ClassVar[int] = 130


class ElevonWarning(UserWarning):
    """Base of every warning given on purpose by Elevon.

    Attributes
    ----------
    exit_code : int
        Exit status of the command line where warnings are errors.
    """

    exit_code: ClassVar[int] = 2


class NotActingWarning(ElevonWarning):
    """A parameter or fault was set away from neutral where it has no effect."""


class UncheckedWarning(ElevonWarning):
    """A file carries no checksum: whether it is as it was written cannot be checked."""


class RetiredNamesWarning(ElevonWarning):
    """A file was written with names that were replaced: it is read with the present ones."""


class FindingWarning(ElevonWarning):
    """The core questions these values together, but runs them."""


def nearest(name: str, candidates: Iterable[str], count: int = 3) -> list[str]:
    """Return the valid names that look most like a wrong one.

    Parameters
    ----------
    name : str
        The name as given.
    candidates : iterable of str
        The valid names.
    count : int
        The largest number of names returned.

    Returns
    -------
    list of str
        Best first. Case and the choice of `-`, `_`, `.` or space do not count as differences; a
        name of which the given one is a whole part (`inertia` of `motor.inertia`) is near. What
        replaced a retired name comes first.
    """
    names = list(dict.fromkeys(candidates))
    # Some callers pass on what they were given, whatever it is.
    given = str(name)
    from elevon.retired import successors  # only where a name is wrong

    first = successors(given, names)
    wanted = _plain(given)
    plain: dict[str, list[str]] = {}
    for candidate in names:
        plain.setdefault(_plain(candidate), []).append(candidate)
    keys = get_close_matches(wanted, plain, n=count, cutoff=0.6)
    keys += [key for key in plain if len(wanted) > 2 and wanted in key.split() and key not in keys]
    like = [original for key in keys for original in plain[key]]
    return list(dict.fromkeys([*first, *like]))[:count]


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """Return the end of an error message: the nearest names, or the valid ones when they are few.

    Returns
    -------
    str
        Such as ``; did you mean 'motor.inertia'?`` or ``; valid: 'a', 'b'``, or an empty text.
    """
    names = list(dict.fromkeys(candidates))
    near = nearest(name, names)
    if near:
        return f"; did you mean {_listed(near, ' or ')}?"
    if 0 < len(names) <= 12:
        return f"; valid: {_listed(names, ', ')}"
    return ""


def unknown(
    what: str, name: str, candidates: Iterable[str], place: str | None = None
) -> UnknownNameError:
    """Build the error for a name that does not exist.

    Parameters
    ----------
    what : str
        What the name should have been: "signal", "parameter", "key".
    name : str
        The name as given.
    candidates : iterable of str
        The valid names.
    place : str, optional
        Where it was found: a file, a path, an option.

    Returns
    -------
    UnknownNameError
        To be raised by the caller.
    """
    name = str(name)
    names = list(candidates)
    start = f"{place}: " if place else ""
    from elevon.retired import remark  # only where a name is wrong

    about = remark(what, name)
    more = f"; {about}" if about else did_you_mean(name, names)
    message = f"{start}unknown {what} {name!r}{more}"
    return UnknownNameError(message, name, nearest(name, names))


def quoted(text: str) -> str:
    """Return foreign text safe to show: quoted, cut, and escaped where it cannot be printed."""
    cut = text if len(text) <= _LONGEST_QUOTE else text[:_LONGEST_QUOTE] + "..."
    return repr(cut)


def _plain(name: str) -> str:
    return " ".join(name.lower().replace("-", " ").replace("_", " ").replace(".", " ").split())


def _listed(names: list[str], joint: str) -> str:
    return joint.join(repr(name) for name in names)
