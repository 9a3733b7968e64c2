"""Plans, folders, resuming, and every plan that cannot be."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.campaign import check as check_module
from elevon.campaign import execute, load_plan, load_run, read_manifest, resolve_plan
from elevon.cli import main
from elevon.errors import FormatError, InputError

HEAD = (
    'actuator = "torino-rotary"\nfidelity = "low"\nrecord = "output_position,motor_speed@400 Hz"\n'
)
SCENARIO = """
[scenario]
duration = "0.2 s"
[[scenario.command.terms]]
kind = "sine"
amplitude = "7 deg"
frequency = "2 Hz"
"""
SHORTS = '[[vary]]\nfault = "short@motor.phase_a"\nvalues = [0, 0.1, "20 %"]\n'
FRICTION = '[[vary]]\nparameter = "friction.dynamic"\nfrom = "0.2 N m"\nto = "0.4 N m"\ncount = 3\n'
RANDOM = """
[random]
count = 8
seed = 3
[[random.draw]]
parameter = "motor.winding_temperature"
from = "20 degC"
to = "80 degC"
[[random.draw]]
fault = "backlash@transmission"
from = "0.01 deg"
to = "1 deg"
spacing = "log"
probability = 0.5
"""


@pytest.fixture
def write(tmp_path):
    def make(*parts):
        path = tmp_path / "plan.toml"
        path.write_text("".join(parts))
        return path

    return make


def planned(path):
    return resolve_plan(*load_plan(path))


def run(path, out, capsys=None):
    code = main(["campaign", "run", str(path), "--out", str(out), "--json"])
    return code, capsys.readouterr() if capsys else None


def test_runs_are_all_combinations(write):
    runs = planned(write(HEAD, "seeds = [1, 2]\n", SCENARIO, SHORTS, FRICTION, RANDOM))
    assert len(runs) == 2 * 3 * 3 * 8
    rows = [runs.values(number) for number in range(len(runs))]
    assert {row["friction.dynamic"] for row in rows} == {0.2, 0.30000000000000004, 0.4}
    assert {row["short@motor.phase_a"] for row in rows} == {0.0, 0.1, 0.2}
    temperatures = {row["motor.winding_temperature"] for row in rows}
    assert len(temperatures) == 8
    assert 293.15 <= min(temperatures) < max(temperatures) <= 353.15
    item = runs.run(100)
    assert item.actuator.parameters["friction.dynamic"].value == rows[100]["friction.dynamic"]


def test_draws_fill_their_ranges_and_leave_some_faults_out(write):
    runs = planned(write(HEAD, SCENARIO, RANDOM.replace("count = 8", "count = 64")))
    backlashes = np.array([runs.values(n)["backlash@transmission"] for n in range(64)])
    present = np.degrees(backlashes[backlashes > 0.0])
    assert 25 <= len(present) <= 39
    assert 0.01 <= min(present) < 0.03 < 0.5 < max(present) <= 1.0 + 1e-12
    assert np.median(present) == pytest.approx(0.1, rel=0.6)
    assert [len(runs.run(n).scenario.fault) for n in range(64)] == list(
        (backlashes > 0.0).astype(int)
    )


@pytest.mark.parametrize("method", ["latin_hypercube", "sobol", "halton", "uniform"])
def test_draws_repeat(write, method):
    path = write(HEAD, SCENARIO, RANDOM.replace("seed = 3", f'seed = 3\nmethod = "{method}"'))
    first, second = planned(path), planned(path)
    assert [first.values(n) for n in range(8)] == [second.values(n) for n in range(8)]


def test_splits_keep_seeds_of_one_draw_together(write):
    split = "[split]\ntrain = 0.75\ntest = 0.25\n"
    runs = planned(write(HEAD, "seeds = [1, 2]\n", SCENARIO, RANDOM, split))
    split = list(runs.index.split)
    assert split.count("train") == 12
    assert split[::2] == split[1::2]


def test_cases_change_several_things(write):
    cases = (
        '[[case]]\nname = "healthy"\n[[case]]\nname = "worn"\n'
        'faults = ["backlash@transmission=0.1 deg", "friction@transmission=0.2"]\n'
        'parameters = { "motor.winding_temperature" = "60 degC" }\n'
        'scenario = { duration = "0.1 s" }\n'
    )
    runs = planned(write(HEAD, SCENARIO, cases))
    assert not runs.run(0).scenario.fault
    assert [str(f) for f in runs.run(1).scenario.fault][1] == "friction@transmission=0.2"
    assert runs.run(1).scenario.seconds == 0.1
    assert runs.run(1).actuator.parameters["motor.winding_temperature"].value == 333.15


def test_a_batch_is_its_single_runs(write, tmp_path):
    path = write(HEAD, "seeds = [1, 2]\n", SCENARIO, SHORTS)
    assert run(path, tmp_path / "out")[0] == 0
    runs = planned(path)
    for number in range(len(runs)):
        item = runs.run(number)
        alone = elevon.simulate(
            item.actuator,
            item.scenario,
            fidelity="low",
            record="output_position,motor_speed@400 Hz",
            seed=item.seed,
            number=number,
        )
        kept = load_run(tmp_path / "out", number)
        assert kept.labels == alone.labels
        assert kept.names == alone.names
        assert kept.final == alone.final
        for name in alone.names:
            assert kept[name].values.tobytes() == alone[name].values.tobytes()
            assert kept[name].unit == alone[name].unit
        assert kept.clocks["at_400_hz"].equals(alone.clocks["at_400_hz"])
        assert kept.meta["status"] == "ok"


def test_the_folder_tells_everything(write, tmp_path, capsys):
    path = write(HEAD, SCENARIO, SHORTS, "[split]\ntrain = 1.0\n")
    out = tmp_path / "out"
    code, captured = run(path, out, capsys)
    summary = json.loads(captured.out)
    assert code == 0
    assert (summary["runs"], summary["status"], summary["counts"]) == (3, "ok", {"ok": 3})
    assert "3 runs in 1 block(s)" in captured.err
    assert (out / "plan.toml").read_text() == path.read_text()
    manifest = read_manifest(out)
    for block in manifest.blocks:
        for name, about in block["files"].items():
            data = (out / name).read_bytes()
            assert hashlib.sha256(data).hexdigest() == about["sha256"]
    assert {"output_position", "short@motor.phase_a"} <= {
        column["name"] for column in manifest.clocks[0]["columns"]
    }
    assert (summary["failed"], summary["bytes_per_run"] > 0.0) == (0, True)
    assert summary["runs_per_hour"] == pytest.approx(3 * 3600 / summary["wall_s"])


def test_blocks_hold_as_many_runs_as_the_plan_says(write, tmp_path):
    many = '[[vary]]\nparameter = "friction.dynamic"\nfrom = 0.1\nto = 0.3\ncount = 60\n'
    path = write(HEAD, "runs_per_file = 50\n", SCENARIO.replace("0.2 s", "10 ms"), many)
    assert run(path, tmp_path / "out")[0] == 0
    blocks = read_manifest(tmp_path / "out").blocks
    assert [(block["first"], block["last"]) for block in blocks] == [(0, 49), (50, 59)]
    assert load_run(tmp_path / "out", 59).meta["run"] == 59


def test_a_diverged_run_is_marked_and_the_rest_is_kept(write, tmp_path, capsys):
    load = (
        '[[scenario.load.shaft.terms]]\nkind = "ramp"\nslope = 0\n'
        '[[vary]]\nscenario = "load.shaft.terms[0].slope"\nvalues = [0, "-1e9 N m/s"]\n'
    )
    path = write(HEAD, SCENARIO, load, "[parameters]\nstop.upper = 1e9\n")
    code, captured = run(path, tmp_path / "out", capsys)
    summary = json.loads(captured.out)
    assert code == 1
    assert summary["status"] == "failed"
    assert summary["failed_runs"] == [1]
    assert load_run(tmp_path / "out", 0).meta["status"] == "ok"
    assert "motor_speed diverged" in load_run(tmp_path / "out", 1).meta["message"]


def test_going_on_does_only_what_is_missing(write, tmp_path, capsys):
    path = write(HEAD, "runs_per_file = 1\n", SCENARIO, SHORTS)
    out = tmp_path / "out"
    run(path, out, capsys)
    whole = {file.name: file.read_bytes() for file in (out / "runs").rglob("*.parquet")}
    (out / "runs" / "at_400_hz" / "block_00001.parquet").unlink()
    _, captured = run(path, out, capsys)
    assert json.loads(captured.out)["skipped"] == 2
    assert {f.name: f.read_bytes() for f in (out / "runs").rglob("*.parquet")} == whole


def test_a_killed_batch_goes_on(write, tmp_path):
    scenario = SCENARIO.replace("0.2 s", "100 s")
    path = write(HEAD, "runs_per_file = 1\n", "seeds = [1, 2, 3, 4]\n", scenario, SHORTS)
    out = tmp_path / "out"
    command = [sys.executable, "-m", "elevon.cli", "campaign", "run", str(path)]
    command += ["--out", str(out)]
    for number, code in ((signal.SIGKILL, -9), (signal.SIGINT, 130)):
        before = len(list(out.rglob("block_*.parquet")))
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ
        )
        for _ in range(400):
            if len(list(out.rglob("block_*.parquet"))) > before or process.poll() is not None:
                break
            time.sleep(0.02)
        process.send_signal(number)
        process.communicate(timeout=20)
        assert process.returncode in (code, 0)
        assert all(item.intact(out) for item in elevon.load_campaign(out).items)
    assert run(path, out)[0] == 0
    frame = elevon.load_campaign(out).runs.to_pandas()
    assert list(frame.run) == list(range(12))
    assert set(frame.status) == {"ok"}
    assert sorted(set(elevon.load_campaign(out).signals.to_pandas(["run"]).run)) == list(range(12))


def test_another_plan_is_refused(write, tmp_path, capsys):
    out = tmp_path / "out"
    run(write(HEAD, SCENARIO, SHORTS), out, capsys)
    code, captured = run(write(HEAD, SCENARIO, FRICTION), out, capsys)
    assert code == 2
    assert captured.out == ""
    assert "holds another campaign" in captured.err


def test_a_folder_of_something_else_is_refused(write, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.txt").write_text("precious")
    code, captured = run(write(HEAD, SCENARIO), out, capsys)
    assert code == 2
    assert "is not a campaign folder" in captured.err
    assert [file.name for file in out.iterdir()] == ["thesis.txt"]


def test_damaged_manifest(tmp_path):
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(FormatError, match="damaged"):
        read_manifest(tmp_path)
    (tmp_path / "manifest.json").write_text('{"schema": 99}')
    with pytest.raises(FormatError, match="form"):
        read_manifest(tmp_path)


def test_a_plan_that_does_not_fit_says_how_much(write, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(check_module, "available_bytes", lambda: 30_000)
    path = write(HEAD, SCENARIO.replace("0.2 s", "10 s"), SHORTS)
    code, captured = run(path, tmp_path / "out", capsys)
    assert code == 2
    assert "would take" in captured.err
    assert "30 kB available" in captured.err
    assert "all 3 runs" in captured.err
    assert not (tmp_path / "out").exists()


REFUSED = {
    "no runs": (HEAD + "seeds = []\n" + SCENARIO, "the plan is empty"),
    "seed": (HEAD + "seeds = [1, -1]\n" + SCENARIO, "seeds.*greater than or equal to 0"),
    "no draws": (HEAD + SCENARIO + RANDOM.replace("count = 8", "count = 0"), "plan is empty"),
    "no cases": (HEAD + "case = []\n" + SCENARIO, "the plan is empty"),
    "no values": (HEAD + SCENARIO + '[[vary]]\nparameter = "gear.ratio"\nvalues = []\n', "empty"),
    "unknown key": (HEAD + "fidelty = 1\n" + SCENARIO, "did you mean 'fidelity'"),
    "unknown actuator": (HEAD.replace("torino-rotary", "torino-rotry"), "did you mean"),
    "unknown fidelity": (HEAD.replace('"low"', '"lo"') + SCENARIO, "did you mean 'low'"),
    "no actuator": (SCENARIO, "actuator: is missing"),
    "two targets": (
        HEAD + SCENARIO + SHORTS.replace("fault", 'parameter = "gear.ratio"\nfault'),
        "exactly one of",
    ),
    "fault form": (HEAD + SCENARIO + SHORTS.replace("@", "-"), "KIND@PLACE"),
    "unknown fault": (HEAD + SCENARIO + SHORTS.replace("short", "sort"), "did you mean 'short'"),
    "unknown place": (HEAD + SCENARIO + SHORTS.replace("phase_a", "phase_d"), "places: motor"),
    "severity": (HEAD + SCENARIO + SHORTS.replace('"20 %"', "2"), "run 2: .*outside"),
    "unknown parameter": (
        HEAD + SCENARIO + FRICTION.replace("friction.dynamic", "friction.dynamik"),
        "did you mean 'friction.dynamic'",
    ),
    "range and list": (HEAD + SCENARIO + FRICTION + "values = [1]\n", "either 'values'"),
    "two units": (HEAD + SCENARIO + FRICTION.replace("0.4 N m", "400 N mm"), "in one unit"),
    "wrong unit": (HEAD + SCENARIO + FRICTION.replace("N m", "N"), "expected a torque"),
    "log of zero": (
        HEAD + SCENARIO + FRICTION.replace("0.2 N m", "0 N m") + 'spacing = "log"\n',
        "above zero",
    ),
    "twice": (HEAD + SCENARIO + SHORTS + SHORTS, "varied twice"),
    "split": (HEAD + SCENARIO + "[split]\ntrain = 0.5\n", "add up to 1"),
    "sobol": (
        HEAD + SCENARIO + RANDOM.replace("count = 8", 'count = 9\nmethod = "sobol"'),
        "nearest: 8 or 16",
    ),
    "probability": (
        HEAD + SCENARIO + RANDOM.replace('to = "80 degC"', 'to = "80 degC"\nprobability = 0.5'),
        "belongs to a fault",
    ),
    "place": (
        HEAD + SCENARIO + '[[vary]]\nscenario = "command.terms[3].phase"\nvalues = [1]\n',
        "no entry 3",
    ),
    "place form": (
        HEAD + SCENARIO + '[[vary]]\nscenario = "command/terms"\nvalues = [1]\n',
        "is not a place",
    ),
    "place key": (
        HEAD + SCENARIO + '[[vary]]\nscenario = "comand.mode"\nvalues = ["speed"]\n',
        "did you mean 'command'",
    ),
    "contradiction": (
        HEAD + SCENARIO + SHORTS + SHORTS.replace("short", "open_phase"),
        "contradict",
    ),
    "signal": (
        HEAD.replace("output_position", "output_positon") + SCENARIO,
        "did you mean 'output_pos",
    ),
    "rate": (HEAD.replace("400 Hz", "300 Hz") + SCENARIO, "nearest"),
    "block": (HEAD + "runs_per_file = 0\n" + SCENARIO, "greater than or equal to 1"),
    "no scenario file": (HEAD + 'scenario = "absent.toml"\n', "cannot be read"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_before_anything_is_written(write, tmp_path, capsys, name):
    text, message = REFUSED[name]
    code, captured = run(write(text), tmp_path / "out", capsys)
    assert code == 2
    assert captured.out == ""
    with pytest.raises(InputError, match=message):
        raise InputError(captured.err)
    assert not (tmp_path / "out").exists()


def test_two_campaigns_of_one_plan_are_equal_to_the_byte(plan, cli, tmp_path):
    """Times, threads and the folder's name stand in the journal alone, and nothing reads it."""
    path = plan(6, tail="[split]\nfit = 0.5\ncheck = 0.5")
    folders = [tmp_path / "one", tmp_path / "another" / "two"]
    for folder, threads in zip(folders, ("1", "2"), strict=True):
        assert cli("campaign", "run", path, "--out", folder, "--threads", threads)[0] == 0
    contents = [
        {f.relative_to(folder): f.read_bytes() for f in folder.rglob("*") if f.is_file()}
        for folder in folders
    ]
    logs = [files.pop(Path("campaign.log")) for files in contents]
    assert contents[0] == contents[1]
    assert str(folders[1]).encode() in logs[1]
    (folders[0] / "campaign.log").write_bytes(b"\xff nonsense")
    assert cli("campaign", "run", path, "--out", folders[0])[1]["skipped"] == 6
    (folders[0] / "campaign.log").unlink()
    assert cli("dataset", "verify", folders[0])[0] == 0


def test_the_end_sweeps_seals_and_verifies(plan, cli, tmp_path, monkeypatch):
    """What a killed worker left is removed; a file that nothing lists makes exit 1."""
    path, out = plan(6), tmp_path / "out"
    real = execute.finish

    def finish(work):
        outcome = real(work)
        (out / "ends" / ".block_00000.0123456789ab.part.parquet").write_bytes(b"half")
        return outcome

    monkeypatch.setattr(execute, "finish", finish)
    assert cli("campaign", "run", path, "--out", out)[0] == 0
    assert not list(out.rglob("*.part.parquet"))
    assert cli("dataset", "verify", out)[0] == 0
    (out / "ends" / "stray.parquet").write_bytes(b"a stranger")
    code, report, err = cli("campaign", "run", path, "--out", out)
    assert (code, report) == (1, None)
    assert "is finished, but not whole: files that the manifest does not list" in err
    assert "stray.parquet" in err
