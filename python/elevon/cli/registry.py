"""Which commands exist and where they live; another package adds its own by an entry point.

An entry point of the group `ENTRY_POINTS` names the command and its program: ``reproduce =
"package.module:app"``. It is loaded when the command is requested.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from elevon.data import packaged_toml

if TYPE_CHECKING:
    import typer

#: Group of entry points whose objects are programs of further commands.
ENTRY_POINTS = "elevon.commands"


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """One command: where its program is, its line in ``elevon --help``, and its purpose.

    Attributes
    ----------
    place : str
        ``MODULE:NAME`` of a `typer.Typer` or an `elevon.cli.shell.TerminalCommand`.
    help, group : str
        The line, and what it stands under.
    """

    place: str
    help: str
    group: str

    def load(self) -> typer.Typer:
        """Import the command and return its program."""
        from elevon.cli.groups import CommandGroup
        from elevon.cli.shell import TerminalCommand

        module, _, name = self.place.partition(":")
        loaded = getattr(import_module(module), name)
        if isinstance(loaded, CommandGroup):
            return loaded.complete()
        return loaded.app() if isinstance(loaded, TerminalCommand) else loaded


#: Modules of the commands that do not stand in one of their own.
_MODULES = {
    "actuators": ("list:listing", "show", "new", "check"),
    "simulating": ("simulate", "compare", "response", "fit-low", "loads", "design"),
    "recordings": ("import:import_", "plot", "features"),
    "judging": ("doctor", "calibrate", "validate", "diagnose", "learn", "next-test"),
    "campaign": ("campaign:app", "dataset:datasets"),
    "lives": ("predict", "next-inspection", "fleet", "learn-growth"),
    "elsewhere": ("export", "safety", "live:live_bench", "demo"),
}


@cache
def commands() -> dict[str, CommandEntry]:
    """Return every command of this installation, in the order of work."""
    places = {}
    for module, names in _MODULES.items():
        for text in names:
            name, _, attribute = text.partition(":")
            places[name] = f"elevon.cli.{module}:{attribute or name.replace('-', '_')}"
    table = packaged_toml("elevon.cli", "commands.toml")
    entries = {
        name: CommandEntry(
            places.get(name, f"elevon.cli.{name.replace('-', '_')}:app"), text, group
        )
        for group, lines in table["purposes"].items()
        for name, text in lines.items()
    }
    added = entry_points(group=ENTRY_POINTS)
    for point in added:
        known = entries.get(point.name)
        text = known.help if known else f"Added by {point.value.partition('.')[0]}."
        entries[point.name] = CommandEntry(point.value, text, known.group if known else "Elsewhere")
    for name in set(packages()) - {point.name for point in added}:
        del entries[name]
    return entries


def packages() -> dict[str, str]:
    """Return the commands that other packages of Elevon add, and the package of each."""
    named: dict[str, str] = packaged_toml("elevon.cli", "commands.toml")["packages"]
    return named
