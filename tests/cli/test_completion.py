"""Completion as a person meets it: installed by the option, in a real shell on a terminal."""

import contextlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from elevon.cli.registry import commands as entries
from elevon.cli.runner import app

pexpect = pytest.importorskip("pexpect")

SHELLS = ["bash", *(pytest.param(name, marks=pytest.mark.long) for name in ("zsh", "fish"))]
PROGRAM = Path(sys.executable).parent
KEYS = re.compile(
    r"\x1b\][^\x07\x1b]*(\x07|\x1b\\)|\x1b[\[(][0-9;?>=]*[A-Za-z]|\x1b[=>78]|[\r\x07\x08]"
)

# What is typed before the tab key, and what stands on the line or is listed after it.
LINES = {
    "elevon sim": "elevon simulate",
    "elevon simulate torino-r": "torino-rotary",
    "elevon simulate torino-rotary --set motor.iner": "motor.inertia=",
    "elevon simulate torino-rotary --set drive.kind=hyst": "drive.kind=hysteresis",
    "elevon simulate torino-rotary --fault shorted": "shorted_switch@",
    "elevon simulate torino-rotary --fault demagnetisation@": "demagnetisation@motor",
    "elevon simulate torino-rotary --record output_position,motor_sp": (
        "output_position,motor_speed"
    ),
    "elevon simulate torino-rotary --scenario my_sc": "my_scenario.toml",
    "elevon calibrate --actuator nasa-b": "nasa-ballscrew",
}


@pytest.fixture(params=SHELLS)
def shell(request, tmp_path):
    """A shell with a home of its own, in which completion was installed as the help says."""
    name = request.param
    if shutil.which(name) is None:
        pytest.skip(f"no {name} here")
    (tmp_path / "my_scenario.toml").write_text("duration = 1\n")
    environment = {
        **{key: value for key, value in os.environ.items() if not key.startswith("XDG_")},
        "HOME": str(tmp_path),
        "ZDOTDIR": str(tmp_path),
        "PATH": f"{PROGRAM}{os.pathsep}{os.environ['PATH']}",
        "TERM": "xterm",
        "PS1": "$ ",
    }
    (tmp_path / ".zshrc").write_text("PROMPT='$ '\n")

    done = subprocess.run(
        [name, "-i", "-c", "elevon --install-completion; true"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert f"{name} completion installed" in done.stdout, done.stdout + done.stderr
    terminal = pexpect.spawn(
        name,
        cwd=str(tmp_path),
        env=environment,
        encoding="utf-8",
        timeout=30,
        dimensions=(60, 200),
    )
    yield terminal
    terminal.close(force=True)


def test_the_tab_key_completes(shell):
    shell.sendline("echo rea''dy")
    shell.expect("ready")
    for typed, wanted in LINES.items():
        shell.send(typed + "\t")
        _wait_for(shell, wanted)
        shell.send("\x03")
        shell.sendline("echo ne''xt")
        shell.expect("next")


def _wait_for(shell, wanted):
    """Read until the completed word stands there; zsh only loads the function at the first tab."""
    seen = ""
    for _ in range(6):
        with contextlib.suppress(pexpect.TIMEOUT):
            while wanted not in KEYS.sub("", seen):
                seen += shell.read_nonblocking(4096, timeout=10)
        if wanted in KEYS.sub("", seen):
            return
        shell.send("\t")
    raise AssertionError(f"{wanted!r} was not offered: {KEYS.sub('', seen)[-300:]!r}")


def test_a_command_does_not_offer_to_install():
    group = typer.main.get_command(app)
    for name in entries():
        names = {item.name for item in group.get_command(None, name).params}
        assert not names & {"install_completion", "show_completion"}


def test_groups_name_their_commands(capsys):
    from elevon.cli import main

    assert main(["reproduce", "xx"]) == 2
    errors = capsys.readouterr().err
    assert "torino-backlash" in errors
    assert "nasa-baseline" in errors
    assert main(["reproduce", "nasa-basline"]) == 2
    assert "Did you mean nasa-baseline" in capsys.readouterr().err
    assert main(["bench", "rnu"]) == 2
    assert "Did you mean run?" in capsys.readouterr().err
