"""Which commands exist and where they live."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass

from elevon.data import packaged_toml


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """One command: the module of its ``app``, its line in ``elevon --help``, and its purpose."""

    module: str
    help: str
    group: str

    @property
    def available(self) -> bool:
        """Whether the module is part of this installation."""
        return importlib.util.find_spec(self.module) is not None


#: Modules whose name is a word of Python.
_MODULES = {"import": "import_log"}
COMMANDS = {
    name: CommandEntry(f"elevon.cli.{_MODULES.get(name, name.replace('-', '_'))}", text, group)
    for group, commands in packaged_toml("elevon.cli", "commands.toml")["purposes"].items()
    for name, text in commands.items()
}
