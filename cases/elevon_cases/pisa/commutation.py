"""Commutation and pulse-width modulation of the landing gear's motor, and its shorted windings.

P Figs. 2.6 and 2.7: Hall code and conducting pair over the electrical angle; Fig. 2.8: the voltage
that a demand becomes; Fig. 5.4: phase currents while the software brake shorts the motor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report.checks import Check, CheckedResult
from elevon_cases.pisa.gear import ACTUATOR, COMMANDED

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


def page_values(result: CommutationResult) -> dict[str, object]:
    """Return what the page draws: one electrical turn, some carrier periods, the longest short."""
    value = Actuator.load(ACTUATOR).parameters.value
    carriers = 6.0 * value("inverter.switching_period")
    return {
        "turn": _turn(result.window, value("motor.pole_pairs")),
        "carrier": _carrier(result.window, carriers),
        "short": _short(result),
    }


def _legs(**signals: Sequence[Floats]) -> list[dict[str, object]]:
    """One entry a leg: its name and colour, and its part of each signal."""
    return [
        {"leg": leg, "colour": colour, **{name: lines[k] for name, lines in signals.items()}}
        for k, (leg, colour) in enumerate(zip("abc", ("blue", "orange", "grey"), strict=True))
    ]


def _of_legs(run: Recording, name: str) -> list[Floats]:
    return [run[f"{name}_{leg}"].values for leg in "abc"]


def _turn(run: Recording, poles: float) -> dict[str, object]:
    turned = np.degrees(poles * np.abs(run["motor_position"].values))
    first, last = np.searchsorted(run.clock().time, WINDOW).tolist()
    inside = np.flatnonzero(np.abs(turned[first:last] - turned[first]) < 360.0) + first
    degrees = electrical(run, poles)[0][inside]
    order = np.argsort(degrees)
    hall, current = (
        [line[inside][order] for line in _of_legs(run, name)] for name in ("hall", "current")
    )
    return {"degrees": degrees[order], "legs": _legs(hall=hall, current=current)}


def _carrier(run: Recording, span: float) -> dict[str, object]:
    time = run.clock().time
    inside = (time > WINDOW[0]) & (time < WINDOW[0] + span)
    return {
        "time": 1e3 * (time[inside] - WINDOW[0]),
        "legs": _legs(voltage=[line[inside] for line in _of_legs(run, "voltage")]),
        "demand": run["duty"].values[inside] * run["supply_voltage"].values[inside],
    }


def _short(result: CommutationResult) -> dict[str, object]:
    run, time = result.extension, result.extension.clock().time
    longest = max(result.pulses, key=lambda pulse: pulse.length, default=None)
    middle = 0.0 if longest is None else longest.time
    close = (time > middle - 0.003) & (time < middle + 0.006)
    currents = _of_legs(run, "current")
    legs = _legs(current=[line[::4] for line in currents], close=[line[close] for line in currents])
    return {"time": time[::4], "near": 1e3 * (time[close] - middle), "legs": legs}
