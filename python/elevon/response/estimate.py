"""Gain, phase and coherence from spectra of an input and an output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from elevon.arrays import Complex, Floats
from elevon.response.band import AgreementBand
from elevon.response.bode import BodeLines, zero_between
from elevon.response.linear import LinearModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class FrequencyResponse(BodeLines):
    """What a sine of each frequency becomes.

    Attributes
    ----------
    input, output : str
        Signals; the response is the output over the input, in `unit`.
    unit : str
        Of the gain; ``1`` when both have one unit.
    method : str
        ``multisine`` or ``sweep``.
    """

    input: str
    output: str
    unit: str
    method: str
    linear: LinearModel | None = None
    band: AgreementBand | None = None

    KIND: ClassVar = "response"
    COMPUTED: ClassVar = (
        "status",
        "gain",
        "gain_db",
        "phase_deg",
        "bandwidth_hz=bandwidth",
        "lag_90_hz=lag_90",
    )
    TABLE: ClassVar = "lines"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        reached = [
            f"{text} at {value:.3g} Hz" if value is not None else f"{text} not reached"
            for text, value in (("gain -3 dB", self.bandwidth), ("phase -90 deg", self.lag_90))
        ]
        return f"{self.input} to {self.output} of {self.actuator}: {', '.join(reached)}."

    @property
    def bandwidth(self) -> float | None:
        """Frequency in Hz at which the gain has fallen by 3 dB for good, or None."""
        return self.crossing()

    @property
    def lag_90(self) -> float | None:
        """Frequency in Hz at which the phase first lags by 90 degrees, or None."""
        return self.lag()

    @property
    def lines(self) -> list[dict[str, float]]:
        """One row a frequency."""
        columns = {
            "frequency_hz": self.frequency, "gain_db": self.gain_db, "phase_deg": self.phase_deg,
            "coherence": self.coherence, "gain_relative_std": self.std,
        }  # fmt: skip
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        return [dict(zip(columns, row, strict=True)) for row in rows]

    def crossing(self, drop_db: float = 3.0) -> float | None:
        """Return the frequency in Hz at which the gain has fallen by `drop_db` for good, or None.

        Against the lowest frequency's gain, interpolated in decibels over log frequency.
        """
        level = 20.0 * np.log10(self.gain / self.gain[0]) + drop_db
        above = np.flatnonzero(level >= 0.0)
        last = int(above[-1])
        if last == len(level) - 1:
            return None
        return zero_between(self.frequency, level, last)

    def lag(self, degrees: float = 90.0) -> float | None:
        """Return the frequency in Hz at which the phase first lags by `degrees`, or None."""
        level = np.rad2deg(self.phase) + degrees
        below = np.flatnonzero(level < 0.0)
        if not below.size or below[0] == 0:
            return None
        return zero_between(self.frequency, level, int(below[0]) - 1)

    def plot(self) -> Figure:
        """Return a Bode plot: gain, phase, coherence over frequency."""
        return self.bode(f"{self.input} to {self.output}, {self.method}", self.unit)


def estimate(inputs: Complex, outputs: Complex) -> tuple[Complex, Floats, Floats]:
    """Return response, coherence and relative deviation from spectra of several realisations.

    The estimator is that of noise at the output (H1); the deviation of gain and phase follows from
    the coherence (Bendat and Piersol, Random Data, chapter 9).

    Parameters
    ----------
    inputs, outputs : ndarray of complex, shape (realisations, n)
        Spectra at the same frequencies.
    """
    power = np.sum(np.abs(inputs) ** 2, axis=0)
    cross = np.sum(outputs * inputs.conj(), axis=0)
    coherence = np.abs(cross) ** 2 / (power * np.sum(np.abs(outputs) ** 2, axis=0))
    count = len(inputs)
    with np.errstate(invalid="ignore", divide="ignore"):
        std = np.sqrt(np.maximum(1.0 - coherence, 0.0) / (2.0 * coherence * count))
    std = std if count > 1 else np.full_like(std, np.nan)
    return cross / power, np.minimum(coherence, 1.0), std
