"""The first picture of a run: tracking on top, error, current, speed, faults and states named."""

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.recording.plot import bands, overview, spectrum_panels
from tests.recording.make import ordinary

SCENARIO = {
    "duration": "3 s",
    "command": {"terms": [{"kind": "sine", "amplitude": "7 deg", "frequency": "0.5 Hz"}]},
}


@pytest.fixture(scope="module")
def healthy():
    return elevon.simulate("torino-rotary", SCENARIO, fidelity="low")


@pytest.fixture(scope="module")
def faulty():
    faults = [
        "backlash@transmission=1 deg:step(time=1 s)",
        "short@motor.phase_a=0.2:step(time=2 s)",
    ]
    return elevon.simulate("torino-rotary", {**SCENARIO, "fault": faults}, fidelity="low")


def test_command_against_output_then_error_current_speed(healthy):
    panels = overview(healthy)
    assert [(p.title, p.unit) for p in panels] == [
        ("position", "deg"),
        ("error", "deg"),
        ("current", "A"),
        ("speed", "rpm"),
    ]
    position, error, _, _ = panels
    assert list(position.lines) == ["command", "motor_position / 124", "output_position"]
    difference = healthy["command"].values - healthy["output_position"].values
    assert next(iter(error.lines.values())) == pytest.approx(np.rad2deg(difference))
    motor, output = position.lines["motor_position / 124"], position.lines["output_position"]
    assert np.abs(motor - output).max() < 0.5  # on one scale, apart by the backlash


def test_a_speed_command_is_held_against_the_speed():
    command = {"mode": "speed", "terms": [{"kind": "constant", "value": "300 rpm"}]}
    run = elevon.simulate("nasa-ballscrew", {"duration": "0.2 s", "command": command})
    panels = {panel.title: panel for panel in overview(run)}
    assert "command - motor_speed" in panels["error"].lines
    assert panels["position"].unit == "mm"
    assert "command" in panels["speed"].lines
    assert "command" not in panels["position"].lines


def test_faults_are_named_with_their_severity_and_time(faulty):
    backlash, short = bands(faulty)
    assert (backlash.text, backlash.kind) == ("backlash@transmission = 1 deg", "fault")
    assert (backlash.start, backlash.end) == pytest.approx((1.0, 3.0), abs=0.01)
    assert short.text == "short@motor.phase_a = 0.2"
    assert short.start == pytest.approx(2.0, abs=0.01)


def test_states_of_a_control_unit_are_named():
    run = elevon.simulate("pisa-landing-gear", fidelity="low")
    names = [band.text for band in bands(run) if band.kind == "state"]
    assert names[0] == "unconfirmed"
    assert "extending" in names
    assert [panel.title for panel in overview(run)] == ["position", "current", "speed"]
    figure = run.plot()
    assert {text.get_text() for text in figure.axes[0].texts} >= set(names)


def test_a_spectrum_shows_a_sine_at_its_height():
    time = np.arange(4000) / 1000
    values = {"command": 0 * time, "output_position": 0.01 * np.sin(2 * np.pi * 50 * time)}
    recording = elevon.Recording.build(time, values, {"command": "rad", "output_position": "rad"})
    (spectrum,) = spectrum_panels(overview(recording))
    line = next(iter(spectrum.lines.values()))
    assert spectrum.time[np.argmax(line)] == pytest.approx(50.0, abs=0.3)
    assert line.max() == pytest.approx(np.rad2deg(0.01), rel=0.02)


def test_another_run_is_drawn_over_it(healthy, faulty, tmp_path):
    path = healthy.save(tmp_path / "healthy.parquet")
    figure = faulty.plot(compare=path, spectra=True)
    titles = [axis.get_ylabel().split(" [")[0] for axis in figure.axes]
    assert titles[:4] == ["position", "error", "current", "speed"]
    assert titles[4:] == [f"spectrum of the {name}" for name in ("error", "current", "speed")]
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    other = lines["output_position (healthy.parquet)"]
    assert other.get_linestyle() == "--"
    assert other.get_ydata() == pytest.approx(np.rad2deg(healthy["output_position"].values))


def test_named_channels_and_what_has_no_command_stand_by_unit(faulty):
    assert overview(ordinary()) == []
    figure = faulty.plot(["motor_speed", "current_q"])
    assert [axis.get_ylabel() for axis in figure.axes] == ["[rpm]", "[A]"]


def test_command_line(tmp_path, capsys):
    healthy, page = tmp_path / "healthy.parquet", tmp_path / "both.html"
    run = ["simulate", "torino-rotary", "--duration", "0.5", "--fidelity", "low"]
    assert main([*run, "--out", str(healthy)]) == 0
    fault = ["--fault", "short@motor.phase_a=0.3:step(time=0.2 s)"]
    assert main([*run, *fault, "--plot", str(page), "--compare", str(healthy), "--spectra"]) == 0
    text = page.read_text("utf-8")
    assert "output_position (healthy.parquet)" in text
    assert "short@motor.phase_a = 0.3: 0.2 to 0.5 s" in text
    assert "spectrum of the current" in text
    assert main([*run, "--compare", str(healthy)]) == 2
    assert "--plot" in capsys.readouterr().err
    missing = ["--plot", str(tmp_path / "x.png"), "--compare", str(tmp_path / "none.parquet")]
    assert main([*run, *missing]) == 2
    assert not (tmp_path / "x.png").exists()
