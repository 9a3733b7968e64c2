"""What a caller gives a session: values for its runs, instants, names; each checked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from elevon.arrays import Floats
from elevon.errors import ArgumentTypeError, InputError
from elevon.units import display_unit, parse_quantity

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
    """Return SI; a text without a unit is refused where a person reads another one."""
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
