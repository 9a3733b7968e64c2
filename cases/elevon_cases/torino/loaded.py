"""The loaded campaign by its definition: a constant brake torque a test, at three backlashes.

The virtual bench has hidden values; the model is calibrated on other logs of it. Of each test the
first period is dropped, as the thesis does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.logs.drive import drive_log
from elevon.logs.log import Log
from elevon.plain import Plain
from elevon.progress import Progress, part
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREEN, ORANGE, Column, table_of, with_end
from elevon_cases.torino.backlash_estimate import lost_motion
from elevon_cases.torino.bench_unit import (
    ACTUATOR,
    bench_logs,
    encoder_count,
    hidden_and_calibrated,
)
from elevon_cases.torino.validation import SHOWS

PERIOD = 20.0
"""Of the command [s]."""
DROPPED = PERIOD + 2.0
"""First period, and the waits of up to 2 s before the command [s]."""
LEAST, MOST = 0.2, 2.0
"""Printed: brake torque on the motor shaft [N m]."""
NET = (0.0, 0.0145, 0.02335)
"""Printed: net backlash [rad]."""
POSITION_LIMIT = 1.0
TORQUE_LIMIT = 0.1
SLOPE_LIMIT = 0.05
"""Percent of range; N m (half a step of the torques); relative. ASSUMED: nothing is printed."""


@dataclass(frozen=True, slots=True)
class LoadedRow(Plain):
    """One test after its first period.

    ``set_nm`` and ``cell_nm``: set point of the brake, mean of the load cell's torque on the motor
    shaft; ``current_a``: mean size of the torque current; lost motion of bench and model.
    """

    net_backlash_rad: float
    set_nm: float
    cell_nm: float
    current_a: float
    bench_lost_deg: float
    model_lost_deg: float
    position_percent: float


@dataclass(frozen=True)
class LoadedCampaign(CheckedResult):
    """Everything `elevon reproduce torino-loaded` reports."""

    rows: list[LoadedRow]
    torque_constant: float
    intrinsic_deg: float
    count_deg: float
    fidelity: str
    seed: int
    parameter_hash: str

    def slope(self) -> float:
        """Return the torque that an ampere balances, by regression over all tests [N m/A]."""
        torque = [row.cell_nm for row in self.rows]
        return float(1.0 / np.polyfit(torque, [row.current_a for row in self.rows], 1)[0])

    @property
    def checks(self) -> list[Check]:
        """Torques as printed, the current that they cost, lost motion, model against bench."""
        count = len({row.set_nm for row in self.rows})
        linear = np.tile(np.linspace(LEAST, MOST, count), len(NET))
        torque = max(abs(row.cell_nm - wanted)
                     for row, wanted in zip(self.rows, linear, strict=True))  # fmt: skip
        lost = [math.degrees(row.net_backlash_rad) + self.intrinsic_deg for row in self.rows]
        bench, model = (
            max(abs(getattr(row, name) - put) - 0.02 * put
                for row, put in zip(self.rows, lost, strict=True))
            for name in ("bench_lost_deg", "model_lost_deg")
        )  # fmt: skip
        return [
            Check("brake torque by the cell less its place on the line", torque, TORQUE_LIMIT,
                  "N m"),
            Check("torque an ampere balances, less the calibrated constant",
                  abs(self.slope() / self.torque_constant - 1.0), SLOPE_LIMIT, "1",
                  ours=self.slope(), ours_unit="N m/A"),
            Check("lost motion of the bench beyond 2 % of the backlash", bench, self.count_deg,
                  "deg"),
            Check("lost motion of the model beyond 2 % of the backlash", model, self.count_deg,
                  "deg"),
            Check("position of model less bench, worst test",
                  max(row.position_percent for row in self.rows), POSITION_LIMIT, "%"),
        ]  # fmt: skip


def reproduce_loaded(
    *, fidelity: str = "high", seed: int = 0, progress: Progress | None = None
) -> LoadedCampaign:
    """Run the campaign on a bench with hidden values and predict each test.

    Parameters
    ----------
    fidelity : str
        Of the bench in the campaign; the model is at low fidelity.
    seed : int
        Of the hidden values and of the bench.
    progress : callable, optional
        As for `simulate_batch`.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.bench.procedure import INTRINSIC_BACKLASH, load_procedure
    from elevon.parameters.relations import motor_torque_constant

    unit, model = hidden_and_calibrated(seed, part(progress, 0.0, 0.25))
    logs = bench_logs(load_procedure("loaded-campaign"), unit, seed=seed + 1, fidelity=fidelity,
                      progress=part(progress, 0.25, 0.85))  # fmt: skip
    total, each = model.parameters.value("backlash.total"), len(logs) // len(NET)
    torques = np.linspace(LEAST, MOST, each)
    rows = []
    for number, log in enumerate(logs):
        net, torque = NET[number // each], float(torques[number % each])
        ready = model.with_values({"backlash.total": total + net})
        rows.append(_row(drive_log(log), ready, net, torque))
        if progress is not None:
            progress(0.85 + 0.15 * (number + 1) / len(logs))
    count = encoder_count(Actuator.load(ACTUATOR))
    return LoadedCampaign(rows, motor_torque_constant(model.parameters),
                          math.degrees(INTRINSIC_BACKLASH), count, fidelity, seed,
                          model.hash)  # fmt: skip


def _row(log: Log, model: Actuator, net: float, torque: float) -> LoadedRow:
    from elevon.calibrate.validation import bench_experiment

    experiment, _ = bench_experiment(log, model, "low", SHOWS)
    run = next(experiment.run()).seen(log).channels
    late = log.time >= DROPPED
    ratio = model.parameters.value("gear.ratio")
    bench = _lost(log.time, log.motor / ratio, log.output)
    simulated = _lost(log.time, run["motor_position"] / ratio, run["encoder_position"])
    error = run["encoder_position"][late] - log.output[late]
    percent = 100.0 * float(np.sqrt(np.mean(error**2)) / np.ptp(log.output[late]))
    # Where it turns, the friction is not that of sliding: only the faster half of the motion.
    speed = np.abs(log.speed)
    moving = late & (speed > 0.5 * speed[late].max())
    cell = float(np.mean(log.brake.at(log.time)[moving]))
    current = float(np.mean(np.abs(log.current[moving])))
    return LoadedRow(net, torque, cell, current, bench, simulated, percent)


def _lost(time: Floats, motor: Floats, encoder: Floats) -> float:
    return math.degrees(lost_motion(time, motor, encoder, DROPPED))


def loaded_page(result: LoadedCampaign, date: str | None = None) -> Report:
    """Return the report of the campaign."""
    report = Report(
        "Loaded campaign of the Torino bench",
        "A constant brake torque a test, linear from 0.2 to 2 N m, at three backlashes; the first "
        "period is dropped. The bench is the virtual one with hidden values; the model was "
        "calibrated on other logs.",
        date=date,
    )
    with new_figure(1, 2, height=3.2) as (figure, (torques, currents)):
        for net, colour in zip(NET, (BLUE, ORANGE, GREEN), strict=True):
            tests = [row for row in result.rows if row.net_backlash_rad == net]
            cell, label = [row.cell_nm for row in tests], f"{math.degrees(net):.2f} deg net"
            torques.plot(range(1, len(tests) + 1), cell, "o", ms=4, color=colour, label=label)
            currents.plot(cell, [row.current_a for row in tests], "o", ms=4, color=colour)
        torques.set(xlabel="Test", ylabel="Brake torque by the cell [N m]")
        torques.legend(loc="upper left")
        currents.set(xlabel="Brake torque by the cell [N m]", ylabel="Mean torque current [A]")
    report.section("Torque and current").figure(
        figure, "Torques of the tests (thesis, Figure 84) and the current they cost."
    )
    columns: tuple[Column, ...] = (
        ("Net backlash [deg]", lambda row: math.degrees(row.net_backlash_rad)),
        ("Set [N m]", "set_nm"),
        ("Cell [N m]", "cell_nm"),
        ("Current [A]", "current_a"),
        ("Bench lost [deg]", "bench_lost_deg"),
        ("Model lost [deg]", "model_lost_deg"),
        ("Position error [% of range]", "position_percent"),
    )
    caption = "After the first period."
    report.section("Tests").table(table_of(result.rows, columns, caption, digits=4))
    command = f"torino-loaded --fidelity {result.fidelity} --seed {result.seed}"
    return with_end(report, result.checks, command, {"Parameter hash": result.parameter_hash})
