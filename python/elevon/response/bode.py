"""Bode plots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def bode_plot(
    frequency: Floats,
    response: npt.NDArray[np.complex128],
    std: Floats,
    coherence: Floats,
    *,
    title: str,
    unit: str = "1",
) -> Figure:
    """Return gain, phase and coherence over frequency, with intervals of 90 %.

    Parameters
    ----------
    frequency : ndarray, shape (n,)
        Hz.
    response : ndarray of complex, shape (n,)
        In `unit`.
    std : ndarray, shape (n,)
        Relative deviation of the gain, and of the phase in rad; NaN: none drawn.
    coherence : ndarray, shape (n,)
        0 to 1.
    title, unit : str
        Of the plot and of the gain.
    """
    from elevon.report.figures import new_figure

    with new_figure(3, 1, height=7.0, sharex=True, height_ratios=[2, 2, 1]) as (figure, axes):
        gain, phase = 20.0 * np.log10(np.abs(response)), np.unwrap(np.angle(response))
        spread = 20.0 / np.log(10.0) * 1.645 * np.nan_to_num(std)
        turned = np.rad2deg(1.645 * np.nan_to_num(std))
        for axis, line, width in ((axes[0], gain, spread), (axes[1], np.rad2deg(phase), turned)):
            axis.fill_between(frequency, line - width, line + width, alpha=0.25, lw=0)
            axis.semilogx(frequency, line, marker=".", ms=4)
        axes[2].semilogx(frequency, coherence, marker=".", ms=4)
        axes[0].set_title(title)
        axes[0].set_ylabel(f"gain [dB of 1 {unit}]" if unit != "1" else "gain [dB]")
        axes[1].set_ylabel("phase [deg]")
        axes[2].set(ylabel="coherence", xlabel="frequency [Hz]", ylim=(0.0, 1.05))
    return figure
