"""What a session sets and reads: changes of inputs, and the signals that its equations hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from elevon.documents import Document, validated
from elevon.errors import InputError, unknown
from elevon.scenario import Terms
from elevon.scenario.compile import compile_term, signal_records
from elevon.seam import CoreTerm
from elevon.session.values import Value, one_each, quantity, text

if TYPE_CHECKING:
    from elevon._core import Session as CoreSession


def input_change(
    core: CoreSession,
    port: str,
    value: Value | Mapping[str, object],
    units: Sequence[Mapping[str, str]],
) -> Callable[[], bool]:
    """Return the change of an input, checked: several change together or not at all.

    `units` are those of each run's inputs.
    """
    if isinstance(value, Mapping):
        sums = [_terms(port, value, each[port]) for each in units]
        return lambda: all(core.set_input(run, port, sum_) for run, sum_ in enumerate(sums))
    given = zip(one_each(value, len(units), port), units, strict=True)
    read = [quantity(each, of[port] or "1", port) for each, of in given]
    return lambda: bool(core.set_values(port, read))


def _terms(port: str, given: Mapping[str, object], unit: str) -> list[CoreTerm]:
    """Return a waveform, or a sum of them, as the core takes it."""
    place = Document(port, "", {})
    sum_ = validated(Terms, given if "terms" in given else {"terms": [given]}, place)
    return [compile_term(term, unit, port) for term in sum_.terms]


def left_out(name: str, option: str) -> InputError:
    """Return the error of a name that needs equations which the session left out."""
    return InputError(
        f"{name}: the equations in use leave it out; announce it: Session(..., {option}=[{name!r}])"
    )


class SignalIndex:
    """Where signals stand, and which of them the equations in use hold."""

    def __init__(self, wiring: str, fidelity: str) -> None:
        self.places = {name: i for i, name in enumerate(signal_records(wiring, fidelity))}
        self._held: dict[str, bool] = {}

    def known(self, name: str) -> str:
        """Return a name that is a signal's; raise `UnknownNameError` of another."""
        if text(name, "signal") not in self.places:
            raise unknown("signal", name, self.places, "session")
        return name

    def place(self, name: str, core: CoreSession) -> int:
        """Return where a signal stands; raise `InputError` where no equation holds it."""
        index = self.places[self.known(name)]
        if name not in self._held:
            self._held[name] = core.carries([name])
        if not self._held[name]:
            raise left_out(name, "signals")
        return index

    def renew(self) -> None:
        """Forget which are held: the equations have changed."""
        self._held.clear()
