"""`elevon loads`: from a flight's file to a table or a scenario that runs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.loads import FlightData, HingeMoment, flight_load

FLIGHT = """time [s],altitude [m],true_airspeed [m/s],angle_of_attack [deg],deflection [deg]
0,1000,100,2,0
1,1000,100,2,5
2,1000,100,2,-10
"""
SURFACE = ["--area", "0.5 m2", "--chord", "400 mm", "--c-delta", "-0.4"]


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """A flight of three samples."""
    path = tmp_path / "flight.csv"
    path.write_text(FLIGHT)
    return path


def test_a_flight_becomes_a_scenario_that_runs(
    flight: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The largest load is the rating; position = arm times deflection; the file is a scenario."""
    out = flight.with_suffix(".toml")
    options = ["--actuator", "nasa-ballscrew", "--arm", "100 mm", "--out", str(out), "--json"]
    assert main(["loads", str(flight), *SURFACE, *options]) == 0
    found = json.loads(capsys.readouterr().out)
    assert max(map(abs, found["load"])) == pytest.approx(8750.0)
    assert found["position"] == pytest.approx([-0.1 * np.radians(10), 0.1 * np.radians(5)])
    scenario = elevon.Scenario.load(out)
    rec = elevon.simulate(
        elevon.Actuator.load("nasa-ballscrew"), scenario, fidelity="low", record="command@100 Hz"
    )
    assert rec["command"].values[-1] == pytest.approx(-0.1 * np.radians(10), rel=1e-3)


def test_a_table_names_its_units(flight: Path) -> None:
    """CSV for a turning actuator: N m and rad."""
    out = flight.with_name("table.csv")
    options = ["--actuator", "torino-rotary", "--limit", "1 N m", "--out", str(out)]
    assert main(["loads", str(flight), *SURFACE, *options]) == 0
    lines = out.read_text().splitlines()
    assert lines[0] == "time [s],load [N m],position [rad],dynamic_pressure [Pa],mach [1]"
    assert max(abs(float(line.split(",")[1])) for line in lines[1:]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--out", "x.txt"], "must end in"),
        (["--out", "x.csv"], "--arm"),
        (["--out", "x.csv", "--arm", "2 m"], "stop.lower"),
        (["--out", "x.csv", "--arm", "0.1 m", "--limit", "5 N", "--unscaled"], "exclude"),
    ],
)
def test_what_cannot_be_is_named(
    flight: Path, options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit 2 and the place."""
    given = [str(flight.parent / o) if o.startswith("x.") else o for o in options]
    assert main(["loads", str(flight), *SURFACE, "--actuator", "nasa-ballscrew", *given]) == 2
    assert words in capsys.readouterr().err


def test_a_measured_density_takes_the_place_of_the_standard_one() -> None:
    """q = rho v^2 / 2 with true airspeed; the Mach number follows the density's temperature."""
    common = {
        "time": np.array([0.0, 1.0]),
        "altitude": np.zeros(2),
        "airspeed": np.full(2, 100.0),
        "airspeed_kind": "true",
        "angle_of_attack": np.zeros(2),
        "deflection": np.array([0.0, 0.1]),
    }
    surface = HingeMoment(area=1.0, chord=1.0, c_delta=-1.0)
    table = flight_load(FlightData(**common, air_density=np.full(2, 1.0)), surface)  # type: ignore[arg-type]
    assert table.dynamic_pressure == pytest.approx(5000.0)
    assert table.mach == pytest.approx(100.0 / np.sqrt(1.4 * 101325.0 / 1.0))
    with pytest.raises(elevon.InputError, match="air_density"):
        flight_load(
            FlightData(**common, air_density=np.ones(2)),  # type: ignore[arg-type]
            surface,
            temperature_offset=10.0,
        )
