"""What an inspection says of the severities, as the filters take it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.prognose.law import Law

__all__ = ["Inspection", "Seen", "inspection"]

Floats = npt.NDArray[np.float64]
_SIGMAS = 1.6449  # of a 90 % interval's half width
_DETECTED = 3.0  # deviations at which a severity counts as seen
_AT_EDGE = 0.98
_OUTLIER = 0.02  # share of diagnoses that say nothing true; ASSUMED
_MISSED = 1e-3  # share of diagnoses that do not see a fault that is well there; ASSUMED


@dataclass(frozen=True)
class Seen:
    """What is said of one fault.

    Attributes
    ----------
    severity : float or None
        Median [the fault's unit]; None where the fault was not seen.
    low, high : float
        Deviations below and above it; of a fault not seen both are the deviation of its zero.
    """

    severity: float | None
    low: float
    high: float

    def log_likelihood(self, severity: Floats) -> Floats:
        """Return it for severities of shape (n,), up to a constant."""
        at = 0.0 if self.severity is None else self.severity
        off = severity - at
        score = off / np.where(off < 0.0, self.low, self.high)
        stray = _MISSED if self.severity is None else _OUTLIER
        wide = np.log(stray / 30.0)  # evenly over thirty deviations
        return np.asarray(np.logaddexp(np.log1p(-stray) - 0.5 * score**2, wide))


@dataclass(frozen=True)
class Inspection:
    """One inspection.

    Attributes
    ----------
    usage : float
        Use up to it, in the mission's unit.
    seen : mapping of str to Seen
        ``KIND@PLACE`` to what is said; a fault that is not in it was not looked for.
    reset : tuple of str
        Faults whose part was made new after the inspection.
    name : str
        Of its file.
    date : str
        ISO date, or empty.
    """

    usage: float
    seen: Mapping[str, Seen]
    reset: tuple[str, ...] = ()
    name: str = ""
    date: str = ""


def inspection(
    data: Mapping[str, Any],
    laws: Sequence[Law],
    *,
    usage: float,
    name: str = "",
    date: str = "",
    reset: Sequence[str] = (),
) -> Inspection:
    """Build an inspection from a diagnosis.

    Parameters
    ----------
    data : mapping
        The JSON object of ``elevon diagnose``: its ``faults`` and ``detectable`` are used.
    laws : sequence of Law
        Whose faults matter.
    usage, name, date, reset
        As in `Inspection`.

    Raises
    ------
    InputError
        What should be numbers is not.
    """
    seen = {}
    for law in laws:
        cause = _cause(data, law)
        limit = _detectable(data, law)
        if cause is not None:
            seen[law.key] = _read(cause, limit, f"{name}: {law.key}")
        elif limit is not None:
            seen[law.key] = Seen(None, limit / _DETECTED, limit / _DETECTED)
    return Inspection(usage, seen, tuple(reset), name, date)


def _cause(data: Mapping[str, Any], law: Law) -> Mapping[str, Any] | None:
    """Return the cause that is the law's fault, also by a place not to be told from it.

    A cause that is less likely than not is none: its severity is that of a guess.
    """
    for cause in data.get("faults", []):
        names = [cause, *cause.get("equivalents", [])]
        same = any((n["kind"], n["place"]) == (law.kind, law.place) for n in names)
        if same and float(cause["probability"]) >= 0.5:
            return dict(cause)
    return None


def _detectable(data: Mapping[str, Any], law: Law) -> float | None:
    known: Mapping[str, float] = data.get("detectable", {})
    if law.key in known:
        return float(known[law.key])
    kin = [value for key, value in known.items() if key.partition("@")[0] == law.kind]
    return float(kin[0]) if len(kin) == 1 else None


def _edge(kind: str) -> float:
    """Return the greatest severity that diagnosis looks at."""
    from elevon.diagnose.bymodel.candidates import CANDIDATES

    return max((c.high for c in CANDIDATES if c.kind == kind), default=np.inf)


def _read(cause: Mapping[str, Any], limit: float | None, place: str) -> Seen:
    try:
        severity = float(cause["severity"])
        low, high = (float(value) for value in cause["interval"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{place}: severity and interval are not numbers") from error
    if not (np.isfinite([severity, low, high]).all() and low <= severity <= high):
        raise InputError(f"{place}: severity {severity:g} is not within {low:g} to {high:g}")
    if high >= _AT_EDGE * _edge(str(cause["kind"])):  # it may be more than is looked at
        high = max(high, severity) + 4.0 * abs(severity)
    floor = 0.02 * max(abs(severity), limit or 0.0) or 1e-9
    return Seen(
        severity,
        max((severity - low) / _SIGMAS, floor),
        max((high - severity) / _SIGMAS, floor),
    )
