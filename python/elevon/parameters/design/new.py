"""A new actuator file from few numbers of a data sheet, or with other numbers of a design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from elevon.errors import InputError, did_you_mean
from elevon.parameters import load_set
from elevon.parameters.design import Given, derive, quantities
from elevon.parameters.design.derive import read_number
from elevon.parameters.design.write import design_text
from elevon.parameters.load import base_reference, find_set
from elevon.units import split_quantity

_WIRING = {"--linear": "ballscrew", "--rotary": "rotary"}


@dataclass(frozen=True)
class NewActuator:
    """An actuator about to be written.

    Attributes
    ----------
    path : path
        Of the file to come; its stem is the actuator's name.
    numbers : mapping of str to str
        Numbers of the data sheet as text, by the names of a design.
    linear, rotary : bool
        Whether its ram moves along a line, or its output turns; one of them, unless it has a base.
    base : str or None
        Actuator with a design whose numbers are changed.
    title, source : str or None
        One line, and where the numbers come from.
    """

    path: Path
    numbers: Mapping[str, str]
    linear: bool
    rotary: bool
    base: str | None
    title: str | None
    source: str | None

    def text(self) -> str:
        """Return the commented file.

        Raises
        ------
        InputError
            Neither kind nor base, a number that a design has not, or that cannot be.
        """
        wiring = self._wiring()
        known = quantities(wiring)
        for name in self.numbers:
            if name not in known:
                raise InputError(self._unknown(name, wiring))
        values = {
            n: read_number(known[n], t, _option(n), self.source) for n, t in self.numbers.items()
        }
        given = Given(values, {name: _option(name) for name in values})
        title = self.title or f"{self.path.stem}, from few numbers"
        numbers = {name: _spaced(text) for name, text in self.numbers.items()}
        if self.base is not None:
            return design_text(self.path.stem, self._base(), title, numbers, {}, source=self.source)
        design = derive(wiring, given, {}, "elevon new").design
        base = "neutral-linear" if self.linear else "neutral-rotary"
        return design_text(self.path.stem, base, title, numbers, design, source=self.source)

    def _wiring(self) -> str:
        if self.base is not None:
            loaded = load_set(self.base)
            if not loaded.design:
                raise InputError(
                    f"--from {self.base}: has no [design] to change; its values change in "
                    f"a variant: elevon new {self.path.stem} --from {self.base}"
                )
            return loaded.wiring
        if self.linear == self.rotary:
            raise InputError(
                "elevon new: one of --linear, --rotary or --from ACTUATOR says what it is"
            )
        return _WIRING["--linear" if self.linear else "--rotary"]

    def _base(self) -> str:
        assert self.base is not None
        return base_reference(find_set(self.base), self.base, self.path)

    def _unknown(self, name: str, wiring: str) -> str:
        known = quantities(wiring)
        other = quantities("rotary" if wiring == "ballscrew" else "ballscrew")
        kind = "linear" if wiring == "ballscrew" else "rotary"
        if name in other:
            near = {
                "torque": "--thrust",
                "thrust": "--torque",
                "mass": "--inertia",
                "inertia": "--mass",
            }.get(name)
            hint = f"; --{kind} takes {near}" if near else ""
            return f"{_option(name)}: a {kind} actuator has none{hint}"
        names = [each.removeprefix("motor.") for each in known if each.startswith("motor.")]
        word = name.removeprefix("motor.")
        near = did_you_mean(word, names)
        return f"{_option(name)}: unknown constant{near}; known: {', '.join(names)}"


def _option(name: str) -> str:
    if name.startswith("motor."):
        return f"--motor {name.removeprefix('motor.')}"
    return f"--{name.replace('_', '-')}"


def _spaced(text: str) -> str:
    """Write ``28V`` as ``28 V``."""
    parts = split_quantity(text)
    return text if parts is None else " ".join(part for part in parts if part)
