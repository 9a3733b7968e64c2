"""A group of commands that names the nearest ones, or all, when it does not know one."""

from __future__ import annotations

from typing import Any

import typer
import typer.core

from elevon.errors import nearest

# The root of the argument errors (bad option, missing argument, ...) of whichever click typer uses.
UsageError: Any = typer.BadParameter.__mro__[1]


class NamingGroup(typer.core.TyperGroup):
    """As its base class, but an unknown command names the nearest ones, or all there are."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command of the first argument, or raise `UsageError`."""
        known = self.list_commands(ctx)
        if args and not args[0].startswith("-") and args[0] not in known:
            near = nearest(args[0], known)
            hint = (
                f" Did you mean {', '.join(near)}?" if near else f" Commands: {', '.join(known)}."
            )
            raise UsageError(f"No such command '{args[0]}'.{hint}", ctx)
        return super().resolve_command(ctx, args)
