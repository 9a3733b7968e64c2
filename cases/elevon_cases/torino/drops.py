"""From dropped weights to a model: stiffness and damping of the transmission, the series block.

Ten weights, four drops each, on the virtual bench whose stiffness and damping are hidden. The
stiffness comes from the angle lost at rest, the damping from how it comes to rest; the model with
both is then held against the bench. The thesis tunes both by hand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.procedure import Procedure
from elevon.bench.rig import GRAVITY
from elevon.calibrate.drops import calibrate_compliance
from elevon.calibrate.validation import bench_experiment
from elevon.experiment import Experiment, Inputs
from elevon.experiment.experiment import Variant, run_all
from elevon.logs.drive import drive_log
from elevon.logs.log import Log
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.report import Report, ReportTable
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREY, ORANGE, with_end
from elevon_cases.torino.bench_unit import (
    ACTUATOR,
    READINGS,
    bench_logs,
    encoder_count,
    hidden_and_calibrated,
    micrometer,
    procedure_of,
    trace,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MASSES = (0.510, 1.000, 1.510, 2.010, 2.520, 3.020, 3.533, 4.031, 4.541, 5.042)
"""Printed: kg, each on both cables."""
REPEATS = 4
CABLES, RADIUS = 2, 0.080
"""Of the winding guide [m]."""
FIRST, EVERY, HANGS = 1.0, 2.0, 1.0
"""s: first drop after the trigger, from drop to drop, how long a weight hangs."""
SETTLED = 0.6
"""s after a drop from which the angle is read: the transient is over, the weight still hangs."""
EDGE = 0.01
"""s in which a weight comes onto its cable. ASSUMED, as the virtual bench has it."""
WINDOW = 0.12
"""s after a drop in which the transient is compared."""
STIFFNESS, DAMPING = "backlash.stiffness", "backlash.damping"
SPREAD = (0.75, 1.35)
"""Of both hidden values about the actuator file's. ASSUMED."""
GRID = np.geomspace(0.25, 4.0, 17)
"""Damping tried, over the actuator file's: at the end of the grid nothing is determined."""
SHOWS = ("encoder_position", "motor_position")
LIMITS = {STIFFNESS: 3.0, DAMPING: 15.0}
"""Percent. ASSUMED."""


@dataclass(frozen=True, slots=True)
class DropRow(Plain):
    """One drop: torque at the output [N m], angle lost between motor and encoder [deg]."""

    mass_kg: float
    drop: int
    torque_nm: float
    loss_deg: float


@dataclass(frozen=True, slots=True)
class DropTrace:
    """Motor and encoder about one drop [deg, at the output], bench and model."""

    mass: float
    time: Floats
    bench: tuple[Floats, Floats]
    model: tuple[Floats, Floats]
    rigid: tuple[Floats, Floats]


@dataclass(frozen=True)
class DropsResult(CheckedResult):
    """Everything `elevon reproduce torino-drops` reports; errors in deg RMS over all drops."""

    rows: list[DropRow]
    stiffness: float
    stiffness_interval: tuple[float, float]
    hidden_stiffness: float
    damping: float
    damping_determined: bool
    hidden_damping: float
    loss_error_deg: float
    rigid_error_deg: float
    count_deg: float
    seed: int
    parameter_hash: str
    traces: Annotated[list[DropTrace], WORKING]
    misfits: Annotated[tuple[tuple[float, float], ...], WORKING]
    """Damping tried [N m s/rad] and its mean squared error [deg2]."""

    @property
    def checks(self) -> list[Check]:
        """Both recovered, the stiffness within its interval, the model nearer than a rigid one."""
        low, high = self.stiffness_interval
        outside = max(low - self.hidden_stiffness, self.hidden_stiffness - high, 0.0)
        errors = {
            STIFFNESS: 100.0 * abs(self.stiffness / self.hidden_stiffness - 1.0),
            DAMPING: 100.0 * abs(self.damping / self.hidden_damping - 1.0)
            if self.damping_determined
            else math.nan,
        }
        return [
            *(Check(f"{name.partition('.')[2]}: recovered less hidden", errors[name], limit, "%")
              for name, limit in LIMITS.items()),
            Check("hidden stiffness outside its interval", outside, 0.0, "N m/rad"),
            Check("angle lost, model less bench", self.loss_error_deg, 2.0 * self.count_deg, "deg"),
            Check("error of a rigid transmission over that of the model",
                  self.rigid_error_deg / self.loss_error_deg, 3.0, "1", at_least=True),
        ]  # fmt: skip


def drop_times() -> list[float]:
    """Return when each weight is dropped [s after the trigger]."""
    return [FIRST + EVERY * number for number in range(len(MASSES))]


def drop_procedure() -> Procedure:
    """Return the campaign: a log of ten drops, four times."""
    drops = [{"mass": f"{mass} kg", "at": f"{at} s", "until": f"{at + HANGS} s"}
             for mass, at in zip(MASSES, drop_times(), strict=True)]  # fmt: skip
    hold = {"kind": "constant", "value": "10 deg"}
    steps = [
        {"kind": "settings", "parameters": {"backlash.model": "elastic"}},
        micrometer(READINGS[0]),
        {"kind": "weights", "drops": drops, "cables": CABLES, "radius": f"{RADIUS} m"},
        *(trace(f"drops-{number}", hold, 22.0) for number in range(1, REPEATS + 1)),
    ]
    return procedure_of("drops", steps)


def reproduce_drops(*, seed: int = 0, progress: Progress | None = None) -> DropsResult:
    """Drop the weights on a bench with hidden values, estimate both, hold the model against it.

    Parameters
    ----------
    seed : int
        Of the hidden values and of the bench.
    progress : callable, optional
        As for `simulate_batch`.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.bench.rig import draw_conditions

    unit, model = hidden_and_calibrated(seed, part(progress, 0.0, 0.5))
    scale = np.random.default_rng([seed, 11]).uniform(*SPREAD, 2)
    value = Actuator.load(ACTUATOR).parameters.value
    hidden = {path: value(path) * float(s)
              for path, s in zip((STIFFNESS, DAMPING), scale, strict=True)}  # fmt: skip
    elastic = unit.with_values(hidden, source="hidden from the calibration")
    logs = bench_logs(drop_procedure(), elastic, seed=seed + 1, progress=part(progress, 0.5, 0.7))
    # The trigger is a channel of the drive's log (r722); the weights are dropped after it.
    triggers = [draw_conditions(seed + 1, number).trigger for number in range(REPEATS)]
    return _result(model, logs, triggers, hidden, seed=seed,
                   progress=part(progress, 0.7, 1.0))  # fmt: skip


def _result(
    model: Actuator,
    logs: Sequence[Log],
    triggers: Sequence[float],
    hidden: dict[str, float],
    *,
    seed: int,
    progress: Progress | None,
) -> DropsResult:
    ratio = model.parameters.value("gear.ratio")
    ready = [drive_log(log) for log in logs]
    rows = [row for number, (log, at) in enumerate(zip(ready, triggers, strict=True), 1)
            for row in _rows(log, at, ratio, number)]  # fmt: skip
    fit = calibrate_compliance(
        [row.torque_nm for row in rows],
        np.radians([row.loss_deg for row in rows]),
        weight=[MASSES.index(row.mass_kg) for row in rows],
    ).estimates[0]
    soft = model.with_values({"backlash.model": "elastic", STIFFNESS: fit.value})
    misfits = _misfits(soft, ready, triggers, part(progress, 0.0, 0.8))
    damping, determined = _least(misfits)
    series = soft.with_values({DAMPING: damping})
    runs = [_seen(m, ready[1], triggers[1], "high" if m is series else "low")
            for m in (series, model)]  # fmt: skip
    bench = _angles(ready[1].motor, ready[1].output, ratio)
    traces = _traces(ready[1], triggers[1], bench, *(_angles(*run, ratio) for run in runs))
    errors = [_loss_error(ready[1], triggers[1], bench, _angles(*run, ratio)) for run in runs]
    return DropsResult(
        rows, fit.value, fit.interval, hidden[STIFFNESS], damping, determined, hidden[DAMPING],
        errors[0], errors[1], encoder_count(model), seed, series.hash, traces, misfits,
    )  # fmt: skip


def _rows(log: Log, trigger: float, ratio: float, number: int) -> list[DropRow]:
    """Return what each drop of a log lost, from the mean angle before to that at rest."""
    motor, encoder = _angles(log.motor, log.output, ratio)
    rows = []
    for mass, at in zip(MASSES, drop_times(), strict=True):
        settled = _within(log, trigger + at + SETTLED, trigger + at + HANGS - 0.05)
        loss = float(np.mean(motor[settled] - encoder[settled]))
        rows.append(DropRow(mass, number, CABLES * mass * GRAVITY * RADIUS, loss))
    return rows


def _angles(motor: Floats, encoder: Floats, ratio: float) -> tuple[Floats, Floats]:
    """Return motor and encoder at the output [deg]."""
    return np.degrees(motor / ratio), np.degrees(encoder)


def _within(log: Log, start: float, stop: float) -> slice:
    return slice(*np.searchsorted(log.time, [start, stop]).tolist())


def _load(log: Log, trigger: float) -> tuple[Floats, Floats]:
    """Return the torque of the weights at the output over the log."""
    times, torques = [float(log.time[0])], [0.0]
    for mass, at in zip(MASSES, drop_times(), strict=True):
        torque = CABLES * mass * GRAVITY * RADIUS
        start, stop = trigger + at, trigger + at + HANGS
        times += [start, start + EDGE, stop, stop + EDGE]
        torques += [0.0, torque, torque, 0.0]
    return np.array(times), np.array(torques)


def _seen(
    model: Actuator, log: Log, trigger: float, fidelity: str = "high"
) -> tuple[Floats, Floats]:
    """Return motor and encoder of the model under the weights, on the log's clock [rad]."""
    loads = {"output": _load(log, trigger)}
    experiment, _ = bench_experiment(log, model, fidelity, SHOWS, loads)
    run = next(experiment.run()).seen(log).channels
    return run["motor_position"], run["encoder_position"]


def _misfits(
    model: Actuator,
    logs: Sequence[Log],
    triggers: Sequence[float],
    progress: Progress | None,
) -> tuple[tuple[float, float], ...]:
    """Return the squared error of the transients under each damping.

    Each drop is a test of its own that begins as measured: where the output stands in the backlash
    when the weight comes is chance, and decides how hard the flanks meet.
    """
    tried = [float(f) * model.parameters.value(DAMPING) for f in GRID]
    pairs = zip(logs, triggers, strict=True)
    drops = [_transient(model, log, trigger, at) for log, trigger in pairs for at in drop_times()]
    tests = [(drop, Variant({DAMPING: value})) for value in tried for drop in drops]
    runs = run_all(tests, progress)
    ratio = model.parameters.value("gear.ratio")
    errors = []
    for (drop, _), run in zip(tests, runs, strict=True):
        simulated, seen = run.seen(drop.log).channels, drop.log
        motor, encoder = _angles(seen["motor_position"], seen["output_position"], ratio)
        other = _angles(simulated["motor_position"], simulated["encoder_position"], ratio)
        errors.append(float(np.mean(((motor - encoder) - (other[0] - other[1])) ** 2)))
    means = np.reshape(errors, (len(tried), len(drops))).mean(axis=1)
    return tuple(zip(tried, means.tolist(), strict=True))


def _transient(model: Actuator, log: Log, trigger: float, at: float) -> Experiment:
    """Return one drop as a test that begins as the log shows it, a sample before the weight."""
    place = _within(log, trigger + at - log.period, trigger + at + WINDOW)
    start = float(log.time[place.start])
    gain = model.parameters.value("control.position_gain")
    offset = model.parameters.value("sensor.encoder.offset")
    before = slice(place.start - 7, place.start + 1)
    slope = np.polyfit(log.time[before], log.output[before], 1)
    # The drive's set point of the speed gives the command: it is constant.
    command = float(np.mean((log.output + log.speed_ref / gain)[before]))
    time = log.time[place] - start
    channels = {"motor_position": log.motor[place], "output_position": log.output[place]}
    inputs = Inputs(
        float(time[-1]), "position", (time[[0, -1]], np.full(2, command)),
        loads={"output": (np.array([0.0, trigger + at - start, trigger + at - start + EDGE, 1.0]),
                          np.array([0.0, 0.0, 1.0, 1.0]) * _torque(at))},
        initial={
            "motor_position": float(log.motor[place.start]),
            "motor_speed": float(log.speed[place.start]),
            "output_position": float(np.polyval(slope, start)) - offset,
            "output_speed": float(slope[0]),
        },
    )  # fmt: skip
    part = Log(f"drop at {at:g} s", time, channels)
    shows = {name: name for name in SHOWS}
    read = model.with_values({"control.position_feedback": "encoder"})
    return Experiment(part, read, inputs, shows, rate="400 Hz", fidelity="high")


def _torque(at: float) -> float:
    """Return the torque at the output of the weight dropped at an instant [N m]."""
    return CABLES * MASSES[drop_times().index(at)] * GRAVITY * RADIUS


def _least(misfits: Sequence[tuple[float, float]]) -> tuple[float, bool]:
    """Return the damping of the least error, by a parabola through it, and whether it has one."""
    x, y = np.log([value for value, _ in misfits]), np.array([error for _, error in misfits])
    best = int(np.argmin(y))
    if best in (0, len(y) - 1):
        return float(np.exp(x[best])), False
    bend, slope, _ = np.polyfit(x[best - 1 : best + 2] - x[best], y[best - 1 : best + 2], 2)
    return float(np.exp(x[best] - 0.5 * slope / bend)), True


def _traces(
    log: Log, trigger: float, bench: tuple[Floats, Floats], *others: tuple[Floats, Floats]
) -> list[DropTrace]:
    """Return each drop of a log from before it until the weight is taken off."""
    out = []
    for mass, at in zip(MASSES, drop_times(), strict=True):
        place = _within(log, trigger + at - 0.1, trigger + at + HANGS)
        parts = [(pair[0][place], pair[1][place]) for pair in (bench, *others)]
        time = log.time[place] - trigger - at
        out.append(DropTrace(mass, time, parts[0], parts[1], parts[2]))
    return out


def _loss_error(
    log: Log, trigger: float, bench: tuple[Floats, Floats], model: tuple[Floats, Floats]
) -> float:
    """RMS over the drops of the angle lost at rest, model less bench [deg]."""
    errors = []
    for at in drop_times():
        settled = _within(log, trigger + at + SETTLED, trigger + at + HANGS - 0.05)
        lost = [float(np.mean(m[settled] - e[settled])) for m, e in (bench, model)]
        errors.append(lost[1] - lost[0])
    return float(np.sqrt(np.mean(np.square(errors))))


def drops_page(result: DropsResult, date: str | None = None) -> Report:
    """Return the report: both values, each weight, the springs of the load module."""
    report = Report(
        "From dropped weights to a model of the transmission",
        "Ten weights, four drops each, on the virtual bench with hidden stiffness and damping. The "
        "thesis tunes both by hand and prints 68.23, then 43, and 5.5, then 7.5, in units that do "
        "not fit: nothing here can be held against them.",
        date=date,
    )
    low, high = result.stiffness_interval
    rows = [
        ["stiffness [N m/rad]", result.hidden_stiffness, result.stiffness,
         f"{low:.5g} to {high:.5g}"],
        ["damping [N m s/rad]", result.hidden_damping, result.damping, ""],
    ]  # fmt: skip
    report.section("Stiffness and damping").table(
        ReportTable(("Value", "Hidden", "Recovered", "Interval"), rows)
    ).figure(
        _fits_figure(result),
        f"Angle lost over load, {len(MASSES)} weights; error over the damping.",
    )
    section = report.section("Each weight", "Motor and encoder about the drop, bench and model.")
    for number, drop in enumerate(result.traces, 1):
        section.figure(_drop_figure(drop), f"{drop.mass:g} kg (thesis, Figure 5.{number})")
    section = report.section("Series block against the bench")
    for drop in result.traces[-1:]:
        section.figure(_drop_figure(drop, rigid=True), "Heaviest weight (Figures 6.1, 6.2)")
    report.section("Springs of the load module").figure(
        _springs_figure(),
        "Diameter that the stress allows, and coils (thesis, Figures 4.3, 4.4); the printed choice "
        "is marked.",
    )
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, f"torino-drops --seed {result.seed}", made)


def _fits_figure(result: DropsResult) -> Figure:
    with new_figure(1, 2, height=3.0) as (figure, (lost, error)):
        losses, torques = zip(*((r.loss_deg, r.torque_nm) for r in result.rows), strict=True)
        lost.plot(losses, torques, "o", ms=3, color=BLUE)
        lost.set(xlabel="Angle lost [deg]", ylabel="Torque at the output [N m]")
        error.semilogx(*zip(*result.misfits, strict=True), "o-", ms=3, color=ORANGE)
        error.set(xlabel=f"{DAMPING} [N m s/rad]", ylabel="Squared error [deg2]")
    return figure


def _drop_figure(drop: DropTrace, *, rigid: bool = False) -> Figure:
    """Draw motor and encoder about one drop."""
    with new_figure(1, 2, height=2.4) as (figure, both):
        for place, (axes, name) in enumerate(zip(both, ("Motor", "Encoder"), strict=True)):
            axes.plot(drop.time, drop.bench[place], color=GREY, lw=2.6, label="bench")
            axes.plot(drop.time, drop.model[place], color=ORANGE, lw=1, label="model")
            if rigid:
                axes.plot(drop.time, drop.rigid[place], color=BLUE, lw=0.8, label="rigid")
            axes.set(xlabel="Time [s]", ylabel=f"{name} [deg]")
        both[0].legend(loc="best")
    return figure


def _springs_figure() -> Figure:
    """Draw mean diameter and number of coils of the load module's springs over the wire."""
    from elevon.bench.spring import STANDARD_WIRES, SpringTask, design_spring

    task = SpringTask()
    wires = [float(wire) for wire in STANDARD_WIRES if 2e-3 <= wire <= 4e-3]
    diameters = 1e3 * np.array(wires)
    largest = 1e3 * np.array([task.largest_coil(wire) for wire in wires])
    coils = [design_spring(task, wire=wire).coils for wire in wires]
    with new_figure(1, 2, height=2.8) as (figure, both):
        for axes, values, printed, name in (
            (both[0], largest, 34.0, "Largest mean diameter [mm]"),
            (both[1], coils, 342.0, "Coils at 34 mm"),
        ):
            axes.plot(diameters, values, "o-", ms=3, color=BLUE)
            axes.plot([3.0], [printed], "s", color=ORANGE)
            axes.set(xlabel="Wire [mm]", ylabel=name)
    return figure
