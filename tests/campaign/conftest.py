"""A small plan, and the command line in this process."""

import json

import pytest

from elevon.cli import main

PLAN = """
actuator = "torino-rotary"
fidelity = "low"
{head}
[scenario]
duration = "10 ms"
[[scenario.command.terms]]
kind = "sine"
amplitude = "7 deg"
frequency = "2 Hz"
{terms}
{vary}
{tail}
"""

VARY = """
[[vary]]
parameter = "friction.dynamic"
from = "0.2 N m"
to = "0.4 N m"
count = {count}
"""


@pytest.fixture
def plan(tmp_path):
    """Write a plan of `count` frictions (0: none), 10 ms each, with further lines."""

    def write(count=12, head="runs_per_file = 4", tail="", terms="", name="plan.toml", bare=False):
        path = tmp_path / name
        vary = VARY.format(count=count) if count else ""
        head = head if bare else f'record = "output_position,motor_speed@400 Hz"\n{head}'
        path.write_text(PLAN.format(vary=vary, head=head, tail=tail, terms=terms))
        return path

    return write


@pytest.fixture
def cli(capsys):
    """Run a command with ``--json``; return exit code, object on stdout, text on stderr."""

    def run(*arguments, json_output=True):
        extra = ["--json"] if json_output else []
        code = main([str(item) for item in arguments] + extra)
        captured = capsys.readouterr()
        report = json.loads(captured.out) if captured.out and json_output else captured.out
        return code, report or None, captured.err

    return run
