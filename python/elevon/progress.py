"""How long work says how far it is, and learns that it should stop."""

from collections.abc import Callable

from elevon.errors import InputError

Progress = Callable[[float], bool]
"""Called with the done fraction (0 to 1); returns False when the work should stop."""


def part(progress: Progress | None, start: float, stop: float) -> Progress | None:
    """Return the progress of one part of a longer work.

    Parameters
    ----------
    progress : callable or None
        Of the whole work.
    start, stop : float
        Fractions of the whole at which the part begins and ends, 0 <= start <= stop <= 1.

    Returns
    -------
    callable or None
        To be given to the part; None when the whole has none.

    Raises
    ------
    InputError
        The fractions are not ordered within 0 to 1.
    """
    if not 0.0 <= start <= stop <= 1.0:
        raise InputError(f"a part of the work from {start} to {stop} is not within 0 to 1")
    if progress is None:
        return None
    whole = progress
    return lambda fraction: whole(start + (stop - start) * fraction)
