"""Tests that can be run next: the bench's procedures that diagnosis reads, and variants of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from elevon.bench.procedure import BrakeStep, Procedure, TraceStep, load_procedure
from elevon.bench.virtual import first_trace


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


#: Variant to procedure, and values of its command and of its brake that differ. ASSUMED: within
#: the motor's 500 rpm, the stops and the brake's 5.5 N m.
_VARIANTS: Mapping[str, tuple[str, Mapping[str, str], Mapping[str, str]]] = {
    "backlash:slow": ("backlash", {"frequency": "0.1 Hz"}, {}),
    "backlash:fast": ("backlash", {"frequency": "0.45 Hz"}, {}),
    "loaded:heavy": ("loaded", {}, {"initial": "1 N m", "slope": "0.125 N m/s"}),
    "loaded:fast": ("loaded", {"frequency": "0.1 Hz", "amplitude": "25 deg"}, {}),
}
_STANDARD = ("backlash", "chirp", "loaded")


def profiles() -> tuple[BenchProfile, ...]:
    """Return the tests in the order of the bench's list, variants after them.

    The bench's other procedures command a torque, not a position: diagnosis does not read
    their logs.
    """
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
    for step in procedure.step:
        if isinstance(step, TraceStep):
            out |= _stated("command", step.command.terms[0])
            out["duration"] = str(step.duration)
        elif isinstance(step, BrakeStep) and step.terms:
            out |= _stated("brake", step.terms[0])
    return out


def _stated(prefix: str, term: object) -> dict[str, str]:
    values = term.model_dump(exclude_unset=True, mode="json")  # type: ignore[attr-defined]
    return {f"{prefix}.{name}": str(value) for name, value in values.items()}
