"""`elevon safety`: the control unit of an actuator under many failures, judged by hazards."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, command

app = typer.Typer(rich_markup_mode=None)


@command(app)
def safety(
    actuator: str,
    *,
    every: int = 1,
    settings: list[str] | None = None,
    seed: int = 0,
    out: Path | None = None,
    force: bool = False,
    date: str | None = None,
) -> Answer:
    """Run every failure, pairs and triples of them in every situation; list the hazards left."""
    import json as text

    from elevon.files import write_text
    from elevon.safety import safety as run
    from elevon.safety.page import safety_report

    pages = [] if out is None else [out / "report.html", out / "result.json"]
    common.check_outputs(pages, force=force)
    model = common.read_actuator(actuator, settings)
    with progress_bar("safety campaign") as advance:
        result = run(model, seed=seed, every=every, progress=advance)
    values = result.to_dict()
    if out is not None:
        say(f"report: {safety_report(result, model, date=date).save(pages[0], force=force)}")
        write_text(pages[1], text.dumps(values, indent=1) + "\n", force=force)
    code = 0 if values["status"] == "pass" else 1
    return Answer(values, lambda: _print(values), code)


def _print(values: dict[str, Any]) -> None:
    answer(
        f"{values['status'].upper()}: {values['unsafe']} of {values['runs']} situations "
        "show a hazard"
    )
    print_table(
        ["hazard", "rows", "listed", "by one failure", "per hour"],
        [[item["name"], *(str(item[key]) for key in ("rows", "listed", "single")),
          f"{item['per_hour']:.1e}"] for item in values["hazards"]],
        title="hazards",
    )  # fmt: skip
