"""What is given on the command line, read: settings, actuators, faults, scenarios, logs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from elevon.cli.output import say
from elevon.errors import InputError, UnitError
from elevon.files import check_output
from elevon.units import display_unit, format_quantity, split_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.faults import Fault, FaultRecord
    from elevon.logs.log import Log
    from elevon.parameters import Parameter
    from elevon.scenario import Scenario


def read_settings(settings: Sequence[str] | None) -> dict[str, str]:
    """Read ``PATH=VALUE[unit]`` texts.

    Raises
    ------
    InputError
        Not of that form, or one path given twice.
    """
    values: dict[str, str] = {}
    for text in settings or ():
        path, equals, value = text.partition("=")
        if not equals or not path.strip() or not value.strip():
            raise InputError(f"--set {text!r} is not of the form PATH=VALUE[unit]")
        if path.strip() in values:
            raise InputError(f"--set {path.strip()} is given twice")
        values[path.strip()] = value.strip()
    return values


def read_actuator(reference: str, settings: Sequence[str] | None = None) -> Actuator:
    """Load an actuator and apply ``--set`` options, each change said."""
    from elevon.actuator import Actuator

    given = Actuator.load(reference)
    changed = given.with_values(
        read_settings(settings), source="set on the command line", place="--set"
    )
    for line in changes(given, changed):
        say(line)
    return changed


def changes(before: Actuator, after: Actuator) -> list[str]:
    """Return what differs, such as ``motor.inertia 7.7 -> 80000 kg cm2, x 10390``."""
    return [
        f"{path} {_change(old, after.parameters[path])}"
        for path, old in before.parameters.items()
        if old.value != after.parameters[path].value
    ]


def _change(old: Parameter, new: Parameter) -> str:
    if isinstance(old.value, str) or isinstance(new.value, str):
        return f"{old.text} -> {new.text}"
    first = old.text.removesuffix(f" {new.unit}") if new.unit else old.text
    if not old.value:
        return f"{first} -> {new.text}"
    ratio = float(f"{new.value / old.value:.4g}")  # 10390, not 1.039e+04
    return f"{first} -> {new.text}, x {ratio:g}"


def read_scenario(
    actuator: Actuator,
    path: Path | None,
    duration: str | None = None,
    faults: Sequence[str] | None = None,
) -> Scenario:
    """Read a scenario file, or the actuator's own, and apply ``--duration`` and ``--fault``."""
    from elevon.simulate.prepare import as_scenario

    scenario = as_scenario(path, actuator)
    if duration is not None:
        scenario = scenario.replaced(duration=_number(duration))
    if faults:
        scenario = scenario.with_faults(read_faults(faults, actuator.wiring))
    for line in changes(actuator, actuator.with_values(scenario.parameters, place=str(path or ""))):
        say(f"scenario: {line}")
    return scenario


def read_faults(texts: Sequence[str] | None, wiring: str) -> list[Fault]:
    """Read ``--fault`` options; each is said as it was read.

    Raises
    ------
    UnitError
        A severity without a unit where the fault has one: 0.5 could be degrees or radians.
    InputError
        The text does not follow the grammar; a kind, place or severity that cannot be.
    """
    from elevon.faults import Fault, find_record

    faults = [Fault.parse(text) for text in texts or ()]
    for fault in faults:
        record = find_record(fault.kind, fault.place, wiring, "--fault")
        name = f"--fault {fault.kind}@{fault.place}"
        parts = split_quantity(str(fault.severity))
        unit = record.unit or "1"
        if unit != "1" and parts is not None and not parts[1] and float(parts[0]) != 0.0:
            display = display_unit(unit)
            raise UnitError(
                f"{name}: {parts[0]} has no unit; write '{parts[0]} {display}'"
                + (f" or '{parts[0]} {unit}'" if display != unit else "")
                + f" ({record.effect})"
            )
        say(f"fault {fault.kind}@{fault.place}: {_in_words(record, fault, name)}")
    return faults


def _in_words(record: FaultRecord, fault: Fault, name: str) -> str:
    """Write a severity as a person reads it: a share in percent, a growth with its sign."""
    value = record.read_severity(fault.severity, name)
    unit = record.unit or "1"
    if unit != "1":
        return format_quantity(value, display_unit(unit))
    if record.switched:
        return f"{value:g}"
    return f"{100.0 * value:{'+' if record.maximum > 1.0 else ''}.6g} %"


def check_outputs(outputs: Sequence[Path | None], *, force: bool) -> None:
    """Check before any work that every output could be written."""
    for path in outputs:
        if path is not None:
            check_output(path, force=force)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def without_companions(logs: list[Path]) -> list[Path]:
    """Leave out load-cell files and command notes that stand beside another log of the list.

    A shell's ``DIR/*.csv`` names them too; they are read with their log.
    """
    from elevon.logs.importing import find_sidecars

    sidecars = {path for log in logs for path in find_sidecars(log) if path is not None}
    remaining = [log for log in logs if log.expanduser() not in sidecars]
    for log in logs:
        if log not in remaining:
            say(f"{log}: read with its log, not as one")
    return remaining


def one_each(
    option: str, given: list[Path] | None, count: int, *, shared: bool = False
) -> list[Path | None]:
    """Spread files over logs.

    A single load-cell file of several logs would be a guess, so it is refused; one command note
    for all is what a bench run repeated gives.
    """
    if not given:
        return [None] * count
    if shared and len(given) == 1:
        return [given[0]] * count
    if len(given) != count:
        raise InputError(f"{option}: {len(given)} given for {count} logs; one for each, in order")
    return list(given)


def roles_said(given: Sequence[str] | None) -> dict[str, str]:
    """Return what ``--role ROLE=COLUMN`` says, role to column.

    Raises
    ------
    InputError
        Not of that form, or a role stated twice.
    """
    answers: dict[str, str] = {}
    for text in given or ():
        role, sign, column = text.partition("=")
        if not (role.strip() and sign and column.strip()):
            raise InputError(f"--role {text!r}: expected ROLE=COLUMN")
        if role.strip() in answers:
            raise InputError(f"--role: {role.strip()} is stated twice")
        answers[role.strip()] = column.strip()
    return answers


def read_logs(
    logs: Sequence[Path],
    column_map: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    *,
    drive: str | None = None,
    role: list[str] | None = None,
) -> list[Log]:
    """Read logs with what stands beside them; warnings of the import go to stderr."""
    from elevon.logs.read import Answers
    from elevon.logs.read import read_logs as read_all

    paths = without_companions(list(logs))
    if not paths:
        return []
    read = read_all(
        paths,
        column_map,
        loadcells=one_each("--loadcell", loadcell, len(paths)),
        notes=one_each("--command", command, len(paths), shared=True),
        answers=Answers(drive, roles_said(role)),
    )
    for log in read:
        for text in log.warnings:
            say(f"{log.name}: {text}")
    return read
