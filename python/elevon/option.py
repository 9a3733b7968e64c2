"""What an annotation says of an argument beyond its type: its name and limits on a command line."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated

__all__ = ["Option", "Quantity"]


@dataclass(frozen=True, slots=True)
class Option:
    """How a command line calls, limits and reads an argument; stands in ``Annotated[...]``.

    Attributes
    ----------
    flags : str or tuple of str
        Names of the option where the argument's own name is not the one.
    metavar : str
        What stands for the value in the help.
    help : str
        What it is, where no docstring of a command says it.
    min, max : float or None
        Limits of a number, both allowed.
    complete : str
        Which completion of the command line offers values.
    reads : str
        How the command line makes the value: ``actuator`` (loaded, changed by ``--set``),
        ``file`` (a name or a file, as it is), ``logs``, ``faults``, ``path``; empty: as its type
        says.
    """

    flags: str | tuple[str, ...] = ()
    metavar: str = ""
    help: str = ""
    min: float | None = None
    max: float | None = None
    complete: str = ""
    reads: str = ""

    def over(self, other: Option) -> Option:
        """Return this option, with what it leaves open as another states it."""
        default = Option()
        mine = {f.name: getattr(self, f.name) for f in fields(self)}
        return Option(
            **{
                name: getattr(other, name) if value == getattr(default, name) else value
                for name, value in mine.items()
            }
        )


#: A number of SI, or a text with its unit.
Quantity = Annotated[float | str, Option(metavar="QUANTITY")]
