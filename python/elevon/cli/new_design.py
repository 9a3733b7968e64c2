"""What `elevon new` does with the numbers of a data sheet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elevon.actuator import Actuator
from elevon.errors import InputError
from elevon.files import check_output, write_text
from elevon.parameters import load_set
from elevon.parameters.design import Given, derive, quantities
from elevon.parameters.design.derive import read_number
from elevon.parameters.design.write import design_text
from elevon.parameters.load import base_reference, find_set
from elevon.plain import fields_of

_WIRING = {"--linear": "ballscrew", "--rotary": "rotary"}


def given_numbers(options: Mapping[str, str | None], motor: Sequence[str] | None) -> dict[str, str]:
    """Return what was given on the command line, by the names of a design.

    Raises
    ------
    InputError
        ``--motor`` that is no ``KEY=QUANTITY``, or one key given twice.
    """
    numbers = {name: text for name, text in options.items() if text is not None}
    for item in motor or ():
        key, equals, text = item.partition("=")
        name = f"motor.{key.strip()}"
        if not equals or not text.strip():
            raise InputError(
                f"--motor {item!r} is not of the form KEY=QUANTITY, such as 'resistance=0.6 ohm'"
            )
        if name in numbers:
            raise InputError(f"--motor {key.strip()} is given twice")
        numbers[name] = text.strip()
    return numbers


@dataclass(frozen=True)
class NewFiles:
    """The files written, and the actuator."""

    file: Path
    actuator: Actuator
    given: Mapping[str, str]
    bench: Path | None

    def data(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        design = {
            name: fields_of(item, "value", "text", "source") | {"given": name in self.given}
            for name, item in self.actuator.design.items()
        }
        bench = None if self.bench is None else str(self.bench)
        return {"status": "ok", "file": str(self.file), "bench": bench, "design": design}

    def lines(self) -> list[str]:
        """Return what is printed: what it became, and what was assumed for it."""
        design = self.actuator.design
        load = design["thrust" if "lead" in design else "torque"]
        unit = "mm/s" if "lead" in design else "deg/s"
        lines = [
            f"wrote {self.file}: {_text(load)} at {_text(design['speed'], unit)}, motor "
            f"{_text(design['motor_speed'], 'rpm')} and {_text(design['current'])}"
        ]
        assumed = [
            f"{name} {_text(item)}: {item.source.removeprefix('ASSUMED: ')}"
            for name, item in design.items()
            if item.confidence == "assumed"
        ]
        lines += [f"ASSUMED {text}" for text in assumed]
        if self.bench is not None:
            lines.append(
                f"wrote {self.bench}: elevon bench run {self.bench} "
                f"--actuator {self.file} --out logs"
            )
        return [*lines, f"next: elevon check {self.file}; elevon show {self.file} --changed"]


@dataclass(frozen=True)
class New:
    """An actuator about to be written."""

    path: Path
    numbers: Mapping[str, str]
    linear: bool
    rotary: bool
    base: str | None
    title: str | None
    source: str | None

    def write(self, bench: Path | None, *, force: bool) -> NewFiles:
        """Write the file, and the procedure where one is wanted; nothing of a wrong number."""
        from elevon.bench.procedure import scaled_procedure

        for path in (self.path, bench):
            if path is not None:
                check_output(path, force=force)
        text = self._text()
        loaded = load_set(self.path, text)
        procedure = None if bench is None else scaled_procedure(loaded)
        write_text(self.path, text, force=force)
        if bench is not None and procedure is not None:
            write_text(bench, procedure, force=force)
        return NewFiles(self.path, Actuator.load(str(self.path.resolve())), self.numbers, bench)

    def _text(self) -> str:
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
        from elevon.errors import did_you_mean

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
    from elevon.units import split_quantity

    parts = split_quantity(text)
    return text if parts is None else " ".join(part for part in parts if part)


def _text(item: Any, unit: str = "") -> str:
    from elevon.units import format_quantity

    return format_quantity(item.value, unit or item.unit, 4)
