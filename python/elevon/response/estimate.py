"""Gain, phase and coherence from spectra of an input and an output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from elevon.arrays import Complex, Floats
from elevon.errors import InputError
from elevon.plain import Plain, in_unit, key
from elevon.report import ReportTable
from elevon.response.linear import BodeLines, LinearModel, zero_between

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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

    def text_tables(self) -> list[ReportTable]:
        """Return gain, phase and coherence, frequency by frequency."""
        data = self.to_dict()
        columns = ("frequency [Hz]", "gain [dB]", "phase [deg]", "coherence", "gain +- [%]")
        keys = ("frequency_hz", "gain_db", "phase_deg", "coherence")
        numbers = zip(*(data[key] for key in keys), 100.0 * 1.645 * self.std, strict=True)
        formats = ("{:.4g}", "{:.2f}", "{:.1f}", "{:.3f}", "{:.1f}")
        rows = [[f.format(x) for f, x in zip(formats, row, strict=True)] for row in numbers]
        return [ReportTable(columns, rows)]

    @property
    def remarks(self) -> list[str]:
        """The linear model, where one was asked for, and the band in which it holds."""
        texts = []
        if (model := self.linear) is not None:
            poles = [f"{x.real:.4g}{f'{x.imag:+.4g}j' if x.imag else ''}" for x in model.poles]
            texts.append(f"linear model: {model.order} states, error {model.error:.2g}")
            texts.append(f"poles [1/s]: {', '.join(poles)}")
        return texts if self.band is None else [*texts, self.band.text]

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
