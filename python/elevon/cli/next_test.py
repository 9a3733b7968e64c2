"""`elevon next-test`: which test tells most about what is still ambiguous."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.nexttest import NextTest

app = typer.Typer(rich_markup_mode=None)


@command(app)
def next_test(
    *,
    actuator: str,
    so_far: list[Path] | None = None,
    settings: list[str] | None = None,
) -> Answer:
    """Propose the bench's test with the largest expected information on what is ambiguous."""
    from elevon.nexttest.door import next_test as choose

    model = common.read_actuator(actuator, settings)
    with progress_bar("weighing tests") as advance:
        result = choose(model, so_far or [], progress=advance)
    return Answer(result, lambda: _print(result))


def _print(result: NextTest) -> None:
    answer(result.headline)
    print_table(
        ("test", "expected [bit]", "takes [s]", "[bit/min]", "healthy log at hand"),
        [
            (
                t.name,
                f"{t.information:.3f}",
                f"{t.duration:g}",
                f"{t.rate:.2g}",
                "yes" if t.standard else "no",
            )
            for t in result.tests
        ],
    )
    print_table(
        ("still possible", "probability"),
        [
            (" and ".join(p.faults) or "healthy", f"{p.probability:.3f}")
            for p in result.possible[:10]
        ],
    )
    listed(result.findings)
