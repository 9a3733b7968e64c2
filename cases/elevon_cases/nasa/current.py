"""Predicted and measured motor current of the ballscrew actuator: the paper's validation, in kind.

No signal of the stand was published, so the measured side is our virtual stand with a mismatch:
another friction law, weaker magnets, less efficient screw, units reassembled between runs, its own
load actuator and sensors. What is compared is the way, not the paper's model with its data.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.logs.command.curve import CommandCurve, rebuilt_curve
from elevon.plain import Plain
from elevon.progress import Progress, part
from elevon.report import Report, ReportTable
from elevon.report.checks import Check, verdict
from elevon.report.figures import new_figure
from elevon.units import to_si
from elevon_cases.page import GREY, ORANGE, table_of, with_end

ACTUATOR = "nasa-ballscrew"
POUND_FORCE = float(to_si(1.0, "lbf"))
PUBLISHED = {"nominal": (7.12, 9.96, 5.82), "jam": (8.34, 9.88, 5.60)}
"""Percent RMS error of the current as printed: average, maximum, minimum."""
REASSEMBLIES = 4
SECONDS = 9.0
CORNER = 0.1
"""Seconds after a corner of the command in which the current may stand at its limit."""
SETTLED = 3.0
"""What comes before is left out [s]: the stand waits up to 2 s."""
PROFILES = {
    "sinusoid": {"kind": "sine", "amplitude": "50 mm", "frequency": "0.19098593171027442 Hz"},
    "triangular": {"kind": "triangle", "amplitude": "50 mm", "frequency": "0.3 Hz"},
}
LOADS = {
    "opposing force, 900 lbf": {"opposing": 900.0 * POUND_FORCE},
    "opposing force, 1800 lbf": {"opposing": 1800.0 * POUND_FORCE},
    "spring, 860 lbf": {"stiffness": 860.0 * POUND_FORCE / 0.05},
    "spring, 1725 lbf": {"stiffness": 1725.0 * POUND_FORCE / 0.05},
}
FREE: dict[str, dict[str, float]] = {"no load": {}}
MISMATCH: dict[str, float | str] = {"friction.law": "stribeck"}
"""Beside it: magnets 30 K warmer (3 % less torque a current), screw 1 % less efficient."""
SCATTER = 0.1
"""Spread of friction and preload from one assembly to the next; ASSUMED, printed nowhere."""
FIGURES = {
    ("nominal", "sinusoid", "opposing force, 900 lbf"): 6,
    ("nominal", "triangular", "spring, 1725 lbf"): 7,
    ("jam", "sinusoid", "opposing force, 900 lbf"): 20,
    ("jam", "triangular", "spring, 1725 lbf"): 21,
}


@dataclass(frozen=True, slots=True)
class CurrentRow(Plain):
    """One experiment: what was run, and the RMS error in percent of the measured current's RMS.

    Attributes
    ----------
    percent_rms : float
        RMS error over the RMS of the measured current about its mean.
    percent_between_corners : float
        The same without what follows a corner of the command within `CORNER`: there the current
        goes to its limit for milliseconds.
    rms_a : float
        RMS error [A].
    """

    state: str
    assembly: int
    profile: str
    load: str
    percent_rms: float
    percent_between_corners: float
    rms_a: float


@dataclass(frozen=True)
class CurrentTrace:
    """Measured and predicted current [A] of one of the paper's figures."""

    figure: int
    title: str
    time: Floats
    measured: Floats
    predicted: Floats


@dataclass(frozen=True)
class CurrentResult:
    """Everything `elevon reproduce nasa-current` reports."""

    rows: list[CurrentRow]
    traces: list[CurrentTrace]
    seed: int
    parameter_hash: str

    def summary(self, state: str, name: str = "percent_rms") -> tuple[float, float, float]:
        """Return average, maximum and minimum of the percent errors of one definition."""
        values = [getattr(row, name) for row in self.rows if row.state == state]
        return float(np.mean(values)), max(values), min(values)

    @property
    def compared(self) -> list[tuple[str, str, float, float, float]]:
        """State, source, average, maximum and minimum: the published ones and ours."""
        between = "percent_between_corners"
        return [
            (state, source, *values)
            for state in PUBLISHED
            for source, values in (
                ("published", PUBLISHED[state]),
                ("here", self.summary(state)),
                ("here, between corners", self.summary(state, between)),
            )
        ]

    @property
    def checks(self) -> list[Check]:
        """As many runs as published; average and maximum against the paper's own."""
        nominal = [row for row in self.rows if row.state == "nominal"]
        checks = [Check("nominal runs", float(len(nominal)), 32.0, "", at_least=True)]
        for state, (average, most, _) in PUBLISHED.items():
            average_and_most = self.summary(state)
            for name, value, limit in (
                ("average", average_and_most[0], average),
                ("largest", average_and_most[1], most),
            ):
                checks.append(Check(f"{state}: {name} error of the current", value, limit, "%"))
        return checks

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command."""
        names = ("average", "maximum", "minimum")
        return {
            **verdict(self.checks),
            "measured": "virtual stand with a mismatch; no signals were published",
            "percent_rms": "RMS error over the measured current's RMS about its mean",
            "summary": {
                state: {
                    name.replace(", ", "_").replace(" ", "_"): dict(zip(names, values, strict=True))
                    for of, name, *values in self.compared
                    if of == state
                }
                for state in PUBLISHED
            },
            "rows": [row.to_dict() for row in self.rows],
            "seed": self.seed,
            "parameter_hash": self.parameter_hash,
        }


def reproduce_current(
    *, fidelity: str = "high", seed: int = 0, progress: Progress | None = None
) -> CurrentResult:
    """Run 32 nominal experiments and ten with a blocked return channel, and predict each.

    Parameters
    ----------
    fidelity : str
        Of the virtual stand; the prediction is at low fidelity.
    seed : int
        Of the assemblies, the stand and its sensors.
    progress : callable, optional
        As for `elevon.simulate`.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    model = Actuator.load(ACTUATOR)
    wanted = _experiments()
    rows, traces = [], []
    for number, (state, assembly, profile, load, force) in enumerate(wanted):
        share = part(progress, number / len(wanted), (number + 1) / len(wanted))
        unit = _unit(model, seed, assembly)
        log = _log(unit, (state, profile, force), fidelity, seed + number, share)
        row, trace = _predicted(model, log, (state, assembly, profile, load))
        rows.append(row)
        if trace is not None:
            traces.append(trace)
    return CurrentResult(rows, traces, seed, model.hash)


def _experiments() -> list[tuple[str, int, str, str, dict[str, float]]]:
    nominal = [
        ("nominal", assembly, profile, load, force)
        for assembly in range(1, REASSEMBLIES + 1)
        for profile in PROFILES
        for load, force in LOADS.items()
    ]
    jam = [
        ("jam", 1, profile, load, force)
        for profile in PROFILES
        for load, force in {**FREE, **LOADS}.items()
    ]
    return nominal + jam


def _unit(model: Actuator, seed: int, assembly: int) -> Actuator:
    """Return one assembly of the actuator on the stand: what the model does not know."""
    rng = np.random.default_rng([seed, assembly])
    value = model.parameters.value
    values: dict[str, float | str] = dict(MISMATCH)
    for path in ("friction.static", "friction.dynamic", "screw.preload"):
        values[path] = value(path) * float(np.exp(SCATTER * rng.standard_normal()))
    values["friction.static"] = max(
        float(values["friction.static"]), float(values["friction.dynamic"])
    )
    values["motor.emf_constant"] = 0.97 * value("motor.emf_constant")
    values["screw.efficiency"] = value("screw.efficiency") - 0.01
    return model.with_values(values, source="assembly on the virtual stand", request=False)


def _log(
    unit: Actuator,
    experiment: tuple[str, str, dict[str, float]],
    fidelity: str,
    seed: int,
    progress: Progress | None,
) -> Any:
    """Return what the stand records of one experiment."""
    from elevon.bench.loaded import loaded_setups, run_loaded
    from elevon.bench.procedure import Procedure
    from elevon.bench.stand import stand_of
    from elevon.documents import Document, validated
    from elevon.simulate import completed

    state, profile, force = experiment
    trace = {"kind": "trace", "name": "run", "duration": SECONDS,
             "command": {"terms": [PROFILES[profile]]}}  # fmt: skip
    data = {"name": "run", "step": [{"kind": "force", **force}, trace]}
    procedure = validated(Procedure, data, Document("nasa-current", "", {}))
    faults = [JAM] if state == "jam" else []
    (setup,) = loaded_setups(procedure, unit, stand_of(unit.wiring), faults=faults, seed=seed)
    log, run = run_loaded(setup, fidelity, progress)
    completed([run], f"{state}, {profile}")
    return log


JAM = "return_jam@screw.return_channel=1"


def _predicted(
    model: Actuator, log: Any, labels: tuple[str, int, str, str]
) -> tuple[CurrentRow, CurrentTrace | None]:
    """Predict one log from its command and load, as `elevon validate` does, jam included."""
    from elevon.scenario import Scenario
    from elevon.simulate import simulate

    state, assembly, profile, load = labels
    command, force = log.role("command"), log.role("load")
    time = np.asarray(command.time, dtype=np.float64)
    curve = rebuilt_curve(time, np.asarray(command.values))
    scenario = Scenario.from_dict(
        {
            "duration": float(time[-1]),
            "command": {"mode": "position", "terms": [_table(*curve.points)]},
            "load": {"output": {"terms": [_table(time, force.values)]}},
        }
    )
    if state == "jam":
        scenario = scenario.with_faults([JAM])
    run = simulate(model, scenario, fidelity="low", record="current_q_meas@every")
    simulated = run["current_q_meas"]
    filtered = _recorded(simulated.time, simulated.values, log.meta["acquisition"]["cutoff_hz"])
    predicted = np.interp(time, simulated.time, filtered)
    measured = np.asarray(log.role("torque_current").values, dtype=np.float64)
    used = time >= SETTLED
    error, size = predicted - measured, float(np.std(measured[used]))
    between = used & ~_after_corners(time, curve)
    rms, without = (float(np.sqrt(np.mean(error[at] ** 2))) for at in (used, between))
    row = CurrentRow(
        state, assembly, profile, load, 100.0 * rms / size, 100.0 * without / size, rms
    )
    figure = FIGURES.get((state, profile, load))
    if figure is None or assembly > 1:
        return row, None
    title = f"{profile}, {load}" + (", one return channel blocked" if state == "jam" else "")
    return row, CurrentTrace(figure, title, time[used], measured[used], predicted[used])


def _after_corners(time: Floats, curve: CommandCurve) -> npt.NDArray[np.bool_]:
    """Tell which instants follow a corner of the command within `CORNER`."""
    after = np.zeros(len(time), dtype=bool)
    for corner in curve.breaks:
        after |= (time >= corner.time) & (time < corner.time + CORNER)
    return after


def _recorded(time: Floats, values: Floats, cutoff: float) -> Floats:
    """Return a run's current behind the filter of the stand's recorder: both sides have one."""
    from scipy.signal import butter, sosfiltfilt

    rate = 1.0 / float(np.median(np.diff(time)))
    return np.asarray(sosfiltfilt(butter(4, cutoff, fs=rate, output="sos"), values))


def _table(time: Any, values: Any) -> dict[str, Any]:
    return {
        "kind": "table",
        "times": np.asarray(time).tolist(),
        "values": np.asarray(values).tolist(),
    }


def current_page(result: CurrentResult, date: str | None = None) -> Report:
    """Return the report: errors of every run, the paper's figures."""
    report = Report(
        "Predicted and measured current of the ballscrew actuator",
        "The paper prints its percentages and draws four runs; its signals were not published. "
        "Measured here means our virtual stand with a mismatch that the model does not know "
        "(friction law, magnets, screw, reassembly, load actuator, sensors). The percentages stand "
        "beside the published ones and are not the same experiment.",
        date=date,
    )
    compared = ReportTable(
        ("Runs", "Source", "Average [%]", "Maximum [%]", "Minimum [%]"),
        [list(row) for row in result.compared],
        "RMS error over the measured current's RMS about its mean; the paper does not define its "
        "percentage.",
        formats=("", "", ".2f", ".2f", ".2f"),
    )
    columns = (
        ("State", "state"),
        ("Assembly", "assembly"),
        ("Profile", "profile"),
        ("Load", "load"),
        ("Error [%]", "percent_rms"),
        ("Between corners [%]", "percent_between_corners"),
        ("Error [A]", "rms_a"),
    )
    report.section("Percent RMS error of the current").table(compared).table(
        table_of(result.rows, columns, "Every run.", folded="Every run")
    )
    for trace in result.traces:
        with new_figure(height=3.0) as (figure, axes):
            axes.plot(trace.time, trace.measured, color=GREY, lw=3.0, label="measured")
            axes.plot(trace.time, trace.predicted, color=ORANGE, lw=1.0, label="model")
            axes.set(xlabel="Time [s]", ylabel="Current [A]")
            axes.legend(loc="upper right", ncols=2)
        report.section(f"As Fig. {trace.figure}: {trace.title}").figure(
            figure, "Torque current of the virtual stand and of the model."
        )
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, f"nasa-current --seed {result.seed}", made)
