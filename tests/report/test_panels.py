"""Charts of drawn figures: the same data, the drawing beside them for paper."""

import base64
import json
import re

import numpy as np
import pytest

from elevon.report import Check, Report, ReportTable
from elevon.report.figures import _INK, COLOURS, inline_svg, new_figure
from elevon.report.panels import columns_of, panels_of
from elevon.report.uplot import chart

X = np.linspace(0.0, 2.0, 50)


def _decoded(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


@pytest.fixture(scope="module")
def figure():
    """One figure of all kinds of marks, drawn once."""
    with new_figure(2, 2) as (figure, grid):
        (first, second), (third, fourth) = grid
        first.plot(X, np.sin(X), color=COLOURS["blue"], label="wave")
        first.fill_between(X, -1.0, 1.0, alpha=0.2, label="band")
        first.axvline(1.0, ls="--")
        first.set(title="Over time", xlabel="time [s]", ylabel="[A]")
        first.legend()
        second.barh(["one", "two", "three"], [1.0, -2.0, 3.0], label="bars")
        third.loglog(X[1:], X[1:] ** 2, "o--", color=COLOURS["blue"])
        third.axhspan(0.1, 0.2, color=COLOURS["green"])
        fourth.errorbar([1.0, 2.0, 3.0], [1.0, 4.0, 9.0], [0.1, 0.2, 0.3], fmt="s")
        fourth.plot([0.0, 1.0, 0.5], [0.0, 1.0, 2.0], label="loop")
        fourth.annotate("here", (2.0, 4.0), xytext=(4, 2), textcoords="offset points")
    inline_svg(figure, "x", "x")  # its layout is made where it is drawn
    return figure


@pytest.fixture(scope="module")
def panels(figure):
    return panels_of(figure, _INK)


def test_a_line_keeps_its_samples_and_its_look(panels):
    panel = panels[0]
    line = panel["series"][0]
    np.testing.assert_allclose(_decoded(line["time"], "<f8"), X, atol=1e-10)
    np.testing.assert_allclose(_decoded(line["values"], "<f4"), np.sin(X), atol=1e-6)
    assert (line["name"], line["colour"], line["dash"]) == ("wave", COLOURS["blue"], None)
    assert (panel["title"], panel["label"]) == ("Over time", ("time [s]", "[A]"))
    shapes = {item["kind"]: item for item in panel["shapes"]}
    assert shapes["upright"]["at"] == 1.0
    assert shapes["upright"]["dash"]
    assert shapes["area"]["name"] == "band"


def test_bars_logarithms_bars_of_errors_and_loops(panels):
    _, bars, logs, others = panels
    boxes = [item for item in bars["shapes"] if item["kind"] == "box"]
    assert [item["x"][1] for item in boxes] == [1.0, -2.0, 3.0]
    assert [item["name"] for item in boxes] == ["bars", "", ""]
    assert [text for _, text in bars["ticks"][1]] == ["one", "two", "three"]
    assert logs["log"] == [True, True]
    assert logs["series"][0]["name"] == "wave"  # by the colour, where another panel names it
    assert logs["series"][0]["marker"] == "o"
    assert next(i for i in logs["shapes"] if i["kind"] == "box")["x"] is None
    kinds = [item["kind"] for item in others["shapes"]]
    assert kinds.count("path") == 4  # three bars of errors, and the line that goes back
    assert next(i for i in others["shapes"] if i["kind"] == "text")["x"] == 2.0
    assert [item["name"] for item in others["shapes"] if item["name"]] == ["loop"]


def test_columns_and_heights_are_those_of_the_drawing(figure, panels):
    assert columns_of(figure) == 2
    assert all(panel["height"] >= 150 for panel in panels)


def test_peaks_of_a_long_line_stay():
    line = np.zeros(100_000)
    line[51_234] = 7.0
    with new_figure() as (figure, axes):
        axes.plot(line)
    values = _decoded(panels_of(figure, _INK)[0]["series"][0]["values"], "<f4")
    assert values.size <= 4000
    assert values.max() == 7.0


def test_a_matrix_stays_a_drawing():
    with new_figure() as (figure, axes):
        axes.imshow(np.eye(3))
    assert panels_of(figure, _INK) is None
    report = Report("Map")
    report.section("s").figure(figure, "c")
    assert "<svg" in report.html()
    assert "uPlot" not in report.html()


def test_legends_stand_off_the_curves(figure):
    axes = figure.axes[0]
    box = axes.get_legend().get_window_extent()
    assert box.x0 >= axes.get_window_extent().x1 or box.y0 >= axes.get_window_extent().y1


@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_chart_brings_its_drawing_with_its_extremes(logarithmic):
    line = np.ones(5000)
    line[1234] = 100.0
    html = chart("t", np.arange(1.0, 5001.0), {"a": line, "b": 2 * line}, logarithmic=logarithmic)
    drawn = re.findall(r'points="([^"]*)"', html)
    assert len(drawn) == 2
    heights = [float(pair.split(",")[1]) for pair in drawn[0].split()]
    assert max(heights) - min(heights) > 50.0


def test_holes_and_empty_lines_are_drawn_as_such():
    html = chart("t", [0, 1, 2, 3, 4], {"a": [1, 2, np.nan, 2, 1], "b": [np.nan] * 5})
    assert len(re.findall("<polyline", html)) == 2
    data = json.loads(re.search(r'json">(.*?)</script>', html, re.S)[1])
    assert [item["name"] for item in data["panels"][0]["series"]] == ["a", "b"]


def test_cells_carry_their_headings_for_narrow_pages():
    report = Report("t")
    section = report.section("s")
    section.table(ReportTable(["name", "of <b>", "unit"], [["a", 1.0, "deg"]]))
    section.table(ReportTable(["two", "columns"], [["a", "b"]])).checks([Check("c", 0.0, 1.0)])
    html = report.html()
    assert '<td data-of="of &lt;b&gt;" class="number">1.0000</td>' in html
    assert html.count('<table class="wide">') == 2


def test_the_verdict_is_a_badge():
    report = Report("t")
    report.judge("Faulty: <x>", "fail")
    assert '<span class="status fail">Faulty: &lt;x&gt;</span>' in report.html()
