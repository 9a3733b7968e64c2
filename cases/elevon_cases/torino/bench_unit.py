"""A bench whose values nobody at it knows: its logs, and the model calibrated on some of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from elevon.actuator import Actuator
from elevon.bench.procedure import Procedure
from elevon.bench.rig import Setup, setups
from elevon.documents import Document, validated
from elevon.logs.log import Log
from elevon.progress import Progress, part

ACTUATOR = "torino-rotary"
READINGS = (14.0, 12.4, 9.15)
"""Micrometer in mm: rows 1, 7 and 14 of the table, no, medium and most added backlash."""
SINE = {"kind": "sine", "amplitude": "7 deg", "bias": "10 deg", "frequency": "0.2 Hz"}
CHIRP = {"kind": "chirp", "amplitude": "3 deg", "bias": "10 deg", "start_frequency": "0.1 Hz",
         "end_frequency": "1.1 Hz", "sweep_time": "20 s"}  # fmt: skip
WIDE = {"kind": "sine", "amplitude": "45 deg", "bias": "60 deg", "frequency": "0.05 Hz"}
RAMP = {"kind": "ramp", "initial": "0.2 N m", "slope": "0.09 N m/s", "start": "0 s", "end": "20 s"}


def trace(name: str, term: Mapping[str, Any], duration: float) -> dict[str, Any]:
    """Return the step that records one log."""
    command = {"terms": [dict(term)]}
    return {"kind": "trace", "name": name, "duration": f"{duration} s", "command": command}


def micrometer(reading: float) -> dict[str, Any]:
    """Return the step that sets the backlash, as it was measured at a reading in mm."""
    return {"kind": "backlash", "micrometer": f"{reading} mm", "curve": "measured"}


def calibration_steps() -> list[dict[str, Any]]:
    """Return the logs that a calibration needs, the encoder's wheel in full mesh."""
    return [
        micrometer(READINGS[0]),
        trace("sine", SINE, 20.0),
        trace("chirp", CHIRP, 20.0),
        {"kind": "brake", "terms": [RAMP]},
        trace("loaded", WIDE, 20.0),
        {"kind": "brake", "terms": []},
    ]


def procedure_of(name: str, steps: Sequence[Mapping[str, Any]]) -> Procedure:
    """Return a procedure of steps."""
    return validated(Procedure, {"name": name, "step": list(steps)}, Document(name, "", {}))


def hidden_and_calibrated(seed: int, progress: Progress | None = None) -> tuple[Actuator, Actuator]:
    """Return a unit with hidden values, and the model calibrated on the bench's logs of it.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.bench.hidden import hidden_actuator
    from elevon.calibrate import calibrate

    base = Actuator.load(ACTUATOR)
    unit = hidden_actuator(base, seed)
    procedure = procedure_of("calibration", calibration_steps())
    logs = bench_logs(procedure, unit, seed=seed, progress=part(progress, 0.0, 0.6))
    return unit, calibrate(logs, base, progress=part(progress, 0.6, 1.0)).actuator


def bench_logs(
    procedure: Procedure,
    unit: Actuator,
    *,
    seed: int,
    fidelity: str = "high",
    progress: Progress | None = None,
) -> list[Log]:
    """Return what the bench records of a procedure on a unit.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    return logs_of(setups(procedure, unit, seed=seed), fidelity, progress)


def logs_of(
    ready: Sequence[Setup], fidelity: str, progress: Progress | None, *, whole: bool = True
) -> list[Log]:
    """Return what the bench records of traces that are set up.

    Parameters
    ----------
    ready : sequence of Setup
        The traces.
    fidelity, progress
        As for `simulate_batch`.
    whole : bool
        Whether each must reach its end.

    Raises
    ------
    SimulationError
        `whole`, and a run did not reach its end.
    """
    from elevon.bench.traces import recorded, traced
    from elevon.scenario.compile import signal_records
    from elevon.simulate import Run, completed, simulate_batch

    runs = [Run(s.actuator, s.scenario, s.conditions.seed, s.trace.name) for s in ready]
    record = recorded(list(signal_records(ready[0].actuator.wiring, fidelity)))
    recordings = simulate_batch(runs, fidelity=fidelity, record=record, progress=progress)
    ended = completed(recordings) if whole else recordings
    return [traced(setup, run) for setup, run in zip(ready, ended, strict=True)]


def encoder_count(actuator: Actuator) -> float:
    """Return one count of the encoder, at the output [deg]."""
    value = actuator.parameters.value
    edges = value("sensor.encoder.pulses") * value("sensor.encoder.edges")
    return 360.0 / (edges * value("sensor.encoder.wheel_ratio"))
