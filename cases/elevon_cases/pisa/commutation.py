"""Commutation and pulse-width modulation of the landing gear's motor, and its shorted windings.

P Figs. 2.6 and 2.7: Hall code and conducting pair over the electrical angle; Fig. 2.8: the voltage
that a demand becomes; Fig. 5.4: phase currents while the software brake shorts the motor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREY, ORANGE, table_of, with_end
from elevon_cases.pisa.gear import ACTUATOR, COMMANDED

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SEQUENCE = (
    (0b101, "a", "b"), (0b100, "a", "c"), (0b110, "b", "c"),
    (0b010, "b", "a"), (0b011, "c", "a"), (0b001, "c", "b"),
)  # fmt: skip
"""Of the sectors from 30 degrees on, 60 degrees each: Hall code, high and low leg of a positive
demand (P eq. 13: +1 on [30, 150), -1 on [210, 330) degrees, b and c shifted by a third)."""
WINDOW = (0.8, 0.85)
"""s of the retraction: some ten electrical turns at a falling duty."""
EXTENSION = 8.0
_LATE = 0.5  # share of a sector after which the outgoing phase has died away
_RECORD = (
    "motor_position,motor_speed,hall_a,hall_b,hall_c,voltage_a,voltage_b,voltage_c,"
    "current_a,current_b,current_c,duty,supply_voltage"
)
_SHORTED = "motor_speed,current_a,current_b,current_c,software_brake,motor_torque"


@dataclass(frozen=True, slots=True)
class SectorRow(Plain):
    """One sector: what the Hall sensors say and what the legs do.

    Attributes
    ----------
    begin_deg : float
        Of the sector, electrical.
    hall : str
        Code a, b, c.
    high, low : str
        Conducting legs; a retraction's demand is negative, which exchanges them.
    wrong_percent : float
        Samples of the sector with another code.
    duty_percent, on_percent : float
        Demanded, and share of the time in which the pair stands at the link's voltage.
    """

    begin_deg: float
    hall: str
    high: str
    low: str
    wrong_percent: float
    duty_percent: float
    on_percent: float


@dataclass(frozen=True, slots=True)
class ShortedPulse:
    """One stretch of shorted windings in motion: when, how long [s], mean torque, peak current."""

    time: float
    length: float
    torque: float
    peak: float


@dataclass(frozen=True)
class CommutationResult(CheckedResult):
    """Everything `elevon reproduce pisa-commutation` reports."""

    rows: list[SectorRow]
    checks: list[Check]
    pulses: Annotated[list[ShortedPulse], WORKING]
    window: Annotated[Recording, WORKING]
    extension: Annotated[Recording, WORKING]


def reproduce_commutation(*, seed: int = 0, progress: Progress | None = None) -> CommutationResult:
    """Run a retraction in the switching model fast enough to see its carrier, and an extension.

    Raises
    ------
    SimulationError
        A run tripped or diverged.
    """
    gear = Actuator.load(ACTUATOR)
    half = "180 mm"
    drive = _run(
        gear, ("retract", WINDOW[1], half), _RECORD + "@1 MHz", seed, part(progress, 0.0, 0.5)
    )
    shorted = _run(gear, ("extend", EXTENSION, None), _SHORTED + "@20 kHz", seed,
                   part(progress, 0.5, 1.0))  # fmt: skip
    poles = gear.parameters.value("motor.pole_pairs")
    rows = sectors(drive, poles)
    pulses = shorted_pulses(shorted)
    cutoff = gear.parameters.value("inverter.current_cutoff")
    return CommutationResult(rows, checks_of(rows, pulses, cutoff), pulses, drive, shorted)


def _run(
    gear: Actuator,
    stroke: tuple[str, float, str | None],
    record: str,
    seed: int,
    progress: Progress | None,
) -> Recording:
    from elevon.scenario import Scenario
    from elevon.simulate import completed, simulate

    action, duration, start = stroke
    data: dict[str, Any] = {
        "duration": duration,
        "command": {"mode": "gear", "steps": [{"time": COMMANDED, "action": action}]},
    }
    if start is not None:
        data["initial"] = {"nut_position": start}
    run = simulate(gear, Scenario.from_dict(data), fidelity="high", record=record, seed=seed,
                   progress=progress)  # fmt: skip
    return completed([run], action)[0]


def electrical(run: Recording, poles: float) -> tuple[Floats, npt.NDArray[np.int64], Floats]:
    """Return the electrical angle [deg], the sector and the share of it that has been passed."""
    turned = np.degrees(poles * run["motor_position"].values)
    way = np.sign(float(np.mean(run["motor_speed"].values)))
    place = np.mod(turned - 30.0, 360.0) / 60.0
    sector = np.floor(place).astype(np.int64)
    passed = place - sector
    return np.mod(turned, 360.0), sector, passed if way > 0.0 else 1.0 - passed


def sectors(run: Recording, poles: float) -> list[SectorRow]:
    """Return what each sector of a retraction shows within `WINDOW`."""
    time = run.clock().time
    inside = (time > WINDOW[0]) & (time < WINDOW[1])
    _, sector, passed = electrical(run, poles)
    code = np.zeros(len(time))
    for weight, leg in zip((4, 2, 1), "abc", strict=True):
        code += weight * run[f"hall_{leg}"].values
    link, duty = run["supply_voltage"].values, np.abs(run["duty"].values)
    rows = []
    for number, (expected, low, high) in enumerate(SEQUENCE):
        mine = inside & (sector == number)
        late = mine & (passed > _LATE)
        pair = run[f"voltage_{high}"].values - run[f"voltage_{low}"].values
        rows.append(
            SectorRow(
                30.0 + 60.0 * number,
                f"{expected:03b}",
                high,
                low,
                100.0 * float(np.mean(code[mine] != expected)),
                100.0 * float(np.mean(duty[late])),
                100.0 * float(np.mean(pair[late] > 0.5 * link[late])),
            )
        )
    return rows


def shorted_pulses(run: Recording) -> list[ShortedPulse]:
    """Return where the software brake shorts windings that turn."""
    time, on = run.clock().time, run["software_brake"].values > 0.5
    edges = np.flatnonzero(np.diff(on.astype(np.int8)))
    begins = [k + 1 for k in edges if not on[k]]
    ends = [k + 1 for k in edges if on[k]]
    speed, torque = run["motor_speed"].values, run["motor_torque"].values
    currents = np.abs([run[f"current_{leg}"].values for leg in "abc"]).max(axis=0)
    return [
        ShortedPulse(float(time[a]), float(time[b] - time[a]), float(torque[a:b].mean()),
                     float(currents[a:b].max()))
        for a, b in zip(begins, [k for k in ends if k > begins[0]], strict=False)
        if abs(speed[a]) > 1.0
    ]  # fmt: skip


def checks_of(
    rows: Sequence[SectorRow], pulses: Sequence[ShortedPulse], cutoff: float
) -> list[Check]:
    """Code of each sector, on-time against demand, and a short that brakes below the cut-off."""
    wrong = max(row.wrong_percent for row in rows)
    off = max(abs(row.on_percent - row.duty_percent) for row in rows)
    torque = max((pulse.torque for pulse in pulses), default=float("nan"))
    peak = max((pulse.peak for pulse in pulses), default=float("nan"))
    return [
        Check("samples whose Hall code is not that of their sector", wrong, 0.1, "%"),
        Check("on-time of the pair less the demanded duty", off, 2.0, "%"),
        Check("weakest braking of a shorted stretch", torque, 0.0, "N m"),
        Check("largest current of the shorted motor over the cut-off", peak / cutoff, 1.02, "1"),
    ]


def commutation_page(result: CommutationResult, date: str | None = None) -> Report:
    """Return the report: commutation, modulation, the shorted motor."""
    report = Report(
        "Commutation, modulation and shorted motor of the Pisa landing gear",
        "The thesis's Figs. 2.6 to 2.8 and 5.4 from the switching model: a retraction recorded "
        "faster than its carrier, and the phase currents of the nominal extension.",
        date=date,
    )
    value = Actuator.load(ACTUATOR).parameters.value
    columns = (
        ("From [deg]", "begin_deg", ".0f"),
        ("Hall a b c", "hall"),
        ("High", "high"),
        ("Low", "low"),
        ("Other codes [%]", "wrong_percent", ".3f"),
        ("Duty [%]", "duty_percent", ".2f"),
        ("On [%]", "on_percent", ".2f"),
    )
    caption = "Retraction: the demand is negative. Duty and on-time in the second half of a sector."
    report.section("As Figs. 2.6 and 2.7: commutation").figure(
        _turn_figure(result.window, value("motor.pole_pairs")),
        "One electrical turn: Hall sensors and phase currents.",
    ).table(table_of(result.rows, columns, caption))
    report.section("As Fig. 2.8: modulation").figure(
        _carrier_figure(result.window, 6.0 * value("inverter.switching_period")),
        "Voltage between the conducting legs over some carrier periods.",
    )
    report.section("As Fig. 5.4: the shorted motor").figure(
        _short_figure(result),
        f"Phase currents of the nominal extension; {len(result.pulses)} stretches of shorted "
        "windings, the longest in the lower panel.",
    )
    return with_end(report, result.checks, "pisa-commutation")


_LEGS = (("a", BLUE), ("b", ORANGE), ("c", GREY))


def _turn_figure(run: Recording, poles: float) -> Figure:
    """Draw Hall sensors and currents over one electrical turn."""
    turned = np.degrees(poles * np.abs(run["motor_position"].values))
    first, last = np.searchsorted(run.clock().time, WINDOW).tolist()
    inside = np.flatnonzero(np.abs(turned[first:last] - turned[first]) < 360.0) + first
    degrees = electrical(run, poles)[0][inside]
    order = np.argsort(degrees)
    with new_figure(2, 1, height=5.0, sharex=True) as (figure, (sensors, currents)):
        for number, (leg, colour) in enumerate(_LEGS):
            hall, current = (run[f"{name}_{leg}"].values[inside][order]
                             for name in ("hall", "current"))  # fmt: skip
            level = 0.8 * hall - number
            sensors.plot(degrees[order], level, color=colour, drawstyle="steps-post")
            currents.plot(degrees[order], current, color=colour, label=leg)
        sensors.set_yticks([0.4, -0.6, -1.6], ["Hall a", "Hall b", "Hall c"])
        currents.set(xlabel="Electrical angle [deg]", ylabel="Current [A]", xlim=(0.0, 360.0))
        currents.set_xticks(range(30, 360, 60))
        currents.legend(loc="upper right", ncols=3)
    return figure


def _carrier_figure(run: Recording, span: float) -> Figure:
    """Draw voltages and demand over some carrier periods."""
    time = run.clock().time
    inside = (time > WINDOW[0]) & (time < WINDOW[0] + span)
    millis = 1e3 * (time[inside] - WINDOW[0])
    with new_figure(height=3.2) as (figure, axes):
        for leg, colour in _LEGS:
            voltage = run[f"voltage_{leg}"].values[inside]
            axes.plot(millis, voltage, color=colour, lw=1.0, label=f"phase {leg}")
        demand = run["duty"].values[inside] * run["supply_voltage"].values[inside]
        axes.plot(millis, demand, "k--", lw=1.0, label="demand")
        axes.set(xlabel="Time [ms]", ylabel="Voltage [V]")
        axes.legend(loc="upper right", ncols=4)
    return figure


def _short_figure(result: CommutationResult) -> Figure:
    """Draw the phase currents of the extension, and the longest short."""
    run, time = result.extension, result.extension.clock().time
    longest = max(result.pulses, key=lambda pulse: pulse.length, default=None)
    middle = 0.0 if longest is None else longest.time
    close = (time > middle - 0.003) & (time < middle + 0.006)
    with new_figure(2, 1, height=5.0) as (figure, (whole, near)):
        for leg, colour in _LEGS:
            current = run[f"current_{leg}"].values
            whole.plot(time[::4], current[::4], color=colour, lw=0.6)
            near.plot(1e3 * (time[close] - middle), current[close], color=colour, label=leg)
        whole.set(xlabel="Time [s]", ylabel="Current [A]")
        near.set(xlabel="Time from the short [ms]", ylabel="Current [A]")
        near.legend(loc="upper right", ncols=3)
    return figure
