"""An actuator resolved to the numbers that the C interface and every FMU are made from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Annotated, Any

from elevon.actuator import Actuator
from elevon.errors import InputError, unknown
from elevon.faults import Fault, FaultRecord, catalogue, check_together
from elevon.option import Option
from elevon.parameters.records import wirings
from elevon.record_plan import record_plan
from elevon.scenario.compile import port_units, signal_records
from elevon.simulate.acting import check_values
from elevon.simulate.prepare import check_fidelity, solver_step

#: The form of the document, which the binary checks.
SCHEMA = 1
DEFAULT_SIGNALS = "drive_log,essential"
DEFAULT_GEAR_SIGNALS = "gear"


@dataclass(frozen=True)
class FaultPort:
    """A fault whose severity is an input: its record, its place, its further numbers."""

    record: FaultRecord
    place: str
    settings: tuple[Mapping[str, Any], ...]

    @property
    def name(self) -> str:
        """``KIND.PLACE``."""
        return f"{self.record.kind}.{self.place}"


@dataclass(frozen=True)
class RunDocument:
    """A resolved actuator: what runs, what may be set, what is read.

    Attributes
    ----------
    actuator : Actuator
        As loaded.
    fidelity, mode : str
        ``high`` or ``low``; what the command demands.
    units : mapping
        Port to the SI unit of its input.
    faults : tuple of FaultPort
        All that this fidelity carries.
    signals : tuple of str
        Outputs, in their order.
    step : float
        Solver step in s.
    """

    actuator: Actuator
    fidelity: str
    mode: str
    units: Mapping[str, str]
    faults: tuple[FaultPort, ...]
    signals: tuple[str, ...]
    step: float

    def contents(self, announced: Iterable[str] = ()) -> dict[str, object]:
        """Return what is written; `announced` faults (``KIND@PLACE``) are held from the start."""
        names = [f"{port.record.kind}@{port.place}" for port in self.faults]
        wanted = list(announced)
        for name in wanted:
            if name not in names:
                raise unknown("fault", name, names, "announced")
        faults = [
            {
                "kind": port.record.kind,
                "place": port.place,
                "severity": 0.0,
                "attributes": {item["name"]: item["default"] for item in port.settings},
                "announced": name in wanted,
            }
            for port, name in zip(self.faults, names, strict=True)
        ]
        return {
            "schema": SCHEMA,
            "actuator": self.actuator.name,
            "wiring": self.actuator.wiring,
            "fidelity": self.fidelity,
            "mode": self.mode,
            "parameters": [float(x) for x in self.actuator.parameters.vector()],
            "inputs": {},
            "initial": {},
            "seed": 0,
            "number": 0,
            "faults": faults,
            "exclusive": _exclusive(self.faults),
            "outputs": list(self.signals),
        }

    def text(self, announced: Iterable[str] = ()) -> str:
        """Return the document of the C interface."""
        contents = self.contents(announced)
        return as_text({**contents, "token": token_of(contents)})


def run_document(
    actuator: Actuator | str,
    *,
    fidelity: str = "high",
    mode: str | None = None,
    signals: Annotated[str | Sequence[str], Option(metavar="NAMES", complete="signals")] = (),
) -> RunDocument:
    """Resolve an actuator for another tool.

    Parameters
    ----------
    actuator : Actuator or str
        A loaded one, a name or a path.
    fidelity : str
        ``high`` or ``low``.
    mode : str, optional
        What the command demands; by default the first of the wiring's: position, or a gear's
        commands.
    signals : str or sequence of str
        Outputs beyond the drive log's: names or groups, by commas or repeated.

    Returns
    -------
    RunDocument
        Whose `text` the C interface takes.

    Raises
    ------
    InputError
        No such actuator, fidelity, mode or signal; values that cannot be together.
    """
    loaded = actuator if isinstance(actuator, Actuator) else Actuator.load(actuator)
    check_fidelity(loaded.wiring, fidelity)
    check_values(loaded, fidelity)
    modes: list[str] = wirings()[loaded.wiring]["modes"]
    chosen = modes[0] if mode is None else mode
    if chosen not in modes:
        raise unknown("mode", chosen, modes, "mode")
    return RunDocument(
        actuator=loaded,
        fidelity=fidelity,
        mode=chosen,
        units=port_units(chosen, loaded.wiring),
        faults=tuple(_ports(loaded.wiring, fidelity)),
        signals=_signals(loaded.wiring, fidelity, signals),
        step=solver_step(loaded, fidelity),
    )


def as_text(contents: Mapping[str, object]) -> str:
    """Return JSON in ASCII without escapes that the binary does not read.

    Raises
    ------
    InputError
        A name with a character beyond ASCII, or a number that is none.
    """
    try:
        text = json.dumps(contents, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    except ValueError as error:
        raise InputError(f"{contents.get('actuator')}: a parameter is no number") from error
    return text


def token_of(contents: Mapping[str, object]) -> str:
    """Return the digest by which an importer and the binary know that they mean the same."""
    return hashlib.sha256(as_text(contents).encode()).hexdigest()


def _ports(wiring: str, fidelity: str) -> Iterable[FaultPort]:
    for record in catalogue(wiring):
        if fidelity in record.fidelities:
            settings = tuple(item for item in record.attributes if item["default"] is not None)
            for place in record.places:
                yield FaultPort(record, place, settings)


def _exclusive(ports: Sequence[FaultPort]) -> list[list[int]]:
    """Return the pairs of faults that cannot act together."""
    faults = [Fault.from_dict({"kind": p.record.kind, "place": p.place, "severity": 0}, p.name)
              for p in ports]  # fmt: skip
    pairs = []
    for (i, one), (j, other) in combinations(enumerate(faults), 2):
        if one.place == other.place:
            try:
                check_together([one, other])
            except InputError:
                pairs.append([i, j])
    return pairs


def _signals(wiring: str, fidelity: str, more: str | Sequence[str]) -> tuple[str, ...]:
    """Return the drive log's signals and those asked for; the command is an input."""
    records = signal_records(wiring, fidelity)
    units = {name: item["unit"] for name, item in records.items()}
    default = DEFAULT_GEAR_SIGNALS if "fault_code" in units else DEFAULT_SIGNALS
    texts = [default, *([more] if isinstance(more, str) else more)]
    names: dict[str, None] = {}
    for text in texts:
        for clock in record_plan(f"{text}@every", units, 1.0):
            names.update(dict.fromkeys(clock.signals))
    return tuple(name for name in names if name != "command")
