"""One parameter: its value in SI and everything a reader needs to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from elevon.units import format_quantity

Confidence = Literal[
    "published", "derived", "assumed", "calibrated", "unknown", "default", "override"
]

#: What an actuator file may give; `default` and `override` are given by the program.
CONFIDENCES = ("published", "derived", "assumed", "calibrated", "unknown")


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value of an actuator, with its provenance.

    Attributes
    ----------
    path : str
        Dotted path, such as ``motor.inertia``.
    value : float or str
        SI value, or the name of a choice.
    unit : str
        The unit as written in the file; empty for choices and pure numbers.
    source : str
        Where the number comes from; starts with ``ASSUMED`` when nobody published it.
    note : str
        How it was derived, what to know before using it.
    confidence : str
        published, derived, assumed, calibrated, unknown (given without a word); ``default`` for a
        healthy value the model itself gives, ``override`` for one set by the caller.
    old : float, optional
        SI value before calibration or override.
    interval : tuple of float, optional
        SI limits of the calibrated value's interval.
    changed : bool
        The caller gave another value than the file: where it has no effect, a run reports it.
    """

    path: str
    value: float | str
    unit: str = ""
    source: str = ""
    note: str = ""
    confidence: Confidence = "assumed"
    old: float | str | None = None
    interval: tuple[float, float] | None = None
    changed: bool = False

    @property
    def text(self) -> str:
        """The value with its unit, as written: ``"7.7 kg cm2"``."""
        return self.value if isinstance(self.value, str) else format_quantity(self.value, self.unit)
