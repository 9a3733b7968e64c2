import base64
import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elevon import Channel, Clock, Recording
from elevon.errors import InputError, OutputExistsError, UnitError, UnknownNameError
from elevon.report.thinning import thinned
from elevon.report.uplot import assets, chart, page
from tests.recording.make import ordinary


def _specs(html):
    found = re.findall(r'<script type="application/json">(.*?)</script>', html, re.S)
    return [json.loads(text)["panels"][0] for text in found]


def _floats(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def test_picture(tmp_path):
    path = ordinary().plot(path=tmp_path / "a.png")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_size > 20_000


def test_figure_has_a_panel_for_each_unit_and_clock_in_degrees_and_rpm():
    figure = ordinary().plot()
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "[deg] (drive)",
        "[rpm] (drive)",
        "[N] (cell)",
    ]
    assert figure.axes[0].lines[0].get_ydata()[-1] == pytest.approx(np.degrees(np.sin(399 / 400)))
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_gaps_interrupt_the_line():
    line = ordinary().plot(["force"]).axes[0].lines[0]
    assert np.flatnonzero(np.isnan(line.get_xdata())).tolist() == [3]


def test_units_can_be_chosen():
    figure = ordinary().plot(["output_position"], units={"output_position": "rad"})
    assert figure.axes[0].get_ylabel() == "[rad]"
    with pytest.raises(UnitError):
        ordinary().plot(["output_position"], units={"output_position": "m"})
    with pytest.raises(UnknownNameError):
        ordinary().plot(["output_position"], units={"output_positoin": "deg"})


def test_page_is_self_contained_and_carries_the_data(tmp_path):
    html = ordinary().plot(path=tmp_path / "a.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in html
    assert not re.search(r'(?:src|href)\s*=\s*["\']?(?!data:)', html.split("<body>")[1])
    assert "Permission is hereby granted" in html
    position, speed, force = _specs(html)
    assert position["label"][1] == "[deg]"
    np.testing.assert_array_equal(
        _floats(position["series"][0]["time"], "<f8"), np.arange(400) / 400
    )
    np.testing.assert_allclose(
        _floats(position["series"][0]["values"], "<f4"),
        np.degrees(np.sin(np.arange(400) / 400)),
        rtol=1e-6,
    )
    assert speed["series"][0]["name"] == "motor_speed"
    assert (
        len(_floats(force["series"][0]["time"], "<f8")) == 6
    )  # five samples and the hole of the gap
    assert np.isnan(_floats(force["series"][0]["values"], "<f4")[3])


@pytest.mark.parametrize(
    "hostile",
    ["</script><script>alert(1)</script>", "<img src=x onerror=alert(1)>", "a & \"b\" 'c'"],
)
def test_every_text_is_escaped(tmp_path, hostile):
    recording = ordinary().with_meta(actuator=hostile)
    html = recording.plot(path=tmp_path / "a.html").read_text()
    html += chart(hostile, [0, 1], {hostile: [0, 1]}, x_label=hostile, note=hostile)
    html = html.replace(assets(), "")
    assert "<img" not in html
    assert "<script>alert" not in html
    assert _specs(html)[-1]["series"][0]["name"] == hostile


def test_plot_refuses_other_endings_overwriting_and_nothing(tmp_path):
    with pytest.raises(UnknownNameError, match=r"\.png"):
        ordinary().plot(path=tmp_path / "a.gif")
    with pytest.raises(UnknownNameError):
        ordinary().plot(["nothing"])
    with pytest.raises(InputError, match="nothing to plot"):
        Recording([]).plot()
    ordinary().plot(path=tmp_path / "a.html")
    with pytest.raises(OutputExistsError):
        ordinary().plot(path=tmp_path / "a.html")
    ordinary().plot(path=tmp_path / "a.html", force=True)


def test_a_title_with_a_dollar_is_text(tmp_path):
    ordinary().plot(path=tmp_path / "a.png", title="5 $ and 6 $_")


def test_empty_channels_plot(tmp_path):
    recording = Recording([Channel("x", "1", [], Clock("main", []))])
    recording.plot(path=tmp_path / "a.png")
    recording.plot(path=tmp_path / "a.html")


def test_the_library_is_there_once_and_small():
    assert 40_000 < len(assets()) < 70_000
    assert page("t", chart("a", [0], {"x": [1]}) * 2).count("new uPlot(") == 1


@given(st.integers(1, 400), st.integers(4, 60), st.integers(0, 2**32 - 1), st.floats(0.0, 0.5))
def test_thinning_keeps_the_extremes_and_the_order_of_time(count, most, seed, missing):
    generator = np.random.default_rng(seed)
    time = np.cumsum(generator.uniform(0.1, 1.0, count))
    line = generator.normal(size=count)
    line[generator.uniform(size=count) < missing] = np.nan
    displayed, kept = thinned(time, {"x": line}, most)
    assert displayed.size <= max(most, count if count <= most else 0)
    assert (np.diff(displayed) >= 0).all()
    finite = line[np.isfinite(line)]
    if finite.size:
        assert np.nanmax(kept["x"]) == finite.max()
        assert np.nanmin(kept["x"]) == finite.min()
