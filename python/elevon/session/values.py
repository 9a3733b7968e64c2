"""What a caller gives a session: values for its runs, instants, names; each checked."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.documents import Document, validated
from elevon.errors import ArgumentTypeError, DivergedError, InputError, unknown
from elevon.faults import find_record
from elevon.parameters.records import record_of
from elevon.scenario import Scenario, Terms
from elevon.scenario.compile import compile_term, signal_records
from elevon.seam import CoreTerm
from elevon.simulate.prepare import ActuatorLike, Run, ScenarioLike, as_actuator
from elevon.units import display_unit, parse_quantity

if TYPE_CHECKING:
    from elevon._core import Session as CoreSession


def diverged_runs(core: CoreSession, runs: int) -> set[int]:
    """Return the runs of a core session that have diverged."""
    return {run for run in range(runs) if core.divergence(run) is not None}


def diverged_error(core: CoreSession, runs: Sequence[int], *, many: bool) -> DivergedError:
    """Return the error of some diverged runs; in a batch each is named."""
    left = core.divergence(runs[0])
    assert left is not None  # it is one of those that have
    time, signal = left
    messages = [core.status(run)[1] for run in runs]
    if many:
        messages = [f"run {run}: {text}" for run, text in zip(runs, messages, strict=True)]
    return DivergedError("; ".join(messages), time=time, signal=signal, runs=runs)


Value = float | str | Sequence[float] | Floats


def one_each(value: Value, runs: int, place: str) -> list[float | str]:
    """Return one value a run, of one value or of one a run.

    Raises
    ------
    ArgumentTypeError
        Neither a number, nor a text, nor numbers.
    InputError
        Not as many as runs.
    """
    if isinstance(value, str):
        return [value] * runs
    try:
        values = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(
            f"{place}: {value!r:.80} is no value; expected a number, a text with a unit, or one "
            "number a run"
        ) from error
    if values.ndim == 0:
        return [float(values)] * runs
    if values.shape != (runs,):
        raise InputError(f"{place}: {values.shape} values for {runs} runs; one, or one a run")
    return [float(item) for item in values]


def quantity(given: float | str, unit: str, place: str) -> float:
    """Return a quantity in SI; text without a unit is refused where users expect another."""
    return parse_quantity(given, unit, place, display_unit(unit))


def positive_seconds(given: float | str, place: str) -> float:
    """Return a time span in s.

    Raises
    ------
    InputError
        Not a time, or not above 0.
    """
    seconds = parse_quantity(given, "s", place)
    if not seconds > 0.0:
        raise InputError(f"{place} = {given}: must be above 0 s")
    return seconds


def whole_steps(seconds: float, step: float, most: float) -> int:
    """Return the solver steps of a time span.

    Raises
    ------
    InputError
        None, no whole number, or more than `most`.
    """
    count = seconds / step
    if not count < most:
        raise InputError(
            f"advance: {seconds:.9g} s is {count:.3g} solver steps; at most {most:.0e}"
        )
    steps = round(count)
    if steps < 1 or abs(seconds - steps * step) > 1e-6 * step * max(steps, 1):
        below = max(int(count), 1) * step
        raise InputError(
            f"advance: {seconds:.9g} s is no whole number of solver steps of {step:g} s; "
            f"nearest: {below:.9g} s, {below + step:.9g} s"
        )
    return steps


def text(given: str, place: str) -> str:
    """Return a name; what is none is refused.

    Raises
    ------
    ArgumentTypeError
        Not a text.
    """
    if not isinstance(given, str):
        raise ArgumentTypeError(f"{place}: {given!r:.80} is no name")
    return given


def texts(given: Iterable[str], place: str) -> list[str]:
    """Return names.

    Raises
    ------
    ArgumentTypeError
        One text where several belong, or something else that is no row of names.
    """
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise ArgumentTypeError(f"{place}: {given!r:.80} is no list of names")
    return [text(name, place) for name in given]


def callable_or_none(given: Callable[..., object] | None, place: str) -> None:
    """Refuse what cannot be called.

    Raises
    ------
    ArgumentTypeError
        Neither a function nor None.
    """
    if given is not None and not callable(given):
        raise ArgumentTypeError(f"{place}: {given!r:.80} is no function")


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
    """Return the error for a name whose equations the session has left out."""
    return InputError(
        f"{name}: the equations in use leave it out; announce it: Session(..., {option}=[{name!r}])"
    )


class SignalIndex:
    """Positions of the signals, and which of them the equations in use compute."""

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
        """Reset the list of computed signals after a change of equations."""
        self._held.clear()


@dataclass(frozen=True)
class SessionState:
    """All that a session holds, as `Session.save` left it; `Session.restore` goes back to it.

    It lives in this process only: the core's state has no form on a disk.
    """

    core: Any
    actuators: tuple[Actuator, ...]
    faults: tuple[Mapping[str, int], ...]
    kind: tuple[Any, ...]
    """What two sessions have alike that may exchange states: wiring, fidelity, step, modes."""

    def __copy__(self) -> Self:
        return self  # nothing changes it: a session goes on from a copy of the core

    def __deepcopy__(self, _memo: dict[int, object]) -> Self:
        return self

    def __reduce__(self) -> NoReturn:
        raise ArgumentTypeError(
            "a state of a session cannot be pickled: it lives in this process's memory"
        )


def runs_of(
    given: ActuatorLike | Sequence[Run], scenario: ScenarioLike, mode: str | None, seed: int
) -> list[Run]:
    """Return the runs of a session: those given, or the one of an actuator."""
    if isinstance(given, (Actuator, str, os.PathLike)):
        actuator = as_actuator(given)
        if scenario is None:
            command = {} if mode is None else {"mode": mode}
            scenario = {"duration": 1, "command": command}
        elif mode is not None:
            raise InputError(f"mode = {mode!r}: a scenario has its own (command.mode)")
        return [Run(actuator, scenario, seed)]
    if scenario is not None or mode is not None:
        raise InputError("runs have scenarios and modes of their own")
    each: Any = given
    runs: list[Any] = list(each) if isinstance(each, Iterable) else [each]
    kinds = [type(run).__name__ for run in runs if not isinstance(run, Run)]
    if kinds or not runs:
        raise ArgumentTypeError(
            f"{f'a {kinds[0]}' if kinds else 'an empty list'} is no run; expected an actuator, or "
            "a sequence of elevon.Run"
        )
    return runs


def fault_places(scenario: Scenario) -> dict[str, int]:
    """Return ``KIND@PLACE`` of a scenario's faults to their places in its list."""
    return {f"{fault.kind}@{fault.place}": i for i, fault in enumerate(scenario.fault)}


def announced(wiring: str, tunable: Iterable[str], faults: Iterable[str]) -> list[str]:
    """Return the parameters that a session will change: those named, and those that faults move."""
    paths = [record_of(wiring, path).path for path in texts(tunable, "tunable")]
    for name in texts(faults, "faults"):
        kind, _, place = name.partition("@")
        paths += find_record(kind, place, wiring).targets[place]
    return paths
