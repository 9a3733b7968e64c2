"""The documented commands for logs with few channels, from a logger's file to a validated set."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from elevon.cli.runner import run as elevon
from tests.calibrate.linear import Linear, log, square, sweep

PID = Linear(weight=60.0, reverse=1.2)


def write_csv(path, columns):
    names = list(columns)
    table = np.column_stack([columns[name] for name in names])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.6g")


@pytest.mark.long
def test_the_four_documented_commands(tmp_path, monkeypatch, capsys):
    """From a logger's file to a validated set; then a machine that has changed fails."""
    root = Path(__file__).resolve().parents[2]
    section = (
        (root / "docs" / "explanation" / "calibration.md")
        .read_text()
        .split("## Logs with few channels")[1]
        .split("\n## ")[0]
    )
    commands = [line[4:] for line in section.splitlines() if line.startswith("    elevon ")]
    assert len(commands) == 4
    monkeypatch.chdir(tmp_path)
    shutil.copy(root / "examples" / "linear-drive" / "drive.toml", tmp_path)
    worn = replace(PID, dry=2.5 * PID.dry)
    trials = {"squares": (PID, square), "sweep": (PID, sweep), "another": (PID, square)}
    for seed, (name, (bench, wave)) in enumerate({**trials, "worn": (worn, square)}.items()):
        write_csv(tmp_path / f"{name}.csv", log(bench, wave, 20.0, seed=seed))
    for command in commands:
        assert elevon([*command.split()[1:], "--json"]) == 0, command
        document = json.loads(capsys.readouterr().out)
    assert document["status"] == "pass"
    checked = commands[-1].replace("another", "worn").split()[1:]
    assert elevon([*checked, "--json"]) == 1
