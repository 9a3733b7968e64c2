"""`elevon next-test`: which test tells most about what is still ambiguous."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.common import ActuatorOption, JsonOption, SetOption, read_actuator
from elevon.cli.output import print_json, print_table, progress_bar, say

if TYPE_CHECKING:
    from elevon.diagnose.nexttest import NextTest

app = typer.Typer(rich_markup_mode=None)


@app.command()
def next_test(
    *,
    actuator: ActuatorOption,
    so_far: Annotated[
        list[Path] | None,
        typer.Option("--so-far", metavar="RESULT", help="JSON of elevon diagnose; repeatable."),
    ] = None,
    settings: SetOption = None,
    json: JsonOption = False,
) -> None:
    """Propose the bench's test with the largest expected information on what is ambiguous."""
    from elevon.diagnose.nexttest import next_test as choose
    from elevon.diagnose.nexttest.belief import read_result

    model = read_actuator(actuator, settings)
    results = [read_result(path) for path in so_far or []]
    with progress_bar("weighing tests") as advance:
        result = choose(model, results, progress=advance)
    if json:
        print_json(result.to_dict())
        return
    _print(result)


def _print(result: NextTest) -> None:
    best = result.tests[0]
    values = ", ".join(f"{name} {value}" for name, value in best.profile.parameters.items())
    say(
        f"Run {best.profile.name} ({values}): {best.information:.2g} of the "
        f"{result.belief.entropy:.2g} bit still unknown are expected from it."
    )
    print_table(
        ("test", "expected [bit]", "healthy log at hand"),
        [
            (t.profile.name, f"{t.information:.3f}", "yes" if t.profile.standard else "no")
            for t in result.tests
        ],
    )
    ranked = sorted(result.belief.possible, key=lambda p: -p.weight)
    print_table(
        ("still possible", "probability"),
        [(" and ".join(p.keys) or "healthy", f"{p.weight:.3f}") for p in ranked[:10]],
    )
