"""The flyable stand of the paper (N 6.3) over a synthetic flight: what its two actuators show.

The paper plans the stand and prints no flight, so the flight is ours: a climb with turns, the load
from airspeed, altitude and angle of attack as `elevon loads` computes it. A nominal and a faulty
actuator follow it; the load actuator is switched between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.flyable import FlightConditions, FlightLog, air_of, fly, shares
from elevon.loads import FlightData, HingeMoment, flight_load
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon.scenario import Scenario
from elevon_cases.page import BLUE, ORANGE, table_of, with_end

ACTUATOR = "nasa-ballscrew"
SECONDS = 40.0
SWITCH = 5.0
FAULT = "return_jam@screw.return_channel=1"
"""One blocked circuit (N 4.2), which raises the current under load."""
SURFACE = HingeMoment(area=0.9, chord=0.45, c_0=0.0, c_alpha=-0.12, c_delta=-0.42)
"""An aileron's size and coefficients; ASSUMED."""
ARM = 0.09
LOAD_FACTOR, VIBRATION = 1.0, 2.0
"""Along the rams, and m/s2 RMS; ASSUMED: level flight, a helicopter's cabin."""
APART = 3.0
"""Deviations of healthy pairs by which the faulty actuator must stand out."""
PAIRS = 3
"""Flights of two healthy actuators."""
_MOVES = 0.02  # of the largest power: below it nothing moves against a load


@dataclass(frozen=True, slots=True)
class FlightRow(Plain):
    """One stretch between two switchings: who bore the load, and what it took.

    Attributes
    ----------
    unit : str
        ``nominal`` or ``faulty``.
    begin_s : float
        Of the stretch.
    load_n, current_a, tracking_mm : float
        RMS of the force on the ram, of the torque current, of the tracking error.
    current_per_load_a : float
        Slope of the current on the force, an ampere a kilonewton.
    """

    unit: str
    begin_s: float
    load_n: float
    current_a: float
    tracking_mm: float
    current_per_load_a: float


@dataclass(frozen=True)
class FlightResult(CheckedResult):
    """Everything `elevon reproduce nasa-flight` reports."""

    rows: list[FlightRow]
    checks: list[Check]
    logs: Annotated[tuple[FlightLog, FlightLog], WORKING]
    flown: Annotated[Scenario, WORKING]


def reproduce_flight(
    *, fidelity: str = "low", seed: int = 0, progress: Progress | None = None
) -> FlightResult:
    """Fly a nominal and a faulty actuator, and pairs of healthy ones beside them.

    Parameters
    ----------
    fidelity : str
        Of the stand: high or low.
    seed : int
        Of vibration and sensors.
    progress : callable, optional
        As for `elevon.simulate`.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    actuator, data = Actuator.load(ACTUATOR), synthetic_flight()
    table = flight_load(data, SURFACE, arm=ARM, limit=actuator.parameters.value("rating.load"))
    flown = Scenario.from_dict(table.scenario())
    aircraft = FlightConditions(LOAD_FACTOR, VIBRATION, air_of(data.time, data.altitude))

    def flight(number: int, faults: Sequence[str]) -> tuple[FlightLog, FlightLog]:
        share = part(progress, number / (PAIRS + 1), (number + 1) / (PAIRS + 1))
        return fly(actuator, flown, faults, aircraft, switch=SWITCH, fidelity=fidelity,
                   seed=seed + 10 * number, progress=share)  # fmt: skip

    logs = flight(0, [FAULT])
    healthy = [flight(number, []) for number in range(1, PAIRS + 1)]
    rows = rows_of(logs)
    excess, floor = ratio_of(logs), np.array([ratio_of(pair) for pair in healthy])
    checks = checks_of(excess, floor, missing_load(logs, table.time, table.load))
    return FlightResult(rows, checks, logs, flown)


def synthetic_flight() -> FlightData:
    """Return a climb with turns, sampled at 20 Hz; no aircraft's."""
    time = np.arange(0.0, SECONDS + 0.025, 0.05)
    turn = np.sin(2.0 * np.pi * 0.4 * time) * (0.6 + 0.4 * np.sin(2.0 * np.pi * time / SECONDS))
    return FlightData(
        time,
        altitude=1500.0 + 20.0 * time,
        airspeed=90.0 + 0.5 * time,
        airspeed_kind="true",
        angle_of_attack=np.radians(4.0 + 2.0 * np.sin(2.0 * np.pi * 0.1 * time)),
        deflection=np.radians(12.0) * turn,
    )


def rows_of(logs: Sequence[FlightLog]) -> list[FlightRow]:
    """Return one row a stretch in which an actuator bears the load."""
    rows = []
    for number, item in enumerate(logs):
        time, load, current, error = _channels(item)
        bears = shares(time, SWITCH)[number]
        for begin in np.arange(0.0, SECONDS - 0.5 * SWITCH, SWITCH):
            inside = (time >= begin) & (time < begin + SWITCH) & (bears > 0.999)
            if inside.sum() < 100:
                continue
            rows.append(
                FlightRow(
                    item.unit, float(begin), _rms(load[inside]), _rms(current[inside]),
                    1e3 * _rms(error[inside]), _slope(load[inside], current[inside]),
                )
            )  # fmt: skip
    return sorted(rows, key=lambda row: row.begin_s)


def _channels(item: FlightLog) -> tuple[Floats, Floats, Floats, Floats]:
    log = item.log
    values = [np.asarray(log.role(name).values, dtype=np.float64)
              for name in ("load", "torque_current", "command", "output_position")]  # fmt: skip
    load, current, command, position = values
    time = np.asarray(log.role("load").time, dtype=np.float64)
    return time, load, current, command - position


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _slope(load: Floats, current: Floats) -> float:
    return 1e3 * float(np.polyfit(load, current, 1)[0])


def ratio_of(logs: Sequence[FlightLog]) -> float:
    """Return by what share the second actuator's current a force is above the first's.

    Where the load opposes the motion: what a screw loses there, it saves where the load aids.
    """
    slopes = []
    for number, item in enumerate(logs):
        time, load, current, _ = _channels(item)
        speed = np.asarray(item.log.role("motor_speed").values, dtype=np.float64)
        opposes = load * speed > _MOVES * float(np.abs(load).max() * np.abs(speed).max())
        used = opposes & (shares(time, SWITCH)[number] > 0.999)
        slopes.append(_slope(load[used], current[used]))
    return slopes[1] / slopes[0] - 1.0


def missing_load(logs: Sequence[FlightLog], time: Floats, load: Floats) -> float:
    """Return what both rams together miss of the flight's load, over its RMS."""
    clock, first, *_ = _channels(logs[0])
    both = first + _channels(logs[1])[1]
    both = both - float(np.mean(both)) + float(np.mean(np.interp(clock, time, load)))
    return _rms(both - np.interp(clock, time, load)) / _rms(np.interp(clock, time, load))


def checks_of(excess: float, floor: Floats, missing: float) -> list[Check]:
    """The load is whole at any instant; the fault stands out of pairs of healthy actuators."""
    spread = float(np.sqrt(np.mean(floor**2)))
    return [
        Check("load of both rams less the flight's, over its RMS", 100.0 * missing, 10.0, "%"),
        Check("faulty over nominal: current of a newton", 100.0 * excess, 100.0 * APART * spread,
              "%", at_least=True),
        Check("healthy pairs: largest difference of the same", 100.0 * float(np.abs(floor).max()),
              50.0 * abs(excess), "%"),
    ]  # fmt: skip


def flight_page(result: FlightResult, date: str | None = None) -> Report:
    """Return the report: the flight's signals, each stretch between two switchings."""
    report = Report(
        "The flyable stand: nominal and faulty actuator in one flight",
        "The paper plans a stand with a nominal, a faulty and a load actuator, the load switched "
        "between the two in flight. It prints no flight: this one is synthetic, and so are load "
        f"factor, vibration and the fault ({FAULT}).",
        date=date,
    )
    signals = (
        ("command", 1e3, "Command [mm]"),
        ("load", 1.0, "Force [N]"),
        ("torque_current", 1.0, "Current [A]"),
        ("surface_temperature", 1.0, "Housing [K]"),
    )
    with new_figure(4, 1, height=7.0, sharex=True) as (figure, panels):
        for axes, (role, scale, label) in zip(panels, signals, strict=True):
            for item, colour in zip(result.logs, (BLUE, ORANGE), strict=True):
                channel = item.log.role(role)
                time, values = channel.time[::5], scale * channel.values[::5]
                axes.plot(time, values, color=colour, lw=0.8, label=item.unit)
            axes.set_ylabel(label)
        panels[0].legend(loc="upper right", ncols=2)
        panels[-1].set_xlabel("Time [s]")
    report.section("The flight").figure(
        figure, f"Both actuators; the load changes over every {SWITCH:g} s."
    )
    columns = (
        ("Actuator", "unit"),
        ("From [s]", "begin_s", ".0f"),
        ("Force RMS [N]", "load_n", ".0f"),
        ("Current RMS [A]", "current_a", ".3f"),
        ("Tracking RMS [mm]", "tracking_mm", ".3f"),
        ("Current a force [A/kN]", "current_per_load_a", ".4f"),
    )
    report.section("Stretches").table(table_of(result.rows, columns, "Of whoever bears the load."))
    return with_end(report, result.checks, "nasa-flight")
