"""Every example runs as its reader would run it."""

import ast
import json
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from elevon import Actuator
from elevon.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

SAYS = {
    "first_run.py": "greatest position: 6.",
    "short_in_a_phase.py": "shorted: ripple of the q voltage",
    "own_variant.py": "light.toml reaches 4.5 deg after",
    "batch_to_pandas.py": "(200, 52) {'backlash': 1.0",
    "own_controller.py": "0.09",
    "many_runs.py": "backlash@transmission=0.9 deg lost motion",
}


@pytest.mark.parametrize("name", SAYS)
def test_script(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    assert SAYS[name] in capsys.readouterr().out


TASKS = [*SAYS, "bench_to_set.sh", "foreign_csv.sh"]


@pytest.mark.parametrize("name", TASKS)
def test_a_task_is_short(name):
    lines = (EXAMPLES / name).read_text("utf-8").splitlines()
    longest = 22 if name in ("many_runs.py", "short_in_a_phase.py") else 15
    assert len([line for line in lines if line.strip() and not line.startswith("#")]) <= longest


def _shell(name, folder, *arguments):
    """Run a shell script with this environment's `elevon`."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["sh", EXAMPLES / name, *arguments],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.long
def test_from_the_bench_to_a_validated_set(tmp_path):
    done = _shell("bench_to_set.sh", tmp_path)
    assert done.returncode == 0, done.stderr
    fitted = Actuator.load(tmp_path / "unit.toml").parameters
    assert fitted["friction.dynamic"].value == pytest.approx(0.36, rel=0.02)  # nobody told it
    assert "after 10 s; pass" in done.stdout + done.stderr


@pytest.mark.long
def test_from_a_foreign_csv_to_a_validated_set(tmp_path):
    from tests.calibrate.test_closed_loop import PID, log, square, sweep, write_csv

    shutil.copy(EXAMPLES / "linear-drive" / "drive.toml", tmp_path)
    trials = {"squares": square, "sweep": sweep, "another": square}
    for seed, (name, demand) in enumerate(trials.items()):
        write_csv(tmp_path / f"{name}.csv", log(PID, demand, 20.0, seed=seed))
    done = _shell("foreign_csv.sh", tmp_path, *(f"{name}.csv" for name in trials))
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("pass")


def test_notebook(tmp_path, monkeypatch):
    """Every cell runs, and what it ends with can be shown as a notebook shows it."""
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((EXAMPLES / "first_hour.ipynb").read_text("utf-8"))
    names, figures = {}, []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"], "a committed notebook has no outputs"
            figures += _run_cell("".join(cell["source"]), names)
    views = [item._repr_html_() for item in figures if hasattr(item, "_repr_html_")]
    assert len(views) >= 4
    assert figures[-1] is True  # the file gives back every bit


def _run_cell(source, names):
    """Run a cell; return the value of its last expression, if it ends with one."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    return (
        [] if last is None else [eval(compile(ast.Expression(last.value), "cell", "eval"), names)]
    )


def test_own_actuator_and_scenario(capsys):
    actuator, scenario = EXAMPLES / "own_actuator.toml", EXAMPLES / "sine_with_short.toml"
    arguments = ["simulate", actuator, "--scenario", scenario, "--duration", "0.1", "--json"]
    assert main([str(item) for item in arguments]) == 0
    assert '"actuator": "torino-large-rotor"' in capsys.readouterr().out


def test_campaign_plan(tmp_path):
    assert (
        main(["campaign", "run", str(EXAMPLES / "campaign.toml"), "--out", str(tmp_path / "runs")])
        == 0
    )


@pytest.mark.parametrize(
    ("name", "status", "code"),
    [
        ("interruption-50ms", "ok", 0.0),
        ("surge", "ok", 0.0),
        ("interruption-200ms", "tripped", 14.0),
        ("dip", "tripped", 0.0),
    ],
)
def test_transients_of_the_landing_gears_supply(name, status, code, tmp_path, capsys):
    """Each ends locked; what ended a motion stands in the message."""
    path = EXAMPLES / "landing-gear" / f"{name}.toml"
    assert main(["simulate", "pisa-landing-gear", "--scenario", str(path), "--fidelity", "low",
                 "--json"]) == 0  # fmt: skip
    answer = json.loads(capsys.readouterr().out)
    assert answer["status"] == status
    assert answer["final"]["locked"] == 1.0
    assert answer["final"]["fault_code"] == code
    assert ("extend" in (answer["message"] or "")) is (status == "tripped")
