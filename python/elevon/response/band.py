"""The band in which the reduced-order model answers as the switching model does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from elevon.errors import InputError
from elevon.plain import Plain, in_unit, key

if TYPE_CHECKING:
    from elevon.response.estimate import FrequencyResponse

_COHERENT = (
    0.5  # of the output's power: below it backlash, friction and limits decide, not the loop
)


@dataclass(frozen=True)
class AgreementBand(Plain):
    """Up to which frequency two responses agree.

    Attributes
    ----------
    gain : float
        Largest relative difference of the gain.
    phase : float
        Largest difference of the phase, rad.
    holds_to : float or None
        Hz; the highest line that agrees, all decided ones below it, too. None: not even the lowest.
    fails_at : float or None
        Hz; the lowest line that does not agree.
    undecided : int
        Lines at which less than half of the output's power is linear in the input, in either
        model: they decide nothing. Both have the same inputs, so what scatters is mostly common.
    """

    gain: Annotated[float, key("gain_limit")]
    phase: Annotated[float, key("phase_limit"), in_unit("rad")]
    holds_to: Annotated[float | None, key("holds_to_hz"), in_unit("Hz")]
    fails_at: Annotated[float | None, key("fails_at_hz"), in_unit("Hz")]
    undecided: Annotated[int, key("undecided_lines")]

    COMPUTED: ClassVar = ("phase_limit_deg",)

    @property
    def phase_limit_deg(self) -> float:
        """Largest difference of the phase in degrees."""
        return float(np.degrees(self.phase))

    @property
    def text(self) -> str:
        """In one sentence."""
        limits = f"within {100 * self.gain:g} % and {np.degrees(self.phase):g} deg"
        if self.holds_to is None and self.fails_at is None:
            return f"reduced-order against switching model: no line decides ({limits})"
        if self.fails_at is None:
            return f"reduced-order model {limits} of the switching one to {self.holds_to:.3g} Hz"
        first = (
            "at no line below" if self.holds_to is None else f"to {self.holds_to:.3g} Hz, not at"
        )
        return f"reduced-order model {limits} of the switching one {first} {self.fails_at:.3g} Hz"


def band_of(
    switching: FrequencyResponse,
    reduced: FrequencyResponse,
    *,
    gain: float = 0.10,
    phase: float = float(np.radians(10.0)),
) -> AgreementBand:
    """Compare two responses to the same inputs, line by line.

    Parameters
    ----------
    switching, reduced : FrequencyResponse
        Of the same lines.
    gain : float
        Relative difference that is allowed.
    phase : float
        Difference in rad that is allowed.

    Raises
    ------
    InputError
        Their lines differ.
    """
    lines = switching.frequency
    if lines.shape != reduced.frequency.shape or not np.allclose(lines, reduced.frequency):
        raise InputError("the band of two responses needs the same frequencies in both")
    ratio = reduced.response / switching.response
    decided = np.minimum(switching.coherence, reduced.coherence) >= _COHERENT
    out = (np.abs(np.abs(ratio) - 1.0) > gain) | (np.abs(np.angle(ratio)) > phase)
    wrong = lines[decided & out]
    fails = float(wrong[0]) if wrong.size else None
    good = lines[decided & ~out & (lines < (np.inf if fails is None else fails))]
    holds = float(good[-1]) if good.size else None
    return AgreementBand(gain, phase, holds, fails, int(np.count_nonzero(~decided)))
