"""Every example runs as its reader would run it."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from elevon.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

SAYS = {
    "first_run.py": "greatest position: 6.",
    "short_in_a_phase.py": "shorted: ripple of the q voltage",
    "many_runs.py": "play@transmission=0.9 deg lost motion",
}


@pytest.mark.parametrize("name", SAYS)
def test_script(name, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", EXAMPLES / name],
        cwd=tmp_path,
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert SAYS[name] in done.stdout


def test_notebook(tmp_path, monkeypatch):
    """Every cell runs, and what it ends with can be shown as a notebook shows it."""
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((EXAMPLES / "first_hour.ipynb").read_text("utf-8"))
    names, shown = {}, []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"], "a committed notebook has no outputs"
            shown += _run_cell("".join(cell["source"]), names)
    views = [item._repr_html_() for item in shown if hasattr(item, "_repr_html_")]
    assert len(views) >= 4
    assert shown[-1] is True  # the file gives back every bit


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
