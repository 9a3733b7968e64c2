"""``elevon new``: a commented file for a variant of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from elevon.cli import completion
from elevon.cli.common import ForceOption
from elevon.cli.output import answer
from elevon.cli.shell import Answer, command

app = typer.Typer(rich_markup_mode=None)


@command(app)
def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Of the variant; its file is NAME.toml.")
    ],
    *,
    base: Annotated[
        str,
        typer.Option(
            "--from", metavar="ACTUATOR", help="Its base.", autocompletion=completion.actuators
        ),
    ],
    force: ForceOption = False,
) -> Answer:
    """Write NAME.toml, a variant of an actuator: every parameter is there, commented out."""
    from elevon.actuator import Actuator
    from elevon.files import write_text
    from elevon.parameters.variant import variant_text

    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    text = variant_text(path.stem, Actuator.load(base), base)
    written = write_text(path, text, force=force)
    data = {"status": "ok", "file": str(written), "base": base}
    return Answer(
        data, lambda: answer(f"wrote {written}: change what differs, then: elevon check {written}")
    )
