"""Gain, phase and coherence from spectra of an input and an output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FrequencyResponse", "estimate"]

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class FrequencyResponse:
    """What a sine of each frequency becomes.

    Attributes
    ----------
    frequency : ndarray, shape (n,)
        Hz.
    response : ndarray of complex, shape (n,)
        Output over input, in `unit`.
    coherence : ndarray, shape (n,)
        Share of the output's power that is linear in the input, 0 to 1: noise and nonlinearity
        (backlash, friction, limits) take the rest.
    std : ndarray, shape (n,)
        Relative standard deviation of the gain, and of the phase in rad; NaN of one realisation.
    input, output : str
        Signals.
    unit : str
        Of the gain; ``1`` when both have one unit.
    method : str
        ``multisine`` or ``sweep``.
    amplitude : float
        Greatest value of the input about its mean, SI.
    realisations : int
        Independent inputs the figures stand on.
    """

    frequency: Floats
    response: Complex
    coherence: Floats
    std: Floats
    input: str
    output: str
    unit: str
    method: str
    amplitude: float
    realisations: int

    @property
    def gain(self) -> Floats:
        """Gain in `unit`, shape (n,)."""
        return np.abs(self.response)

    @property
    def phase(self) -> Floats:
        """Phase in rad, unwrapped from the lowest frequency on, shape (n,)."""
        return np.unwrap(np.angle(self.response))

    def crossing(self, drop_db: float = 3.0) -> float | None:
        """Return the frequency in Hz at which the gain has fallen by `drop_db` for good, or None.

        Against the lowest frequency's gain, interpolated in decibels over log frequency.
        """
        level = 20.0 * np.log10(self.gain / self.gain[0]) + drop_db
        above = np.flatnonzero(level >= 0.0)
        last = int(above[-1])
        if last == len(level) - 1:
            return None
        return self._between(last, level)

    def lag(self, degrees: float = 90.0) -> float | None:
        """Return the frequency in Hz at which the phase first lags by `degrees`, or None."""
        level = np.rad2deg(self.phase) + degrees
        below = np.flatnonzero(level < 0.0)
        return None if not below.size or below[0] == 0 else self._between(int(below[0]) - 1, level)

    def _between(self, at: int, level: Floats) -> float:
        low, high = np.log(self.frequency[at : at + 2])
        share = level[at] / (level[at] - level[at + 1])
        return float(np.exp(low + share * (high - low)))

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "input": self.input,
            "output": self.output,
            "unit": self.unit,
            "method": self.method,
            "amplitude": self.amplitude,
            "realisations": self.realisations,
            "frequency_hz": self.frequency,
            "gain": self.gain,
            "gain_db": 20.0 * np.log10(self.gain),
            "phase_deg": np.rad2deg(self.phase),
            "coherence": self.coherence,
            "gain_relative_std": self.std,
            "bandwidth_hz": self.crossing(),
            "lag_90_hz": self.lag(),
        }

    def plot(self) -> Figure:
        """Return a Bode plot: gain, phase, coherence over frequency."""
        from elevon.response.bode import bode_plot

        return bode_plot(
            self.frequency, self.response, self.std, self.coherence,
            title=f"{self.input} to {self.output}, {self.method}", unit=self.unit,
        )  # fmt: skip


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
