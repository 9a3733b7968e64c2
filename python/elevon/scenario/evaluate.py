"""Values of a command or a load over time, without a simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.scenario.compile import compile_term
from elevon.scenario.scenario import Term
from elevon.waveforms import TABLE


def evaluate_terms(
    terms: Sequence[Term], unit: str, time: npt.ArrayLike, place: str = "command"
) -> Floats:
    """Return a sum of waveforms as the core computes it.

    Parameters
    ----------
    terms : sequence of Term
        Disabled ones add nothing.
    unit : str
        SI unit of the quantity they drive.
    time : array_like, shape (n,)
        s.
    place : str
        For errors.

    Returns
    -------
    ndarray, shape (n,)
        In `unit`.

    Raises
    ------
    InputError
        A unit of the wrong kind, values that cannot be.
    """
    from elevon import _core

    at = np.ascontiguousarray(time, dtype=np.float64)
    total = np.zeros_like(at)
    for index, term in enumerate(terms):
        core = compile_term(term, unit, f"{place}.terms[{index}]")
        if not core["enabled"]:
            continue
        if term.kind == TABLE:
            total += _table(
                np.asarray(core["times"]),
                np.asarray(core["values"]),
                at,
                hold=bool(term.arguments.get("hold")),
            )
        else:
            total += _core.waveform(term.kind, core["parameters"], at)
    return total


def _table(times: Floats, values: Floats, at: Floats, *, hold: bool) -> Floats:
    """Straight lines between the points, or each value held; the ends are held."""
    if not hold:
        return np.interp(at, times, values)
    return np.asarray(values[np.maximum(np.searchsorted(times, at, "right") - 1, 0)])
