"""From the description and columns of a file back to a recording, trusting neither."""

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, InputError
from elevon.recording.channel import Channel
from elevon.recording.clock import Clock
from elevon.recording.header import Header
from elevon.recording.recording import Recording

__all__ = ["check_size", "header_bytes", "rebuild"]


def check_size(place: str, needed: int, max_bytes: int) -> None:
    """Refuse a file that would need more memory than allowed."""
    if needed > max_bytes:
        raise FormatError(
            f"{place}: would need {needed / 2**20:.0f} MiB of memory; "
            f"the limit is {max_bytes / 2**20:.0f} MiB (max_bytes)"
        )


def header_bytes(header: Header) -> int:
    """Memory needed by the time and values that a header promises."""
    return sum(8 * max(clock.samples, 0) * (1 + len(clock.channels)) for clock in header.clocks)


def rebuild(
    header: Header,
    columns: Callable[[str], Mapping[str, npt.NDArray[np.float64]]],
    place: str,
) -> Recording:
    """Build the recording that a header and its columns describe.

    Parameters
    ----------
    header : Header
        As read.
    columns : callable
        Clock name to its arrays by name: ``time`` and the channels.
    place : str
        The file, for the errors.

    Raises
    ------
    FormatError
        A column is missing, of another length, or breaks a rule of `Clock` or `Channel`.
    """
    clocks, channels = [], []
    try:
        for entry in header.clocks:
            arrays = columns(entry.name)
            missing = [name for name in ("time", *entry.channels) if name not in arrays]
            if missing:
                raise FormatError(f"{place}: columns are missing: {', '.join(missing)}")
            clock = Clock(entry.name, arrays["time"], entry.rate, entry.gaps)
            if len(clock) != entry.samples:
                raise FormatError(
                    f"{place}: clock {entry.name!r} holds {len(clock)} of {entry.samples} samples"
                )
            clocks.append(clock)
            channels += [
                Channel(name, unit, arrays[name], clock, text)
                for name, (unit, text) in entry.channels.items()
            ]
        return Recording(
            channels, clocks=clocks, meta=header.meta, labels=header.labels, final=header.final
        )
    except FormatError:
        raise
    except (InputError, TypeError, ValueError) as error:
        raise FormatError(f"{place}: {error}") from error
