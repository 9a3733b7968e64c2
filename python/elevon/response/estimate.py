"""Gain, phase and coherence from spectra of an input and an output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.plain import STORED, in_unit, key
from elevon.response.band import AgreementBand
from elevon.response.linear import LinearModel
from elevon.results import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class FrequencyResponse(Result):
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

    frequency: Annotated[Floats, key("frequency_hz"), in_unit("Hz")]
    response: Annotated[Complex, STORED]
    coherence: Floats
    std: Annotated[Floats, key("gain_relative_std")]
    input: str
    output: str
    unit: str
    method: str
    amplitude: float
    realisations: int
    actuator: str = ""
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
    status: ClassVar = "ok"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        reached = [
            f"{text} at {value:.3g} Hz" if value is not None else f"{text} not reached"
            for text, value in (("gain -3 dB", self.bandwidth), ("phase -90 deg", self.lag_90))
        ]
        return f"{self.input} to {self.output} of {self.actuator}: {', '.join(reached)}."

    @property
    def gain_db(self) -> Floats:
        """Gain in decibels, shape (n,)."""
        return np.asarray(20.0 * np.log10(self.gain))

    @property
    def phase_deg(self) -> Floats:
        """Phase in degrees, unwrapped, shape (n,)."""
        return np.asarray(np.rad2deg(self.phase))

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
