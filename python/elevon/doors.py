"""The doors `elevon.bench`, `elevon.compare`, `elevon.response` and `elevon.effects`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

from elevon.actuator import Actuator
from elevon.analysis.effects import Effects
from elevon.bench.procedure import Procedure, load_procedure
from elevon.bench.run import BenchResult, run_procedure
from elevon.compare import Comparison
from elevon.compare import compare as run
from elevon.faults import Fault
from elevon.logs.formats.drive import DriveFormat
from elevon.progress import Progress
from elevon.response import (
    FrequencyResponse,
    LoopResponse,
    band_of,
    frequency_response,
    linearise,
    loop_response,
)
from elevon.simulate.prepare import ActuatorLike, ScenarioLike, as_actuator, as_scenario


def bench(
    procedure: Procedure | str | os.PathLike[str],
    actuator: ActuatorLike,
    out: str | os.PathLike[str],
    *,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
    fidelity: str = "high",
    layout: DriveFormat | None = None,
    truth: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> BenchResult:
    """Carry out a procedure on the virtual bench and write what the bench writes.

    Parameters
    ----------
    procedure : Procedure, str or path
        A name (``elevon bench list``) or a TOML file.
    actuator : Actuator, str or path
        On the stand that its wiring's ports choose.
    out, faults, seed, fidelity, layout, truth, force, progress
        As `elevon.bench.run.run_procedure`; a fault may be a text.

    Returns
    -------
    BenchResult
        Its ``paths`` are the logs' files.
    """
    document = (
        procedure if isinstance(procedure, Procedure) else load_procedure(os.fspath(procedure))
    )
    injected = [fault if isinstance(fault, Fault) else Fault.parse(fault) for fault in faults]
    return run_procedure(
        document, as_actuator(actuator), os.fspath(out), faults=injected, seed=seed,
        fidelity=fidelity, layout=layout, truth=None if truth is None else os.fspath(truth),
        force=force, progress=progress,
    )  # fmt: skip


def compare(
    actuator: ActuatorLike,
    scenario: ScenarioLike = None,
    *,
    loads: bool = False,
    load: str | float | None = None,
    seed: int = 0,
    start: float | None = None,
    cutoff: float = 10.0,
    progress: Progress | None = None,
) -> Comparison:
    """Run one scenario with both models and compare what came out.

    Parameters
    ----------
    actuator : Actuator, str or path
        What moves.
    scenario : Scenario, mapping or path, optional
        Default: what the actuator is compared on.
    loads : bool
        Whether it is repeated under opposing and aiding load (`Comparison.loads`).
    load : quantity, optional
        Size of that load; default: the actuator file's.
    seed, start, cutoff, progress
        As `elevon.compare.compare`.
    """
    from elevon.compare import compare_loads

    model = as_actuator(actuator)
    moved = None if scenario is None else as_scenario(scenario, model)
    if not loads:
        return run(model, moved, seed=seed, start=start, cutoff=cutoff, progress=progress)
    results = compare_loads(
        model, moved, load=load, seed=seed, start=start, cutoff=cutoff, progress=progress
    )
    return replace(results["as given"], loads=results)


def response(
    actuator: ActuatorLike,
    low: float | str | None = None,
    high: float | str | None = None,
    amplitude: float | str | None = None,
    *,
    loop: str | None = None,
    output: str = "output_position",
    mode: str = "position",
    method: str = "multisine",
    linear: bool = False,
    bias: float | str = 0.0,
    load: float | str = 0.0,
    realisations: int = 6,
    fidelity: str = "high",
    seed: int = 0,
    progress: Progress | None = None,
) -> FrequencyResponse | LoopResponse:
    """Measure gain, phase and coherence from the command to a signal, or an open loop.

    Parameters
    ----------
    actuator : Actuator, str or path
        What is measured.
    low, high : quantity, optional
        Lowest and highest frequency; default 0.5 and 20 Hz, of a loop its own.
    amplitude : quantity, optional
        Of the input; default: small against the stroke.
    loop : str, optional
        ``position``, ``speed`` or ``current``: the open loop instead, with its margins.
    output, mode, method : str
        Signal, kind of command, ``multisine`` or ``sweep``; not for a loop.
    linear : bool
        Whether the linear model of the low fidelity and the band in which it holds are added; not
        for a loop.
    bias, load, realisations, fidelity, seed, progress
        As `elevon.response.frequency_response`.
    """
    model = as_actuator(actuator)
    if loop is not None:
        measured = loop_response(
            model, loop, low, high, amplitude, bias=bias, load=load, realisations=realisations,
            fidelity=fidelity, seed=seed, progress=progress,
        )  # fmt: skip
        return replace(measured, actuator=model.name)

    def at(fidelity: str) -> FrequencyResponse:
        return frequency_response(
            model, low or "0.5 Hz", high or "20 Hz", amplitude or _usual(model, mode),
            output=output, mode=mode, method=method, bias=bias, load=load,
            realisations=realisations, fidelity=fidelity, seed=seed, progress=progress,
        )  # fmt: skip

    measured_response = replace(at(fidelity), actuator=model.name)
    if not linear:
        return measured_response
    by = linearise(model, outputs=[output], mode=mode, command=bias, load=load)
    other = at("high" if fidelity == "low" else "low")
    pair = (other, measured_response) if fidelity == "low" else (measured_response, other)
    return replace(measured_response, linear=by, band=band_of(*pair))


def _usual(actuator: Actuator, mode: str) -> str:
    """Return a command small against the stroke: one that backlash and friction still shape."""
    from elevon.scenario.compile import signal_units

    if mode != "position":
        return {"speed": "60 rpm", "torque": "0.5 N m"}.get(mode, "1")
    linear = signal_units(actuator.wiring, "high")["output_position"] == "m"
    return "1 mm" if linear else "1 deg"


def effects(campaign: str | os.PathLike[str], response: str, *, level: float = 0.95) -> Effects:
    """Say which factors of a campaign move a response, and by how much.

    Parameters
    ----------
    campaign : path
        The campaign's folder.
    response : str
        A feature, or a number of the runs.
    level : float
        Confidence of the intervals.
    """
    from elevon.analysis import effects_of, read_response
    from elevon.campaign import load_campaign

    folder = os.fspath(campaign)
    measured = effects_of(read_response(load_campaign(folder), response), level=level)
    return replace(measured, folder=folder)
