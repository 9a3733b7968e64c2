"""``elevon new``: an actuator of one's own, from few numbers or as a variant of another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from elevon.cli import completion
from elevon.cli.common import ForceOption
from elevon.cli.output import answer
from elevon.cli.shell import Answer, command

app = typer.Typer(rich_markup_mode=None)


def _quantity(text: str) -> Any:
    return typer.Option(metavar="QUANTITY", help=text)


Text = str | None


@command(app)
def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Of the actuator; its file is NAME.toml.")
    ],
    *,
    linear: Annotated[bool, typer.Option("--linear", help="Its ram moves along a line.")] = False,
    rotary: Annotated[bool, typer.Option("--rotary", help="Its output turns.")] = False,
    base: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="ACTUATOR",
            help="A variant of this one, every parameter a comment; with numbers, of its design.",
            autocompletion=completion.actuators,
        ),
    ] = None,
    supply: Annotated[Text, _quantity("Supply, such as 28V.")] = None,
    power: Annotated[Text, _quantity("Rated power at the motor's shaft.")] = None,
    thrust: Annotated[Text, _quantity("Rated force of the ram.")] = None,
    torque: Annotated[Text, _quantity("Rated torque of the output.")] = None,
    speed: Annotated[
        Text, _quantity("Rated speed of ram or output; ASSUMED from the motor's without.")
    ] = None,
    motor_speed: Annotated[
        Text, _quantity("Rated speed of the motor; ASSUMED 3000 rpm without.")
    ] = None,
    lead: Annotated[Text, _quantity("Travel per turn of the screw.")] = None,
    gear: Annotated[Text, _quantity("Turns of the motor per turn behind the gear.")] = None,
    encoder: Annotated[Text, _quantity("Counts per turn of the motor.")] = None,
    efficiency: Annotated[Text, _quantity("Of gear and screw at the rating.")] = None,
    stroke: Annotated[Text, _quantity("Whole travel, half of it to either side of zero.")] = None,
    backlash: Annotated[Text, _quantity("Whole backlash at the output.")] = None,
    mass: Annotated[Text, _quantity("What the ram moves.")] = None,
    inertia: Annotated[Text, _quantity("What the output moves.")] = None,
    bandwidth: Annotated[Text, _quantity("Of the position loop.")] = None,
    motor: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=QUANTITY",
            help="A constant of the motor's data sheet; repeatable: kind (brushless, servo, dc), "
            "torque_constant, resistance, inductance, inertia, pole_pairs, current, peak_current.",
        ),
    ] = None,
    title: Annotated[str | None, typer.Option(metavar="TEXT", help="One line.")] = None,
    source: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Where the numbers come from.")
    ] = None,
    bench: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a procedure of the virtual bench for it as well."),
    ] = None,
    force: ForceOption = False,
) -> Answer:
    """Write NAME.toml: an actuator from few numbers of a data sheet, or a variant of another."""
    from elevon.cli.new_design import New, given_numbers

    options = {
        "supply": supply, "power": power, "thrust": thrust, "torque": torque, "speed": speed,
        "motor_speed": motor_speed, "lead": lead, "gear": gear, "encoder": encoder,
        "efficiency": efficiency, "stroke": stroke, "backlash": backlash, "mass": mass,
        "inertia": inertia, "bandwidth": bandwidth,
    }  # fmt: skip
    numbers = given_numbers(options, motor)
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if base is not None and not (numbers or linear or rotary):
        return _variant(path, base, force=force)
    wanted = New(path, numbers, linear, rotary, base, title, source)
    made = wanted.write(bench, force=force)
    return Answer(made.data(), lambda: _print(made.lines()))


def _print(lines: list[str]) -> None:
    for line in lines:
        answer(line)


def _variant(path: Path, base: str, *, force: bool) -> Answer:
    from elevon.actuator import Actuator
    from elevon.files import write_text
    from elevon.parameters.variant import variant_text

    text = variant_text(path.stem, Actuator.load(base), base)
    written = write_text(path, text, force=force)
    data = {"status": "ok", "file": str(written), "base": base}
    return Answer(
        data, lambda: answer(f"wrote {written}: change what differs, then: elevon check {written}")
    )
