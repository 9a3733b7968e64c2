"""`elevon simulate`, `compare`, `response`, `fit-low`, `loads` and `design`: the model runs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from elevon.cli import common
from elevon.cli.groups import group
from elevon.cli.output import answer, print_result, print_table, progress_bar, say
from elevon.cli.shell import Answer, DoorCall, command
from elevon.errors import InputError, unknown
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.bench.spring import SpringDesign, SpringSizing
    from elevon.calibrate.low_fit import FitCase, LowFit
    from elevon.compare import Comparison
    from elevon.loads.table import LoadTable
    from elevon.recording import Recording
    from elevon.response import FrequencyResponse, LoopResponse
    from elevon.scenario import Scenario
    from elevon.simulate import Run

_PLOTS = (".png", ".svg", ".pdf", ".html")
#: Signals of a control unit that are shown by name.
_WORDS = ("command", "state", "fault_code", "warning_code", "command_refused")

design = group("Design experiments and parts.")


@command(
    None, "strict", door="elevon.simulate:simulate", working="simulating",
    without=("features", "number", "lanes", "strict"),
)  # fmt: skip
def simulate(
    door: DoorCall,
    *,
    scenario: Path | None = None,
    duration: Annotated[str | None, Option(metavar="QUANTITY")] = None,
    out: Path | None = None,
    plot: Path | None = None,
    compare: Annotated[Path | None, Option(metavar="REC")] = None,
    spectra: bool = False,
    force: bool = False,
) -> Answer:
    """Simulate one actuator and keep what it did.

    Parameters
    ----------
    duration : str
        Simulated time, such as 5 or '200 ms'; overrides the scenario's.
    out : path
        Save the recording: .parquet, .nc, .csv or .mat.
    plot : path
        Plot it: .png, .svg, .pdf or .html.
    compare : path
        Another recording drawn over this one.
    spectra : bool
        Add spectra of error, current and speed to the plot.
    """
    from elevon.recording.formats import files_of
    from elevon.simulate import Run

    _check_files(out, plot, force=force)
    other = _read_other(compare, plot)
    options = door.options
    loaded = common.read_actuator(options["actuator"], options["settings"])
    wanted = common.read_scenario(loaded, scenario, duration, options["faults"])
    if out is not None:
        run = Run(loaded, wanted, options["seed"])
        _check_clocks(out, run, options["fidelity"], options["record"], force=force)
    recording: Recording = door(actuator=loaded, scenario=wanted, faults=())
    if out is not None:
        recording.save(out, force=force)
        say(f"wrote {', '.join(str(file) for file in files_of(out))}")
    if plot is not None:
        recording.plot(path=plot, compare=other, spectra=spectra, force=force)
        say(f"wrote {plot}")
    data = _run_data(recording, loaded.wiring) | {"out": out, "plot": plot}
    return Answer(data, lambda: _print_run(recording, loaded.wiring))


def _check_files(out: Path | None, plot: Path | None, *, force: bool) -> None:
    from elevon.recording.formats import check_ending

    if out is not None:
        check_ending(out)
    if plot is not None and plot.suffix.lower() not in _PLOTS:
        raise unknown("ending of a plot", plot.suffix, _PLOTS, str(plot))
    if out is not None and plot is not None and out.absolute() == plot.absolute():
        raise InputError(f"{out}: --out and --plot name the same file")
    common.check_outputs([out, plot], force=force)


def _read_other(compare: Path | None, plot: Path | None) -> Recording | None:
    """Read the recording to compare with before simulating."""
    from elevon.recording import Recording

    if compare is None:
        return None
    if plot is None:
        raise InputError("--compare draws over a plot: give its file with --plot")
    other = Recording.load(compare)
    return other if other.meta.get("label") else other.with_meta(label=compare.name)


def _check_clocks(
    out: Path, run: Run, fidelity: str, record: list[str] | None, *, force: bool
) -> None:
    """Check before simulating that what will be recorded can be saved: a CSV has a file a clock."""
    from elevon.recording.formats import check_target
    from elevon.simulate.prepare import prepare

    plan = prepare(run, fidelity, record, notices=False).plan
    check_target(out, [clock.name for clock in plan], force=force)


def _run_data(recording: Recording, wiring: str) -> dict[str, Any]:
    meta = recording.meta
    keys = ("status", "message", "actuator", "fidelity", "seed", "parameter_hash", "version",
            "sim_s", "wall_s", "ns_per_step", "steps")  # fmt: skip
    return {
        **{key: meta[key] for key in keys},
        "final": recording.final,
        "labels": recording.labels,
        **_events(recording, wiring),
    }


def _events(recording: Recording, wiring: str) -> dict[str, list[dict[str, Any]]]:
    """Return the timeline of an actuator with a control unit; of any other nothing."""
    from elevon.simulate.timeline import has_states, timeline

    if not has_states(wiring):
        return {}
    return {
        "events": [
            {"time_s": event.time, "signal": event.signal, "text": event.text}
            for event in timeline(recording, wiring)
        ]
    }


def _print_run(recording: Recording, wiring: str) -> None:
    from elevon.recording.plot import code_names
    from elevon.units import display_unit, to_display

    meta = recording.meta
    speed = meta["sim_s"] / meta["wall_s"] if meta["wall_s"] > 0.0 else float("inf")
    message = f" ({meta['message']})" if meta["message"] else ""
    answer(
        f"{meta['actuator']}, {meta['fidelity']} fidelity: {meta['status']}{message}\n"
        f"{meta['sim_s']:g} s simulated in {meta['wall_s']:.3g} s "
        f"({speed:.3g} times real time, {meta['ns_per_step']:.3g} ns a step)\n"
    )
    events = _events(recording, wiring).get("events")
    if events is not None:
        lines = [[f"{event['time_s']:.3f}", event["text"]] for event in events]
        print_table(("time [s]", "event"), lines or [["", "nothing changed"]])
        answer("")
    rows = []
    for channel in recording.channels:
        name, values = channel.name, channel.values
        words = code_names(wiring, name) if events is not None and name in _WORDS else {}
        unit = display_unit(channel.unit or "1")
        if not len(channel):
            rows.append([name, unit, "", "", ""])
        elif words:
            rows.append([name, "", "", "", words.get(round(float(values[-1])), f"{values[-1]:g}")])
        else:
            displayed = to_display([values.min(), values.max(), values[-1]], unit)
            rows.append([name, unit, *(f"{x:.6g}" for x in displayed)])
    print_table(("signal", "unit", "least", "greatest", "last"), rows)


@command(None, "strict", "date", door="elevon.doors:compare", working="comparing")
def compare(
    door: DoorCall,
    *,
    scenario: Path | None = None,
    fault: list[str] | None = None,
    faults_table: bool = False,
    out: Annotated[Path | None, Option(metavar="DIR")] = None,
    force: bool = False,
) -> Answer:
    """Run one scenario at high and at low fidelity; default: the one that the set says.

    Parameters
    ----------
    faults_table : bool
        What each fault changes in either model.
    out : path
        Folder for report.html.
    """
    from elevon.compare import compare_report, default_scenario, default_start
    from elevon.scenario import Scenario

    options = door.options
    if options["load"] is not None and not options["loads"]:
        raise InputError("--load needs --loads")
    page = None if out is None else out / "report.html"
    common.check_outputs([page], force=force)
    model = common.read_actuator(options["actuator"], options["settings"])
    moved = default_scenario(model) if scenario is None else Scenario.load(scenario)
    moved = moved.with_faults(common.read_faults(fault, model.wiring))
    start = options["start"]
    if start is None:
        start = default_start(model, moved, default=scenario is None)
    if faults_table:
        return _faults_table(model, moved, start, options["seed"])
    result: Comparison = door(actuator=model, scenario=moved, start=start)
    if page is not None:
        report = compare_report(result, options["actuator"], date=options["date"])
        say(f"report: {report.save(page, force=force)}")
    return Answer(result)


def _faults_table(model: Actuator, moved: Scenario, start: float, seed: int) -> Answer:
    from elevon.fault_sensitivity import fault_sensitivity

    with progress_bar("healthy and faulty runs") as advance:
        rows = fault_sensitivity(model, moved, start=start, seed=seed, progress=advance)
    values = {"actuator": model.name, "rows": [row.to_dict() for row in rows]}

    def show() -> None:
        both = sum(row.verdict == "seen by both" for row in rows)
        answer(f"{model.name}: {both} of {len(rows)} faults are seen by both models")
        table = [
            [row.fault, row.feature, f"{row.high:+.4g}", f"{row.low:+.4g}", f"{row.floor:.2g}",
             f"{row.ratio:+.2f}", row.verdict]
            for row in rows
        ]  # fmt: skip
        print_table(["fault", "seen in", "high", "low", "floor", "low/high", ""], table)

    return Answer(values, show)


@command(None, "strict", door="elevon.doors:response", working="response")
def response(door: DoorCall, *, plot: Path | None = None, force: bool = False) -> Answer:
    """Measure gain, phase and coherence from the command to a signal by simulation.

    With ``--loop`` the open loop instead: gain, phase and disk margin with intervals.

    Parameters
    ----------
    plot : path
        Bode plot: .png, .svg or .pdf.
    """
    from elevon.files import atomic_path
    from elevon.recording.plot import PICTURES

    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise unknown("ending of a plot", plot.suffix, PICTURES, str(plot))
    common.check_outputs([plot], force=force)
    measured: FrequencyResponse | LoopResponse = door()
    if plot is not None:
        with atomic_path(plot, force=force) as temporary:
            measured.plot().savefig(temporary, format=plot.suffix[1:].lower(), dpi=150)
        say(f"wrote {plot}")
    data = measured.to_dict(stored=False)
    optional = ("linear", "band")
    data = {n: value for n, value in data.items() if n not in optional or value is not None}
    return Answer(data, lambda: print_result(measured))


@command(
    None, "strict", "report", "date", door="elevon.calibrate.low_fit:fit_low",
    working="switching model, then the fit", without=("cases",),
)  # fmt: skip
def fit_low(
    door: DoorCall,
    *,
    scenario: list[Path] | None = None,
    fault: list[str] | None = None,
    out: Path | None = None,
    force: bool = False,
) -> Answer:
    """Fit the reduced-order model's free numbers to the switching model over scenarios, faults.

    Parameters
    ----------
    scenario : list of path
        Scenario to fit to instead of the stated list; repeatable.
    out : path
        Write the set.
    """
    from elevon.calibrate.low_fit import lowfit_report, write_fit

    common.check_outputs([out], force=force)
    reference = door.options["actuator"]
    model = common.read_actuator(reference, door.options["settings"])
    fit: LowFit = door(actuator=model, cases=_cases(model, scenario, fault))
    if out is not None:
        say(f"set: {write_fit(out, fit, force=force)}")
    data = fit.to_dict() | {"out": None if out is None else str(out)}
    page = partial(lowfit_report, fit, reference)
    return Answer(data, lambda: _print_fit(fit), page=page)


def _cases(model: Actuator, files: list[Path] | None, faults: list[str] | None) -> list[FitCase]:
    from elevon.calibrate.low_fit import default_cases, named_cases
    from elevon.scenario import Scenario

    if files:
        return named_cases([(path.stem, Scenario.load(path)) for path in files], faults or [])
    if faults:
        raise InputError("fit-low: --fault needs the --scenario it is to be added to")
    return default_cases(model)


def _print_fit(fit: LowFit) -> None:
    values = fit.to_dict()
    cases, retained = values["cases"], values["kept"]
    fitted = [
        [row["path"], f"{row['old']:.4g}", f"{row['new']:.4g}", f"{row['deviation']:.2g}"]
        for row in values["fitted"]
    ]
    answer(f"{len(fitted)} numbers fitted over {len(cases)} cases, {len(retained)} kept")
    rows = fitted + [[row["path"], "", "kept", row["reason"]] for row in retained]
    print_table(["number", "old", "new", "deviation"], rows)
    ends = [(name, when) for name in values["rms_before"] for when in ("before", "after")]
    errors = [
        [row["name"], *(f"{100 * row[when][name]:.2f}" for name, when in ends)] for row in cases
    ]
    head = [f"{name.replace('_', ' ')} {when}" for name, when in ends]
    print_table(["case", *head], errors, title="RMS of low less high, % of high's")


@command(None, "force", door="elevon.doors:flight_load", working="reading the flight")
def loads(door: DoorCall, *, out: Path, force: bool = False) -> Answer:
    """Turn a recorded flight into the load of one actuator: a table or a scenario.

    Parameters
    ----------
    out : path
        A table (.csv) or a scenario (.toml) to write.
    """
    from elevon.files import check_output, write_text

    kinds = (".csv", ".toml")
    if out.suffix not in kinds:
        raise InputError(f"--out {out}: must end in {' or '.join(kinds)}")
    check_output(out, force=force)
    table: LoadTable = door()
    text = table.csv() if out.suffix == ".csv" else table.scenario_text()
    say(f"{out.suffix[1:]}: {write_text(out, text, force=force)}")
    return Answer(table.summary(), lambda: _print_loads(table))


def _print_loads(table: LoadTable) -> None:
    values = table.summary()
    (low, high), (left, right) = values["load"], values["position"]
    force, length = values["load_unit"], values["position_unit"]
    answer(f"load {low:.5g} to {high:.5g} {force} over {table.time[-1]:g} s")
    rows = [
        ["samples", f"{table.time.size} over {table.time[-1]:g} s"],
        ["load", f"{low:.5g} to {high:.5g} {force}, scale {table.load_scale:.4g}"],
        ["position", f"{left:.4g} to {right:.4g} {length}, scale {table.position_scale:.4g}"],
        ["largest Mach number", f"{values['mach']:.3f}"],
        ["largest dynamic pressure", f"{values['dynamic_pressure_pa'] / 1e3:.3g} kPa"],
    ]
    print_table(["what", "value"], rows)


@command(design, door="elevon.bench.spring:size_spring")
def spring(door: DoorCall) -> Answer:
    """Size the load module's springs: stress check, stiffness, other designs that do as well."""
    sizing: SpringSizing = door()
    return Answer(sizing.to_dict(), lambda: _print_spring(sizing), 0 if sizing.feasible else 1)


def _print_spring(sizing: SpringSizing) -> None:
    verdict = "holds" if sizing.feasible else "does not hold"
    others = sizing.others
    safety = sizing.design.safety
    answer(f"The spring {verdict}: safety {safety:.3g}; {len(others)} other designs do")
    rows = [(name.replace("_", " "), _text(x)) for name, x in sizing.design.to_dict().items()]
    rows.append((f"radial force at {1e3 * sizing.mover:g} mm, N", _text(sizing.radial_force)))
    print_table(("quantity", "value"), rows, title="Spring of the load module")
    least: dict[float, SpringDesign] = {}
    for design in others:
        least.setdefault(design.wire, design)
    cells = [
        (f"{1e3 * d.wire:g}", f"{1e3 * d.coil:g}", d.coils, f"{1e3 * d.free_length:.0f}",
         f"{1e-6 * d.stress:.0f}", f"{d.safety:.2f}", f"{1e6 * d.wire_volume:.0f}")
        for d in least.values()
    ]  # fmt: skip
    heads = ("wire mm", "coil mm", "coils", "length mm", "stress N/mm2", "safety", "wire cm3")
    print_table(heads, cells, title=f"Least wire for each diameter ({len(others)} designs hold)")


def _text(value: float | bool) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value) if isinstance(value, int) else f"{value:.6g}"
