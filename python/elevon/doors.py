"""The doors `elevon.bench`, `compare`, `response` and `effects`, and a flight's load."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from elevon import _core
from elevon.actuator import Actuator
from elevon.analysis.effects import Effects
from elevon.bench.procedure import Procedure, load_procedure
from elevon.bench.run import BenchResult, run_procedure
from elevon.compare import Comparison
from elevon.compare import compare as run
from elevon.errors import InputError, RangeError
from elevon.faults import Fault
from elevon.loads import HingeMoment, LoadTable, read_flight
from elevon.loads import flight_load as scaled_load
from elevon.logs.formats.drive import DriveFormat
from elevon.option import Option, Quantity
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
from elevon.units import parse_quantity

#: Faults to inject, each also as ``KIND@PLACE=VALUE[unit]``.
FaultsLike = Annotated[Sequence[Fault | str], Option("--fault", reads="faults")]


def bench(
    procedure: Annotated[
        Procedure | str | os.PathLike[str], Option(metavar="PROCEDURE", complete="procedures")
    ],
    actuator: ActuatorLike,
    out: Annotated[str | os.PathLike[str], Option(metavar="DIR")],
    *,
    faults: FaultsLike = (),
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
    out : path
        Folder for the logs.
    truth : path, optional
        Write the hidden values (JSON).
    faults, seed, fidelity, layout, force, progress
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
    load: Quantity | None = None,
    seed: int = 0,
    start: Annotated[float | None, Option("--after", min=0.0)] = None,
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
        Size of that load, such as '500 N'; default: the actuator file's.
    start : float, optional
        Left out before [s]; default: as the set says.
    cutoff : float
        Cut-off of the one filter [Hz].
    seed, progress
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
    low: Annotated[Quantity | None, Option("--from")] = None,
    high: Annotated[Quantity | None, Option("--to")] = None,
    amplitude: Quantity | None = None,
    *,
    loop: str | None = None,
    output: str | None = None,
    mode: str | None = None,
    method: str | None = None,
    linear: bool = False,
    bias: Quantity = 0.0,
    load: Quantity = 0.0,
    realisations: Annotated[int, Option(min=1)] = 6,
    fidelity: str = "high",
    seed: int = 0,
    progress: Progress | None = None,
) -> FrequencyResponse | LoopResponse:
    """Measure gain, phase and coherence from the command to a signal, or an open loop.

    Parameters
    ----------
    actuator : Actuator, str or path
        What is measured.
    low : quantity, optional
        Lowest frequency; default: 0.5 Hz, of a loop its own.
    high : quantity, optional
        Highest frequency; default: 20 Hz, of a loop 2 kHz.
    amplitude : quantity, optional
        Greatest command about its mean; default: 1 deg or 1 mm.
    loop : str, optional
        Measure an open loop and its margins: ``position``, ``speed`` or ``current``.
    output : str, optional
        Signal that answers; default: output_position. Not for a loop.
    mode : str, optional
        Commanded: ``position`` (default), ``speed`` or ``torque``. Not for a loop.
    method : str, optional
        ``multisine`` (default) or ``sweep``. Not for a loop.
    linear : bool
        Whether the linear model of the low fidelity and the band in which it holds are added. Not
        for a loop.
    bias : quantity
        Mean of the command.
    load : quantity
        Constant load on the output side.
    realisations : int
        Independent inputs.
    fidelity, seed, progress
        As `elevon.response.frequency_response`.

    Raises
    ------
    InputError
        What a loop has not was given for one; what the measurement refuses.
    """
    model = as_actuator(actuator)
    if loop is not None:
        refused = {"--output": output, "--mode": mode, "--method": method, "--linear": linear}
        given = [name for name, value in refused.items() if value]
        if given:
            raise InputError(f"{', '.join(given)}: not with --loop, which measures its own signals")
        measured = loop_response(
            model, loop, low, high, amplitude, bias=bias, load=load, realisations=realisations,
            fidelity=fidelity, seed=seed, progress=progress,
        )  # fmt: skip
        return replace(measured, actuator=model.name)

    output, mode, method = output or "output_position", mode or "position", method or "multisine"

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


def effects(
    campaign: Annotated[str | os.PathLike[str], Option(metavar="DIR")],
    response: Annotated[str, Option(metavar="R")],
    *,
    level: float = 0.95,
) -> Effects:
    """Say which factors of a campaign move a response, and by how much.

    Parameters
    ----------
    campaign : path
        The campaign's folder.
    response : str
        A feature, or a number of runs.parquet.
    level : float
        Confidence of the intervals.
    """
    from elevon.analysis import effects_of, read_response
    from elevon.campaign import load_campaign

    folder = os.fspath(campaign)
    measured = effects_of(read_response(load_campaign(folder), response), level=level)
    return replace(measured, folder=folder)


def flight_load(
    flight: Annotated[str | os.PathLike[str], Option(metavar="FLIGHT")],
    actuator: Annotated[ActuatorLike, Option(reads="file")],
    *,
    area: Quantity,
    chord: Quantity,
    c_0: float = 0.0,
    c_alpha: float = 0.0,
    c_delta: float = 0.0,
    arm: Quantity | None = None,
    limit: Quantity | None = None,
    travel: Quantity | None = None,
    unscaled: bool = False,
    temperature_offset: float = 0.0,
    progress: Progress | None = None,
) -> LoadTable:
    """Return what a recorded flight asks of the actuator of one control surface.

    Parameters
    ----------
    flight : path
        Columns with units; see docs/how-to/loads.md.
    actuator : Actuator, str or path
        What bears the load.
    area : quantity
        Area of the surface behind its hinge, '0.9 m2'.
    chord : quantity
        Mean chord behind the hinge, '450 mm'.
    c_0 : float
        Hinge-moment coefficient at rest.
    c_alpha : float
        Per radian of the angle of attack.
    c_delta : float
        Per radian of the deflection.
    arm : quantity, optional
        Lever between hinge and ram; not for a turning output.
    limit : quantity, optional
        Largest load after scaling; default: the actuator's rating.load.
    travel : quantity, optional
        Largest position after scaling; default: as flown.
    unscaled : bool
        Keep the aircraft's load as it is.
    temperature_offset : float
        K on the standard atmosphere.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    InputError
        A lever missing or too many; no rating to scale to; a flight that cannot be read.
    RangeError
        The flight reaches beyond the actuator's stops.
    """
    model = as_actuator(actuator)
    surface = HingeMoment(
        parse_quantity(area, "m2", "--area"), parse_quantity(chord, "m", "--chord"),
        c_0, c_alpha, c_delta,
    )  # fmt: skip
    data = read_flight(flight, progress=progress)
    command = next(port for port in _core.ports(model.wiring) if port["name"] == "command")
    linear = command["unit"] == "m"
    if linear and arm is None:
        raise InputError(f"{model.name}: travels; give the lever between hinge and ram with --arm")
    if not linear and arm is not None:
        raise InputError(f"{model.name}: turns on the hinge line; --arm is for one that travels")
    if unscaled and limit is not None:
        raise InputError("--unscaled and --limit exclude each other")
    force, length = ("N", "m") if linear else ("N m", "rad")
    peak = None if limit is None else parse_quantity(limit, force, "--limit")
    if peak is None and not unscaled:
        if "rating.load" not in model.parameters:
            raise InputError(f"{model.name}: has no rating.load; give --limit or --unscaled")
        peak = model.parameters.value("rating.load")
    table = scaled_load(
        data, surface, limit=peak, temperature_offset=temperature_offset,
        arm=None if arm is None else parse_quantity(arm, "m", "--arm"),
        travel=None if travel is None else parse_quantity(travel, length, "--travel"),
    )  # fmt: skip
    _check_stroke(model, table)
    return table


def _check_stroke(model: Actuator, table: LoadTable) -> None:
    low, high = float(table.position.min()), float(table.position.max())
    for path, reached, sign in (("stop.lower", low, -1.0), ("stop.upper", high, 1.0)):
        stop = model.parameters.value(path) if path in model.parameters else sign * math.inf
        if sign * reached > sign * stop:
            raise RangeError(
                f"{model.name}: the flight reaches {reached:.4g} {table.units[1]}, beyond {path}, "
                f"{stop:.4g} {table.units[1]}; give --travel"
            )
