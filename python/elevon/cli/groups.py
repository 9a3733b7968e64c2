"""A group of commands that names the nearest ones, or all, when it does not know one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer
import typer.core

from elevon.cli.help import write_example
from elevon.errors import nearest
from elevon.retired import remark

# The root of the argument errors (bad option, missing argument, ...) of whichever click typer uses.
UsageError: Any = typer.BadParameter.__mro__[1]


class NamingGroup(typer.core.TyperGroup):
    """As its base class, but an unknown command names the nearest ones, or all there are."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command of the first argument, or raise `UsageError`."""
        known = self.list_commands(ctx)
        if args and not args[0].startswith("-") and args[0] not in known:
            about = remark("command", f"{ctx.command_path.partition(' ')[2]} {args[0]}")
            if about:
                raise UsageError(f"No such command '{args[0]}'; {about}", ctx)
            near = nearest(args[0], known)
            hint = (
                f" Did you mean {', '.join(near)}?" if near else f" Commands: {', '.join(known)}."
            )
            raise UsageError(f"No such command '{args[0]}'.{hint}", ctx)
        return super().resolve_command(ctx, args)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the example of a group that works by itself."""
        write_example(self, ctx, formatter)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each command with the first sentence of its help, whole."""
        loaded = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [(name, _first_line(c.help)) for name, c in loaded if c is not None and not c.hidden]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class CommandGroup(typer.Typer):
    """A program of several commands; those of doors are added when it is first looked into."""

    def __init__(self, **words: Any) -> None:
        super().__init__(**words)
        self.waiting: list[Callable[[], None]] = []

    def complete(self) -> CommandGroup:
        """Add the commands that wait for their doors' signatures."""
        while self.waiting:
            self.waiting.pop(0)()
        for inner in self.registered_groups:
            if isinstance(inner.typer_instance, CommandGroup):
                inner.typer_instance.complete()
        return self


def group(text: str, kind: type[NamingGroup] = NamingGroup) -> CommandGroup:
    """Return a group of commands; it stays one where it has a single command."""
    app = CommandGroup(no_args_is_help=True, cls=kind, rich_markup_mode=None, help=text)
    app.callback()(lambda: None)
    return app


def _first_line(text: str | None) -> str:
    return " ".join((text or "").partition("\n\n")[0].split())
