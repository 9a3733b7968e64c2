"""What a notebook shows: every fact, escaped, well formed, with nothing to load."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import elevon
from elevon.report.cards import Html, card, sparkline, table

SCENARIO = {
    "duration": "50 ms",
    "text": "a < b & c",
    "command": {"terms": [{"kind": "sine", "amplitude": "7 deg", "frequency": "5 Hz"}]},
    "load": {"output": {"terms": [{"kind": "constant", "value": "3 N m"}]}},
    "fault": ["short@motor.phase_a=0.1:step(time=10 ms)"],
    "parameters": {"motor.inertia": "9 kg cm2"},
}


def _text(html):
    """The text of a view; it must be well-formed markup without scripts, styles or links."""
    tree = ElementTree.fromstring(html)
    tags = {item.tag.rpartition("}")[2] for item in tree.iter()}
    assert not tags & {"script", "style", "link", "img", "a", "iframe"}
    return " ".join(tree.itertext())


@pytest.fixture(scope="module")
def recording():
    record = ["output_position,motor_speed@1 kHz", "current_q@2 kHz"]
    return elevon.simulate("torino-rotary", SCENARIO, record=record)


def test_a_recording_shows_status_clocks_units_and_curves(recording):
    html = recording._repr_html_()
    text = _text(html)
    for word in ("ok", "torino-rotary", "at_1000_hz", "at_2000_hz", "deg", "rpm", *recording.names):
        assert word in text
    assert html.count("<polyline") == len(recording)
    assert f"{np.rad2deg(recording['output_position'].values[-1]):.5g}" in text


def test_an_actuator_shows_every_parameter_with_its_unit_and_source():
    actuator = elevon.Actuator.load("torino-rotary").with_values({"motor.inertia": "9 kg cm2"})
    text = _text(actuator._repr_html_())
    assert "9 kg cm2" in text
    assert all(path in text and item.source in text for path, item in actuator.parameters.items())


def test_a_scenario_shows_command_loads_and_faults():
    text = _text(elevon.Scenario.from_dict(SCENARIO)._repr_html_())
    for word in (
        "0.05 s",
        "a < b & c",
        "sine(amplitude=7 deg",
        "load: output",
        "short@motor.phase_a",
    ):
        assert word in text
    assert "motor.inertia" in text


def test_names_are_offered_behind_a_bracket(recording):
    assert recording._ipython_key_completions_() == recording.names
    parameters = elevon.Actuator.load("torino-rotary").parameters
    assert "motor.inertia" in parameters._ipython_key_completions_()


def test_text_is_escaped_and_html_is_not():
    html = card("<b>", [("", "<i>")], table(["&"], [["<td>"], [Html("<em>x</em>")], [None]]))
    assert _text(html).split() == ["<b>", "<i>", "&", "<td>", "x"]


def test_a_sparkline_keeps_its_extremes_and_its_gaps():
    line = np.zeros(10_000)
    line[5_000] = 1.0
    points = sparkline(line).partition('points="')[2].partition('"')[0]
    heights = [float(point.split(",")[1]) for point in points.split()]
    assert min(heights) == pytest.approx(2.0)  # the one sample's peak, at the upper edge
    line[2_000:3_000] = np.nan
    assert sparkline(line).count("<polyline") == 2
    assert sparkline([1.0]) == sparkline(np.full(9, np.nan)) == ""
    assert sparkline(np.ones(9)).count("<polyline") == 1


def test_a_calibration_shows_its_intervals_and_what_it_cannot_tell():
    from elevon.calibrate.outcome import calibration_card
    from elevon.estimate import Estimate

    actuator = elevon.Actuator.load("torino-rotary")
    value, interval = 7.913e-4, (7.85e-4, 7.98e-4)
    item = Estimate(
        value, 4e-6, interval=interval, path="motor.inertia", unit="kg m2", register="plant",
        old=7.7e-4,
    )  # fmt: skip
    html = calibration_card(actuator, ["a.csv"], [item], {"backlash.total": "no reversal"})
    text = _text(html)
    for word in ("torino-rotary", "a.csv", "motor.inertia", "kg cm2", "7.7", "backlash.total"):
        assert word in text
    assert "7.91 7.85 7.98" in text
    assert "no reversal" in text
