"""Frequency response by simulation: a multisine of random phases, or a swept sine."""

from __future__ import annotations

from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError, unknown
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.response.estimate import FrequencyResponse, estimate
from elevon.scenario import Scenario
from elevon.scenario.compile import signal_units
from elevon.simulate import Run, check_fidelity, simulate_batch, solver_step
from elevon.simulate.arguments import ActuatorLike, as_actuator
from elevon.units import display_unit, parse_quantity

METHODS = ("multisine", "sweep")
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
    unit_of_command = {"position": "", "speed": "rad/s", "torque": "N m"}
    loaded = as_actuator(actuator)
    check_fidelity(loaded.wiring, fidelity)
    if method not in METHODS:
        raise unknown("method", method, METHODS)
    if mode not in unit_of_command:
        raise unknown("mode", mode, unit_of_command)
    units = signal_units(loaded.wiring, fidelity)
    if output not in units:
        raise unknown("signal", output, units, "output")
    unit = unit_of_command[mode] or units["output_position"]
    first, last = frequencies(low, high)
    size = parse_quantity(amplitude, unit, "amplitude", display_unit(unit))
    if not size > 0.0:
        raise InputError(f"amplitude = {amplitude} must be positive")
    if realisations < 1:
        raise InputError(f"realisations = {realisations} must be at least 1")
    design = (Multisine if method == "multisine" else _Sweep)(
        first, last, solver_step(loaded, fidelity)
    )
    mean = parse_quantity(bias, unit, "bias", display_unit(unit))
    generator = np.random.default_rng(seed)
    runs = []
    for number in range(realisations):
        terms = [*design.terms(size, generator), {"kind": "constant", "value": mean}]
        runs.append(
            Run(loaded, scenario_of(design.duration, mode, terms, load), seed, number=number)
        )
    record = f"command,{output}@{design.rate!r} Hz"
    recordings = simulate_batch(runs, fidelity=fidelity, record=record, progress=progress)
    require_finished(recordings)
    spectra = [design.spectra(item, output, mean) for item in recordings]
    response, coherence, std = estimate(
        np.concatenate([item[0] for item in spectra]), np.concatenate([item[1] for item in spectra])
    )
    return FrequencyResponse(
        frequency=design.frequency,
        response=response,
        coherence=coherence,
        std=std,
        input="command",
        output=output,
        unit="1" if units[output] == unit else f"{units[output]} / ({unit})",
        method=method,
        amplitude=size,
        realisations=realisations,
    )


def frequencies(low: float | str, high: float | str) -> tuple[float, float]:
    """Return a range in Hz; `InputError` where it is none."""
    first, last = parse_quantity(low, "Hz", "low"), parse_quantity(high, "Hz", "high")
    if not 0.0 < first < last:
        raise InputError(f"frequencies: {first:g} to {last:g} Hz is no range; 0 < low < high")
    return first, last


def require_finished(recordings: list[Recording]) -> None:
    """Raise `InputError` for a run that tripped or diverged."""
    for item in recordings:
        if item.status != "ok":
            raise InputError(
                f"the run {item.status}: {item.meta['message']}; a smaller amplitude may do"
            )


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
