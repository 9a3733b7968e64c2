"""The no-load campaign of the Torino bench, simulated at all fifteen measured backlashes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.data import read_table
from elevon.plain import fields_of
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.report import Report
from elevon.report.checks import Check, verdict
from elevon.report.figures import COLOURS, new_figure
from elevon_cases.page import BLUE, GREEN, GREY, ORANGE, table_of, with_end
from elevon_cases.torino.backlash_estimate import backlash_from_encoder, flat_lengths, lost_motion
from elevon_cases.torino.bench_unit import encoder_count

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ACTUATOR = "torino-rotary"
FREQUENCY = 0.2
DURATION = 35.0
START = 10.0
"""What came before is transient and left out, as on the bench [s]."""
RECORD = "encoder_position,output_position,motor_position,command@400 Hz"
RELATIVE_LIMIT = 0.02
PRINT_LIMIT_DEG = 0.0025
"""Half of the spacing's last printed digit, 0.01 mm, carried through the formula."""


@dataclass(frozen=True, slots=True)
class RowResult:
    """One row: measured, calculated, put in, recovered. Angles in degrees at the output side."""

    measured: BacklashRow
    formula_deg: float
    backlash_in_deg: float
    backlash_out_deg: float
    spread_deg: float
    lost_motion_deg: float
    flat_s: float
    count_deg: float

    @property
    def limit_deg(self) -> float:
        """One encoder count and 2 % of the backlash put in."""
        return self.count_deg + RELATIVE_LIMIT * self.backlash_in_deg

    @property
    def error_deg(self) -> float:
        """Recovered less put in."""
        return self.backlash_out_deg - self.backlash_in_deg

    def printed(self) -> dict[str, object]:
        """Return one row of the command's JSON object."""
        return fields_of(
            self, "row=measured.row", "micrometer_mm=measured.micrometer_mm",
            "spacing_mm=measured.spacing_mm", "measured_total_deg=measured.measured_total_deg",
            "formula_deg", "backlash_in_deg", "backlash_out_deg", "error_deg", "limit_deg",
            "backlash_out_spread_deg=spread_deg", "lost_motion_deg", "flat_s",
        )  # fmt: skip


@dataclass(frozen=True)
class BacklashResult:
    """Everything `elevon reproduce torino-backlash` reports."""

    rows: list[RowResult]
    encoder_count_deg: float
    gear_ratio: float
    recordings: list[Recording]
    blank: Recording
    checks: list[Check]

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command."""
        runs = [self.blank, *self.recordings]
        return {
            **verdict(self.checks),
            "encoder_count_deg": self.encoder_count_deg,
            "flat_length_rank_correlation": _rank_correlation(self.rows),
            "rows": [row.printed() for row in self.rows],
            "sim_s": sum(float(run.meta["sim_s"]) for run in runs),
            "seed": self.blank.meta["seed"],
            "parameter_hash": self.blank.meta["parameter_hash"],
            "version": self.blank.meta["version"],
        }


def no_load_scenario() -> dict[str, object]:
    """Return the command of the campaign: 7 deg about 10 deg at 0.2 Hz, nothing attached."""
    sine = {"kind": "sine", "amplitude": "7 deg", "bias": "10 deg", "frequency": f"{FREQUENCY} Hz"}
    return {"duration": f"{DURATION} s", "command": {"mode": "position", "terms": [sine]}}


def reproduce_backlash(*, seed: int = 0, progress: Progress | None = None) -> BacklashResult:
    """Simulate the campaign at every measured backlash and recover each from its encoder.

    Parameters
    ----------
    seed : int
        Seed of the runs.
    progress : callable, optional
        As for `simulate_batch`.

    Returns
    -------
    BacklashResult

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.actuator import Actuator
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    actuator = Actuator.load(ACTUATOR)
    scenario = Scenario.from_dict(no_load_scenario())
    table = measured_rows()
    backlashes = [0.0, *(row.measured_total_deg for row in table)]
    runs = [
        Run(
            actuator.with_values({"backlash.total": math.radians(backlash)}),
            scenario,
            seed,
            f"{backlash} deg",
        )
        for backlash in backlashes
    ]
    blank, *recordings = simulate_batch(runs, fidelity="high", record=RECORD, progress=progress)
    completed([blank, *recordings])
    values = actuator.parameters
    ratio = values.value("gear.ratio")
    gain = values.value("control.position_gain") / ratio
    count = encoder_count(actuator)
    rows = [
        _row(row, recording, blank, gain=gain, ratio=ratio, count=count)
        for row, recording in zip(table, recordings, strict=True)
    ]
    return BacklashResult(rows, count, ratio, recordings, blank, _checks(rows, count))


def _row(
    measured: BacklashRow,
    recording: Recording,
    blank: Recording,
    *,
    gain: float,
    ratio: float,
    count: float,
) -> RowResult:
    encoder = recording["encoder_position"]
    estimate = backlash_from_encoder(
        encoder.time,
        encoder.values,
        blank["encoder_position"].values,
        frequency=FREQUENCY,
        loop_gain=gain,
        start=START,
    )
    motor = recording["motor_position"].values / ratio
    flats = flat_lengths(encoder.time, encoder.values, FREQUENCY, START)
    return RowResult(
        measured=measured,
        formula_deg=formula_deg(measured.spacing_mm),
        backlash_in_deg=measured.measured_total_deg,
        backlash_out_deg=math.degrees(estimate.total),
        spread_deg=math.degrees(estimate.spread),
        lost_motion_deg=math.degrees(lost_motion(encoder.time, motor, encoder.values, START)),
        flat_s=float(flats.mean()),
        count_deg=count,
    )


def _checks(rows: Sequence[RowResult], count: float) -> list[Check]:
    recovered = [
        Check(f"row {row.measured.row}: recovered less put in", abs(row.error_deg),
              row.limit_deg, "deg")
        for row in rows
    ]  # fmt: skip
    lost = max(abs(row.lost_motion_deg - row.backlash_in_deg) for row in rows)
    distance = [
        abs(centre_distance(row.measured.micrometer_mm) - row.measured.centre_distance_mm)
        for row in rows
    ]
    printed = [
        abs(row.formula_deg - formula_deg(0.0) - row.measured.calculated_deg) for row in rows
    ]
    return [
        *recovered,
        # Both ends of the lost motion are read with a resolution of one count.
        Check("largest: motor minus encoder less put in", lost, count, "deg"),
        Check("centre distances from the micrometer", max(distance), 0.015, "mm"),
        Check("printed formula column from the geometry", max(printed), PRINT_LIMIT_DEG, "deg"),
    ]  # fmt: skip


def _rank_correlation(rows: Sequence[RowResult]) -> float:
    from scipy.stats import spearmanr

    correlation = spearmanr([row.backlash_in_deg for row in rows], [row.flat_s for row in rows])
    return float(correlation.statistic)


INTRINSIC_DEG = 0.365568
"""Backlash of the bench itself at zero spacing, total, at the output side (thesis) [deg]."""
PRESSURE_ANGLE = math.radians(20.0)
PITCH_RADIUS_MM = 88.0
"""Module 2 times 88 teeth, halved."""


@dataclass(frozen=True, slots=True)
class BacklashRow:
    """One setting of the encoder support.

    Attributes
    ----------
    row : int
        From 1, as printed.
    micrometer_mm, centre_distance_mm, spacing_mm : float
        Reading, distance of the two gears' centres, and that less the distance of row 1.
    calculated_deg : float
        Net backlash of the formula as printed.
    measured_total_deg : float
        Measured total backlash: the printed radians in degrees.
    """

    row: int
    micrometer_mm: float
    centre_distance_mm: float
    spacing_mm: float
    calculated_deg: float
    measured_total_deg: float


def measured_rows() -> list[BacklashRow]:
    """Return the fifteen rows as printed."""
    return [
        BacklashRow(
            row=int(line["row"]),
            micrometer_mm=float(line["micrometer_mm"]),
            centre_distance_mm=float(line["centre_distance_mm"]),
            spacing_mm=float(line["spacing_mm"]),
            calculated_deg=float(line["net_calculated_deg"]),
            measured_total_deg=math.degrees(float(line["total_measured_rad"])),
        )
        for line in read_table("torino_backlash")
    ]


def centre_distance(micrometer_mm: float) -> float:
    """Return the centre distance [mm] of a micrometer reading: the support slides at 45 deg."""
    return 108.43 + (14.0 - micrometer_mm) * math.sin(math.radians(45.0))


def formula_deg(spacing_mm: float) -> float:
    """Return the total backlash [deg] that a radial spacing gives between ideal teeth.

    Two flanks, each opening by spacing * tan(pressure angle), over the pitch radius, and the
    bench's intrinsic backlash. The published form divides by z instead of the pitch radius m z / 2
    and is right only because m = 2.
    """
    opened = 2.0 * spacing_mm * math.tan(PRESSURE_ANGLE) / PITCH_RADIUS_MM
    return math.degrees(opened) + INTRINSIC_DEG


DISPLAYED = (1, 7, 14)
"""Rows whose traces the paper shows."""


def summary_figure(rows: Sequence[RowResult]) -> Figure:
    """Draw measured, calculated and recovered backlash over the spacing."""
    spacing = np.array([row.measured.spacing_mm for row in rows])
    with new_figure(width=8.0, height=3.8) as (figure, axes):
        axes.plot(
            spacing,
            [row.formula_deg for row in rows],
            color=COLOURS["grey"],
            label="geometric formula, with the intrinsic backlash",
        )
        axes.plot(
            spacing,
            [row.measured.measured_total_deg for row in rows],
            "o",
            ms=8,
            mfc="none",
            color=COLOURS["blue"],
            label="measured on the bench",
        )
        axes.plot(
            spacing,
            [row.backlash_out_deg for row in rows],
            "x",
            color=COLOURS["orange"],
            label="recovered from the simulated encoder",
        )
        axes.set(
            xlabel="Radial spacing of the gears [mm]", ylabel="Total backlash [deg]", ylim=(0, 2.8)
        )
        axes.legend(loc="upper left")
    return figure


def backlash_page(result: BacklashResult, date: str | None = None) -> Report:
    """Return the report of the campaign."""
    rows, answer = result.rows, result.to_dict()
    worst = max(rows, key=lambda row: abs(row.error_deg) / row.limit_deg)
    report = Report(
        "Backlash of the Torino bench",
        "Fifteen measured backlashes, put into the simulated actuator and recovered from its "
        f"encoder alone. Largest error against its limit: row {worst.measured.row}, "
        f"{abs(worst.error_deg):.4f} of {worst.limit_deg:.4f} deg.",
        date=date,
    )
    rms = np.sqrt(np.mean(np.square([row.error_deg for row in rows])))
    gap = min(row.formula_deg - row.backlash_in_deg for row in rows)
    report.fact("Error of recovery", f"{rms:.4f} deg", "RMS, fifteen rows")
    report.fact("Encoder count", f"{result.encoder_count_deg:.4f} deg", "at the output side")
    report.fact("Formula less measured", f"{gap:+.2f} deg", "largest, at the widest spacing")
    report.fact("Simulated", f"{answer['sim_s']:.0f} s", f"{len(rows) + 1} runs, 1 us steps")
    section = report.section(
        "Measured, calculated, simulated",
        "The formula is that of ideal teeth. Above some 2 mm of spacing the printed gears' flanks "
        "are no involutes any more and the bench shows more backlash than the formula.",
    )
    section.figure(summary_figure(rows), "Total backlash against the spacing of the gears.")
    section.table(table_of(rows, _COLUMNS, "Total backlash at the output side."))
    section.figure(
        _error_figure(rows),
        "Error of the recovered backlash; the band is one count and 2 % of the backlash.",
    )
    report.section(
        "What the encoder sees",
        "While the gap is crossed the encoder stands still. The loop, closed on the encoder, "
        "drives the motor on: it overshoots by the backlash; the flat ends with a step in speed.",
    ).figure(
        _traces_figure(result),
        "Rows 1, 7 and 14: command, motor divided by the gear ratio, encoder. Above one period "
        f"after {START:g} s, below its top.",
    )
    report.section(
        "How the backlash is recovered",
        "From encoder signals only. Over half a period, from before one reversal to before the "
        "next, the motor turns the encoder's own travel plus the backlash. The loop's integral "
        "action makes the time integral of command less encoder, times the position gain, equal "
        "to that travel, up to what friction takes to turn round. The same command without "
        "backlash (a blank run) takes the same for friction. So the backlash is the position gain "
        "times the area between the two encoder signals over half a period: no inertia, friction "
        f"or timing enters. The areas of the reversals after {START:g} s are averaged; a count is "
        f"{result.encoder_count_deg:g} deg.",
        "Second estimate, for comparison: the range of motor position less encoder, which a bench "
        "with a motor sensor sees directly, to within a count.",
    )
    made = {"Parameter hash (no backlash)": answer["parameter_hash"], "Seed": answer["seed"],
            "Core": answer["version"]}  # fmt: skip
    return with_end(report, result.checks, "torino-backlash", made)


_COLUMNS = (
    ("Row", "measured.row", "d"),
    ("Micrometer [mm]", "measured.micrometer_mm", ".2f"),
    ("Measured [deg]", "measured.measured_total_deg", ".4f"),
    ("Formula [deg]", "formula_deg", ".4f"),
    ("Put in [deg]", "backlash_in_deg", ".4f"),
    ("Recovered [deg]", "backlash_out_deg", ".4f"),
    ("Error [deg]", "error_deg", "+.4f"),
    ("Limit [deg]", "limit_deg", ".4f"),
    ("Motor less encoder [deg]", "lost_motion_deg", ".4f"),
    ("Flat [s]", "flat_s", ".3f"),
)


def _error_figure(rows: Sequence[RowResult]) -> Figure:
    put_in = [row.backlash_in_deg for row in rows]
    limit = np.array([row.limit_deg for row in rows])
    with new_figure(height=2.6) as (figure, axes):
        axes.fill_between(put_in, -limit, limit, color=GREEN, alpha=0.15, lw=0)
        axes.axhline(0.0, color=GREY, lw=0.8)
        errors, spread = [row.error_deg for row in rows], [row.spread_deg for row in rows]
        axes.errorbar(put_in, errors, spread, fmt="o", ms=4.5, lw=1, color=ORANGE)
        axes.set(xlabel="Backlash put in [deg]", ylabel="Error [deg]")
    return figure


def _traces_figure(result: BacklashResult) -> Figure:
    """Draw one period of the displayed rows, and its top."""
    period = 1.0 / FREQUENCY
    with new_figure(2, 3, width=9.0, height=5.6) as (figure, axes):
        for place, number in enumerate(DISPLAYED):
            whole, top = axes[:, place]
            _draw_row(whole, result, number, START, START + period)
            _draw_row(top, result, number, START + 0.2 * period, START + 0.42 * period)
            backlash = result.rows[number - 1].backlash_in_deg
            whole.set(title=f"Row {number}: {backlash:.2f} deg", ylim=(1.0, 19.0))
            top.set(xlabel="Time [s]", ylim=(14.2, 18.8))
        for row in axes:
            row[0].set(ylabel="Position at the output [deg]")
        axes[0, 0].legend(loc="lower left")
    return figure


def _draw_row(axes: Axes, result: BacklashResult, number: int, start: float, stop: float) -> None:
    """Draw a part of a row's signals at the output."""
    recording = result.recordings[number - 1]
    time = recording["encoder_position"].time
    window = (time >= start) & (time < stop)
    for name, ratio, colour, width, label in (
        ("command", 1.0, GREY, 1.0, "command"),
        ("motor_position", result.gear_ratio, BLUE, 1.2, "motor / ratio"),
        ("encoder_position", 1.0, ORANGE, 1.6, "encoder"),
    ):
        angle = np.degrees((recording[name].values / ratio)[window])
        axes.plot(time[window], angle, color=colour, lw=width, label=label)
