"""`elevon reproduce`: recompute a published table or figure, with checks."""

from __future__ import annotations

from typing import Any

from elevon.cli.groups import NamingGroup, UsageError, group
from elevon.cli.reproduce.all_cases import reproduce_all
from elevon.cli.reproduce.case import add_command
from elevon.cli.reproduce.cases import CASES
from elevon.cli.shell import styled

#: What judges Elevon itself stands outside the package.
STUDIES = (
    "benchmark-set",
    "diagnosis-limits",
    "diagnosis-optimisers",
    "fault-limits",
    "foreign",
    "independent",
    "inspection-error",
    "learned",
    "learned-campaign",
    "monitor-delay",
    "monitor-hours",
    "next-test",
    "prognosis",
)


class _Group(NamingGroup):
    """Published cases; the name of a study is answered with where it is."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command of the first argument, or raise `UsageError`."""
        if args and args[0] in STUDIES:
            raise UsageError(
                f"'{args[0]}' is no published case but a study of Elevon itself: run "
                f"python -m studies {args[0]} in a checkout of the sources",
                ctx,
            )
        return super().resolve_command(ctx, args)


app = group("Recompute a published table or figure; exit code 1 when a check fails.", _Group)


app.callback(invoke_without_command=True)(styled(reproduce_all))
for _case in CASES:
    add_command(app, _case)
