"""Test stands: what loads an actuator and what records it, chosen by the wiring's own ports."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Literal

from pydantic import Field, StrictStr

from elevon.documents import read_toml, validated
from elevon.errors import InputError
from elevon.strict import Quantity, Strict
from elevon.units import parse_quantity


class ForceSpec(Strict):
    """A load actuator in force control.

    Attributes
    ----------
    limit : quantity
        Largest force commanded, N.
    bandwidth, damping : quantity, float
        Of the closed force loop, of second order.
    friction, mass : quantity
        Of the load actuator as seen at the rod, N and kg; what the loop does not yet reject.
    """

    limit: Quantity
    bandwidth: Quantity
    damping: float = Field(gt=0.0)
    friction: Quantity = 0.0
    mass: Quantity = 0.0


class ChannelSpec(Strict):
    """What a recorded channel adds: noise (standard deviation) and a lag of first order."""

    noise: Quantity = 0.0
    lag: Quantity = 0.0


class Stand(Strict):
    """A stand, as its file says.

    Attributes
    ----------
    name, text : str
        Name and description.
    equipment : str
        ``rotary`` (brake, load module, drive trace) or ``force`` (load actuator, recorder).
    ports : dict of str to str
        Ports that an actuator must have, with their units.
    rate, fastest : quantity
        Samples a second when nothing is given, and at most.
    force : ForceSpec or None
        The load actuator.
    settings : dict
        Parameters of the actuator that the stand fixes: what hangs on it, the supply.
    channels : dict of str to ChannelSpec
        Roles recorded.
    """

    name: StrictStr
    text: StrictStr
    equipment: Literal["rotary", "force"]
    ports: dict[StrictStr, StrictStr]
    rate: Quantity = "400 Hz"
    fastest: Quantity = "400 Hz"
    force: ForceSpec | None = None
    settings: dict[StrictStr, Quantity] = Field(default_factory=dict)
    channels: dict[StrictStr, ChannelSpec] = Field(default_factory=dict)

    def hertz(self, requested: Quantity | None) -> float:
        """Return the rate of a log in Hz; `InputError` above what the stand records."""
        rate = parse_quantity(self.rate if requested is None else requested, "Hz", "rate")
        most = parse_quantity(self.fastest, "Hz", "fastest")
        if rate > most * (1.0 + 1e-9):
            raise InputError(
                f"rate = {requested}: the stand {self.name} records {self.fastest} at most"
            )
        return rate


@lru_cache(maxsize=1)
def stands() -> tuple[Stand, ...]:
    """Return the package's stands, by name."""
    folder = files("elevon.bench") / "stands"
    paths = sorted(Path(str(item)) for item in folder.iterdir() if item.name.endswith(".toml"))
    documents = [read_toml(path) for path in paths]
    return tuple(validated(Stand, document.data, document) for document in documents)


def stand_names() -> list[str]:
    """Return the names of the stands."""
    return [stand.name for stand in stands()]


def stand_of(wiring: str) -> Stand:
    """Return the stand whose ports a wiring has, with the units the stand asks for.

    Raises
    ------
    InputError
        None fits; the message says what each asks for.
    """
    from elevon import _core

    ports = {port["name"]: port["unit"] for port in _core.ports(wiring)}
    for stand in stands():
        if stand.ports.items() <= ports.items():
            return stand
    wanted = "; ".join(
        f"{stand.name}: " + ", ".join(f"{port} [{unit}]" for port, unit in stand.ports.items())
        for stand in stands()
    )
    raise InputError(f"no stand fits the wiring {wiring!r}; ports they need: {wanted}")
