"""Reports: escaped, self-contained, the same bytes each time, and honest about failures."""

import re
from html.parser import HTMLParser

import pytest
from markupsafe import Markup

from elevon.errors import OutputExistsError
from elevon.report import Check, Report, ReportTable, all_passed
from elevon.report.figures import COLOURS, new_figure, on_white, save_figure

HOSTILE = '<script>alert("x")</script>&amp;'


class _Page(HTMLParser):
    """Collects every element with its attributes, and the text outside style elements."""

    def __init__(self, html):
        super().__init__()
        self.elements, self.texts = [], []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.texts.append(data)


def _figure():
    with new_figure() as (figure, axes):
        axes.plot([0, 1], [0, 1], label=HOSTILE)
        axes.set(title=HOSTILE, xlabel="Time [s]")
        axes.legend()
    return figure


def _report(title="Title", value=0.5):
    report = Report(title, HOSTILE, date="2024-02-29")
    report.fact(HOSTILE, HOSTILE, HOSTILE)
    section = report.section(HOSTILE, HOSTILE)
    section.table(ReportTable([HOSTILE, "number"], [[HOSTILE, 1.0], ["b", 2.5]], HOSTILE))
    section.points([HOSTILE]).code(HOSTILE)
    section.figure(_figure(), HOSTILE)
    section.checks([Check(HOSTILE, value, 1.0, HOSTILE)])
    report.provenance({HOSTILE: HOSTILE})
    return report


def test_hostile_text_stays_text():
    page = _Page(_report(HOSTILE).html())
    scripts = [attrs for tag, attrs in page.elements if tag == "script"]
    assert [attrs for attrs in scripts if attrs.get("type") == "application/json"]
    assert "<script>alert" not in _report(HOSTILE).html()
    # Everywhere it was put it can be read as it was: title twice, lead, fact, section, ...
    assert sum(HOSTILE in text for text in page.texts) >= 12


def test_nothing_is_fetched():
    html = _report().html()
    page = _Page(html)
    for tag, attrs in page.elements:
        for name in ("src", "href", "xlink:href", "action", "data"):
            value = attrs.get(name) or "#"
            assert value.startswith("#"), (tag, name, value)
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)


def test_same_report_same_bytes():
    assert _report().html() == _report().html()


def test_two_figures_do_not_share_names():
    report = Report("Two figures")
    section = report.section("Figures")
    section.figure(_figure(), "one").figure(_figure(), "two")
    html = report.html()
    identifiers = [attrs["id"] for _, attrs in _Page(html).elements if "id" in attrs]
    assert len(identifiers) > 20
    assert len(identifiers) == len(set(identifiers))
    used = re.findall(r'url\(#([^)]*)\)|xlink:href="#([^"]*)"', html)
    assert {one or other for one, other in used} <= set(identifiers)


def test_charts_bring_their_script_once_and_only_when_there_are_any():
    report = Report("Charts")
    report.section("One").chart(HOSTILE, [0.0, 1.0, 2.0], {HOSTILE: [1.0, 2.0, 1.5]})
    report.section("Two").chart("second", [0.0, 1.0], {"a": [1.0, 2.0]})
    html = report.html()
    assert html.count("new uPlot(") == 1
    assert html.count('class="elevon-chart"') == 2
    scripts = [attrs for tag, attrs in _Page(html).elements if tag == "script"]
    assert not any("src" in attrs for attrs in scripts)
    assert "<script>alert" not in html
    plain = Report("No charts")
    plain.section("Text", "words")
    assert "uPlot" not in plain.html()


def test_status_follows_the_checks():
    assert _report(value=0.5).status == "pass"
    failed = _report(value=1.5)
    assert failed.status == "fail"
    assert 'class="status fail"' in failed.html()
    assert "0 of 1 checks pass" in failed.html()
    assert Report("No checks").status is None


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("at_least", [False, True])
def test_a_check_of_no_number_fails(value, at_least):
    assert not Check("x", value, 0.0, at_least=at_least).passed


def test_no_checks_is_not_a_pass():
    assert not all_passed([])


def test_plain_text_is_no_markup():
    with pytest.raises(TypeError, match="Markup"):
        Report("x").section("y").markup("<b>z</b>")


def test_saved_whole_and_never_over_another(tmp_path):
    path = _report().save(tmp_path / "report.html")
    assert path.read_text("utf-8").endswith("</html>")
    with pytest.raises(OutputExistsError):
        _report().save(path)
    _report().save(path, force=True)
    assert [item.name for item in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize("ending", ["svg", "png"])
def test_figure_files_have_dark_ink(tmp_path, ending):
    path = save_figure(_figure(), tmp_path / f"figure.{ending}")
    data = path.read_bytes()
    if ending == "svg":
        text = data.decode()
        assert "#010203" not in text
        assert COLOURS["blue"] in text
        assert "Time [s]" in text
    else:
        assert data.startswith(b"\x89PNG")
    short, long = ([[k, "x"] for k in range(n)] for n in (20, 21))
    page = Report("t")
    page.section("s").table(ReportTable(["a", "b"], short))
    assert "<details>" not in page.html()
    page.section("more").table(ReportTable(["a", "b"], long))
    html = page.html()
    assert html.count("<details>") == 1
    assert "Table of 21 rows: a, b" in html
    assert "beforeprint" in html


def test_pages_of_one_folder_link_to_each_other(tmp_path):
    (tmp_path / "other.html").write_text("<title>not ours</title>")
    Report("First <page>").save(tmp_path / "a b.html")
    Report("Second").save(tmp_path / "second.html")
    html = (tmp_path / "second.html").read_text("utf-8")
    assert '<a href="a%20b.html">First &lt;page&gt;</a>' in html
    assert "other.html" not in html
    assert "Beside this page" not in (tmp_path / "a b.html").read_text("utf-8")
    first = (tmp_path / "a b.html").read_bytes()
    Report("First <page>").save(tmp_path / "a b.html", force=True, links=False)
    assert (tmp_path / "a b.html").read_bytes() == first


def test_a_drawing_of_its_own_is_an_svg_file():
    """Also one that a page would take as it is."""
    picture = on_white(Markup('<svg viewBox="0 0 1 1"><g/></svg>'))
    assert picture.startswith("<svg ")
    assert '<rect width="100%" height="100%" fill="#ffffff"/><g/>' in picture
