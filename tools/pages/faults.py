"""The gallery of faults: what each looks like, what causes it, the command that shows it."""

import hashlib
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from records import code, plain

import elevon
from elevon import _core
from elevon.units import display_unit, format_quantity
from elevon_cases import signatures
from elevon_cases.signatures import Signature, reproduce_signatures

COLOURS = ("#1f5fa8", "#b3261e")  # healthy, faulty: on white, contrast above 4.5


def pages(root: Path) -> Iterator[tuple[str, bytes]]:
    """Yield a page for each actuator, and its pictures.

    Simulated anew only where the core, the actuators or this file changed.
    """
    package = Path(elevon.__path__[0])
    made_of = [*package.glob("_core*"), *package.glob("actuators/*.toml"), Path(__file__)]
    made_of += [package / "data" / "fault_gallery.csv", Path(str(signatures.__file__))]
    key = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(made_of))).hexdigest()
    folder = root / "out" / "gallery" / key[:16]
    if not (folder / "whole").is_file():
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in gallery(reproduce_signatures().signatures):
            (folder / name).write_bytes(content)
        (folder / "whole").touch()
    for path in sorted(folder.iterdir()):
        if path.suffix:
            yield f"gallery/{path.name}", path.read_bytes()


def gallery(rows: Sequence[Signature]) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of each page and each picture."""
    for actuator in dict.fromkeys(row.actuator for row in rows):
        text = (
            f"# Faults of {actuator}\n\nEach fault (red) beside the healthy unit of the same run "
            "(blue), in the switching model, from a quarter of the run on. The severities are "
            "chosen to be plainly visible. The signal is the one that changes most.\n\n"
        )
        for row in (row for row in rows if row.actuator == actuator):
            name = f"{actuator}-{row.kind}"
            yield f"{name}.svg", picture(row)
            text += entry(row, name)
        yield f"{actuator}.md", text.encode()


def entry(row: Signature, name: str) -> str:
    """Return the part of the page that is one fault's."""
    severity = format_quantity(row.severity, display_unit(row.unit), 3)
    places = ", ".join(code(place) for place in row.places)
    words = f"elevon simulate {row.actuator} --fault '{row.kind}@{row.place}={severity}'"
    alt = f"{row.signal} of {row.actuator}, healthy and with {row.kind}".replace("_", " ")
    return (
        f"## {row.kind}\n\n![{alt}]({name}.svg)\n\n{plain(row.effect)}\n\n"
        f"Places: {places}.\n\n```sh\n{words} --plot {row.kind}.html\n```\n\n"
    )


def unit_of(row: Signature) -> str:
    """Return the unit of a fault's signal, as an axis names it."""
    wiring = elevon.Actuator.load(row.actuator).wiring
    units = {signal["name"]: signal["unit"] for signal in _core.signals(wiring, "high")}
    unit = units.get(row.signal, "")
    return f", {unit}" if unit not in ("", "1") else ""


def picture(row: Signature) -> bytes:
    """Return both runs of the signal that changes most, as SVG."""
    figure = Figure(figsize=(6.4, 2.2), layout="constrained")
    axis = figure.add_subplot()
    for values, colour, label in zip(
        (row.healthy, row.faulty), COLOURS, ("healthy", row.kind), strict=True
    ):
        step = max(1, len(row.time) // 400)
        axis.plot(row.time[::step], np.asarray(values)[::step], color=colour, label=label, lw=1)
    axis.set_xlabel("time, s")
    axis.set_ylabel(f"{row.signal.replace('_', ' ')}{unit_of(row)}")
    figure.legend(loc="outside upper right", ncols=2, fontsize=8, frameon=False)
    axis.grid(visible=True, lw=0.3)
    out = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "elevon", "svg.fonttype": "path"}):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()
