"""The flyable stand (N 6.3): a nominal, a faulty and a load actuator, the load switched in flight.

Both test actuators follow the same commanded flight; the load actuator is on one of them at a time,
so that healthy and faulty data come from the same conditions. What the aircraft adds acts on both:
the load factor on the ram's mass, vibration on ram and accelerometer, the air of the altitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.acquisition import acquire, acquired
from elevon.bench.loaded import ForceLoop, waveform_values, write_loaded
from elevon.bench.stand import Stand, stand_of
from elevon.errors import InputError, SimulationError
from elevon.faults import Fault
from elevon.files import check_output
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.scenario import Scenario
from elevon.simulate import Run, simulate_batch
from elevon.worklog import locked, sweep

UNITS = ("nominal", "faulty")
SWITCH = 10.0
"""s for which the load stays on one actuator; ASSUMED, the paper prints none."""
STANDARD_GRAVITY = 9.80665
VIBRATION = (10.0, 200.0)
"""Hz of the vibration that reaches the ram; ASSUMED: a helicopter's blade passes and gears."""
_STAND: dict[str, Any] = {
    "name": "flyable", "text": "two test actuators under one load, in flight",
    "parameters": {}, "initial": {}, "rig_moves": False,
}  # fmt: skip
_GRID = 1e-3  # s of the force table
_OVERLAP = 0.2  # s in which the load actuator leaves one ram and takes the other


@dataclass(frozen=True)
class FlightConditions:
    """What the aircraft does to the stand.

    Attributes
    ----------
    load_factor : float
        Along the rams; 0: they lie across it.
    vibration : float
        RMS along the rams [m/s2].
    air : (ndarray, ndarray) or None
        Instants [s] and temperature [K] of the air about the stand.
    """

    load_factor: float = 0.0
    vibration: float = 0.0
    air: tuple[Floats, Floats] | None = None


@dataclass(frozen=True)
class FlightLog:
    """What the stand records of one of its test actuators."""

    unit: str
    log: Recording
    loaded: float


def air_of(time: Floats, altitude: Floats) -> tuple[Floats, Floats]:
    """Return the standard atmosphere's temperature over a flight [K]."""
    from elevon.loads.atmosphere import standard_atmosphere

    return time, np.asarray(standard_atmosphere(altitude).temperature, dtype=np.float64)


def shares(time: Floats, switch: float) -> tuple[Floats, Floats]:
    """Return which share of the load each actuator bears; both sum to one at any instant."""
    phase = np.mod(time, 2.0 * switch)
    rise = np.clip((phase - switch) / _OVERLAP, 0.0, 1.0)
    fall = np.clip((phase - 2.0 * switch + _OVERLAP) / _OVERLAP, 0.0, 1.0)
    faulty = rise - fall
    return 1.0 - faulty, faulty


def fly(
    actuator: Actuator,
    flight: Scenario,
    faults: Sequence[Fault | str],
    conditions: FlightConditions | None = None,
    *,
    switch: float = SWITCH,
    rate: float | None = None,
    fidelity: str = "high",
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[FlightLog, FlightLog]:
    """Fly a nominal and a faulty actuator under one load, switched between them.

    Parameters
    ----------
    actuator : Actuator
        Of a stand with a load actuator.
    flight : Scenario
        A position command and the flight's load on the output, as `elevon loads` writes it.
    faults : sequence of Fault or str
        Of the second actuator; none: both are healthy.
    conditions : FlightConditions, optional
        What the aircraft adds; default: nothing.
    switch : float
        Seconds for which the load stays on one actuator.
    rate : float, optional
        Of the logs [Hz]; default: the stand's.
    fidelity, seed, progress
        As `elevon.simulate`.

    Raises
    ------
    InputError
        A stand without load actuator, no load, or a time of switching that is none.
    SimulationError
        A run did not reach its end.
    """
    stand, aircraft = stand_of(actuator.wiring), conditions or FlightConditions()
    _check(actuator, stand, switch, loaded=bool(flight.loads.output.terms))
    time = np.arange(0.0, flight.seconds + _GRID, _GRID)
    mass = actuator.parameters.value("load.mass")
    inertial = mass * _acceleration(aircraft, time, seed)
    forces = [force + inertial for force in _forces(stand, flight, time, switch)]
    scenarios = [_scenario(flight, time, force, aircraft) for force in forces]
    scenarios[1] = scenarios[1].with_faults(list(faults))
    hertz = stand.hertz(rate)
    roles, record = acquired(actuator, fidelity, stand, hertz, flight.seconds)
    runs = [Run(actuator, scenario, seed + k, name)
            for k, (name, scenario) in enumerate(zip(UNITS, scenarios, strict=True))]  # fmt: skip
    recordings = simulate_batch(runs, fidelity=fidelity, record=record, progress=progress)
    for name, run in zip(UNITS, recordings, strict=True):
        if run.status != "ok":
            raise SimulationError(f"{name}: {run.meta['message']}", run.status)
    logs = [
        acquire(run, roles, (time, force), stand, rate=hertz, seed=seed + k)
        for k, (run, force) in enumerate(zip(recordings, forces, strict=True))
    ]
    first, second = (
        FlightLog(name, log.with_meta(status="measured", log=name, stand=_STAND), float(share))
        for name, log, share in zip(UNITS, logs, np.mean(shares(time, switch), axis=1), strict=True)
    )
    return first, second


def claim_flight(folder: Path, *, force: bool = False) -> None:
    """Refuse a folder that has logs of a flight, before one is flown."""
    for name in UNITS:
        check_output(folder / f"{name}.csv", force=force)


def write_flight(folder: Path, logs: Sequence[FlightLog], *, force: bool = False) -> list[Path]:
    """Write what the stand records of both actuators, each a log with its roles beside it.

    Returns
    -------
    list of Path
        ``nominal.csv``, ``faulty.csv`` and their descriptions.

    Raises
    ------
    BusyError
        Another process works in the folder.
    OutputExistsError, OutputError
        As `elevon.Recording.save`; nothing is written where one of them is there.
    """
    with locked(folder):
        sweep(folder)
        claim_flight(folder, force=force)
        return [
            path for log in logs for path in write_loaded(folder, log.unit, log.log, force=force)
        ]


def _check(actuator: Actuator, stand: Stand, switch: float, *, loaded: bool) -> None:
    if stand.force is None or "load.mass" not in actuator.parameters:
        raise InputError(f"{actuator.name}: stands on {stand.name}, which has no load actuator")
    if not loaded:
        raise InputError("the flight has no load on the output: make it with elevon loads")
    if switch <= 2.0 * _OVERLAP:
        raise InputError(f"switch = {switch:g} s: must be above {2.0 * _OVERLAP:g} s")


def _acceleration(aircraft: FlightConditions, time: Floats, seed: int) -> Floats:
    """Return what the aircraft does to both rams [m/s2]."""
    shaking = aircraft.vibration * _band(time, np.random.default_rng([seed, 6]))
    return STANDARD_GRAVITY * aircraft.load_factor + shaking


def _forces(stand: Stand, flight: Scenario, time: Floats, switch: float) -> list[Floats]:
    """Return what the load actuator does to each ram [N]."""
    assert stand.force is not None
    load = waveform_values(flight.loads.output.terms, time)
    position = waveform_values(flight.command.terms, time, unit="m")
    loop, speed = ForceLoop.of(stand.force), np.gradient(position, time)
    return [loop.achieved(time, share * load, share * speed) for share in shares(time, switch)]


def _band(time: Floats, rng: np.random.Generator) -> Floats:
    """Return noise of unit RMS within the band of the vibration."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, VIBRATION, "bandpass", fs=1.0 / _GRID, output="sos")
    noise = sosfiltfilt(sections, rng.standard_normal(len(time)))
    return np.asarray(noise / np.sqrt(np.mean(noise**2)))


def _scenario(
    flight: Scenario, time: Floats, force: Floats, aircraft: FlightConditions
) -> Scenario:
    table = {"kind": "table", "times": time.tolist(), "values": force.tolist()}
    changed: dict[str, Any] = {"load": {"output": {"terms": [table]}}}
    if aircraft.air is not None:
        instants, kelvin = aircraft.air
        air = {"kind": "table", "times": instants.tolist(), "values": kelvin.tolist()}
        changed["ambient"] = {"terms": [air]}
    return flight.replaced(**changed)
