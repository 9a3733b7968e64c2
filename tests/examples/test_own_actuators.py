"""Actuators made by `elevon new`: from their few numbers to a backlash that is named."""

import json
from pathlib import Path

import pytest

from elevon import Actuator
from elevon.bench.procedure import scaled_procedure
from elevon.cli import main
from elevon.parameters import load_set

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "own-actuators"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_each_is_one_page_that_passes_its_check(name, capsys):
    path = FOLDER / f"{name}.toml"
    lines = path.read_text("utf-8").splitlines()
    assert len([line for line in lines if line and not line.startswith("#")]) <= 40
    assert main(["check", str(path)]) == 0
    assert capsys.readouterr().out.startswith(f"{path}: 0 errors, 0 warnings")


@pytest.mark.parametrize("name", NAMES)
def test_its_torque_constant_follows_its_supply(name, tmp_path):
    path = FOLDER / f"{name}.toml"
    given = Actuator.load(path)
    text = path.read_text("utf-8")
    supply = given.design["supply"].text
    half = tmp_path / "half.toml"
    half.write_text(text.replace(f'supply = "{supply}"', f'supply = "{float(supply[:-2]) / 2} V"'))
    changed = Actuator.load(half)
    for at in ("motor.emf_constant", "control.torque_constant"):
        assert changed.parameters.value(at) == pytest.approx(given.parameters.value(at) / 2)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "backlash"),
    [("linear-drive-28v", "0.1 mm"), ("robot-joint", "0.2 deg"), ("valve", "0.5 deg")],
)
def test_from_its_numbers_to_the_answer(name, backlash, tmp_path, monkeypatch, capsys):
    """Bench, calibration on its own logs, a healthy day, one with backlash: as the page says."""
    monkeypatch.chdir(tmp_path)
    file = str(FOLDER / f"{name}.toml")
    Path("bench.toml").write_text(scaled_procedure(load_set(file)))

    def bench(out, seed, *options):
        words = ["bench", "run", "bench.toml", "--actuator", file, "--out", out, "--seed", seed]
        assert main([*words, *options]) == 0

    def diagnosis(day):
        capsys.readouterr()
        words = ["diagnose", f"{day}/sine.csv", "--actuator", "unit.toml", "--json"]
        assert main([*words, "--baseline", "healthy/sine.csv"]) == 0
        return json.loads(capsys.readouterr().out)

    bench("healthy", "1")
    logs = [str(path) for path in sorted(Path("healthy").glob("*.csv"))]
    assert main(["calibrate", *logs, "--actuator", file, "--out", "unit.toml"]) == 0
    bench("day", "2")
    bench("today", "4", "--fault", f"backlash@transmission={backlash}")
    assert diagnosis("day")["status"] == "healthy"
    answer = diagnosis("today")
    assert answer["status"] == "faulty"
    assert "backlash@transmission" in [f"{f['kind']}@{f['place']}" for f in answer["faults"]]
