"""`elevon diagnose`: what is wrong, where, how bad, how sure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.calibrate import (
    CommandOption,
    LoadcellOption,
    LogsArgument,
    MapOption,
    one_each,
)
from elevon.cli.common import (
    ActuatorOption,
    ForceOption,
    JsonOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
    without_companions,
)
from elevon.cli.output import print_json, print_table, say
from elevon.errors import InputError, unknown
from elevon.number_text import severity_texts

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from elevon.actuator import Actuator
    from elevon.diagnose.bymodel import TestLog
    from elevon.diagnose.bymodel.answer import Diagnosis
    from elevon.diagnose.pictures import Traces
    from elevon.recording import Recording

app = typer.Typer(rich_markup_mode=None)
METHODS = ["model", "surrogate", "both"]


@app.command()
def diagnose(
    logs: LogsArgument,
    *,
    actuator: ActuatorOption,
    loadcell: LoadcellOption = None,
    command: CommandOption = None,
    column_map: MapOption = None,
    baseline: Annotated[
        list[Path] | None,
        typer.Option("--baseline", metavar="LOG", help="Log of the healthy unit; repeatable."),
    ] = None,
    method: Annotated[
        str, typer.Option(help="model, surrogate, or both (it proposes, the model refines).")
    ] = "model",
    surrogate: Annotated[
        Path | None,
        typer.Option(help="Surrogate by elevon diagnose-train; default: the package's own."),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="KIND@PLACE", help="Candidate; repeatable. Default: all."),
    ] = None,
    false_alarm: Annotated[
        float, typer.Option("--false-alarm", help="Rate of healthy logs called faulty.")
    ] = 0.05,
    settings: SetOption = None,
    report: Annotated[Path | None, typer.Option("--report", help="HTML page to write.")] = None,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Diagnose the unit that wrote the logs, all in one condition."""
    from elevon.diagnose.bymodel import read_test_logs
    from elevon.diagnose.bymodel.traces import traces_of

    check_outputs([report], force=force)
    run = _method(method, surrogate)
    if not 0.0 < false_alarm < 1.0:
        raise InputError(f"--false-alarm {false_alarm:g}: must be between 0 and 1")
    model = read_actuator(actuator, settings)
    logs = without_companions(logs)
    if model.wiring != "rotary":
        if method != "model":
            raise InputError(f"--method {method}: serves rotary actuators; {model.name} is none")
        result, traces = _by_roles(
            model, logs, baseline or [], column_map, faults=fault, false_alarm=false_alarm,
            drawn=report is not None,
        )  # fmt: skip
        return _output(result, method, model.name, report, traces=traces, json=json, force=force)
    data = read_with(logs, loadcell, command, column_map)
    healthy = read_test_logs(without_companions(baseline or []), column_map=column_map)
    result = run(data, model, baselines=healthy, faults=fault, false_alarm=false_alarm)
    traces = traces_of(data, model, result) if report is not None else []
    return _output(result, method, model.name, report, traces=traces, json=json, force=force)


def read_with(
    logs: list[Path],
    loadcell: list[Path] | None,
    command: list[Path] | None,
    column_map: Path | None,
) -> list[TestLog]:
    """Read logs with what stands beside them, given or found by name."""
    from elevon.diagnose.bymodel import read_test_logs

    logs = without_companions(logs)
    return read_test_logs(
        logs,
        loadcells=one_each("--loadcell", loadcell, len(logs)),
        commands=one_each("--command", command, len(logs), shared=True),
        column_map=column_map,
    )


def _by_roles(
    model: Actuator,
    logs: list[Path],
    baseline: list[Path],
    column_map: Path | None,
    *,
    faults: list[str] | None,
    false_alarm: float,
    drawn: bool,
) -> tuple[Diagnosis, list[Traces]]:
    """Diagnose an actuator whose logs are read by roles; with their signals, if drawn."""
    from elevon.cli.closed_loop import read_recording
    from elevon.diagnose.byroles import diagnose_by_roles
    from elevon.diagnose.byroles.traces import traces_by_roles

    def read(paths: list[Path]) -> list[tuple[str, Recording]]:
        return [(path.name, read_recording(path, column_map)) for path in without_companions(paths)]

    data = read(logs)
    result = diagnose_by_roles(
        data, model, baselines=read(baseline), faults=faults, false_alarm=false_alarm
    )
    return result, traces_by_roles(data, model, result) if drawn else []


def _output(
    result: Diagnosis,
    method: str,
    name: str,
    report: Path | None,
    *,
    traces: Sequence[Traces] = (),
    json: bool,
    force: bool,
) -> int:
    """Write the report and print the answer."""
    if report is not None:
        from elevon.diagnose.bymodel.page import diagnosis_page

        page = diagnosis_page(result, name, traces=traces)
        say(f"report: {page.save(report, force=force)}")
    if json:
        print_json({**result.to_dict(), "method": method})
        return 0
    _print(result)
    return 0


def _method(method: str, file: Path | None) -> Callable[..., Diagnosis]:
    """Return what diagnoses; a surrogate's file is read before any log."""
    from functools import partial

    from elevon.diagnose.bymodel import diagnose as by_model

    if method not in METHODS:
        raise unknown("method", method, METHODS, "--method")
    if method == "model":
        if file is not None:
            raise InputError("--surrogate: serves --method surrogate and both")
        return by_model
    from elevon.diagnose.surrogate import (
        Surrogate,
        diagnose_by_both,
        diagnose_by_surrogate,
        shipped,
    )

    trained = shipped() if file is None else Surrogate.load(file)
    return partial(
        diagnose_by_surrogate if method == "surrogate" else diagnose_by_both, surrogate=trained
    )


def _print(result: Diagnosis) -> None:
    from elevon.diagnose.bymodel.words import by_reason, sentence

    say(sentence(result))
    rows = [
        (
            f"{c.kind}@{c.place}",
            f"{c.probability:.3f}",
            *severity_texts(c.severity, c.interval, c.unit),
            ", ".join(f"{kind}@{place}" for kind, place in c.ambiguous_with),
        )
        for c in result.faults
    ]
    print_table(("cause", "probability", "severity", "low", "high", "ambiguous with"), rows)
    for names, reason in by_reason(result.unobservable):
        say(f"not observable: {names}: {reason}")
    for text in result.findings:
        say(text)
