"""A report as it is read: wide and narrow, light and dark, on paper, without scripts."""

import numpy as np
import pytest

from elevon.report import Check, Report, ReportTable
from elevon.report.figures import new_figure
from tests.live.browser import browser, needs_browser

pytestmark = [pytest.mark.long, needs_browser]

X = np.linspace(0.0, 2.0, 400)
VISIBLE = "getComputedStyle(document.querySelector('{}')).display !== 'none'"
ZOOMED = "[...document.querySelectorAll('.panel > button')].map(b => !b.hidden)"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    report = Report("Read in a browser", "One sentence.")
    report.judge("Faulty: a@b", "fail")
    section = report.section("Signals")
    with new_figure(2, 1, sharex=True) as (figure, axes):
        axes[0].plot(X, np.sin(9 * X), label="healthy", lw=3)
        axes[0].plot(X, np.sin(9 * X + 0.2), label="faulty")
        axes[0].fill_between(X, -1, 1, alpha=0.2, label="band")
        axes[1].plot(X, X**2)
        axes[1].set(xlabel="time [s]")
        axes[0].legend()
    section.figure(figure, "Two panels of one abscissa.")
    section.chart("A chart", X, {"one": X, "two": -X}, shaded=[(0.5, 1.0, "fault", True)])
    columns = ["feature", "value", "healthy", "deviates by", "explained", "what is said of it"]
    words = "a_name_that_is_long_and_has_no_blank_in_it"
    section.table(ReportTable(columns, [[words, 1.0, 2.0, 3.0, 4.0, "many words " * 9]] * 4))
    section.checks([Check("a check", 1.0, 2.0, "deg")])
    return report.save(tmp_path_factory.mktemp("page") / "report.html")


@pytest.fixture(scope="module")
def run():
    with browser() as run:
        yield run


def _opened(run, path, **options):
    page = run.new_page(**options)
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)
    page.goto(path.as_uri(), timeout=120_000)
    page.wait_for_timeout(300)
    return page, complaints


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 820, 1280])
def test_nothing_is_cut_and_nothing_fails(run, path, width, theme):
    page, complaints = _opened(
        run, path, viewport={"width": width, "height": 3000}, color_scheme=theme
    )
    assert page.locator(".elevon-chart[data-ready]").count() == 2
    assert page.locator("canvas").count() == 3
    assert not complaints
    sides = page.evaluate(
        "[...document.querySelectorAll('td, .panel, h1, p')].map(e => e.getBoundingClientRect())"
        ".map(r => [r.left, r.right])"
    )
    assert all(0 <= left <= right <= width for left, right in sides)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()


def test_a_zoom_moves_all_panels_of_one_abscissa_and_goes_back(run, path):
    page, _ = _opened(run, path, viewport={"width": 1280, "height": 2000})
    assert page.evaluate(ZOOMED) == [False] * 3
    box = page.locator(".u-over").first.bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 100, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, middle, steps=4)
    values = page.locator(".u-legend").nth(1).inner_text()
    page.mouse.up()
    page.wait_for_timeout(100)
    assert "--" not in values  # the cursor is there in the other panels, too
    assert page.evaluate(ZOOMED) == [True] * 3
    page.evaluate("document.querySelector('.panel > button').click()")
    page.wait_for_timeout(100)
    assert page.evaluate(ZOOMED)[0] is False
    page.close()


def test_paper_and_a_reader_without_scripts_have_the_drawings(run, path):
    page, _ = _opened(run, path)
    assert not page.evaluate(VISIBLE.format(".elevon-chart > svg"))
    page.emulate_media(media="print")
    assert page.evaluate(VISIBLE.format(".elevon-chart > svg"))
    assert not page.evaluate(VISIBLE.format(".panels"))
    page.close()
    context = run.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(path.as_uri())
    assert page.locator(".elevon-chart > svg").first.is_visible()
    assert page.locator(".elevon-chart > svg").nth(1).is_visible()
    context.close()
