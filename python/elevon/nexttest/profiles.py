"""Tests that can be run next: the bench's procedures that diagnosis reads, and variants of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from elevon.bench.procedure import Procedure, load_procedure, standard_tests
from elevon.bench.steps import BrakeStep, ForceStep, SettingsStep, TraceStep
from elevon.bench.virtual import first_trace
from elevon.calibrate.ways import turns
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator


@dataclass(frozen=True)
class BenchProfile:
    """A test.

    Attributes
    ----------
    name : str
        ``PROCEDURE``, or ``PROCEDURE:VARIANT``.
    procedure : Procedure
        One trace.
    parameters : mapping of str to str
        What sets it: command and brake.
    standard : bool
        Whether it is the bench's own: a healthy log of it is taken to be at hand.
    """

    name: str
    procedure: Procedure
    parameters: Mapping[str, str] = field(default_factory=dict)
    standard: bool = True

    @property
    def duration(self) -> float:
        """Length of its log [s]."""
        return parse_quantity(self.procedure.traces[-1].duration, "s", "duration")


#: Variant to procedure, and values of its command and of its brake that differ. ASSUMED: within
#: the motor's 500 rpm, the stops and the brake's 5.5 N m.
_VARIANTS: Mapping[str, tuple[str, Mapping[str, str], Mapping[str, str]]] = {
    "backlash:slow": ("backlash", {"frequency": "0.1 Hz"}, {}),
    "backlash:fast": ("backlash", {"frequency": "0.45 Hz"}, {}),
    "loaded:heavy": ("loaded", {}, {"initial": "1 N m", "slope": "0.125 N m/s"}),
    "loaded:fast": ("loaded", {"frequency": "0.1 Hz", "amplitude": "25 deg"}, {}),
}
_STANDARD = ("backlash", "chirp", "loaded")


def profiles(actuator: Actuator | None = None) -> tuple[BenchProfile, ...]:
    """Return the tests in the order of the bench's list, variants after them.

    The bench's other procedures command a torque, not a position, or are there for temperatures:
    diagnosis does not read their logs.

    Parameters
    ----------
    actuator : Actuator, optional
        What stands on the bench; default: a turning servo, whose tests alone have variants.
    """
    if actuator is not None and not turns(actuator):
        return tuple(
            BenchProfile(test.name, test.procedure, _parameters(test.procedure))
            for test in standard_tests(actuator)
        )
    out = []
    for name in _STANDARD:
        procedure = first_trace(load_procedure(name))
        out.append(BenchProfile(name, procedure, _parameters(procedure)))
    for name, (base, command, brake) in _VARIANTS.items():
        procedure = _varied(first_trace(load_procedure(base)), command, brake)
        out.append(BenchProfile(name, procedure, _parameters(procedure), standard=False))
    return tuple(out)


def _varied(
    procedure: Procedure, command: Mapping[str, str], brake: Mapping[str, str]
) -> Procedure:
    data = procedure.model_dump(exclude_unset=True, mode="json")
    for step in data["step"]:
        if step["kind"] == "trace":
            step["command"]["terms"][0].update(command)
        elif step["kind"] == "brake":
            step["terms"][0].update(brake)
    return Procedure.model_validate(data)


def _parameters(procedure: Procedure) -> dict[str, str]:
    out: dict[str, str] = {}
    forces = [step for step in procedure.step if isinstance(step, ForceStep)]
    for step in procedure.step:
        if isinstance(step, TraceStep):
            if step.command.terms:
                out |= _stated("command", step.command.terms[0])
            for action in step.command.steps:
                out[f"action at {action.time}"] = str(action.action)
            out["duration"] = str(step.duration)
        elif isinstance(step, SettingsStep):
            out |= {path: str(value) for path, value in step.parameters.items()}
        elif isinstance(step, ForceStep) and step is forces[-1]:
            out |= _force(step)
        elif isinstance(step, BrakeStep) and step.terms:
            out |= _stated("brake", step.terms[0])
    return out


def _force(step: ForceStep) -> dict[str, str]:
    """What the load actuator is commanded."""
    out: dict[str, str] = {}
    if step.opposing:
        out["force.opposing"] = str(step.opposing)
    if step.stiffness:
        out["force.stiffness"] = str(step.stiffness)
    if step.forces:
        out["force.over the stroke"] = f"{min(step.forces):g} to {max(step.forces):g} N"
    if step.terms:
        out |= _stated("force", step.terms[0])
    return out


def _stated(prefix: str, term: object) -> dict[str, str]:
    values = term.model_dump(exclude_unset=True, mode="json")  # type: ignore[attr-defined]
    return {f"{prefix}.{name}": str(value) for name, value in values.items()}
