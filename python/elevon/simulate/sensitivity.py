"""Exact derivatives of the low-fidelity model's signals, by dual numbers over the same source."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import InputError, Interrupted, RangeError
from elevon.parameters.records import record_of
from elevon.recording import Recording
from elevon.scenario import Scenario
from elevon.seam import CoreResult, CoreRows
from elevon.simulate.acting import report
from elevon.simulate.prepare import Prepared, Record, Run, prepare
from elevon.simulate.result import build_recording


@dataclass(frozen=True)
class Sensitivities:
    """A run and the derivatives of its signals.

    Attributes
    ----------
    recording : Recording
        The run itself.
    derivatives : mapping of str to mapping of str to ndarray
        Name of what was varied (a parameter path, or ``fault_1`` for the severity of the first
        fault) to signal name to derivative, shape (n,), on the signal's clock; SI units of the
        signal over those of the varied quantity.

    Notes
    -----
    At an instant where the friction sticks or slips, the backlash opens or closes, or a limit is
    reached, the derivative jumps: it is that of the branch the run takes. Its integral over such an
    instant misses the displacement of the instant itself, so that a finite difference over many
    switches differs from it by the sum of these displacements.
    """

    recording: Recording
    derivatives: Mapping[str, Mapping[str, Floats]]


def sensitivities(
    actuator: Actuator,
    scenario: Scenario,
    parameters: Sequence[str] = (),
    *,
    faults: Sequence[int] = (),
    fidelity: str = "low",
    record: Record = None,
    seed: int = 0,
    strict: bool = False,
    progress: Callable[[float], object] | None = None,
) -> Sensitivities:
    """Simulate one run with exact derivatives.

    Parameters
    ----------
    actuator, scenario
        As for `simulate`.
    parameters : sequence of str
        Paths to differentiate by; numbers only, no choices.
    faults : sequence of int
        Indices of the scenario's faults whose severities are to be differentiated by.
    fidelity : str
        ``low``: the relays of the high fidelity have no useful derivative.
    record, seed, strict, progress
        As for `simulate`.

    Returns
    -------
    Sensitivities
        The recording and the derivatives.

    Raises
    ------
    InputError
        Nothing chosen, an unknown path, a choice, a fault the scenario does not have, or a
        fidelity without derivatives.
    Interrupted
        `progress` returned False.
    """
    from elevon import _core

    prepared = prepare(Run(actuator, scenario, seed), fidelity, record)
    report([prepared.notices], strict=strict)
    names = [*parameters, *(f"fault_{index + 1}" for index in faults)]
    _check(actuator, scenario, parameters, faults, names)
    clocks = [clock.to_core() for clock in prepared.plan]
    try:
        passes = _core.sensitivities(
            actuator.wiring,
            fidelity,
            prepared.core,
            clocks,
            list(parameters),
            list(faults),
            (lambda fraction: progress is None or progress(fraction) is not False),
        )
    except ValueError as error:
        raise InputError(str(error)) from error
    if any(item["status"] == "interrupted" for item in passes):
        raise Interrupted(f"interrupted at {passes[-1]['time']:.6g} s of simulated time")
    return _assembled(Run(actuator, scenario, seed), prepared, fidelity, names, passes)


def _check(
    actuator: Actuator,
    scenario: Scenario,
    parameters: Sequence[str],
    faults: Sequence[int],
    names: Sequence[str],
) -> None:
    if not names:
        raise InputError("sensitivities: choose at least one parameter or fault")
    for name in names:
        if list(names).count(name) > 1:
            raise InputError(f"sensitivities: {name!r} is chosen twice")
    for path in parameters:
        if record_of(actuator.wiring, path).choices is not None:
            raise InputError(f"sensitivities: {path} is a choice; only numbers have derivatives")
    for index in faults:
        if not 0 <= index < len(scenario.fault):
            raise RangeError(
                f"sensitivities: fault {index}: the scenario has {len(scenario.fault)} fault(s)"
            )


def _assembled(
    run: Run,
    prepared: Prepared,
    fidelity: str,
    names: Sequence[str],
    passes: Sequence[CoreResult],
) -> Sensitivities:
    from elevon import _core

    count = _core.derivatives_per_pass()
    derivatives: dict[str, dict[str, Floats]] = {name: {} for name in names}
    clocks: dict[str, CoreRows] = {}
    for number, item in enumerate(passes):
        chosen = names[number * count : (number + 1) * count]
        width = 1 + len(chosen)
        for plan in prepared.plan:
            rows = item["clocks"][plan.name]
            values = rows["values"].reshape(len(rows["time"]), -1, width)
            clocks.setdefault(plan.name, {"time": rows["time"], "values": values[:, :, 0]})
            for column, signal in enumerate(plan.signals):
                for place, name in enumerate(chosen):
                    derivatives[name][signal] = values[:, column, 1 + place]
    result: CoreResult = {**passes[0], "clocks": clocks}
    return Sensitivities(build_recording(run, prepared, fidelity, result, {}), derivatives)
