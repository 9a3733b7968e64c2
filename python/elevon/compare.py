"""The reduced-order model beside the switching one: how far apart, and how much faster."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.errors import InputError, RangeError, SimulationError
from elevon.plain import STORED, in_unit, key
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report import ReportTable
from elevon.results import Result
from elevon.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.report import Report

Array = npt.NDArray[np.float64]

ROLES = {"position": "output_position", "speed": "motor_speed", "q_current": "torque_current"}
"""What is compared, and the role that shows it."""
SIGNALS = ("output_position", "motor_speed", "current_q")
"""The channels of these roles in a servo, true values before what the sensors show."""
RATES = {"high": "10 kHz", "low": "10 kHz"}
"""The relays' ripple (1 to 5 kHz) must not alias. Both alike, or the recording would be compared: a
landing gear recorded at each step of 20 us takes four times as long. See `compared_rate`."""
GRID_HZ = 400.0
"""Rate at which the filtered signals are compared: that of the bench's log."""
START_S = 10.0
CUTOFF_HZ = 10.0
LOADS = {"as given": 0.0, "opposing": 1.0, "aiding": -1.0}
"""Name of each run and the sign of its load along the motion."""
_LOAD_RATE = 200.0  # Hz of the load's table
_AT_REST = 0.05
"""Share of the greatest speed below which the load fades: the direction of rest is none."""


@dataclass(frozen=True)
class Comparison(Result):
    """Two runs of one scenario, filtered alike, on one time base.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Common time after `start` [s].
    high, low : mapping of str to ndarray, shape (n,)
        By signal, filtered: output position [rad or m], motor speed [rad/s], torque current [A].
    signals : mapping of str to str
        Position, speed and q_current: the signal compared.
    amplitude : float
        Half the range of the switching model's position, its normaliser [rad or m].
    start, cutoff : float
        What came before is left out [s]; cut-off of the filter [Hz].
    actuator : str
        Its name.
    unit : str
        Of the position.
    high_wall_s, low_wall_s, sim_s : float
        Wall time of each run, integration alone, and simulated time [s].
    faults : tuple of str
        In both.
    parameter_hash, seed : str, int
        Of both.
    loads : mapping of str to Comparison
        The same under load, where that was requested.
    """

    time: Annotated[Array, STORED]
    high: Annotated[Mapping[str, Array], STORED]
    low: Annotated[Mapping[str, Array], STORED]
    signals: Mapping[str, str]
    amplitude: Annotated[float, STORED]
    start: Annotated[float, key("start_s"), in_unit("s")]
    cutoff: Annotated[float, STORED, in_unit("Hz")]
    actuator: str
    unit: Annotated[str, STORED]
    high_wall_s: Annotated[float, in_unit("s")] = field(compare=False)
    low_wall_s: Annotated[float, in_unit("s")] = field(compare=False)
    sim_s: Annotated[float, STORED]
    faults: tuple[str, ...]
    parameter_hash: str
    seed: int
    loads: Mapping[str, Comparison] = field(default_factory=dict)

    KIND: ClassVar = "comparison"
    COMPUTED: ClassVar = (
        "status", "position_nrmse", "speed_nrmse", "q_current_nrmse", "speed_up", "filter",
        "high_realtime_factor", "low_realtime_factor",
    )  # fmt: skip
    status: ClassVar = "ok"

    def to_dict(self, *, stored: bool = True) -> dict[str, Any]:
        """Return the JSON form, beside it the errors by their units."""
        position, speed, current = (self.signals[part] for part in ROLES)
        return super().to_dict(stored=stored) | {
            f"position_rms_error_{self.unit}": self.rms_error(position),
            "speed_rms_error_rad_per_s": self.rms_error(speed),
            "q_current_rms_error_a": self.rms_error(current),
            "q_current_rms_a": _rms(self.high[current]),
            f"amplitude_{self.unit}": self.amplitude,
        }

    def rms_error(self, signal: str) -> float:
        """Return the RMS of the two models' difference, in the signal's own unit."""
        return _rms(self.low[signal] - self.high[signal])

    @property
    def position_nrmse(self) -> float:
        """RMS position error over the amplitude of the motion."""
        return self.rms_error(self.signals["position"]) / self.amplitude

    @property
    def speed_nrmse(self) -> float:
        """RMS speed error over the RMS speed."""
        name = self.signals["speed"]
        return self.rms_error(name) / _rms(self.high[name])

    @property
    def q_current_nrmse(self) -> float:
        """RMS current error over the RMS current."""
        name = self.signals["q_current"]
        return self.rms_error(name) / _rms(self.high[name])

    @property
    def speed_up(self) -> float:
        """Wall time of the switching model over the reduced-order one's, integration alone."""
        return _over(self.high_wall_s, self.low_wall_s)

    @property
    def high_realtime_factor(self) -> float:
        """Simulated time over wall time of the switching model."""
        return _over(self.sim_s, self.high_wall_s)

    @property
    def low_realtime_factor(self) -> float:
        """Simulated time over wall time of the reduced-order model."""
        return _over(self.sim_s, self.low_wall_s)

    @property
    def filter(self) -> str:
        """Through which both went, in words."""
        return f"Butterworth, 2nd order, {self.cutoff:g} Hz, forwards and backwards"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        return (
            f"{self.actuator}: the reduced-order model is {100 * self.position_nrmse:.3g} % of the "
            f"amplitude from the switching one, {self.speed_up:.0f} times as fast."
        )

    def text_tables(self) -> list[ReportTable]:
        """Return the differences and the speeds, of each load where there are several."""
        values = self.to_dict(stored=False)
        runs = values["loads"] or {"": values}
        lines = (
            ("output position", "position_nrmse", ".3%", "of the amplitude"),
            ("motor speed", "speed_nrmse", ".3%", "of its RMS"),
            ("torque current", "q_current_nrmse", ".3%", "of its RMS"),
            ("reduced-order model", "low_realtime_factor", ".0f", "times real time"),
            ("speed-up", "speed_up", ".0f", "times the switching model"),
        )
        rows = [
            [name, *(f"{run[key]:{form}} {what}".replace("%", " %") for run in runs.values())]
            for name, key, form, what in lines
        ]
        return [ReportTable(["RMS of low less high", *runs], rows)]

    @property
    def remarks(self) -> list[str]:
        """What of the runs was compared."""
        values = self.to_dict(stored=False)
        return [f"after {values['start_s']:g} s; {values['filter']}"]


def default_scenario(actuator: Actuator) -> Scenario:
    """Return what an actuator is compared on when nothing is given.

    Its file's ``[compare]``, else its own scenario, else the ``[compare]`` of an actuator file that
    comes with the package and has the same wiring.

    Raises
    ------
    InputError
        There is none of these.
    """
    data = (actuator.compare or {}).get("scenario") or actuator.default_scenario
    if data is None:
        data = _shipped(actuator.wiring)
    if data is None:
        raise InputError(f"{actuator.name} has no scenario of its own; give one with --scenario")
    return Scenario.from_dict(data, f"{actuator.name}: compare.scenario")


def _shipped(wiring: str) -> Mapping[str, Any] | None:
    from elevon.parameters.load import set_names

    sets = (Actuator.load(name) for name in set_names())
    tables = (item.compare for item in sets if item.wiring == wiring)
    return next((table["scenario"] for table in tables if table is not None), None)


def default_start(actuator: Actuator, scenario: Scenario, *, default: bool) -> float:
    """Return what is left out at the beginning [s].

    `default`: the scenario is the actuator's, not the caller's. What the actuator file says; else
    10 s, of an actuator's own scenario a third at most.
    """
    if actuator.compare is not None:
        return float(actuator.compare["after"])
    return min(START_S, scenario.seconds / 3.0) if default else START_S


def compare(
    actuator: Actuator,
    scenario: Scenario | None = None,
    *,
    seed: int = 0,
    start: float | None = None,
    cutoff: float = CUTOFF_HZ,
    progress: Progress | None = None,
) -> Comparison:
    """Run one scenario with both models and compare what came out.

    Parameters
    ----------
    actuator : Actuator
        What moves.
    scenario : Scenario, optional
        By default `default_scenario`.
    seed : int
        Of the random numbers of both.
    start : float, optional
        What came before is left out [s]; default `default_start`.
    cutoff : float
        Cut-off of the one filter through which both go [Hz].
    progress : callable, optional
        As for `simulate`.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        The scenario ends before `start` or does not move after it; or as `simulate`.
    SimulationError
        One of the runs did not reach its end.
    """
    default = scenario is None
    scenario = default_scenario(actuator) if scenario is None else scenario
    start = default_start(actuator, scenario, default=default) if start is None else start
    if not (math.isfinite(cutoff) and cutoff > 0.0):
        raise RangeError(f"cutoff = {cutoff:g} Hz: must be above 0 and finite")
    if scenario.seconds <= start + 1.0 / cutoff:
        raise InputError(
            f"compare: the scenario lasts {scenario.seconds:g} s; what is compared begins at "
            f"{start:g} s (--after) and needs {1.0 / cutoff:g} s at least"
        )
    high, low = run_pair(actuator, scenario, seed=seed, progress=progress)
    names = compared_signals(actuator.wiring)
    grid = np.arange(start, scenario.seconds, 1.0 / GRID_HZ)
    signals = [
        {name: filtered(run, name, grid, cutoff) for name in names.values()} for run in (high, low)
    ]
    amplitude = float(np.ptp(signals[0][names["position"]])) / 2.0
    if amplitude == 0.0:
        raise InputError(f"compare: nothing moves after {start:g} s, there is no amplitude")
    return Comparison(
        grid, signals[0], signals[1], names, amplitude, start, cutoff,
        actuator=str(high.meta["actuator"]),
        unit=high[names["position"]].unit,
        high_wall_s=float(high.meta["wall_s"]),
        low_wall_s=float(low.meta["wall_s"]),
        sim_s=float(high.meta["sim_s"]),
        faults=tuple(high.meta["faults"]),
        parameter_hash=str(high.meta["parameter_hash"]),
        seed=int(high.meta["seed"]),
    )  # fmt: skip


def compared_signals(wiring: str) -> dict[str, str]:
    """Return part to signal: of those with the role, the first that both fidelities have.

    The first is the true quantity; what a sensor shows of it stands behind it. A mean over the
    control period (``..._mean``) goes first: samples of a chopped current would alias.
    """
    from elevon.scenario.compile import signal_records

    high, low = (signal_records(wiring, fidelity) for fidelity in RATES)
    both = sorted((name for name in high if name in low), key=lambda n: not n.endswith("_mean"))
    playing = [(high[name]["role"], name) for name in both]
    return {
        part: next(n for role, n in playing if role == wanted) for part, wanted in ROLES.items()
    }


def compared_rate(actuator: Actuator, fidelity: str) -> str:
    """Return the rate at which a model is recorded: every so many of its steps.

    `RATES`, or the next higher rate that is a whole number of steps; longer steps: every one.
    """
    from elevon.simulate import solver_step
    from elevon.units import parse_quantity

    step = solver_step(actuator, fidelity)
    steps = 1.0 / (step * parse_quantity(RATES[fidelity], "Hz", "rate"))
    period = math.floor(steps * (1.0 + 1e-9))  # rounding of a step that divides the period
    return f"{1.0 / (period * step)!r} Hz" if period > 1 else "every"


def run_pair(
    actuator: Actuator, scenario: Scenario, *, seed: int = 0, progress: Progress | None = None
) -> tuple[Recording, Recording]:
    """Return the recordings of one scenario with both models; errors as `compare`."""
    from elevon.progress import part
    from elevon.simulate import simulate
    from elevon.simulate.acting import together

    names = ",".join(compared_signals(actuator.wiring).values())
    record = {name: f"{names}@{compared_rate(actuator, name)}" for name in RATES}
    spans = {"high": part(progress, 0.0, 0.95), "low": part(progress, 0.95, 1.0)}
    with together((actuator, scenario, name) for name in RATES):
        high, low = (
            simulate(
                actuator, scenario, fidelity=name, record=record[name], seed=seed, progress=span
            )
            for name, span in spans.items()
        )
    for name, run in zip(spans, (high, low), strict=True):
        if run.status != "ok":
            raise SimulationError(
                f"compare: the {name} model ended as {run.status} after "
                f"{run.meta['sim_s']:g} s: {run.meta['message']}",
                run.status,
            )
    return high, low


def filtered(recording: Recording, name: str, grid: Array, cutoff: float) -> Array:
    """Return one signal through the comparison's filter, at the times of `grid`.

    A second-order Butterworth low-pass runs forwards and backwards, so that it delays nothing.

    Raises
    ------
    InputError
        The cut-off is not below half the recording's rate.
    """
    from scipy.signal import butter, sosfiltfilt

    channel = recording[name]
    rate = 1.0 / float(np.median(np.diff(channel.time)))
    if not 0.0 < cutoff < rate / 2.0:
        raise InputError(f"cut-off {cutoff:g} Hz is not between 0 and {rate / 2.0:g} Hz")
    sections = butter(2, cutoff, fs=rate, output="sos")
    smooth = np.asarray(sosfiltfilt(sections, channel.values), dtype=np.float64)
    return np.interp(grid, channel.time, smooth)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _over(time: float, wall: float) -> float:
    return time / wall if wall > 0.0 else float("inf")


def compare_loads(
    actuator: Actuator,
    scenario: Scenario | None = None,
    *,
    load: str | float | None = None,
    seed: int = 0,
    start: float | None = None,
    cutoff: float = 10.0,
    progress: Progress | None = None,
) -> dict[str, Comparison]:
    """Compare both fidelities on a scenario as it is, and with a load against and along its motion.

    The load acts on the output. Its direction is that of the motion without it (reduced-order
    model); it fades out below 5 % of the greatest speed.

    Parameters
    ----------
    load : quantity, optional
        Size of the load [N or N m at the output]; default the actuator file's ``[compare]``.
    actuator, scenario, seed, start, cutoff, progress
        As for `elevon.compare.compare`.

    Returns
    -------
    dict of str to Comparison
        ``as given``, ``opposing``, ``aiding``.

    Raises
    ------
    InputError, SimulationError
        As `compare`; nothing says how large the load is.
    """
    default = scenario is None
    base = default_scenario(actuator) if scenario is None else scenario
    start = default_start(actuator, base, default=default) if start is None else start
    size = load_size(actuator, load)
    times, direction = _direction(actuator, base, seed)
    results = {}
    for number, (name, sign) in enumerate(LOADS.items()):
        loaded = base if sign == 0.0 else _loaded(base, times, sign * size * direction)
        share = part(progress, number / len(LOADS), (number + 1) / len(LOADS))
        results[name] = compare(
            actuator, loaded, seed=seed, start=start, cutoff=cutoff, progress=share
        )
    return results


def load_size(actuator: Actuator, load: str | float | None = None) -> float:
    """Return the size of the load [N or N m]: as given, else as the actuator file says."""
    from elevon import _core
    from elevon.units import parse_quantity

    given = (actuator.compare or {}).get("load") if load is None else load
    if given is None:
        raise InputError(
            f"{actuator.name}: its set has no [compare] load; give one with --load, such as '500 N'"
        )
    unit = next(port["unit"] for port in _core.ports(actuator.wiring) if port["name"] == "output")
    size = parse_quantity(given, unit, "load")
    if size <= 0.0:
        raise InputError(f"load = {given} must be above 0")
    return size


def _direction(actuator: Actuator, scenario: Scenario, seed: int) -> tuple[Any, Any]:
    """Direction of the motion over time, between -1 and 1."""
    from elevon.simulate import simulate

    run = simulate(actuator, scenario, fidelity="low", record="output_speed@every", seed=seed)
    if run.status != "ok":
        raise SimulationError(f"compare: the motion ended as {run.status}", run.status)
    speed = run["output_speed"]
    times = np.arange(0.0, scenario.seconds, 1.0 / _LOAD_RATE)
    values = np.interp(times, speed.time, speed.values)
    return times, np.tanh(values / (_AT_REST * max(float(np.abs(values).max()), 1e-12)))


def _loaded(scenario: Scenario, times: Any, values: Any) -> Scenario:
    """Return the scenario with one more load at the output."""
    data = scenario.to_dict()
    term = {"kind": "table", "times": times.tolist(), "values": values.tolist()}
    load = dict(data.get("load", {}))
    terms = list(load.get("output", {}).get("terms", []))
    return scenario.replaced(load={**load, "output": {"terms": [*terms, term]}})


_SHOWN_NAMES = {
    "position": "Output position",
    "speed": "Motor speed",
    "q_current": "Torque current",
}
_SHOWN_UNITS = {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3), "rad/s": ("rpm", 30.0 / np.pi)}


def compare_report(comparison: Comparison, actuator: str, *, date: str | None = None) -> Report:
    """Return the page of a comparison; `actuator` is named as on the command line."""
    from elevon.report import Report, ReportTable, provenance

    values = comparison.to_dict()
    report = Report(
        f"High and low fidelity of {values['actuator']}",
        f"Both models on one scenario, after {comparison.start:g} s, through one filter: "
        f"{values['filter']}.",
        date=date,
    )
    error, speed_up = "RMS error over RMS", f"{comparison.speed_up:.0f}"
    report.fact("Position", f"{100 * comparison.position_nrmse:.3f} %", "RMS error over amplitude")
    report.fact("Speed", f"{100 * comparison.speed_nrmse:.2f} %", error)
    report.fact("Torque current", f"{100 * comparison.q_current_nrmse:.2f} %", error)
    real_time = f"low at {values['low_realtime_factor']:.0f} times real time"
    report.fact("Speed-up", speed_up, real_time)
    section = report.section("Side by side")
    for figure, caption in comparison_figures(comparison):
        section.figure(figure, caption)
    numbers = [item for item in values.items() if isinstance(item[1], float)]
    report.section("Numbers").table(ReportTable(["Quantity", "Value"], numbers))
    made = {"Parameter hash": values["parameter_hash"], "Seed": values["seed"]}
    faults = ", ".join(values["faults"]) or "none"
    report.provenance(provenance(f"elevon compare {actuator} --out DIR", **made, Faults=faults))
    return report


def comparison_figures(comparison: Comparison) -> Iterator[tuple[Figure, str]]:
    """Yield a figure of each compared signal, both models and their difference, and its caption."""
    from elevon.report.figures import COLOURS, new_figure

    units = {"position": comparison.unit, "speed": "rad/s", "q_current": "A"}
    time = comparison.time
    for part_name, signal in comparison.signals.items():
        unit, scale = _SHOWN_UNITS.get(units[part_name], (units[part_name], 1.0))
        high, low = scale * comparison.high[signal], scale * comparison.low[signal]
        label = f"{_SHOWN_NAMES[part_name]} [{unit}]"
        with new_figure(2, height=3.8, sharex=True, height_ratios=[3, 1]) as (figure, axes):
            both, difference = axes
            both.plot(time, high, color=COLOURS["blue"], lw=2.2, label="high")
            both.plot(time, low, "--", color=COLOURS["orange"], lw=1.4, label="low")
            both.set_ylabel(label)
            both.legend(loc="upper right", ncols=2)
            difference.plot(time, low - high, color=COLOURS["grey"], lw=1.0)
            difference.set(xlabel="Time [s]", ylabel="low - high")
        yield figure, f"{label}, high and low, and their difference."
