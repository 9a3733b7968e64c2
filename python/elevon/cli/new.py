"""``elevon new``: an actuator of one's own, from few numbers or as a variant of another."""

from __future__ import annotations

from pathlib import Path

import typer

from elevon.cli.output import answer
from elevon.cli.shell import Answer, command

app = typer.Typer(rich_markup_mode=None)


Text = str | None


@command(app)
def new(
    name: str,
    *,
    linear: bool = False,
    rotary: bool = False,
    base: str | None = None,
    supply: Text = None,
    power: Text = None,
    thrust: Text = None,
    torque: Text = None,
    speed: Text = None,
    motor_speed: Text = None,
    lead: Text = None,
    gear: Text = None,
    encoder: Text = None,
    efficiency: Text = None,
    stroke: Text = None,
    backlash: Text = None,
    mass: Text = None,
    inertia: Text = None,
    bandwidth: Text = None,
    motor: list[str] | None = None,
    title: str | None = None,
    source: str | None = None,
    bench: Path | None = None,
    force: bool = False,
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
    made = New(path, numbers, linear, rotary, base, title, source).write(bench, force=force)
    return Answer(made.data(), lambda: answer(*made.lines()))


def _variant(path: Path, base: str, *, force: bool) -> Answer:
    from elevon.actuator import Actuator
    from elevon.files import write_text
    from elevon.parameters.write import variant_text

    text = variant_text(path.stem, Actuator.load(base), base)
    written = write_text(path, text, force=force)
    data = {"status": "ok", "file": str(written), "base": base}
    return Answer(
        data, lambda: answer(f"wrote {written}: change what differs, then: elevon check {written}")
    )
