"""An actuator: a name, a wiring, and immutable parameters."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from elevon.documents import read_toml
from elevon.parameters import Parameter, ParameterSet, load_set, set_names
from elevon.parameters.load import set_paths
from elevon.plain import Plain
from elevon.seam import ValueFinding


@dataclass(frozen=True)
class Actuator(Plain):
    """An electromechanical actuator, as an immutable value.

    Attributes
    ----------
    name, title : str
        From the actuator file's header.
    wiring : str
        Which of the core's wirings it is.
    parameters : ParameterSet
        Every parameter, complete and checked.
    references : mapping
        Citations the sources point to.
    default_scenario : mapping or None
        What runs when no scenario is given.
    path : Path or None
        The file it was loaded from.
    validation : mapping or None
        Thresholds of `elevon validate`: ``transient`` [s] and ``limits``.
    compare : mapping or None
        What `elevon compare` runs: ``after`` [s], ``load`` and ``scenario``.
    design : mapping
        Name to `Parameter`: the few numbers that rules derived the rest from; empty without any.

    Examples
    --------
    >>> actuator = Actuator.load("torino-rotary")  # doctest: +SKIP
    >>> heavier = actuator.with_values({"motor.inertia": "9 kg cm2"})  # doctest: +SKIP
    """

    name: str
    wiring: str
    parameters: ParameterSet
    title: str = ""
    references: Mapping[str, str] = field(default_factory=dict, compare=False, repr=False)
    default_scenario: Mapping[str, Any] | None = field(default=None, compare=False, repr=False)
    path: Path | None = field(default=None, compare=False, repr=False)
    validation: Mapping[str, Any] | None = field(default=None, compare=False, repr=False)
    compare: Mapping[str, Any] | None = field(default=None, compare=False, repr=False)
    design: Mapping[str, Parameter] = field(default_factory=dict, compare=False, repr=False)

    @classmethod
    def load(cls, reference: str | os.PathLike[str]) -> Actuator:
        """Load an actuator by name, or from a TOML file.

        Raises
        ------
        UnknownNameError
            No such actuator; the message holds the nearest names.
        InputError
            The file is wrong; the message holds file, line, path and limit.
        """
        loaded = load_set(reference)
        return cls(
            name=loaded.name,
            wiring=loaded.wiring,
            parameters=loaded.parameters,
            title=loaded.title,
            references=loaded.references,
            default_scenario=loaded.scenario,
            path=loaded.path,
            validation=loaded.validation,
            compare=loaded.compare,
            design=loaded.design,
        )

    def with_values(
        self,
        values: Mapping[str, str | float],
        *,
        source: str = "set by the caller",
        place: str = "",
        request: bool = True,
    ) -> Actuator:
        """Return an actuator with some values changed.

        Parameters
        ----------
        values : mapping
            Path to a number (SI) or a text with a unit (``"7.7 kg cm2"``) or a choice.
        source : str
            Kept as the source of the changed values.
        place : str
            Named in errors, such as the file the values come from.
        request : bool
            Whether the caller wants these values: one that has no effect is then reported.

        Raises
        ------
        UnknownNameError, UnitError, RangeError
            The message names the path, the value, the limit, the nearest paths.
        """
        if not values:
            return self
        return replace(
            self,
            parameters=self.parameters.replaced(
                values, source=source, place=place, request=request
            ),
        )

    def _repr_html_(self) -> str:
        from elevon.report.cards import Html, card

        facts = [("", self.title), ("wiring", self.wiring), ("hash", self.hash)]
        table = Html(self.parameters._repr_html_())
        return card(self.name, facts, table, folded=f"{len(self.parameters)} parameters")

    @property
    def hash(self) -> str:
        """Sixteen hexadecimal digits over the wiring and every value."""
        return self.parameters.hash

    def findings(self, fidelity: str = "high") -> list[ValueFinding]:
        """Return what the core says against these values together (empty when nothing).

        Each finding has ``severity``, ``path``, ``value``, ``limit`` and ``message``: a step too
        large for a named pole, gains that cannot be stable, limits that are exchanged. With an
        ``error`` nothing runs; a ``warning`` says what to expect.
        """
        from elevon import _core

        return _core.check(self.wiring, fidelity, self.parameters.vector())


def actuators() -> dict[str, str]:
    """Return the actuators that `Actuator.load` knows: name to title, by name.

    >>> "torino-rotary" in actuators()
    True
    """
    return {
        name: str(read_toml(path).data.get("title", ""))
        for name, path in sorted(set_paths().items())
    }


def list_actuators() -> list[str]:
    """Return the names that `Actuator.load` knows: shipped, and in ``ELEVON_ACTUATORS``."""
    return list(set_names())
