"""``elevon import``: bench and drive logs made into recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table, say
from elevon.cli.shell import Answer, command
from elevon.errors import InputError
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from elevon.logs.importing import ImportedLog
    from elevon.logs.report import ImportReport

app = typer.Typer(
    rich_markup_mode=None, help="Read bench and drive logs into recordings; report what was seen."
)


@command(app)
def import_(
    logs: list[Path],
    *,
    out: Path | None = None,
    guess: Path | None = None,
    log_format: str = "auto",
    column_map: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    gear_ratio: float | None = None,
    sidecars: bool = True,
    force: bool = False,
) -> Answer:
    """Read logs into recordings, and say everything that was seen on the way."""
    from elevon.errors import unknown
    from elevon.logs.formats.detect import FORMATS

    if log_format not in FORMATS:
        raise unknown("format", log_format, FORMATS, "--format")
    if guess is not None:
        return _guess(logs, guess, out, log_format=log_format, force=force)
    if out is None:
        raise InputError("--out is missing: a recording to write; or --guess, a first column map")
    if log_format == "cranfield":
        return _cranfield(logs, out, force=force)
    logs = common.without_companions(logs) if sidecars else logs
    cells = common.one_each("--loadcell", loadcell, len(logs))
    notes = common.one_each("--command", command, len(logs), shared=True)
    targets = _targets(logs, out)
    _check_targets(targets, force=force)
    imported = _read_all(
        logs, cells, notes, log_format=log_format, column_map=column_map,
        gear_ratio=gear_ratio, sidecars=sidecars,
    )  # fmt: skip
    for log, target in zip(imported, targets, strict=True):
        log.recording.save(target, force=force)

    def show() -> None:
        for log, target in zip(imported, targets, strict=True):
            _show(log.report, target)

    return Answer(_result(imported, targets), show)


def _guess(
    logs: list[Path], target: Path, out: Path | None, *, log_format: str, force: bool
) -> Answer:
    """Write a first column map, and say why every column is what it is."""
    from elevon.files import check_output, write_text
    from elevon.logs.formats.detect import read_table
    from elevon.logs.maps.guess import guess_map, guess_text

    if len(logs) != 1 or out is not None:
        raise InputError("--guess writes the map of one log, and no recording")
    check_output(target, force=force)
    guess = guess_map(read_table(logs[0], log_format))
    write_text(target, guess_text(guess), force=force)
    data = {
        "status": "ok",
        "log": str(logs[0]),
        "map": str(target),
        "gear_ratio": guess.gear_ratio,
        "travel_per_turn_m": guess.travel_per_turn,
        "columns": guess.columns,
    }

    def show() -> None:
        rows = [(c.name, c.role or "?", c.unit or "", "; ".join(c.reasons)) for c in guess.columns]
        print_table(("column", "role", "unit", "why"), rows, title=f"{logs[0]} -> {target}")

    return Answer(data, show)


def _read_all(
    logs: list[Path],
    cells: list[Path | None],
    notes: list[Path | None],
    **options: Any,
) -> list[ImportedLog]:
    from elevon.logs.importing import import_log, same_rate

    imported = []
    for path, cell, note in zip(logs, cells, notes, strict=True):
        log = import_log(path, loadcell=cell, command=note, **options)
        for finding in log.report.findings:
            if finding.level == "warning":
                say(f"{path}: {finding.place}: {finding.text}")
        imported.append(log)
    same_rate(imported)
    return imported


def _targets(logs: list[Path], out: Path) -> list[Path]:
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


def _check_targets(targets: list[Path], *, force: bool) -> None:
    from elevon.files import check_output
    from elevon.recording.formats import check_ending

    for target in targets:
        check_ending(target)
        check_output(target, force=force)


def _result(imported: list[ImportedLog], targets: list[Path]) -> dict[str, Any]:
    rows = [
        {"recording": str(target), **log.report.to_dict()}
        for log, target in zip(imported, targets, strict=True)
    ]
    return {"status": "ok", "logs": rows}


def _show(report: ImportReport, target: Path) -> None:
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
        rows_ = [(name, _number(value)) for name, value in facts.items()]
        print_table(("synchronisation", "value"), rows_)


def _bound(channel: dict[str, Any], name: str) -> str:
    return _number(float(to_display(channel[name], display_unit(channel["unit"]))))


def _number(value: Any) -> str:
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
