"""The standard tests of an actuator: its stand's procedures that diagnosis reads.

The stand chooses them; no actuator is known by name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from elevon.bench.procedure import Procedure, load_procedure, procedure_names
from elevon.bench.stand import stand_of
from elevon.bench.steps import BacklashStep, RigStep, TraceStep
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator

POSITION = "rotary"  # equipment whose logs are read by the model of the rotary bench
_LONGEST = 60.0  # s: longer traces are of temperatures


@dataclass(frozen=True)
class StandardTest:
    """One trace of a procedure, with the steps that set the bench for it.

    Attributes
    ----------
    name : str
        Of the trace.
    procedure : Procedure
        Its steps.
    """

    name: str
    procedure: Procedure


def standard_tests(actuator: Actuator) -> tuple[StandardTest, ...]:
    """Return the tests, in the order of the bench's list.

    What commands nothing, or is there for temperatures or vibration (a rate of its own), is none.
    Of a rotary bench's procedures that ask for the same motion, the first is one.
    """
    stand = stand_of(actuator.wiring)
    out: list[StandardTest] = []
    motions = []
    for name in procedure_names(stand.name):
        procedure = load_procedure(name)
        traces = [step for step in procedure.step if isinstance(step, TraceStep)]
        moved = any(isinstance(step, RigStep) and step.terms for step in procedure.step)
        if stand.equipment == POSITION:
            traces = [trace for trace in traces[:1] if trace.command not in motions]
        for trace in traces:
            if not moved and _read(trace):
                out.append(StandardTest(trace.name, _up_to(procedure, trace)))
                motions.append(trace.command)
    return tuple(out)


def _read(trace: TraceStep) -> bool:
    command = trace.command
    moving = any(term.kind != "constant" for term in command.terms) or command.steps
    return (
        bool(moving)
        and command.mode in ("position", "gear")
        and trace.rate is None
        and parse_quantity(trace.duration, "s", "duration") <= _LONGEST
    )


def _up_to(procedure: Procedure, trace: TraceStep) -> Procedure:
    """Return the procedure with this trace alone, and what was set before it."""
    at = next(k for k, step in enumerate(procedure.step) if step is trace)
    before = [s for s in procedure.step[:at] if not isinstance(s, TraceStep | BacklashStep)]
    return procedure.model_copy(update={"step": (*before, trace)})
