"""The demonstration's page: what a person reads off it."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from elevon import Actuator
from elevon.calibrate.outcome import Calibration, by_path
from elevon.calibrate.validation import SIGNALS, ValidationTrace
from elevon.demo import page
from elevon.demo.page_parameters import errors_figure, parameters_section
from elevon.demo.results import Step
from elevon.estimate import Estimate
from elevon.report import Report


def row(path, unit, before, truth, value, half):
    low, high = value - half, value + half
    return {
        "path": path, "unit": unit, "before": before, "truth": truth, "value": value,
        "low": low, "high": high, "inside": low <= truth <= high,
    }  # fmt: skip


ROWS = [
    row("backlash.total", "rad", 0.00638, 0.0116009, 0.0116057, 1.4e-5),
    row("sensor.encoder.offset", "rad", 0.0, -0.0014901, -0.0014893, 4e-5),
    row("sensor.encoder.gain", "1", 1.0, 1.0, 0.9999986, 3.3e-6),
    row("derived.inertia", "kg m2", None, 0.00268796, 0.00267851, 1.3e-5),
    row("friction.viscous", "N m s/rad", 0.00334, 0.0038954, 0.0039013, 1e-6),
]
NOTES = {"derived.inertia": "all inertia on the motor shaft"}


@pytest.fixture(scope="module")
def demo():
    estimates = tuple(
        Estimate(
            r["value"], 1.0, interval=(r["low"], r["high"]), path=r["path"], unit=r["unit"],
            register="plant", old=r["before"], note=NOTES.get(r["path"], ""),
            in_set=r["path"] not in NOTES,
        )
        for r in ROWS
    )  # fmt: skip
    base = Actuator.load("torino-rotary")
    calibration = Calibration(
        actuator=base, before=base, logs=(), parameters=by_path(estimates), findings=("a finding",)
    )
    return SimpleNamespace(base=base, calibration=calibration)


def section(demo, rows):
    report = Report("t")
    parameters_section(report, demo, rows)
    items = report.sections[0].items
    table = next(item["table"] for item in items if item["kind"] == "table")
    cells = {r[0].split("\N{NO-BREAK SPACE}")[0]: r for r in table.rows}
    texts = [item["text"] for item in items if item["kind"] == "text"]
    points = [point for item in items if item["kind"] == "points" for point in item["points"]]
    return table, cells, texts, points


def test_values_stand_in_the_units_of_the_set_with_the_digits_of_their_interval(demo):
    table, cells, texts, points = section(demo, ROWS)
    space = "\N{NO-BREAK SPACE}"
    assert all(len(line) == len(table.columns) for line in table.rows)
    backlash = cells["backlash.total"]
    assert backlash[0] == f"backlash.total{space}[deg]"
    assert backlash[1:6] == [
        "0.3655", "0.6647", "0.6650", f"0.6642{space}to{space}0.6658", f"+0.04{space}%",
    ]  # fmt: skip
    assert cells["derived.inertia"][0].endswith(f"[kg{space}cm2]")
    assert cells["derived.inertia"][1] == ""
    assert cells["sensor.encoder.offset"][5].endswith(f"{space}deg")
    for line in cells.values():
        low, high = line[4].split(f"{space}to{space}")
        assert low != high
        assert "-" not in line[4]
        assert " " not in "".join(line)
    assert points == ["derived.inertia: all inertia on the motor shaft", "a finding"]
    assert "4 of 5 are inside" in texts[0]
    assert "bias" in texts[0]
    assert "bias" not in section(demo, [ROWS[0]])[2][0]


def test_nothing_of_the_errors_is_outside_the_figure(demo):
    rows = [r for r in ROWS if "offset" not in r["path"]]
    axes = errors_figure(rows).axes[0]
    low, high = axes.get_xlim()
    values = [x for line in axes.lines for x in np.atleast_1d(line.get_xdata())]
    assert low < min(values) < -40.0  # the published backlash
    assert max(values) < high
    labels = [text.get_text() for text in axes.get_yticklabels()]
    assert labels == [r["path"] for r in reversed(rows)]
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert [text.split(",")[0] for text in legend] == [
        "estimate",
        "truth outside",
        "published value",
    ]


def test_both_sides_of_a_logs_figure_have_their_units(demo):
    time = np.linspace(0.0, 20.0, 200)
    signals = {name: np.sin(time) for name in SIGNALS}
    trace = ValidationTrace("sine.csv", time, signals, signals, time >= 10.0)
    figure = page._trace_figure(trace, trace)
    units = [axes.get_ylabel()[axes.get_ylabel().index("[") :] for axes in figure.axes]
    assert units == ["[deg]", "[deg]", "[rpm]", "[rpm]", "[A]", "[A]"]


def test_the_times_say_which_steps_were_resumed():
    steps = [Step("one", 1.0), Step("two", 0.01, "kept from the interrupted run")]
    for used, columns in ((steps, 3), (steps[:1], 2)):
        report = Report("t")
        demo = SimpleNamespace(steps=used, seconds=sum(step.seconds for step in used))
        page.times_section(report, demo)
        table = report.sections[0].items[0]["table"]
        assert len(table.columns) == columns
        assert [line[0] for line in table.rows] == [*(step.name for step in used), "all"]
    assert "kept from the interrupted run" not in report.html()


def test_a_drift_that_nothing_tells_is_left_empty():
    found = {"method": "trigger", "offset_s": 0.5, "offset_std_s": 1e-3, "drift": 0.0,
             "drift_std": 2.9e-3}  # fmt: skip
    truth = {"trigger": 0.5, "cell": {"clock_drift": -1e-3}}
    imported = [
        SimpleNamespace(
            report=SimpleNamespace(
                synchronisation=found, findings=[SimpleNamespace(code=code)] * bool(code)
            )
        )
        for code in ("drift-unknown", "")
    ]
    logs = [{"name": name, "conditions": truth} for name in ("a", "b")]
    report = Report("t")
    page._clocks(report, SimpleNamespace(bench_truth={"logs": logs}, imported=imported))
    (table,) = (item["table"] for item in report.sections[0].items if item["kind"] == "table")
    assert table.rows[0][-2:] == [None, None]
    assert table.rows[1][-2:] == pytest.approx([0.0, 2900.0])
    assert not re.search(r"\bnan\b", report.html())
    assert math.isfinite(table.rows[1][2])
