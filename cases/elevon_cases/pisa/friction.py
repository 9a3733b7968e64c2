"""Friction tests of the Pisa landing gear, and what their logs alone tell.

Free fall (FF): the stages are apart and the rig moves screw, nut and ram. Modified free fall
(FFM): everything is connected, the bench holds the brake open and the rig drives the motor back.
The ram hangs from the load cell. At constant speed the friction is ``-(F_LC + m g)`` (P 4.1).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREEN, GREY, ORANGE, RED, VIOLET, table_of, with_end
from elevon_cases.pisa.gear import ACTUATOR, Stroke, run_strokes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


GRAVITY = 9.80665
SPEEDS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Speeds of the tests [mm/s]."""
FACTORS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
"""Load factors of the loaded retractions; the first gives the friction at working speed."""
TURNS = 10
"""Whole turns of the screw that are evaluated."""
HARMONICS = 5
LIMIT = 0.03
"""Of the largest value of a kind."""
SUPPLY = 30.3


@dataclass(frozen=True, slots=True)
class FrictionRow(Plain):
    """A quantity put into the model and recovered from the logs."""

    quantity: str
    direction: str
    speed_mm_s: float | None
    load_n: float | None
    put_in: float
    recovered: float
    unit: str


@dataclass(frozen=True)
class FrictionTrace:
    """One test as the paper shows it: friction, position and speed over time."""

    released: bool
    direction: int
    speed_mm_s: float
    time: Floats
    position_mm: Floats
    ram_mm_s: Floats
    motor_rad_s: Floats
    friction_n: Floats
    order: Floats
    """Of the spectrum: periods a turn of the screw."""
    amplitude_n: Floats

    @property
    def name(self) -> str:
        """Such as ``FF, extension, 1 mm/s``."""
        way = "extension" if self.direction > 0 else "retraction"
        return f"{'FF' if self.released else 'FFM'}, {way}, {self.speed_mm_s:g} mm/s"


@dataclass(frozen=True)
class FrictionResult(CheckedResult):
    """Everything `elevon reproduce pisa-friction` reports; the rows of functional runs first."""

    rows: list[FrictionRow]
    checks: list[Check]
    seed: int
    traces: Annotated[list[FrictionTrace], WORKING]
    tables: Annotated[dict[str, list[tuple[float, float]]], WORKING]
    """The set's own friction: kind and direction to pairs of mm/s and N."""

    def of(self, quantity: str, direction: str = "") -> list[FrictionRow]:
        """Return the rows of a quantity, of one direction where it is given."""
        rows = [row for row in self.rows if row.quantity == quantity]
        return [row for row in rows if direction in ("", row.direction)]

    def both(self, released: bool, speed: float) -> list[FrictionTrace]:
        """Return both directions of a test at a speed in mm/s."""
        tests = [trace for trace in self.traces if trace.released == released]
        return [trace for trace in tests if abs(trace.speed_mm_s - speed) < 1e-9]


@dataclass(frozen=True, slots=True)
class _Test:
    """One pull or push of the rig."""

    released: bool
    speed: float
    direction: int

    @property
    def way(self) -> str:
        return "extension" if self.direction > 0 else "retraction"


def reproduce_friction(*, seed: int = 0, progress: Progress | None = None) -> FrictionResult:
    """Run the tests, recover weight, friction, harmonics and efficiency from their logs.

    Raises
    ------
    SimulationError
        A run tripped or diverged.
    """
    actuator = Actuator.load(ACTUATOR)
    lead = 2.0 * math.pi * actuator.parameters.value("screw.lead")
    tests = [
        _Test(released, 1e-3 * speed, direction)
        for released in (False, True)
        for speed in SPEEDS
        for direction in (1, -1)
    ]
    logs = _run_rig(actuator, tests, lead, seed, progress)
    forces = [_settled(log, lead) for log in logs]
    mass = float(
        np.mean(
            [
                -(ahead.mean() + back.mean()) / (2.0 * GRAVITY)
                for (_, ahead), (_, back) in zip(forces[::2], forces[1::2], strict=True)
            ]
        )
    )
    put_mass = actuator.parameters.value("screw.moving_mass")
    rows = [FrictionRow("mass", "both", None, None, put_mass, mass, "kg")]
    for test, log in zip(tests, forces, strict=True):
        rows += _friction_rows(actuator, test, log, mass, lead)
    rows = _efficiency_rows(actuator, seed, progress) + rows
    traces = [_trace(test, log, mass, lead) for test, log in zip(tests, logs, strict=True)]
    return FrictionResult(rows, _checks(rows), seed, traces, _tables(actuator))


def _trace(test: _Test, log: Recording, mass: float, lead: float) -> FrictionTrace:
    force, position = log["load_cell"].values, log["nut_position"].values
    over, resisting = _settled(log, lead)
    ripple = test.direction * (resisting - resisting.mean())
    order: Floats = np.arange(1, 16, dtype=np.float64) * np.float64(0.5)
    waves = np.exp(2j * math.pi * np.outer(order, over) / lead)
    return FrictionTrace(
        test.released,
        test.direction,
        1e3 * test.speed,
        log["load_cell"].time,
        1e3 * position,
        1e3 * log["output_speed"].values,
        log["motor_speed"].values,
        np.asarray(-(force + mass * GRAVITY), dtype=np.float64),
        order,
        np.asarray(np.abs(2.0 * (waves @ ripple) / over.size), dtype=np.float64),
    )


def _tables(actuator: Actuator) -> dict[str, list[tuple[float, float]]]:
    value = actuator.parameters.value
    knots = [1e3 * value(f"friction.speed_{k}") for k in range(1, 9)]
    return {
        f"{kind}_{way}": [
            (knot, value(f"friction.{kind}_{way}_{k}")) for k, knot in enumerate(knots, 1)
        ]
        for kind in ("ff", "ffm")
        for way in ("extension", "retraction")
    }


def _run_rig(
    actuator: Actuator,
    tests: Sequence[_Test],
    lead: float,
    seed: int,
    progress: Progress | None,
) -> list[Recording]:
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    runs = []
    for number, test in enumerate(tests):
        travel = (TURNS + 1) * lead
        start = 0.02 if test.direction > 0 else 0.02 + travel
        values: dict[str, Any] = {"low.step": 1e-4}
        values["release.open" if test.released else "brake.powered"] = (
            "yes" if test.released else "always"
        )
        speed = {"kind": "constant", "value": test.direction * test.speed}
        scenario = Scenario.from_dict(
            {
                "duration": round(travel / test.speed, 2),
                "load": {"rig_speed": {"terms": [speed]}},
                "initial": {"nut_position": start},
                "parameters": values,
            }
        )
        label = f"{'FF' if test.released else 'FFM'}, {test.way}, {1e3 * test.speed:g} mm/s"
        runs.append(Run(actuator, scenario, seed, label, number))
    logs = simulate_batch(
        runs,
        fidelity="low",
        record="nut_position,load_cell,output_speed,motor_speed@500 Hz",
        progress=progress,
    )
    return completed(logs)


def _settled(log: Recording, lead: float) -> tuple[Floats, Floats]:
    """Return position and force over whole turns, the first turn left out."""
    position, force = log["nut_position"].values, log["load_cell"].values
    travel = np.abs(position - position[0])
    settled = (travel >= lead) & (travel < (TURNS + 1) * lead * (1.0 - 1e-9))
    return position[settled], force[settled]


def _friction_rows(
    actuator: Actuator, test: _Test, log: tuple[Floats, Floats], mass: float, lead: float
) -> list[FrictionRow]:
    position, force = log
    resisting = test.direction * (force + mass * GRAVITY)
    kind = "ff" if test.released else "ffm"
    speed = 1e3 * test.speed
    put = _table(actuator, f"{kind}_{test.way}", test.speed)
    rows = [
        FrictionRow(f"friction_{kind}", test.way, speed, None, put, float(resisting.mean()), "N")
    ]
    ripple = resisting - resisting.mean()
    # P 4.1.1 takes the amplitudes from FF; Fig. 3.50 shows those of FFM, in which the detent of the
    # motor is too, at other orders.
    name = "harmonic" if test.released else "harmonic_ffm"
    for order in range(1, HARMONICS + 1):
        wave = np.exp(2j * math.pi * order * position / lead)
        recovered = float(np.abs(2.0 * np.mean(ripple * wave)))
        put = _table(actuator, f"harmonic_{order}", test.speed)
        rows.append(FrictionRow(f"{name}_{order}", test.way, speed, None, put, recovered, "N"))
    if not test.released:
        return rows
    preload = 2.0 * actuator.parameters.value("screw.preload")
    put = _table(actuator, f"ff_{test.way}", test.speed)
    apparent = 1.0 / (1.0 + float(resisting.mean()) / preload)
    rows.append(
        FrictionRow(
            "preload_efficiency", test.way, speed, None, 1.0 / (1.0 + put / preload), apparent, "1"
        )
    )
    return rows


def _table(actuator: Actuator, name: str, speed: float) -> float:
    """Return what the actuator file's own table says at a speed in m/s."""
    value = actuator.parameters.value
    knots = [value(f"friction.speed_{k}") for k in range(1, 9)]
    return float(np.interp(speed, knots, [value(f"friction.{name}_{k}") for k in range(1, 9)]))


def _efficiency_rows(actuator: Actuator, seed: int, progress: Progress | None) -> list[FrictionRow]:
    """Efficiency of the screw from retractions under load, less the friction of the unloaded one.

    Current, speed and the known load curve are all that is used of a run.
    """
    strokes = [Stroke("retract", factor, SUPPLY) for factor in FACTORS]
    runs = run_strokes(strokes, fidelity="low", duration=8.0, seed=seed, progress=progress)
    value = actuator.parameters.value
    gear = value("gear.efficiency_first") * value("gear.efficiency_second")
    ratio = value("gear.ratio_first") * value("gear.ratio_second")
    travel = value("screw.lead") / ratio
    means = [_steady(run) for run in runs]
    torques = [-2.0 * value("motor.emf_constant") * current for current, _, _ in means]
    free = torques[0]
    knot, loaded, scale = (
        value("screw.efficiency_unloaded"),
        value("screw.efficiency_loaded"),
        value("screw.efficiency_force"),
    )
    rows = []
    for torque, (_, speed, load) in zip(torques[1:], means[1:], strict=True):
        recovered = load * travel / (torque - free) / gear
        put = loaded + (knot - loaded) * math.exp(-load / scale)
        working = 1e3 * abs(speed) * travel
        rows.append(FrictionRow("efficiency", "retraction", working, load, put, recovered, "1"))
    return rows


def _steady(run: Recording) -> tuple[float, float, float]:
    """Mean current, motor speed and load of the steady part of a retraction."""
    ram, speed = run["output_position"].values, run["motor_speed"].values
    steady = (speed < -560.0) & (ram > 0.075) & (ram < 0.16)
    return (
        float(run["current_mean"].values[steady].mean()),
        float(speed[steady].mean()),
        float(run["load_force"].values[steady].mean()),
    )


def _checks(rows: Sequence[FrictionRow]) -> list[Check]:
    kinds = {
        "mass": ("mass",),
        "mean friction, FFM": ("friction_ffm",),
        "mean friction, FF": ("friction_ff",),
        "harmonics, FF": tuple(f"harmonic_{order}" for order in range(1, HARMONICS + 1)),
        "harmonics, FFM": tuple(f"harmonic_ffm_{order}" for order in range(1, HARMONICS + 1)),
        "efficiency at the preload": ("preload_efficiency",),
        "efficiency over load": ("efficiency",),
    }
    checks = []
    for name, quantities in kinds.items():
        mine = [row for row in rows if row.quantity in quantities]
        largest = max(abs(row.put_in) for row in mine)
        worst = max(abs(row.recovered - row.put_in) for row in mine) / largest
        checks.append(Check(f"{name}: worst error over the largest", 100.0 * worst, 3.0, "%"))
    return checks


def friction_page(result: FrictionResult, date: str | None = None) -> Report:
    """Return the report: efficiency, friction, harmonics, histories, every quantity."""
    report = Report(
        "Friction tests of the Pisa landing gear",
        "Free fall (FF) and modified free fall (FFM) on the virtual rig at 1 to 10 mm/s in both "
        "directions, and loaded retractions. Weight, friction, harmonics and efficiency are "
        "recovered from the logs alone.",
        date=date,
    )
    functional = [row for row in result.rows if row.quantity in ("efficiency", "mass")]
    report.section("From the functional runs: weight and efficiency under load").figure(
        _efficiency_figure(result), "Efficiency of the screw over its load (Fig. 4.9)."
    ).table(table_of(functional, _COLUMNS, digits=4))
    report.section(
        "Mean friction",
        "The tests end at 10 mm/s, the leg works at 24 to 50 mm/s. P adds values there with which "
        "the simulation meets the measured peak speeds; ours are ASSUMED. Dashed: extrapolated.",
    ).figure(
        _mean_figure(result), "Mean friction: tested, and extrapolated (Figs. 3.47, 3.48, 4.3)."
    )
    report.section("Harmonics of the pitch").figure(
        _harmonics_figure(result),
        "Amplitudes of the first five harmonics: FF (Figs. 3.49, 4.4) and FFM (Fig. 3.50).",
    ).figure(_spectra_figure(result), "Spectra of the friction, FF at 2 mm/s (Figs. 4.5 and 4.6).")
    report.section(
        "Efficiency at the preload",
        "Eq. (40): the friction of an unloaded nut taken as that of its preload. Symmetric in both "
        "directions, falling with the friction force.",
    ).figure(_preload_figure(result), "Efficiency over speed (Fig. 4.7) and friction (Fig. 4.8).")
    section = report.section("Histories of the tests")
    for released, speed, figures in (
        (True, 1.0, "3.23 to 3.28"),
        (True, 4.0, "3.29 to 3.34"),
        (False, 1.0, "3.35 to 3.40"),
        (False, 3.0, "3.41 to 3.46"),
    ):
        kind = "FF" if released else "FFM"
        section.figure(
            _history_figure(result.both(released, speed)),
            f"Friction, position and speeds, {kind} at {speed:g} mm/s (Figs. {figures}).",
        )
    folded = f"{len(result.rows)} quantities, put in and recovered"
    report.section("All quantities").table(table_of(result.rows, _COLUMNS, digits=4, folded=folded))
    return with_end(report, result.checks, "pisa-friction", {"Seed": result.seed})


_COLUMNS = (
    ("Quantity", "quantity"),
    ("Direction", "direction"),
    ("Speed [mm/s]", "speed_mm_s"),
    ("Load [N]", "load_n"),
    ("Put in", "put_in"),
    ("Recovered", "recovered"),
    ("Unit", "unit"),
)
_WAYS = (("extension", BLUE, 1.0), ("retraction", ORANGE, -1.0))
_HARMONIC_COLOURS = (BLUE, ORANGE, GREEN, RED, VIOLET)


def _efficiency_figure(result: FrictionResult) -> Figure:
    rows = result.of("efficiency")
    loads = [row.load_n for row in rows]
    with new_figure(height=3.0) as (figure, axes):
        axes.plot(loads, [row.put_in for row in rows], color=BLUE, label="put in")
        recovered = [row.recovered for row in rows]
        axes.plot(loads, recovered, "x", color=ORANGE, label="recovered")
        axes.set(xlabel="Load [N]", ylabel="Efficiency of the screw", ylim=(0.5, 0.8))
        axes.legend()
    return figure


def _mean_figure(result: FrictionResult) -> Figure:
    """Draw the set's friction up to the tests' speeds and beyond, and what was recovered."""
    end = max(SPEEDS)
    with new_figure(2, 1, height=5.0) as (figure, panels):
        for axes, kind in zip(panels, ("ffm", "ff"), strict=True):
            for way, colour, _ in _WAYS:
                table = np.array(result.tables[f"{kind}_{way}"])
                tested, beyond = table[table[:, 0] <= end], table[table[:, 0] >= end]
                axes.semilogx(*tested.T, color=colour, label=f"{way}, put in")
                axes.semilogx(*beyond.T, "--", color=colour, label="extrapolated")
                rows = result.of(f"friction_{kind}", way)
                speeds = [row.speed_mm_s for row in rows]
                axes.plot(speeds, [row.recovered for row in rows], "x", color=colour)
            axes.axvline(end, color=GREY, lw=0.8)
            axes.set(ylabel=f"{kind.upper()} [N]", ylim=(0, None))
            axes.legend(ncols=2, loc="upper left")
        panels[-1].set(xlabel="Ram speed [mm/s]")
    return figure


def _harmonics_figure(result: FrictionResult) -> Figure:
    with new_figure(2, 1, height=5.0, sharex=True) as (figure, panels):
        for axes, quantity, kind in zip(
            panels, ("harmonic", "harmonic_ffm"), ("FF", "FFM"), strict=True
        ):
            for number, colour in enumerate(_HARMONIC_COLOURS, 1):
                rows = result.of(f"{quantity}_{number}")
                line = sorted((row.speed_mm_s or 0.0, row.put_in) for row in rows)
                axes.plot(*zip(*line, strict=True), color=colour, label=f"harmonic {number}")
                speeds = [row.speed_mm_s for row in rows]
                axes.plot(speeds, [row.recovered for row in rows], "x", color=colour)
            axes.set(ylabel=f"{kind}, amplitude [N]", ylim=(0, None))
        panels[0].legend(ncols=3)
        panels[-1].set(xlabel="Ram speed [mm/s]")
    return figure


def _spectra_figure(result: FrictionResult) -> Figure:
    with new_figure(1, 2, height=3.0, sharey=True) as (figure, panels):
        for axes, (way, colour, _), trace in zip(
            panels, _WAYS, result.both(True, 2.0), strict=True
        ):
            axes.stem(trace.order, trace.amplitude_n, linefmt=colour, markerfmt="o", basefmt=" ")
            axes.set(xlabel="Periods a turn of the screw", title=way, ylim=(0, None))
        panels[0].set(ylabel="Amplitude [N]")
    return figure


def _preload_figure(result: FrictionResult) -> Figure:
    """Draw the apparent efficiency over the speed, and over the friction force."""
    with new_figure(1, 2, height=3.2, sharey=True) as (figure, (over_speed, over_friction)):
        for way, colour, sign in _WAYS:
            eta, force = (
                {row.speed_mm_s: row.recovered for row in result.of(quantity, way)}
                for quantity in ("preload_efficiency", "friction_ff")
            )
            speeds = sorted(speed for speed in eta if speed is not None)
            signed, values = [sign * speed for speed in speeds], [eta[speed] for speed in speeds]
            over_speed.plot(signed, values, "x-", color=colour, label=way)
            pairs = sorted((force[speed], eta[speed]) for speed in speeds)
            over_friction.plot(*zip(*pairs, strict=True), "x-", color=colour)
        over_speed.set(xlabel="Ram speed, positive extends [mm/s]", ylabel="Efficiency")
        over_speed.legend()
        over_friction.set(xlabel="Friction, FF [N]")
    return figure


def _history_figure(both: Sequence[FrictionTrace]) -> Figure:
    """Draw friction, position and speeds of one test in both directions."""
    signals = (
        ("friction_n", "Friction [N]"),
        ("position_mm", "Ram [mm]"),
        ("ram_mm_s", "Ram [mm/s]"),
        ("motor_rad_s", "Motor [rad/s]"),
    )
    with new_figure(4, 1, height=6.2, sharex=True) as (figure, panels):
        for axes, (name, label) in zip(panels, signals, strict=True):
            first = name == "friction_n"
            for trace, (way, colour, _) in zip(both, _WAYS, strict=True):
                thin = slice(10, None, max(1, trace.time.size // 1500))
                values = getattr(trace, name)[thin]
                about = {"lw": 0.8, "label": way} if first else {}
                axes.plot(trace.time[thin], values, color=colour, **about)
            axes.set(ylabel=label)
        panels[0].legend(loc="center right")
        panels[-1].set(xlabel="Time [s]")
    return figure
