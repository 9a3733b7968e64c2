"""`elevon import`, `plot` and `features`: logs and recordings read, drawn and described."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from elevon.cli import common
from elevon.cli.output import answer, print_table, say
from elevon.cli.shell import Answer, command
from elevon.errors import InputError, unknown
from elevon.number_text import quantity_text
from elevon.option import Option
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from elevon.arrays import Floats
    from elevon.logs.formats.table import RawTable
    from elevon.logs.importing import ImportedLog
    from elevon.logs.maps.guess import Guess
    from elevon.logs.read import Answers
    from elevon.logs.report import ImportReport
    from elevon.recording import Recording
    from elevon.report import Report
    from elevon.results import Result


@command(None, "report")
def import_(
    logs: list[Path],
    *,
    out: Path | None = None,
    guess: bool = False,
    log_format: Annotated[str, Option("--format")] = "auto",
    column_map: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    drive: str | None = None,
    role: list[str] | None = None,
    gear_ratio: float | None = None,
    sidecars: Annotated[bool, Option("--sidecars/--no-sidecars")] = True,
    force: bool = False,
) -> Answer:
    """Read logs into recordings, and say everything that was seen on the way.

    Parameters
    ----------
    logs : list of path
        Log files.
    out : path
        Recording to write (.parquet, .nc, .mat, .csv); a folder for several logs; with --guess a
        map (.toml).
    guess : bool
        Say what the columns of one log are, and what is doubtful; --out writes it as a map.
    log_format : str
        auto, drive, csv, parquet, netcdf, mat, recording or cranfield.
    column_map : path
        Column map (TOML), or torino, cranfield, pisa.
    loadcell : list of path
        Load-cell file; one for each log, in their order.
    command : list of path
        Command note (TOML or JSON); one for each log, or one for all.
    gear_ratio : float
        Motor over output, unless the map says it.
    sidecars : bool
        Look for NAME_loadcell.csv and NAME_command.json beside a log.
    """
    from elevon.logs.formats.detect import FORMATS
    from elevon.logs.read import Answers

    if log_format not in FORMATS:
        raise unknown("format", log_format, FORMATS, "--format")
    answers = Answers(drive, common.roles_said(role))
    if guess:
        return _write_guess(logs, out, answers, log_format=log_format, force=force)
    if out is None:
        raise InputError("--out is missing: a recording to write; or --guess, what its columns are")
    if log_format == "cranfield":
        return _cranfield(logs, out, force=force)
    logs = common.without_companions(logs) if sidecars else logs
    cells = common.one_each("--loadcell", loadcell, len(logs))
    notes = common.one_each("--command", command, len(logs), shared=True)
    targets = _recording_files(logs, out)
    _check_files(targets, force=force)
    imported = _read_all(
        logs, cells, notes, log_format=log_format, column_map=column_map,
        gear_ratio=gear_ratio, sidecars=sidecars, answers=answers,
    )  # fmt: skip
    for log, target in zip(imported, targets, strict=True):
        log.recording.save(target, force=force)

    def show() -> None:
        for log, target in zip(imported, targets, strict=True):
            _print_report(log.report, target)

    return Answer(_import_data(imported, targets), show)


def _write_guess(
    logs: list[Path], target: Path | None, answers: Answers, *, log_format: str, force: bool
) -> Answer:
    """Say why every column is what it is and what is doubtful; write it as a map where wanted."""
    from elevon.files import check_output, write_text
    from elevon.logs.formats.detect import read_table
    from elevon.logs.maps.guess import guess_map, guess_text

    if len(logs) != 1:
        raise InputError("--guess looks at one log; its map is written with --out map.toml")
    if target is not None:
        if target.suffix.lower() != ".toml":
            raise InputError(f"--out {target}: --guess writes a map (.toml), and no recording")
        check_output(target, force=force)
    table = read_table(logs[0], log_format)
    guess = guess_map(table, drive=answers.drive, answers=answers.roles)
    if target is not None:
        write_text(target, guess_text(guess), force=force)
    data = {
        "status": "ok",
        "log": str(logs[0]),
        "map": None if target is None else str(target),
        "gear_ratio": guess.gear_ratio,
        "travel_per_turn_m": guess.travel_per_turn,
        "roles": guess.roles(),
        "questions": [{"role": q.role, "candidates": q.candidates} for q in guess.questions],
        "columns": guess.columns,
    }

    def show() -> None:
        rows = [(c.name, c.role or "?", c.unit or "", "; ".join(c.reasons)) for c in guess.columns]
        title = f"{logs[0]}" + ("" if target is None else f" -> {target}")
        print_table(("column", "role", "unit", "why"), rows, title=title)
        for question in guess.questions:
            answer(f"? {question.text}")

    return Answer(data, show, page=lambda: guess_page(guess, table))


def guess_page(guess: Guess, table: RawTable) -> Report:
    """Return the page of a guess: each role's signal with the reason beside it."""
    from elevon.report import Report, ReportTable

    report = Report(
        f"Columns of {Path(guess.source).name}", "What each column is taken for, and why."
    )
    doubtful = len(guess.questions)
    report.judge(
        f"{doubtful} questions" if doubtful else "no question", "open" if doubtful else "pass"
    )
    if guess.questions:
        report.section("Questions").points([question.text for question in guess.questions])
    time = next(c for c in guess.columns if c.role == "time")
    seconds = table.columns[time.name]
    for item in guess.columns:
        if item.role and item.role != "time":
            margin = "" if item.margin is None else f" Margin {item.margin:.2f}."
            section = report.section(item.role, f"{item.name}: {'; '.join(item.reasons)}.{margin}")
            label = f"{item.name} [{item.unit or 'no unit'}]"
            section.chart(label, seconds, {item.name: table.columns[item.name]})
    known = report.section("All columns")
    rows = [
        {"column": c.name, "role": c.role or "not known", "unit": c.unit or ""}
        for c in guess.columns
    ]
    known.table(ReportTable.of(rows))
    return report


def _read_all(
    logs: list[Path],
    cells: list[Path | None],
    notes: list[Path | None],
    log_format: str,
    answers: Answers,
    **options: Any,
) -> list[ImportedLog]:
    from elevon.logs.importing import import_log, same_rate
    from elevon.logs.read import imported_log

    imported = []
    for path, cell, note in zip(logs, cells, notes, strict=True):
        if log_format == "auto":
            log = imported_log(path, note=note, loadcell=cell, answers=answers, **options)
        else:
            log = import_log(path, loadcell=cell, command=note, log_format=log_format, **options)
        for finding in log.report.findings:
            if finding.level == "warning":
                say(f"{path}: {finding.place}: {finding.text}")
        imported.append(log)
    same_rate(imported)
    return imported


def _recording_files(logs: list[Path], out: Path) -> list[Path]:
    if len(logs) == 1:
        return [out / f"{_stem(logs[0])}.parquet" if out.is_dir() else out]
    if out.suffix.lower() in {".parquet", ".nc", ".mat", ".csv"}:
        raise InputError(f"--out {out}: {len(logs)} logs need a folder, not one file")
    targets = [out / f"{_stem(log)}.parquet" for log in logs]
    for target in targets:
        if targets.count(target) > 1:
            raise InputError(f"two logs would be written to {target}; import them apart")
    return targets


def _stem(path: Path) -> str:
    return path.name.removesuffix(".gz").rpartition(".")[0] or path.name


def _check_files(targets: list[Path], *, force: bool) -> None:
    from elevon.files import check_output
    from elevon.recording.formats import check_ending

    for target in targets:
        check_ending(target)
        check_output(target, force=force)


def _import_data(imported: list[ImportedLog], targets: list[Path]) -> dict[str, Any]:
    rows = [
        {"recording": str(target), **log.report.to_dict()}
        for log, target in zip(imported, targets, strict=True)
    ]
    return {"status": "ok", "logs": rows}


def _print_report(report: ImportReport, target: Path) -> None:
    title = f"{report.source} ({report.file_format}) -> {target}"
    rows = [
        (c["name"], c["column"], display_unit(c["unit"]), _bound(c, "minimum"),
         _bound(c, "maximum"), c["missing"])
        for c in report.channels
    ]  # fmt: skip
    print_table(("channel", "column", "unit", "minimum", "maximum", "missing"), rows, title=title)
    clocks = [
        (name, c["samples"], f"{c['rate_hz']:.6g}", f"{1e3 * c['jitter_rms_s']:.3g}",
         len(c["gaps"]), c["duplicates"])
        for name, c in report.clocks.items()
    ]  # fmt: skip
    print_table(("clock", "samples", "rate Hz", "jitter ms", "gaps", "duplicates"), clocks)
    findings = [(f.level, f.place, f.text) for f in report.findings]
    print_table(("level", "where", "what"), findings)
    if report.synchronisation:
        facts = report.synchronisation
        rows_ = [(name, _cell(value)) for name, value in facts.items()]
        print_table(("synchronisation", "value"), rows_)


def _bound(channel: dict[str, Any], name: str) -> str:
    return _cell(float(to_display(channel[name], display_unit(channel["unit"]))))


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _cranfield(logs: list[Path], out: Path, *, force: bool) -> Answer:
    from elevon.logs.formats.cranfield import read_cranfield

    if out.suffix.lower() in {".parquet", ".nc", ".mat", ".csv"}:
        raise InputError(f"--out {out}: a Cranfield file holds many recordings; give a folder")
    rows = []
    for log in logs:
        for recording in read_cranfield(log):
            meta = recording.meta
            name = f"{meta['condition']}_{meta['profile']}_{meta['load_kgf']:g}_{meta['run']}"
            target = out / f"{name.replace('-', 'm')}.parquet"
            recording.save(target, force=force)
            rows.append({"recording": str(target), "samples": len(recording.clock()),
                         "labels": recording.labels, **meta})  # fmt: skip

    def show() -> None:
        cells = [(r["recording"], r["samples"], r["load_kgf"], r["run"]) for r in rows]
        answer(f"{len(cells)} recordings in {out}")
        print_table(("recording", "samples", "load kgf", "run"), cells)

    return Answer({"status": "ok", "logs": rows}, show)


@command(None)
def plot(
    file: Annotated[Path, Option(metavar="FILE")],
    *,
    signal: Annotated[list[str] | None, Option(metavar="NAME")] = None,
    out: list[Path] | None = None,
    run: Annotated[int | None, Option(min=0)] = None,
    column_map: Path | None = None,
    drive: str | None = None,
    role: list[str] | None = None,
    compare: Path | None = None,
    spectra: bool = False,
    force: bool = False,
) -> Answer:
    """Draw a recording, a log, a run of a campaign or a result; nothing is shown on a display.

    Parameters
    ----------
    file : path
        Recording, log, folder of a campaign, or result (JSON).
    signal : list of str
        Only this one; repeatable. Default: how it ran.
    out : list of path
        .html: an interactive page; .png, .svg, .pdf: a picture; repeatable; default: a page
        named after FILE, here.
    run : int
        Of a campaign; default: 0.
    compare : path
        Another recording or log drawn over it.
    spectra : bool
        Add spectra of error, current and speed.
    """
    from elevon.logs.read import Answers

    if file.suffix.lower() == ".toml":
        raise InputError(
            f"{file}: is an actuator or a scenario, not a recording; elevon show {file} --svg "
            "FILE draws an actuator's diagram, elevon simulate --plot FILE what it does"
        )
    targets = _targets(file, out)
    common.check_outputs(targets, force=force)
    if file.suffix.lower() == ".json":
        _only_signals(signal, run, column_map, compare, spectra)
        return _result(file, targets, force=force)
    answers = Answers(drive, common.roles_said(role))
    recording = _recording(file, run, column_map, answers)
    other = None if compare is None else _recording(compare, None, column_map, answers)
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


def _recording(file: Path, run: int | None, column_map: Path | None, answers: Answers) -> Recording:
    from elevon.logs.read import import_foreign, settled

    if file.expanduser().is_dir():
        from elevon.campaign import load_run

        return load_run(file.expanduser(), run or 0)
    if run is not None:
        raise InputError(f"--run: {file} is no folder of a campaign")
    return settled(import_foreign(file, column_map, answers=answers)).recording


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
         "samples": len(values), **_ends(values)}
        for panel in panels_of(recording, names)
        for name, values in panel.lines.items()
    ]  # fmt: skip
    data = {"status": "ok", "file": file, "written": list(targets), "signals": rows}

    def show() -> None:
        answer(_wrote(targets, f"{len(rows)} signals of {file.name}"))
        cells = [
            (r["name"], r["unit"], *(_text(r[key]) for key in ("least", "greatest"))) for r in rows
        ]
        print_table(("signal", "unit", "least", "greatest"), cells)

    return Answer(data, show)


def _ends(values: Floats) -> dict[str, float | None]:
    import numpy as np

    good = values[np.isfinite(values)]
    return {
        "least": float(good.min()) if good.size else None,
        "greatest": float(good.max()) if good.size else None,
    }


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


@command(None)
def features(
    log: Annotated[Path, Option(metavar="LOG")],
    *,
    wanted: Annotated[str, Option("--features")] = "all",
    role: Annotated[list[str] | None, Option(metavar="ROLE=CHANNEL")] = None,
    pole_pairs: float | None = None,
    clock: str | None = None,
) -> Answer:
    """Compute features of a log, by the code that computes them while simulating.

    Parameters
    ----------
    log : path
        A recording, or a log to import.
    wanted : str
        Names, families or all, with commas between.
    role : list of str
        Which channel serves; repeatable.
    pole_pairs : float
        Of the motor: for features per electrical turn.
    clock : str
        Clock whose channels serve.
    """
    from elevon.features import recording_features
    from elevon.logs.importing import import_log

    imported = import_log(log, sidecars=False)
    for finding in imported.report.findings:
        if finding.level == "warning":
            say(f"{log}: {finding.place}: {finding.text}")
    result = recording_features(
        imported.recording, wanted, roles=_read_roles(role), clock=clock, pole_pairs=pole_pairs
    )
    rows = [
        {"name": name, "value": value, "unit": result.units[name]}
        for name, value in result.values.items()
    ]

    def show() -> None:
        cells = [
            (name, *quantity_text(value, result.units[name], 6))
            for name, value in result.values.items()
        ]
        answer(f"{log}: {len(cells)} features at {result.rate:g} Hz")
        print_table(("feature", "value", "unit"), cells)

    data = {"features": rows, "signals": result.signals, "rate_hz": result.rate}
    return Answer(data, show)


def _read_roles(given: list[str] | None) -> dict[str, str]:
    roles = {}
    for text in given or ():
        name, equals, channel = text.partition("=")
        if not equals or not channel:
            raise InputError(f"--role {text!r} is not of the form ROLE=CHANNEL")
        roles[name.strip()] = channel.strip()
    return roles
