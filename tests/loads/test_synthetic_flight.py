"""The example makes a flight that the readers accept and the actuator can fly."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from elevon.loads import read_flight

SCRIPT = Path(__file__).parents[2] / "examples" / "synthetic_flight.py"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(SCRIPT))


def test_the_written_file_reads_back(example, tmp_path):
    path = tmp_path / "flight.csv"
    example["write_flight"](path)
    flight = read_flight(path)
    made = example["synthetic_flight"]()
    np.testing.assert_allclose(flight.time, made[:, 0], atol=1e-9)
    np.testing.assert_allclose(flight.altitude, made[:, 1], rtol=1e-5)
    np.testing.assert_allclose(np.degrees(flight.deflection), made[:, 4], rtol=1e-5, atol=1e-9)


def test_the_load_suits_the_actuator(example, tmp_path):
    path = tmp_path / "flight.csv"
    example["write_flight"](path)
    table = example["ram_load"](path)
    assert np.abs(table.load).max() == 8750.0
    assert table.load.min() < 0.0 < table.load.max()
    rate = np.abs(np.diff(table.position) / np.diff(table.time)).max()
    assert rate < 0.12  # m/s, the upper speed of the published tests


def test_command_line(monkeypatch, tmp_path, capsys):
    path = tmp_path / "flight.csv"
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(path)])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    assert "1201 samples, 60 s" in capsys.readouterr().out
    assert path.exists()
