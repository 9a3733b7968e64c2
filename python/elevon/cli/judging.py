"""`elevon calibrate`, `validate`, `doctor`, `diagnose`, `learn`, `next-test`: logs judge a unit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from elevon.cli import common
from elevon.cli.output import answer, listed, print_result, print_table, progress_bar, say
from elevon.cli.shell import REPORT, Answer, DoorCall, command, result_command
from elevon.errors import InputError
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.calibrate.outcome import Calibration
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.diagnose.learning.model import LearnedModel
    from elevon.doctor import Examination
    from elevon.prognose.history import NextEntry

_DOCTOR_FILES = ("doctor.html", "doctor.json", "map.toml")


@command(
    None, *REPORT[:3], "date", door="elevon.calibrate.door:calibrate", working="calibrating",
    without=("promise", "torque_constant"),
)  # fmt: skip
def calibrate(
    door: DoorCall, *, free: list[str] | None = None, out: Path | None = None, force: bool = False
) -> Answer:
    """Estimate what the logs determine, with intervals, and write it as a set.

    Parameters
    ----------
    free : list of str
        Parameter path to estimate, repeatable; or auto (the default).
    out : path
        Set to write (TOML).
    """
    from elevon.calibrate.drops import is_drop_table

    common.check_outputs([out], force=force)
    if out is not None and out.suffix.lower() != ".toml":
        raise InputError(f"--out {out}: a set is a TOML file; end the name in .toml")
    settings, constant = _effort_scale(door.options["settings"])
    model = common.read_actuator(door.options["actuator"], settings)
    logs, paths = door.options["logs"], _paths(free)
    table = {"logs": logs} if len(logs) == 1 and is_drop_table(logs[0]) else {}
    result: Calibration = door(
        actuator=model, free=paths, promise=out is not None, torque_constant=constant, **table
    )
    if out is not None:
        say(f"set: {result.write_actuator(out, force=force)}")
    data = result.to_dict(stored=False) | {"out": None if out is None else str(out)}
    return Answer(data, lambda: print_result(result), page=result.report)


def _effort_scale(settings: list[str] | None) -> tuple[list[str], str | None]:
    """Take ``motor.torque_constant=VALUE`` out of the settings: the scale of the logs' effort."""
    head = "motor.torque_constant="
    given = [text for text in settings or () if text.replace(" ", "").startswith(head)]
    if len(given) > 1:
        raise InputError("--set motor.torque_constant is given twice")
    others = [text for text in settings or () if text not in given]
    return others, given[0].partition("=")[2].strip() if given else None


def _paths(free: list[str] | None) -> list[str] | None:
    """Split ``--free a,b``; auto or nothing: everything that the logs determine."""
    names = [name.strip() for text in free or () for name in text.split(",") if name.strip()]
    if not names or names == ["auto"]:
        return None
    if "auto" in names:
        raise InputError("--free auto stands alone: it frees what the logs can determine")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"--free {name} is given twice")
    return names


validate = result_command(
    "elevon.calibrate.door:validate",
    "Compare the model with logs, signal by signal; exit 1 where a threshold fails.",
    *REPORT, "date", working="validating",
)  # fmt: skip
next_test = result_command(
    "elevon.nexttest.door:next_test",
    "Propose the bench's test with the largest expected information on what is ambiguous.",
    working="weighing tests", arguments=0,
)  # fmt: skip


@command(
    None, "strict", "details", "force", door="elevon.doctor.door:doctor", working="looking",
    without=("loadcells", "notes", "answers", "false_alarm"),
)  # fmt: skip
def doctor(
    door: DoorCall,
    *,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    drive: str | None = None,
    role: list[str] | None = None,
    out: Annotated[Path | None, Option(metavar="DIR")] = None,
    force: bool = False,
) -> Answer:
    """Look at logs for the first time: columns, data, the model's fit, the verdict.

    Parameters
    ----------
    out : path
        Write page, answer and guessed map into this folder.
    """
    from elevon.logs.read import Answers

    if out is not None:
        common.check_outputs([out / name for name in _DOCTOR_FILES], force=force)
    paths = common.without_companions(door.options["logs"])
    result: Examination = door(
        logs=paths,
        baselines=common.without_companions(door.options["baselines"] or []),
        loadcells=common.one_each("--loadcell", loadcell, len(paths)),
        notes=common.one_each("--command", command, len(paths), shared=True),
        answers=Answers(drive, common.roles_said(role)),
    )
    if out is not None:
        for path in result.write(out, force=force):
            say(f"wrote {path}")
    more = () if out is not None else ("one page of all this: --out DIR",)
    return Answer(result, lambda: print_result(result, *more), 1 if result.failed else 0)


@command(None, *REPORT, door="elevon.diagnose.door:diagnose")
def diagnose(
    door: DoorCall,
    *,
    append: Annotated[Path | None, Option(metavar="HISTORY")] = None,
    usage: Annotated[str | None, Option(metavar="N")] = None,
    force: bool = False,
) -> Answer:
    """Diagnose the unit that wrote the logs, all in one condition.

    Parameters
    ----------
    append : path
        Add the answer to this folder of inspections.
    usage : str
        Use at it; the first one as '600 flights'.
    """
    rate = door.options["false_alarm"]
    if not 0.0 < rate < 1.0:
        raise InputError(f"--false-alarm {rate:g}: must be between 0 and 1")
    unit = common.read_actuator(door.options["actuator"], door.options["settings"])
    entry = _next_entry(append, usage, unit.name, force=force)
    result: Diagnosis = door(actuator=unit)
    code = 0 if entry is None else _add_to_history(entry, result)
    return Answer(result, code=code, page=result.report)


def _next_entry(
    history: Path | None, usage: str | None, actuator: str, *, force: bool
) -> NextEntry | None:
    """Return where the answer is added; refused before the work where it cannot be."""
    from elevon.prognose.history import next_entry

    if history is None and usage is None:
        return None
    if history is None or usage is None:
        raise InputError("--append HISTORY and --usage N go together: a use is that of a history")
    return next_entry(history, usage, actuator, force=force)


def _add_to_history(inspection: NextEntry, result: Diagnosis) -> int:
    try:
        say(f"added: {inspection.write(result)}")
    except InputError as error:
        say(f"elevon: {error}")
        return 1
    return 0


_FALSE_ALARM_RATE = 0.05  # of false alarms, by default


@command(None, "strict", "details")
def learn(
    logs: Annotated[list[Path], Option(metavar="LOG")],
    *,
    labels: Path | None = None,
    out: Annotated[Path, Option(metavar="MODEL")],
    actuator: Annotated[str | None, Option(complete="actuators")] = None,
    pole_pairs: float | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    column_map: Path | None = None,
    drive: str | None = None,
    role: list[str] | None = None,
    settings: list[str] | None = None,
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Learn classes, severities and how healthy days differ, from labelled logs or a data set.

    Parameters
    ----------
    logs : list of path
        Drive logs, or one folder of a campaign.
    labels : path
        Table (CSV): log, label; unit, condition, severity, healthy, day.
    out : path
        Model to write (.npz).
    actuator : str
        Learn how healthy days differ, against this actuator.
    pole_pairs : float
        Of the motor; default: the actuator's.
    """
    from elevon.diagnose.learning.door import as_dataset
    from elevon.diagnose.learning.door import learn as run
    from elevon.diagnose.learning.labels import read_labels

    common.check_outputs([out], force=force)
    if actuator is None and settings:
        raise InputError("--set: goes with --actuator")
    unit = None if actuator is None else common.read_actuator(actuator, settings)
    options: dict[str, Any] = {"actuator": unit, "pole_pairs": pole_pairs, "seed": seed}
    data = as_dataset(logs)
    with progress_bar("learning") as advance:
        if data is not None:
            result = run(data, labels, **options, progress=advance)
        else:
            paths = common.without_companions(logs)
            known = None if labels is None else read_labels(labels, paths)
            read = common.read_logs(paths, column_map, loadcell, command, drive=drive, role=role)
            result = run(read, known, **options, progress=advance)
    path = result.save(out, force=force)
    return Answer({"file": path, **result.to_dict()}, lambda: _print_learned(result, path))


def _print_learned(result: LearnedModel, path: Path) -> None:
    answer(f"learnt: {', '.join(result.holds)} of {result.report['logs']} logs -> {path}")
    if result.classes is not None:
        _print_classes(result)
    if result.spread is None:
        return
    spread = result.report["spread"]
    far = sorted(spread["features"].items(), key=lambda row: -abs(row[1]["days"] - 1.0))
    rows = [(name, *(f"{x:.2f}" for x in values.values())) for name, values in far]
    columns = ("feature", "day to day", "low", "high", "mismatch", "low", "high")
    counts = ", ".join(f"{spread[n]} {n if spread[n] != 1 else n[:-1]}" for n in ("days", "units"))
    title = f"{counts}: deviations over those stated, with 90 % intervals"
    print_table(columns, rows, title=title)
    listed([result.spread.threshold_text(_FALSE_ALARM_RATE)])


def _print_classes(result: LearnedModel) -> None:
    rows = [
        (
            name if view == "absolute" else f"{name}, with a baseline",
            f"{r['right']}/{r['logs']}",
            f"{100.0 * r['interval'][0]:.0f} to {100.0 * r['interval'][1]:.0f} %",
            f"{r['false_alarms']}/{r['healthy']}",
            f"{r['missed']}/{r['faulty']}",
        )
        for view, report in _reports(result)
        for name, r in report["left_out"].items()
    ]
    print_table(("left out in turn", "right class", "95 %", "false alarms", "missed"), rows)
    sized = [
        (
            kind if view == "absolute" else f"{kind}, with a baseline",
            r["logs"], f"{r['low']:.3g}", f"{r['high']:.3g}", f"{r['error']:.2f}",
            f"{r['interval']:.2f}",
        )
        for view, report in _reports(result)
        for kind, r in report.get("severities", {}).items()
    ]  # fmt: skip
    if sized:
        title = "severities: errors of the root of the share in the largest, units left out"
        columns = ("kind", "logs", "lowest, SI", "highest, SI", "median error", "90 % within")
        print_table(columns, sized, title=title)
    lost = result.report.get("left_out_runs", {})
    listed([f"left out: {count} runs: {reason}" for reason, count in lost.items()])


def _reports(result: LearnedModel) -> list[tuple[str, dict[str, Any]]]:
    """Return what was counted without and with baselines."""
    views = [("absolute", dict(result.report))]
    return views + [(n, result.report[n]) for n in ("relative",) if n in result.report]
