"""Figures 18 and 19 of the paper, and its comparison of two ways to seed a winding short (4.3).

The figures: a sine under a steady load with 10 % dynamic eccentricity, and with 20 % of the turns
of phase 1 shorted, phase current beside the healthy one. The comparison: true shorts and resistors
to the centre tap at the paper's five levels, at a fixed applied voltage over speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREY, ORANGE, table_of, with_end

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ACTUATOR = "nasa-ballscrew"
FAULTS = {18: "eccentricity_dynamic@motor=0.1", 19: "short@motor.phase_a=0.2"}
"""What the figures have: 10 % of the air gap, 20 % of the turns of phase 1 (N 5.1, 5.2)."""
ORDERS = {18: 9.0, 19: 8.0}
"""Order of the motor's turn at which each shows in the current: 2 p + 1, 2 p (p = 4 pole pairs)."""
SECONDS, SETTLED = 6.0, 0.5
ZOOM = (1.5, 1.75)
"""s; what the paper's last panel zooms into is not printed."""
FOLLOWS = 0.05
"""Percent of the amplitude by which a fault may move the tracking error: "still able to follow"."""
LEVELS = (1 / 10, 1 / 7, 1 / 4, 1 / 3, 1 / 2)
"""Winding short by resistors in their combinations (N 4.3)."""
RESISTANCES = (225.0, 150.0, 75.0, 50.0, 25.0)
"""ohm: 25, 50 and 150 ohm alone and in series."""
SPEEDS = (10.0, 20.0, 40.0)
"""rad/s of the motor, at a voltage that stands still."""
_FIXED_VOLTAGE: dict[str, str | float] = {
    "motor.inertia": 1e9, "control.current_limit": 1e4, "thermal.model": "off",
    "friction.static": 0.0, "friction.dynamic": 0.0, "friction.viscous": 0.0,
    "screw.preload": 0.0, "sensor.current.bandwidth": 0.0, "inverter.supply_voltage": 40.0,
    "stop.upper": 1e3, "stop.lower": -1e3,
}  # fmt: skip
"""A reference far from what can flow, on a shaft that keeps its speed: each leg stands at the rail
of its reference's sign, so the applied voltage is the same at any speed. Under the drive's control
it would follow the speed, and nothing could be compared."""
_FAR = 1e4  # N m
_WARM, _TURN = 0.1, 0.1 * 3.141592653589793
"""s: what dies away, and whole electrical turns at all `SPEEDS`."""
_RECORD = "current_a,leg_current_a,tap_current_a,voltage_a@20 kHz"


@dataclass(frozen=True, slots=True)
class FaultFigure:
    """One of the paper's figures: what the fault does, and the signals of its panels.

    Attributes
    ----------
    figure, fault : int, str
        What.
    time : ndarray, shape (n,)
        s.
    position, load : ndarray, shape (n,)
        Top panels [m], [N].
    healthy, faulty : ndarray, shape (n,)
        Current of phase 1 [A].
    tracking_percent : float
        Change of the tracking error's RMS, percent of the amplitude.
    torque_current_percent : float
        Change of the torque current's RMS, percent.
    line_a, healthy_line_a : float
        Amplitude of the torque current's reference at the fault's order [A].
    """

    figure: int
    fault: str
    time: Floats
    position: Floats
    load: Floats
    healthy: Floats
    faulty: Floats
    tracking_percent: float
    torque_current_percent: float
    line_a: float
    healthy_line_a: float


@dataclass(frozen=True, slots=True)
class SeedingRow(Plain):
    """Current that a short adds to the drive's leg, RMS [A], seeded both ways, at one speed."""

    level: float
    resistance_ohm: float
    speed_rad_s: float
    turns_a: float
    resistor_a: float


@dataclass(frozen=True)
class FaultFiguresResult(CheckedResult):
    """Everything `elevon reproduce nasa-faults` reports."""

    rows: list[SeedingRow]
    checks: list[Check]
    figures: Annotated[list[FaultFigure], WORKING]
    parameter_hash: str


def reproduce_faults(*, seed: int = 0, progress: Progress | None = None) -> FaultFiguresResult:
    """Run the figures' faults beside the healthy unit, and both ways of seeding over speed.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    actuator = Actuator.load(ACTUATOR)
    figures = _figures(actuator, seed, part(progress, 0.0, 0.6))
    rows = _seeding(actuator, seed, part(progress, 0.6, 1.0))
    checks = [*figure_checks(figures), *seeding_checks(rows)]
    return FaultFiguresResult(rows, checks, figures, actuator.hash)


def _simulated(runs: Sequence[Any], record: str, progress: Progress | None) -> list[Recording]:
    from elevon.simulate import completed, simulate_batch

    recordings = simulate_batch(runs, fidelity="high", record=record, progress=progress)
    return completed(recordings)


def _figures(actuator: Actuator, seed: int, progress: Progress | None) -> list[FaultFigure]:
    from elevon.scenario import Scenario
    from elevon.simulate import Run
    from elevon_cases.nasa.profiles import MotionProfile, profile_scenario

    profile = MotionProfile("sinusoidal", 0.05, 0.06, SECONDS)
    scenario = Scenario.from_dict(profile_scenario(profile, 4500.0))
    runs = [Run(actuator, scenario, seed, "healthy")]
    runs += [Run(actuator, scenario.with_faults([text]), seed, text) for text in FAULTS.values()]
    record = "output_position,command,load_force,current_a,current_ref,motor_position@10 kHz"
    healthy, *faulty = _simulated(runs, record, progress)
    return [
        _figure(number, healthy, recording, profile.amplitude)
        for number, recording in zip(FAULTS, faulty, strict=True)
    ]


def _figure(number: int, healthy: Recording, faulty: Recording, amplitude: float) -> FaultFigure:
    time = faulty.clock().time
    used = time > SETTLED

    def rms(run: Recording, *names: str) -> float:
        first, *others = (run[name].values[used] for name in names)
        return float(np.sqrt(np.mean((first - sum(others)) ** 2)))

    tracking = [rms(run, "command", "output_position") for run in (healthy, faulty)]
    current = [rms(run, "current_ref") for run in (healthy, faulty)]
    return FaultFigure(
        number,
        FAULTS[number],
        time,
        faulty["output_position"].values,
        faulty["load_force"].values,
        healthy["current_a"].values,
        faulty["current_a"].values,
        100.0 * abs(tracking[1] - tracking[0]) / amplitude,
        100.0 * (current[1] / current[0] - 1.0),
        *(line(run, ORDERS[number]) for run in (faulty, healthy)),
    )


def line(run: Recording, order: float) -> float:
    """Return the amplitude [A] of the current's reference at an order of the motor's turn."""
    forward = (run.clock().time > SETTLED) & (np.gradient(run["motor_position"].values) > 1e-3)
    angle, values = run["motor_position"].values[forward], run["current_ref"].values[forward]
    grid = np.arange(angle.min(), angle.max(), 2.0 * np.pi / 256.0)
    place = np.argsort(angle)
    even = np.interp(grid, angle[place], values[place])
    window = np.hanning(len(grid))
    weighted = window * (even - np.average(even, weights=window))
    return float(2.0 * abs(np.sum(weighted * np.exp(-1j * order * grid))) / window.sum())


def figure_checks(figures: Sequence[FaultFigure]) -> list[Check]:
    """What the paper says of both: the position follows, the current of the phase differs."""
    checks = []
    for item in figures:
        name = f"Figure {item.figure}"
        more = item.line_a / max(item.healthy_line_a, 1e-12)
        checks += [
            Check(f"{name}: change of the tracking error", item.tracking_percent, FOLLOWS, "%"),
            Check(f"{name}: line of the fault over the healthy one", more, 10.0, "", at_least=True),
        ]
    for item in figures:
        if item.figure == 19:
            # T = 1.5 k i_q - (1 - N) k i_q sin^2: the mean torque of an ampere is 1 - 0.2/3 of it.
            closed = 100.0 * (1.0 / (1.0 - 0.2 / 3.0) - 1.0)
            off = abs(item.torque_current_percent / closed - 1.0)
            checks.append(
                Check("Figure 19: rise of the current against the closed form", 100.0 * off, 5.0,
                      "%")
            )  # fmt: skip
    return checks


def _seeding(actuator: Actuator, seed: int, progress: Progress | None) -> list[SeedingRow]:
    """Run every level both ways at every speed; what each adds to the leg of phase 1."""
    from elevon.simulate import Run

    unit = actuator.with_values(_FIXED_VOLTAGE, request=False)
    faults = [""]
    faults += [f"{kind}@motor.phase_a={level!r}" for level in LEVELS
               for kind in ("short", "resistor_short")]  # fmt: skip
    runs = [
        Run(unit, _at_speed(speed, [fault] if fault else []), seed, f"{fault} at {speed:g} rad/s")
        for speed in SPEEDS
        for fault in faults
    ]
    recordings = _simulated(runs, _RECORD, progress)
    rows = []
    for k, speed in enumerate(SPEEDS):
        healthy, *faulty = recordings[k * len(faults) : (k + 1) * len(faults)]
        for level, resistance, turns, resistor in zip(
            LEVELS, RESISTANCES, faulty[::2], faulty[1::2], strict=True
        ):
            extra = [_extra(run, healthy) for run in (turns, resistor)]
            rows.append(SeedingRow(level, resistance, speed, *extra))
    return rows


def _at_speed(speed: float, faults: list[str]) -> Any:
    from elevon.scenario import Scenario

    scenario = Scenario.from_dict(
        {
            "duration": _WARM + _TURN,
            "command": {"mode": "torque", "terms": [{"kind": "constant", "value": _FAR}]},
            "initial": {"motor_speed": speed},
        }
    )
    return scenario.with_faults(faults) if faults else scenario


def _extra(run: Recording, healthy: Recording) -> float:
    late = run.clock().time > _WARM
    extra = run["leg_current_a"].values[late] - healthy["leg_current_a"].values[late]
    return float(np.sqrt(np.mean(extra**2)))


def seeding_checks(rows: Sequence[SeedingRow]) -> list[Check]:
    """What 4.3 says: five levels; a short's current depends on the speed, a resistor's does not."""
    levels = max(abs(25.0 / (25.0 + row.resistance_ohm) - row.level) for row in rows)
    spread = {name: max(_spread(rows, level, name) for level in LEVELS)
              for name in ("turns_a", "resistor_a")}  # fmt: skip
    rising = [
        after - before
        for speed in SPEEDS
        for name in ("turns_a", "resistor_a")
        for before, after in pairwise([getattr(r, name) for r in rows if r.speed_rad_s == speed])
    ]
    return [
        Check("levels of the resistors against those printed", levels, 1e-9, "1"),
        Check("resistor: spread of its current over speed", spread["resistor_a"], 1.0, "%"),
        Check("shorted turns: spread of their current over speed", spread["turns_a"], 10.0, "%",
              at_least=True),
        Check("least rise of the current from level to level", min(rising), 0.0, "A",
              at_least=True),
    ]  # fmt: skip


def _spread(rows: Sequence[SeedingRow], level: float, name: str) -> float:
    values = np.array([getattr(row, name) for row in rows if row.level == level])
    return float(100.0 * np.ptp(values) / values.mean())


def faults_page(result: FaultFiguresResult, date: str | None = None) -> Report:
    """Return the report: the two figures, both ways to seed a short."""
    report = Report(
        "Dynamic eccentricity and winding shorts of the ballscrew actuator",
        "The paper's Figs. 18 and 19 with their printed levels, each beside the healthy unit, and "
        "true shorts beside resistors to the centre tap at its five levels over speed.",
        date=date,
    )
    for item in result.figures:
        report.section(f"As Fig. {item.figure}: {item.fault}").figure(
            _panels_figure(item),
            f"The tracking error moves by {item.tracking_percent:.2g} % of the amplitude, the RMS "
            f"of the torque current by {item.torque_current_percent:.2g} %.",
        )
    columns = (
        ("Level", "level", ".4g"),
        ("Resistor [ohm]", "resistance_ohm", ".0f"),
        ("Speed [rad/s]", "speed_rad_s", ".0f"),
        ("Shorted turns [A]", "turns_a", ".3f"),
        ("Resistor [A]", "resistor_a", ".3f"),
    )
    report.section("Seeding a winding short").figure(
        _seeding_figure(result.rows), "Current that the fault adds to the leg of phase 1, RMS."
    ).text(
        "At a fixed applied voltage: a resistor draws V/R at any speed, shorted turns let through "
        "what the EMF leaves of the voltage. Under the drive's control the voltage follows the "
        "speed itself, so no closed-loop run shows this."
    ).table(table_of(result.rows, columns))
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, "nasa-faults", made)


def _panels_figure(item: FaultFigure) -> Figure:
    """Draw the paper's panels: position, load, current of phase 1, a part with all its samples."""
    zoom = (item.time > ZOOM[0]) & (item.time < ZOOM[1])
    with new_figure(2, 2, height=5.4) as (figure, axes):
        (position, load), (current, close) = axes
        position.plot(item.time[::10], 1e3 * item.position[::10], color=BLUE)
        position.set(ylabel="Position [mm]")
        load.plot(item.time[::10], item.load[::10], color=BLUE)
        load.set(ylabel="Load [N]")
        for panel, samples in ((current, slice(None, None, 10)), (close, zoom)):
            time, healthy, faulty = item.time[samples], item.healthy[samples], item.faulty[samples]
            panel.plot(time, healthy, color=GREY, lw=1.5, label="baseline")
            panel.plot(time, faulty, color=ORANGE, lw=0.8, label="fault")
            panel.set(xlabel="Time [s]", ylabel="Phase 1 [A]")
        close.legend(loc="upper right")
    return figure


def _seeding_figure(rows: Sequence[SeedingRow]) -> Figure:
    with new_figure(1, 2, height=3.2) as (figure, both):
        for axes, name, title in zip(
            both, ("turns_a", "resistor_a"), ("shorted turns", "resistor"), strict=True
        ):
            for level in LEVELS:
                current = [getattr(row, name) for row in rows if row.level == level]
                axes.plot(SPEEDS, current, "o-", ms=3, label=f"{100 * level:.4g} %")
            axes.set(xlabel="Motor [rad/s]", title=title, ylim=(0, None))
        both[0].set(ylabel="Added current [A]")
        both[0].legend()
    return figure
