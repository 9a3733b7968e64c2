"""The bench's brake: a disk closed by a servo, in a torque loop on its load cell.

This is equipment of the bench, not physics of the actuator, so it is computed here, before the
run, and enters the simulation as a table of the torque the brake can oppose. Between the two lies
one assumption: the loop sees the disk slide. It holds while the shaft turns; at a reversal the cell
shows less for the few milliseconds of standstill, too short for the loop to answer.

Printed (reference sheet 1.8, item 7): PI control, error = set - torque, a servo, load-cell
feedback, 20 to 30 N m at the disk, a chain. Everything else is ASSUMED; see `BrakeRig`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.bench.converter import Hx711
from elevon.errors import InputError, RangeError
from elevon.scenario.scenario import Term
from elevon.units import parse_quantity
from elevon.waveforms import TABLE, evaluate, unit_of, wave_records


@dataclass(frozen=True, slots=True)
class BrakeRig:
    """What the brake is made of.

    Attributes
    ----------
    chain_ratio : float
        Turns of the motor for one of the disk. ASSUMED 4.5: 20 to 30 N m at the disk must reach
        the motor's 6 N m.
    arm : float
        From the disk's axis to the load cell [m]. ASSUMED 0.1: the disk's torque then loads a
        50 kg cell to one half.
    disk_torque : float
        Torque of the closed brake at the disk [N m]: the middle of the printed 20 to 30.
    proportional : float
        Commanded opening, over the disk's torque, for an error of that size. ASSUMED.
    integral : float
        1/s, likewise. ASSUMED: its zero cancels the servo's lag.
    servo_lag : float
        s. ASSUMED: a hobby servo under load.
    servo_rate : float
        Full strokes a second. ASSUMED: 60 degrees in 0.2 s, stroke 90 degrees.
    """

    chain_ratio: float = 4.5
    arm: float = 0.1
    disk_torque: float = 25.0
    proportional: float = 0.5
    integral: float = 5.0
    servo_lag: float = 0.1
    servo_rate: float = 3.3

    @property
    def limit(self) -> float:
        """Greatest torque on the motor shaft [N m]."""
        return self.disk_torque / self.chain_ratio


@dataclass(frozen=True, slots=True)
class CellState:
    """What of the load cell no one knows while it measures.

    Attributes
    ----------
    offset : float
        N, after taring.
    drift : float
        N/s.
    noise : float
        Standard deviation of a sample [N].
    clock_drift : float
        Its clock's error: one of its seconds lasts (1 + clock_drift) of the drive's.
    pad : float
        Friction of the pads over its nominal value.
    """

    offset: float
    drift: float
    noise: float
    clock_drift: float
    pad: float


@dataclass(frozen=True, slots=True)
class BrakeRun:
    """One run of the brake's loop.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds of the load cell's clock, from the trigger.
    target, torque : ndarray, shape (n,)
        Set point, and what the brake can oppose, on the motor shaft [N m].
    noise : ndarray, shape (n,)
        Disturbance of each sample of the cell [N], offset and drift included.
    """

    time: Floats
    target: Floats
    torque: Floats
    noise: Floats


def set_point(terms: Sequence[Term], time: Floats) -> Floats:
    """Return the sum of the brake's terms [N m, motor shaft] at instants [s] after the trigger.

    Raises
    ------
    InputError
        A waveform the brake's controller does not know.
    """
    total = np.zeros_like(time)
    for index, term in enumerate(terms):
        if term.enabled:
            total += _term(term, time, f"brake: terms[{index}]")
    return total


def _term(term: Term, time: Floats, place: str) -> Floats:
    units = {p.name: unit_of(p, "N m") for p in wave_records()[term.kind].parameters}
    given = {n: _number(v, units[n], f"{place}: {n}") for n, v in term.arguments.items()}
    if term.kind == TABLE:
        if given.get("repeat") or given.get("hold"):
            raise InputError(f"{place}: a table of the brake neither repeats nor holds")
        times, values = (np.asarray(a, dtype=np.float64) for a in term.points())
        seconds = times * parse_quantity(f"1 {term.time_unit}", "s", place)
        scale = parse_quantity(f"1 {term.unit or 'N m'}", "N m", place) * given.get("gain", 1.0)
        at = time - given.get("start", 0.0)
        return np.asarray(np.interp(at, seconds, values * scale), dtype=np.float64)
    return evaluate(term.kind, given, time)


def _number(value: bool | float | str, unit: str, place: str) -> float:
    return float(value) if isinstance(value, bool) else parse_quantity(value, unit, place)


def brake_loop(
    rig: BrakeRig,
    cell: CellState,
    terms: Sequence[Term],
    duration: float,
    rng: np.random.Generator,
) -> BrakeRun:
    """Run the torque loop at the load cell's rate.

    Parameters
    ----------
    rig : BrakeRig
        The brake.
    cell : CellState
        Its load cell.
    terms : sequence of Term
        Set point on the motor shaft [N m].
    duration : float
        Seconds of the load cell's clock, from the trigger.
    rng : Generator
        For the cell's noise.

    Raises
    ------
    RangeError
        A set point below zero or above what the brake can hold.
    """
    converter = Hx711()
    time = np.arange(int(duration * converter.rate) + 1) / converter.rate
    target = set_point(terms, time)
    if target.min(initial=0.0) < 0.0 or target.max(initial=0.0) > rig.limit:
        raise RangeError(
            f"brake: set point from {target.min():.4g} to {target.max():.4g} N m is outside 0 to "
            f"{rig.limit:.4g} N m ({rig.disk_torque:g} N m at the disk over {rig.chain_ratio:g})"
        )
    noise = cell.offset + cell.drift * time + cell.noise * rng.standard_normal(len(time))
    torque = _loop(rig, cell, target, noise, converter)
    return BrakeRun(time, target, torque, noise)


def _loop(
    rig: BrakeRig, cell: CellState, target: Floats, noise: Floats, converter: Hx711
) -> Floats:
    """Return the torque on the motor shaft, sample by sample; as fractions of the disk's torque."""
    period = 1.0 / converter.rate
    newtons = rig.disk_torque / rig.arm
    torque = np.empty_like(target)
    position = integral = 0.0
    targets = (target / rig.limit).tolist()
    for k, (goal, disturbance) in enumerate(zip(targets, noise.tolist(), strict=True)):
        fraction = cell.pad * position
        torque[k] = fraction * rig.limit
        seen = float(converter.convert(fraction * newtons + disturbance)) / newtons
        error = goal - seen
        wish = rig.proportional * error + integral
        opening = min(max(wish, 0.0), 1.0)
        if opening == wish or (wish - opening) * error < 0.0:  # no windup against the end stops
            integral += rig.integral * error * period
        step = (opening - position) * -np.expm1(-period / rig.servo_lag)
        reach = rig.servo_rate * period
        position += min(max(float(step), -reach), reach)
    return torque
