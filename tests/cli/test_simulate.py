"""`simulate`: the contract of its output, and every bad input."""

import os
import signal
import subprocess
import sys
import time
from functools import wraps
from pathlib import Path

import pytest

import elevon

RUN = ("simulate", "torino-rotary", "--duration", "20 ms")


def test_json_contract(elevon_cli):
    result = elevon_cli(*RUN, "--json")
    data = result.json
    assert data["status"] == "ok"
    assert data["sim_s"] == pytest.approx(0.02)
    assert data["steps"] == 20000
    assert data["wall_s"] > 0.0
    assert data["ns_per_step"] == pytest.approx(1e9 * data["wall_s"] / data["steps"])
    assert set(data["final"]) >= {"output_position", "motor_speed", "current_a"}
    assert data["out"] is None


def test_a_table_for_the_reader(elevon_cli):
    out = elevon_cli(*RUN).out
    assert "torino-rotary, high fidelity: ok" in out
    assert "output_position" in out


GEAR = ("simulate", "pisa-landing-gear", "--fidelity", "low")


def test_a_gear_shows_states_by_name_and_a_timeline(elevon_cli):
    """What a test engineer reads, recorded and printed without being requested."""
    out = elevon_cli(*GEAR).out
    assert "locked (7.0" in out
    assert "s after extend)" in out
    last = {line.split()[0]: line.split() for line in out.splitlines() if line.strip()}
    assert last["state"][-1] == "locked"
    assert last["fault_code"][-1] == "none"
    assert last["output_position"][1] == "mm"
    assert {"brake_released", "current_mean", "motor_speed", "supply_voltage"} <= set(last)


def test_a_gears_json_has_its_events(elevon_cli):
    events = elevon_cli(*GEAR, "--duration", "1 s", "--json").json["events"]
    assert [event["text"] for event in events] == ["command: extend", "extending", "brake open"]
    assert [set(event) for event in events] == [{"time_s", "signal", "text"}] * 3


@pytest.mark.parametrize("ending", [".parquet", ".nc", ".csv", ".mat"])
def test_out(elevon_cli, tmp_path, ending):
    out = tmp_path / f"run{ending}"
    data = elevon_cli(*RUN, "--out", out, "--json").json
    assert data["out"] == str(out)
    assert elevon.Recording.load(out).final["output_position"] == data["final"]["output_position"]


def test_csv_of_several_clocks_is_checked_before_simulating(elevon_cli, tmp_path, monkeypatch):
    arguments = (*RUN, "--record", "motor_speed@400 Hz", "--record", "current_q@1 kHz")
    result = elevon_cli(*arguments, "--out", tmp_path / "run.csv")
    assert result.code == 0
    assert "run.at_400_hz.csv" in result.err
    assert set(elevon.Recording.load(tmp_path / "run.csv").names) == {"motor_speed", "current_q"}
    for path in tmp_path.glob("run.at_400_hz*"):
        path.unlink()
    module = sys.modules["elevon.simulate"]

    @wraps(module.simulate)  # its signature gives the command its options; calling it fails
    def never(*_args, **_options):
        raise AssertionError("simulated")

    monkeypatch.setattr(module, "simulate", never)
    result = elevon_cli(*arguments, "--out", tmp_path / "run.csv")
    assert result.code == 2
    assert "run.at_1000_hz.csv: exists already" in result.err


@pytest.mark.parametrize("ending", [".png", ".html"])
def test_plot(elevon_cli, tmp_path, ending):
    plot = tmp_path / f"run{ending}"
    assert elevon_cli(*RUN, "--plot", plot).code == 0
    assert plot.stat().st_size > 1000


def test_seed_and_everything_else_reach_the_run(elevon_cli, tmp_path):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text('duration = "1 s"\n[[command.terms]]\nkind = "constant"\nvalue = "1 deg"\n')
    arguments = (
        "--scenario", scenario, "--set", "motor.inertia=9 kg cm2", "--set", "drive.kind=pwm",
        "--set", "control.noise_deviation=1e-5 rad", "--fault", "short@motor.phase_a=10 %",
        "--fidelity", "high", "--record", "output_position@100 Hz", "--record", "current_a@every",
    )  # fmt: skip
    first, same, other = (
        elevon_cli(*RUN, *arguments, "--seed", seed, "--json").json for seed in (1, 1, 2)
    )
    assert first["final"] == same["final"]
    assert first["final"] != other["final"]
    assert first["labels"][0]["severity"] == 0.1


def test_a_tripped_drive_is_a_result(elevon_cli):
    result = elevon_cli(*RUN, "--fault", "shorted_switch@inverter.a_high=1", "--json")
    assert result.code == 0
    assert result.json["status"] == "tripped"


BAD = {
    "unknown actuator": (("simulate", "torino-rotry"), "did you mean 'torino-rotary'"),
    "unknown path": ((*RUN, "--set", "motor.inertai=1"), "did you mean 'motor.inertia'"),
    "unknown unit": ((*RUN, "--set", "motor.inertia=1 kg cn2"), "did you mean 'kg cm2'"),
    "wrong kind": ((*RUN, "--set", "motor.inertia=1 N"), "expected an inertia"),
    "nan": ((*RUN, "--set", "motor.inertia=nan"), "not a finite number"),
    "negative inertia": ((*RUN, "--set", "motor.inertia=-1 kg cm2"), "outside (0, inf)"),
    "no turns": ((*RUN, "--set", "motor.turns_a=0"), "outside (0, 1]"),
    "too many turns": ((*RUN, "--set", "motor.turns_a=1.1"), "outside (0, 1]"),
    "zero step": ((*RUN, "--set", "solver.step=0"), "outside [1e-12, 1] s"),
    "step and electrical pole": ((*RUN, "--set", "solver.step=20 ms"), "electrical pole"),
    "step and relays": ((*RUN, "--set", "solver.step=100 us"), "relays: the current"),
    "step and contact": (
        (*RUN, "--set", "backlash.model=elastic", "--set", "backlash.stiffness=1e12"),
        "backlash.stiffness",
    ),
    "no value": ((*RUN, "--set", "motor.inertia"), "PATH=VALUE"),
    "twice": ((*RUN, "--set", "gear.ratio=1", "--set", "gear.ratio=2"), "given twice"),
    "unknown signal": (
        (*RUN, "--record", "output_positon@400 Hz"),
        "did you mean 'output_position'",
    ),
    "zero rate": ((*RUN, "--record", "output_position@0 Hz"), "must be positive"),
    "unit of the rate": ((*RUN, "--record", "output_position@400 rad/s"), "expected a frequency"),
    "rate that does not divide": ((*RUN, "--record", "output_position@300 Hz"), "nearest: 299.94"),
    "two rates": (
        (*RUN, "--record", "output_position@400 Hz", "--record", "output_position@100 Hz"),
        "requested twice",
    ),
    "too much": (
        ("simulate", "torino-rotary", "--duration", "1e9", "--record", "all@every"),
        "of memory",
    ),
    "fault": ((*RUN, "--fault", "short@motor.phase_d=0.1"), "places: motor.phase_a"),
    "severity": ((*RUN, "--fault", "short@motor.phase_a=2"), "outside [0, 0.95]"),
    "contradiction": (
        (*RUN, "--fault", "short@motor.phase_a=0.1", "--fault", "open_phase@motor.phase_a=1"),
        "contradict",
    ),
    "profile": ((*RUN, "--fault", "short@motor.phase_a=0.1:ramp(start=2,end=1)"), "ends before"),
    "fidelity": ((*RUN, "--fidelity", "hihg"), "did you mean 'high'"),
    "duration": (("simulate", "torino-rotary", "--duration", "0"), "longer than zero"),
    "short duration": (("simulate", "torino-rotary", "--duration", "1 ns"), "shorter than a step"),
    "seed": ((*RUN, "--seed", "-1"), "--seed"),
    "out ending": ((*RUN, "--out", "run.xlsx"), "ending"),
    "plot ending": ((*RUN, "--plot", "run.bmp"), "ending"),
    "out is a folder": ((*RUN, "--out", "folder.csv"), "is a folder"),
    "same file": ((*RUN, "--out", "a.csv", "--plot", "a.csv"), "ending"),
    "no scenario": ((*RUN, "--scenario", "absent.toml"), "cannot be read"),
    "scenario key": ((*RUN, "--scenario", "unknown.toml"), "did you mean 'duration'"),
    "scenario table": ((*RUN, "--scenario", "table.toml"), "times must increase"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input(elevon_cli, tmp_path, name):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "unknown.toml").write_text("duraton = 1\n")
    (tmp_path / "table.toml").write_text(
        "duration = 1\n[[command.terms]]\nkind = 'table'\ntimes = [0, 0]\nvalues = [1, 2]\n"
        "unit = 'deg'\n"
    )
    arguments, message = BAD[name]
    before = sorted(tmp_path.rglob("*"))
    result = elevon_cli(*arguments, "--json")
    assert result.code == 2
    assert message in result.err
    assert sorted(tmp_path.rglob("*")) == before


def test_existing_output_is_kept(elevon_cli, tmp_path):
    out = tmp_path / "run.csv"
    out.write_text("precious")
    result = elevon_cli(*RUN, "--out", out)
    assert result.code == 2
    assert "--force" in result.err
    assert out.read_text() == "precious"
    assert elevon_cli(*RUN, "--out", out, "--force").code == 0
    assert out.read_text() != "precious"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_output(elevon_cli, tmp_path):
    folder = tmp_path / "sealed"
    folder.mkdir(mode=0o500)
    result = elevon_cli(*RUN, "--out", folder / "run.csv")
    assert result.code == 2
    assert "not writable" in result.err


def test_output_in_a_place_that_cannot_be(elevon_cli, tmp_path):
    (tmp_path / "file").write_text("")
    result = elevon_cli(*RUN, "--out", tmp_path / "file" / "run.csv")
    assert result.code == 2
    assert "cannot make the folder" in result.err


def test_a_diverging_run_names_time_and_signal(elevon_cli, tmp_path):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(
        'duration = 1\n[[load.shaft.terms]]\nkind = "ramp"\nslope = "-1e9 N m/s"\n'
        "[parameters]\nstop.upper = 1e9\n"
    )
    out = tmp_path / "run.csv"
    result = elevon_cli("simulate", "torino-rotary", "--scenario", scenario, "--out", out, "--json")
    assert result.code == 1
    assert result.out == ""
    assert "motor_speed diverged at" in result.err
    assert not out.exists()


def start(*arguments, cwd):
    command = [sys.executable, "-m", "elevon.cli", *map(str, arguments)]
    return subprocess.Popen(
        command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


LONG = ("simulate", "torino-rotary", "--duration", "500", "--out", "run.parquet", "--json")


def underway(process):
    """Wait until the run is in the core: the core is loaded, and a second has passed."""
    maps = Path(f"/proc/{process.pid}/maps")
    while maps.exists() and "_core.abi3" not in maps.read_text():
        assert process.poll() is None
        time.sleep(0.1)
    time.sleep(1.0 if maps.exists() else 2.0)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGKILL, -9)])
def test_a_stopped_run_leaves_nothing(tmp_path, number, code):
    with start(*LONG, cwd=tmp_path) as process:
        underway(process)
        assert process.poll() is None
        process.send_signal(number)
        try:
            out, err = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == code, err
    assert out == ""
    assert list(tmp_path.iterdir()) == []
