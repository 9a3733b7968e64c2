"""A small plan, and the command line in this process."""

import json

import pytest

from elevon.cli import main

PLAN = """
actuator = "torino-rotary"
fidelity = "low"
record = "user_position,motor_speed@400 Hz"
{head}
[scenario]
duration = "10 ms"
[[scenario.command.terms]]
kind = "sine"
amplitude = "7 deg"
frequency = "2 Hz"
{terms}
[[vary]]
parameter = "friction.dynamic"
from = "0.2 N m"
to = "0.4 N m"
count = {count}
{tail}
"""


@pytest.fixture
def plan(tmp_path):
    """Write a plan of `count` runs of 10 ms; `head` and `tail` are further lines."""

    def write(count=12, head="runs_per_file = 4", tail="", terms="", name="plan.toml"):
        path = tmp_path / name
        path.write_text(PLAN.format(count=count, head=head, tail=tail, terms=terms))
        return path

    return write


@pytest.fixture
def cli(capsys):
    """Run a command with ``--json``; return exit code, object on stdout, text on stderr."""

    def run(*arguments, json_output=True):
        extra = ["--json"] if json_output else []
        code = main([str(item) for item in arguments] + extra)
        captured = capsys.readouterr()
        return code, json.loads(captured.out) if captured.out else None, captured.err

    return run
