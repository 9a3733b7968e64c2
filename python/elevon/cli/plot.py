"""`elevon plot`: a recording, a log, a run of a campaign or a result, drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table
from elevon.cli.shell import Answer, command
from elevon.errors import InputError, unknown

if TYPE_CHECKING:
    from elevon.arrays import Floats
    from elevon.recording import Recording
    from elevon.results import Result

app = typer.Typer(rich_markup_mode=None)


@command(app)
def plot(
    file: Path,
    *,
    signal: list[str] | None = None,
    out: list[Path] | None = None,
    run: int | None = None,
    column_map: Path | None = None,
    compare: Path | None = None,
    spectra: bool = False,
    force: bool = False,
) -> Answer:
    """Draw a recording, a log, a run of a campaign or a result; nothing is shown on a display."""
    targets = _targets(file, out)
    common.check_outputs(targets, force=force)
    if file.suffix.lower() == ".json":
        _only_signals(signal, run, column_map, compare, spectra)
        return _result(file, targets, force=force)
    recording = _recording(file, run, column_map)
    other = None if compare is None else _recording(compare, None, column_map)
    if other is not None and compare is not None:
        other = other.with_meta(label=compare.name)
    for path in targets:
        recording.plot(
            signal, path, title=_title(file, run), compare=other, spectra=spectra, force=force
        )
    return _drawn(file, recording, signal, targets)


def _targets(file: Path, out: Sequence[Path] | None) -> list[Path]:
    from elevon.recording.plot import PICTURES

    targets = list(out or [Path(f"{file.absolute().name.removesuffix(file.suffix)}.html")])
    for path in targets:
        if path.suffix.lower() not in (*PICTURES, ".html"):
            raise unknown("ending of a plot", path.suffix, (*PICTURES, ".html"), str(path))
        if targets.count(path) > 1:
            raise InputError(f"--out {path} is given twice")
    return targets


def _only_signals(
    signal: object, run: object, column_map: object, compare: object, spectra: object
) -> None:
    """Refuse what only a recording has, rather than ignore it."""
    given = {
        "--signal": signal, "--run": run, "--map": column_map, "--compare": compare,
        "--spectra": spectra or None,
    }  # fmt: skip
    wrong = next((name for name, value in given.items() if value is not None), None)
    if wrong is not None:
        raise InputError(f"{wrong}: a result has no signals; it is drawn as a whole")


def _recording(file: Path, run: int | None, column_map: Path | None) -> Recording:
    from elevon.logs.read import import_foreign

    if file.expanduser().is_dir():
        from elevon.campaign import load_run

        return load_run(file.expanduser(), run or 0)
    if run is not None:
        raise InputError(f"--run: {file} is no folder of a campaign")
    return import_foreign(file, column_map).imported.recording


def _title(file: Path, run: int | None) -> str:
    return f"{file.name}, run {run or 0}" if file.expanduser().is_dir() else file.name


def _result(file: Path, targets: Sequence[Path], *, force: bool) -> Answer:
    from elevon.report.figures import save_figure
    from elevon.results import load

    result: Result = load(file)
    pages = [path for path in targets if path.suffix.lower() == ".html"]
    pictures = [path for path in targets if path not in pages]
    figure = result.plot() if pictures else None  # before anything is written: it may have none
    for path in pages:
        result.report().save(path, force=force)
    for path in pictures:
        assert figure is not None
        save_figure(figure, path, force=force)
    data = {
        "status": "ok", "file": file, "kind": result.KIND, "headline": result.headline,
        "written": list(targets),
    }  # fmt: skip
    return Answer(data, lambda: answer(_wrote(targets, result.headline)))


def _wrote(targets: Sequence[Path], what: str) -> str:
    return f"wrote {', '.join(str(path) for path in targets)}: {what}"


def _drawn(
    file: Path, recording: Recording, names: Sequence[str] | None, targets: Sequence[Path]
) -> Answer:
    from elevon.recording.plot import panels_of

    rows: list[dict[str, Any]] = [
        {"panel": panel.title, "name": name, "unit": panel.unit, "clock": panel.clock,
         "samples": len(values), **_range(values)}
        for panel in panels_of(recording, names)
        for name, values in panel.lines.items()
    ]  # fmt: skip
    data = {"status": "ok", "file": file, "written": list(targets), "signals": rows}

    def show() -> None:
        answer(_wrote(targets, f"{len(rows)} signals of {file.name}"))
        cells = [
            (r["name"], r["unit"], *(_number(r[key]) for key in ("least", "greatest")))
            for r in rows
        ]
        print_table(("signal", "unit", "least", "greatest"), cells)

    return Answer(data, show)


def _range(values: Floats) -> dict[str, float | None]:
    import numpy as np

    good = values[np.isfinite(values)]
    return {
        "least": float(good.min()) if good.size else None,
        "greatest": float(good.max()) if good.size else None,
    }


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"
