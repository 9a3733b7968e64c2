"""Logs of the virtual bench for diagnosis, without the files between."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from elevon.bench.procedure import Procedure
from elevon.bench.rig import Setup
from elevon.bench.steps import BacklashStep, TraceStep
from elevon.bench.traces import cell_signals, drive_signals
from elevon.logs.command.note import CommandNote
from elevon.logs.log import Log
from elevon.recording import Recording
from elevon.recording import Recording as Built


def first_trace(procedure: Procedure) -> Procedure:
    """Return a procedure up to its first trace, with the unit's own backlash."""
    steps = []
    for step in procedure.step:
        if not isinstance(step, BacklashStep):
            steps.append(step)
        if isinstance(step, TraceStep):
            break
    return procedure.model_copy(update={"step": tuple(steps)})


def traced(
    setup: Setup,
    recording: Recording,
    *,
    cell: float = 1.0,
    noise: Mapping[str, float] | None = None,
) -> Log:
    """Return the log that the bench writes of a run.

    Parameters
    ----------
    setup : Setup
        From `elevon.bench.rig.setups`.
    recording : Recording
        Its run, with what `elevon.bench.traces.recorded` says.
    cell : float
        Brake torque measured over the true one.
    noise : mapping of str to float, optional
        Deviation of white noise on channels of the log, SI.
    """
    from elevon.logs.brake import brake_of

    signals = drive_signals(setup, recording)
    rng = np.random.default_rng([setup.conditions.seed, 7])
    for name, deviation in (noise or {}).items():
        signals[name] = signals[name] + deviation * rng.standard_normal(len(signals[name]))
    time, note = signals["time"], _noted(setup)
    cell_log = _cell(setup, recording, cell)
    channels = {
        "speed_ref": signals["speed_ref"],
        "motor_speed": signals["motor_speed"],
        "torque_current": signals["current_q_meas"],
        "current_ref": signals["current_ref"],
        "motor_position": signals["resolver_position"],
        "output_position": signals["encoder_position"],
        "torque_voltage": signals["voltage_q_ref"],
    }
    if "current_d_meas" in signals:
        channels["direct_current"] = signals["current_d_meas"]
    brake = brake_of(cell_log, note, time, 0.0, channels["motor_speed"])
    return Log(setup.trace.name, time, channels, note=note, brake=brake)


def _noted(setup: Setup) -> CommandNote:
    """What the operator notes of the command: a single waveform."""
    from elevon.units import parse_quantity
    from elevon.waveforms import unit_of, wave_records

    term = setup.trace.command.terms[0]
    parameters = {
        p.name: parse_quantity(term.arguments[p.name], unit_of(p, "rad"), p.name)
        for p in wave_records()[term.kind].parameters
        if p.name in term.arguments and p.name not in {"start", "end", "time", "phase"}
    }
    return CommandNote("", term.kind, parameters, brake=setup.brake is not None)


def _cell(setup: Setup, recording: Recording, factor: float) -> Recording:
    """Return a recording of the brake's torque by the load cell, on the drive's clock."""
    signals = cell_signals(setup, recording)
    if signals is None:
        return recording
    time, force = signals
    equipment = setup.rig.equipment
    torque = factor * force * equipment.arm / equipment.chain_ratio
    clock = setup.conditions.trigger + time * (1.0 + setup.conditions.cell.clock_drift)
    return Built.build(clock, {"load_cell_torque": torque}, {"load_cell_torque": "N m"})
