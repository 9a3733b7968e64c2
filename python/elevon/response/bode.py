"""What every response over frequency has: its lines, in decibels and degrees, and a Bode plot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from elevon.arrays import Complex, Floats
from elevon.plain import STORED, in_unit, key
from elevon.results import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class BodeLines(Result):
    """A response at each line.

    Attributes
    ----------
    frequency : ndarray, shape (n,)
        Hz.
    response : ndarray of complex, shape (n,)
        Output over input, or feedback over error.
    coherence : ndarray, shape (n,)
        Share of the output's power that is linear in the input, 0 to 1: noise and nonlinearity
        (backlash, friction, limits) take the rest.
    std : ndarray, shape (n,)
        Relative standard deviation of the gain, and of the phase in rad; NaN of one realisation.
    amplitude : float
        Greatest value of the input about its mean, SI.
    realisations : int
        Independent inputs the figures stand on.
    actuator : str
        Its name.
    """

    frequency: Annotated[Floats, key("frequency_hz"), in_unit("Hz")]
    response: Annotated[Complex, STORED]
    coherence: Floats
    std: Annotated[Floats, key("gain_relative_std")]
    amplitude: float
    realisations: int
    actuator: str = ""

    status: ClassVar = "ok"

    @property
    def gain(self) -> Floats:
        """Gain, shape (n,)."""
        return np.abs(self.response)

    @property
    def phase(self) -> Floats:
        """Phase in rad, unwrapped from the lowest frequency on, shape (n,)."""
        return np.unwrap(np.angle(self.response))

    @property
    def gain_db(self) -> Floats:
        """Gain in decibels, shape (n,)."""
        return np.asarray(20.0 * np.log10(self.gain))

    @property
    def phase_deg(self) -> Floats:
        """Phase in degrees, unwrapped, shape (n,)."""
        return np.asarray(np.rad2deg(self.phase))

    def bode(self, title: str, unit: str = "1") -> Figure:
        """Return gain, phase and coherence over frequency, with intervals of 90 %.

        Parameters
        ----------
        title, unit : str
            Of the plot and of the gain.
        """
        from elevon.report.figures import new_figure

        with new_figure(3, 1, height=7.0, sharex=True, height_ratios=[2, 2, 1]) as (figure, axes):
            spread = 20.0 / np.log(10.0) * 1.645 * np.nan_to_num(self.std)
            turned = np.rad2deg(1.645 * np.nan_to_num(self.std))
            lines = (self.gain_db, spread), (self.phase_deg, turned)
            for axis, (line, width) in zip(axes[:2], lines, strict=True):
                axis.fill_between(self.frequency, line - width, line + width, alpha=0.25, lw=0)
                axis.semilogx(self.frequency, line, marker=".", ms=4)
            axes[2].semilogx(self.frequency, self.coherence, marker=".", ms=4)
            axes[0].set_title(title)
            axes[0].set_ylabel(f"gain [dB of 1 {unit}]" if unit != "1" else "gain [dB]")
            axes[1].set_ylabel("phase [deg]")
            axes[2].set(ylabel="coherence", xlabel="frequency [Hz]", ylim=(0.0, 1.05))
        return figure


def zero_between(frequency: Floats, values: Floats, at: int) -> float:
    """Return where values between two lines are zero [Hz], interpolated over log frequency."""
    low, high = np.log(frequency[at : at + 2])
    share = values[at] / (values[at] - values[at + 1])
    return float(np.exp(low + share * (high - low)))
