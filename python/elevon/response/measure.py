"""Frequency response by simulation: a multisine of random phases, or a swept sine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import InputError, unknown
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.response.estimate import FrequencyResponse, estimate
from elevon.scenario import Scenario
from elevon.scenario.compile import signal_units
from elevon.simulate import Run, check_fidelity, simulate_batch, solver_step
from elevon.simulate.prepare import ActuatorLike, as_actuator
from elevon.units import display_unit, parse_quantity

_UNITS = {"position": "", "speed": "rad/s", "torque": "N m"}  # of the command; "": the output's
_MOST = 24  # lines of a multisine: about ten in a decade are read well from a plot
_PERIODS = 2  # measured, after one in which the transient dies
_WIDEST = 1e4  # highest frequency over lowest: a period of the one is sampled for the other
_SAMPLES = 20  # a period of the highest frequency at least


def frequency_response(
    actuator: ActuatorLike,
    low: float | str,
    high: float | str,
    amplitude: float | str,
    *,
    output: str = "output_position",
    mode: str = "position",
    bias: float | str = 0.0,
    load: float | str = 0.0,
    method: str = "multisine",
    realisations: int = 6,
    fidelity: str = "high",
    seed: int = 0,
    progress: Progress | None = None,
) -> FrequencyResponse:
    """Measure the frequency response from the command to a signal.

    A nonlinear actuator has the response of its amplitude: backlash and stick show at a small one,
    limits of current and voltage at a large one. The realisations differ in phases (multisine) or
    noise, and what differs between them lowers the coherence.

    Parameters
    ----------
    actuator : Actuator, str or path
        What is measured.
    low, high : float or str
        Frequency range, Hz; the lowest is moved a little where its period must be a whole number
        of samples.
    amplitude : float or str
        Greatest value of the command about `bias`, in the mode's SI unit or with a unit.
    output : str
        A signal.
    mode : str
        ``position``, ``speed`` or ``torque``: what is commanded.
    bias : float or str
        Mean of the command.
    load : float or str
        Constant load on the output side.
    method : str
        ``multisine``: about 24 lines at once, equally spaced over the logarithm; ``sweep``: a sine
        whose frequency rises steadily.
    realisations : int
        Independent inputs, run side by side.
    fidelity, seed, progress
        As for `elevon.simulate`.

    Returns
    -------
    FrequencyResponse
        At the lines of the multisine, or the resolution of the sweep.

    Raises
    ------
    InputError
        An empty range, a frequency above what the solver resolves, an unknown method or signal, a
        run that tripped or diverged.
    """
    loaded = as_actuator(actuator)
    check_fidelity(loaded.wiring, fidelity)
    units = signal_units(loaded.wiring, fidelity)
    for what, name, known, place in (
        ("method", method, _DESIGNS, ""), ("mode", mode, _UNITS, ""),
        ("signal", output, units, "output"),
    ):  # fmt: skip
        if name not in known:
            raise unknown(what, name, known, place)
    unit = _UNITS[mode] or units["output_position"]
    excitation = Excitation(
        loaded, mode, unit, amplitude, bias, load, realisations=realisations, fidelity=fidelity,
        seed=seed,
    )  # fmt: skip
    design = _DESIGNS[method](*frequencies(low, high), solver_step(loaded, fidelity))
    recordings = excitation.recordings(design, f"command,{output}", progress)
    spectra = [design.spectra(item, output, excitation.mean) for item in recordings]
    response, coherence, std = estimate(*map(np.concatenate, zip(*spectra, strict=True)))
    return FrequencyResponse(
        frequency=design.frequency, response=response, coherence=coherence, std=std,
        input="command", output=output, method=method,
        unit="1" if units[output] == unit else f"{units[output]} / ({unit})",
        amplitude=excitation.size, realisations=realisations,
    )  # fmt: skip


@dataclass(frozen=True)
class Excitation:
    """How an actuator is excited: its fields are what `frequency_response` takes, and the unit."""

    actuator: Actuator
    mode: str
    unit: str
    amplitude: float | str
    bias: float | str
    load: float | str
    realisations: int
    fidelity: str
    seed: int

    def __post_init__(self) -> None:
        if not self.size > 0.0:
            raise InputError(f"amplitude = {self.amplitude} must be positive")
        if self.realisations < 1:
            raise InputError(f"realisations = {self.realisations} must be at least 1")

    @property
    def size(self) -> float:
        """Greatest value of the command about its mean, SI."""
        return parse_quantity(self.amplitude, self.unit, "amplitude", display_unit(self.unit))

    @property
    def mean(self) -> float:
        """Of the command, SI."""
        return parse_quantity(self.bias, self.unit, "bias", display_unit(self.unit))

    def recordings(
        self, design: Multisine | _Sweep, signals: str, progress: Progress | None
    ) -> list[Recording]:
        """Return a run for each realisation; `InputError` where one did not go to its end."""
        generator = np.random.default_rng(self.seed)
        runs = []
        for number in range(self.realisations):
            terms = [*design.terms(self.size, generator), {"kind": "constant", "value": self.mean}]
            scenario = scenario_of(design.duration, self.mode, terms, self.load)
            runs.append(Run(self.actuator, scenario, self.seed, number=number))
        record = f"{signals}@{design.rate!r} Hz"
        recordings = simulate_batch(runs, fidelity=self.fidelity, record=record, progress=progress)
        for item in recordings:
            if item.status != "ok":
                raise InputError(
                    f"the run {item.status}: {item.meta['message']}; a smaller amplitude may do"
                )
        return recordings


def frequencies(low: float | str, high: float | str) -> tuple[float, float]:
    """Return a range in Hz; `InputError` where it is none."""
    first, last = parse_quantity(low, "Hz", "low"), parse_quantity(high, "Hz", "high")
    if not 0.0 < first < last:
        raise InputError(f"frequencies: {first:g} to {last:g} Hz is no range; 0 < low < high")
    return first, last


class Multisine:
    """Lines at whole multiples of the lowest frequency, with random phases.

    Parameters
    ----------
    low, high : float
        Hz.
    step : float
        Of the solver, s.
    lines : int
        At most, equally spaced over the logarithm.
    falling : bool
        Amplitudes fall as 1/f, so that a controller's derivative asks as much of each line; else
        they are equal.
    """

    def __init__(
        self, low: float, high: float, step: float, *, lines: int = _MOST, falling: bool = False
    ) -> None:
        sample = _sample(low, high, step)
        multiples = np.unique(np.round(np.geomspace(1.0, high / low, lines))).astype(int)
        self._count = round(1.0 / (low * sample))
        self.period = self._count * sample
        self.frequency: Floats = multiples / self.period
        self.duration = (1 + _PERIODS) * self.period
        self.rate = 1.0 / sample
        self._multiples = multiples
        self._shape = 1.0 / multiples if falling else np.ones(len(multiples))

    def terms(self, amplitude: float, generator: np.random.Generator) -> list[dict[str, object]]:
        """Return the waveforms of one realisation."""
        phases = generator.uniform(0.0, 2.0 * np.pi, self.frequency.size)
        time = np.linspace(0.0, self.period, 64 * int(self._multiples[-1]), endpoint=False)
        total = np.zeros_like(time)
        for frequency, phase, size in zip(self.frequency, phases, self._shape, strict=True):
            total += size * np.sin(2.0 * np.pi * frequency * time + phase)
        scale = amplitude / np.abs(total).max()
        return [
            {
                "kind": "sine",
                "amplitude": float(scale * a),
                "frequency": float(f),
                "phase": float(p),
            }
            for f, p, a in zip(self.frequency, phases, self._shape, strict=True)
        ]

    def spectrum(self, recording: Recording, name: str, mean: float = 0.0) -> object:
        """Return a signal at the lines, averaged over the measured periods, one row."""
        count = self._count
        values = recording[name].values[count : count * (1 + _PERIODS)] - mean
        spectrum = np.fft.rfft(values.reshape(_PERIODS, count), axis=1)
        return spectrum[:, self._multiples].mean(axis=0, keepdims=True)

    def spectra(self, recording: Recording, output: str, bias: float) -> tuple[object, object]:
        """Return input and output at the lines."""
        return self.spectrum(recording, "command", bias), self.spectrum(recording, output)


class _Sweep:
    """A sine whose frequency rises in time, read by averaged spectra of overlapping stretches."""

    def __init__(self, low: float, high: float, step: float) -> None:
        self.rate = 1.0 / _sample(low, high, step)
        self._stretch = int(2 ** np.ceil(np.log2(2.0 * self.rate / low)))
        self.duration = 8.0 * self._stretch / self.rate
        grid = np.fft.rfftfreq(self._stretch, 1.0 / self.rate)
        self._lines = np.flatnonzero((grid >= low) & (grid <= high))
        self.frequency: Floats = np.asarray(grid[self._lines], dtype=np.float64)
        self._ends = (low, high)

    def terms(self, amplitude: float, generator: np.random.Generator) -> list[dict[str, Any]]:
        low, high = self._ends
        phase = float(generator.uniform(0.0, 2.0 * np.pi))
        sweep = {"start_frequency": low, "end_frequency": high, "sweep_time": self.duration}
        return [{"kind": "chirp", "amplitude": amplitude, "phase": phase, **sweep}]

    def spectra(self, recording: Recording, output: str, bias: float) -> tuple[Any, Any]:
        """Return input and output at the lines, one row a stretch."""
        window = np.hanning(self._stretch)
        rows = []
        for name, mean in (("command", bias), (output, 0.0)):
            values = recording[name].values - mean
            starts = range(0, values.size - self._stretch + 1, self._stretch // 2)
            parts = np.array([values[k : k + self._stretch] for k in starts])
            rows.append(np.fft.rfft(parts * window, axis=1)[:, self._lines])
        return rows[0], rows[1]


_DESIGNS: dict[str, type[Multisine | _Sweep]] = {"multisine": Multisine, "sweep": _Sweep}


def _sample(low: float, high: float, step: float) -> float:
    """Return the time between samples: whole solver steps, enough of them for the highest line."""
    steps = int(1.0 / (_SAMPLES * high * step) * (1.0 + 1e-9))
    if steps < 1:
        raise InputError(
            f"high = {high:g} Hz: the solver's step of {step:g} s resolves up to "
            f"{1.0 / (_SAMPLES * step):g} Hz here ({_SAMPLES} steps a period)"
        )
    if high > _WIDEST * low:
        raise InputError(
            f"low = {low:g} Hz: is more than {_WIDEST:g} times below high = {high:g} Hz; measure "
            "the range in parts"
        )
    return steps * step


def scenario_of(
    duration: float, mode: str, terms: list[dict[str, object]], load: float | str
) -> Scenario:
    """Return the run of one realisation."""
    loads = {"load": {"output": {"terms": [{"kind": "constant", "value": load}]}}} if load else {}
    command = {"mode": mode, "terms": terms}
    return Scenario.from_dict({"duration": duration, "command": command, **loads})
