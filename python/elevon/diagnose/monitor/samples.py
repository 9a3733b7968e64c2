"""Samples of a stream by the roles of their channels, checked."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, unknown
from elevon.logs.maps.column_map import known_roles, known_signals

LATEST = 1e12  # s: a time stamp beyond that is none


def by_role(
    samples: Mapping[str, npt.ArrayLike], read: Collection[str]
) -> tuple[Floats, dict[str, Floats]]:
    """Return time stamps, shape (n,), and channels by role, of samples by role or signal.

    Signals whose role is not among those that are read are left out.

    Raises
    ------
    InputError
        No time or none that is finite, a name that is neither, two channels with one role, no
        numbers, lengths that differ.
    """
    out: dict[str, Floats] = {}
    for name, values in samples.items():
        role = _role(name, read)
        if role in out:
            raise InputError(f"stream: {name!r} has the role {role}, and so has another channel")
        if role:
            out[role] = _column(name, values)
    if "time" not in out:
        raise InputError("stream: 'time' is missing")
    time = out.pop("time")
    odd = {role: len(values) for role, values in out.items() if len(values) != len(time)}
    if odd:
        role, count = odd.popitem()
        raise InputError(f"stream: {len(time)} time stamps, {count} values of {role}")
    if not (np.abs(time) <= LATEST).all():
        wrong = time[~(np.abs(time) <= LATEST)][0]
        raise InputError(f"stream: time stamp {wrong:g} s: must be finite, at most {LATEST:g} s")
    return time, out


def _role(name: str, read: Collection[str]) -> str:
    """Return the role of a name; empty of a signal that nothing here reads."""
    if name in read or name in known_roles():
        return name
    signals = known_signals()
    if name not in signals:
        raise unknown("channel", name, [*known_roles(), *signals], "stream")
    role = signals[name].role
    return role if role in read else ""


def _column(name: str, values: npt.ArrayLike) -> Floats:
    try:
        column = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise InputError(f"stream: {name}: no numbers: {error}") from error
    if column.ndim != 1:
        raise InputError(f"stream: {name} has the shape {column.shape}; one value a sample")
    return np.where(np.isfinite(column), column, np.nan)
