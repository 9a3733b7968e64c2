"""What is coupled to a session acts at its ticks, whatever the steps of the caller."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from elevon.errors import ArgumentTypeError, InputError
from elevon.session.fmu import Fmu

if TYPE_CHECKING:
    from elevon.session.session import Session


def coupled(session: Session, controller: Fmu | None, loads: Sequence[Fmu]) -> Coupling | None:
    """Return what is coupled to a session that begins; None of nothing."""
    if controller is None and not len(loads):
        return None
    coupling = Coupling(controller, loads)
    coupling.bind(session)
    return coupling


class Coupling:
    """Foreign FMUs beside a session.

    Parameters
    ----------
    controller : Fmu, optional
        Steps first, so that it acts from the tick on at which it reads.
    loads : sequence of Fmu
        Act with what they put out at a tick, and step beside the actuator.
    """

    def __init__(self, controller: Fmu | None, loads: Sequence[Fmu]) -> None:
        given: list[Any] = [*([] if controller is None else [controller]), *loads]
        wrong = [item for item in given if not isinstance(item, Fmu)]
        if wrong:
            raise ArgumentTypeError(f"controller, loads: {wrong[0]!r:.60} is no elevon.Fmu")
        self._controller, self._loads = controller, list(loads)
        self._all: list[Fmu] = given

    def bind(self, session: Session) -> None:
        """Join them to a session that begins."""
        for item in self._all:
            item.bind(session)
        joined = [port for item in self._all for port in item.outputs()]
        twice = next((port for port in joined if joined.count(port) > 1), None)
        if twice is not None:
            raise InputError(f"{twice}: two outputs of FMUs are joined to it")

    def portions(self, session: Session, steps: int, done: int) -> Iterator[int]:
        """Yield the solver steps from tick to tick; before each the FMUs whose tick it is act."""
        every = {id(item): round(item.period / session.step) for item in self._all}
        while steps:
            self._act(session, [item for item in self._all if done % every[id(item)] == 0])
            count = min(steps, *(size - done % size for size in every.values()))
            yield count
            steps, done = steps - count, done + count

    def _act(self, session: Session, due: Sequence[Fmu]) -> None:
        loads = [item for item in self._loads if item in due]
        for item in loads:
            session.set(**item.outputs())
        if self._controller in due and self._controller is not None:
            self._controller.advance(session)
            session.set(**self._controller.outputs())
        for item in loads:
            item.advance(session)
