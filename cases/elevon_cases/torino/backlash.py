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
from elevon.report.checks import Check, verdict
from elevon.report.figures import COLOURS, new_figure
from elevon_cases.torino.backlash_estimate import backlash_from_encoder, flat_lengths, lost_motion

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    edges = values.value("sensor.encoder.pulses") * values.value("sensor.encoder.edges")
    count = 360.0 / (edges * values.value("sensor.encoder.wheel_ratio"))
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


def page_values(result: BacklashResult) -> dict[str, object]:
    """Return what the page says and draws beside the rows."""
    errors = np.array([row.error_deg for row in result.rows])
    period = 1.0 / FREQUENCY
    return {
        "answer": result.to_dict(),
        "worst": max(result.rows, key=lambda row: abs(row.error_deg) / row.limit_deg),
        "rms": np.sqrt(np.mean(errors**2)),
        "gap": min(row.formula_deg - row.backlash_in_deg for row in result.rows),
        "summary": summary_figure,
        "limit": np.array([row.limit_deg for row in result.rows]),
        "wholes": [_trace(result, row, START, START + period) for row in DISPLAYED],
        "tops": [_trace(result, row, START + 0.2 * period, START + 0.42 * period)
                 for row in DISPLAYED],
    }  # fmt: skip


def _trace(result: BacklashResult, number: int, start: float, stop: float) -> dict[str, object]:
    """Return a part of a row's signals [deg] at the output."""
    recording = result.recordings[number - 1]
    time = recording["encoder_position"].time
    window = (time >= start) & (time < stop)
    lines = {
        "command": recording["command"].values,
        "motor": recording["motor_position"].values / result.gear_ratio,
        "encoder": recording["encoder_position"].values,
    }
    backlash = result.rows[number - 1].backlash_in_deg
    degrees = {name: np.degrees(values[window]) for name, values in lines.items()}
    return {"title": f"Row {number}: {backlash:.2f} deg", "time": time[window], **degrees}
