"""What of examples/matlab runs in GNU Octave: recordings in, logs out, the command line."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from elevon import Recording

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(shutil.which("octave-cli") is None, reason="GNU Octave is not installed"),
]
HERE = Path(__file__).resolve().parents[2] / "examples" / "matlab"


def octave(folder, text):
    """Run a text in a folder; return what it printed, failed or not."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["octave-cli", "--norc", "--path", HERE, "--eval", text],
        cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_recording_goes_to_octave_and_back_without_a_bit_lost(tmp_path):
    done = octave(tmp_path, "round_trip")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "201 samples, output_position in rad",
        "greatest difference: 0",
    ]
    first, again = (Recording.load(tmp_path / name) for name in ("run.mat", "again.mat"))
    np.testing.assert_array_equal(again.role("torque_current").values, first["current_q"].values)


def test_what_does_not_fit_is_an_error_with_the_reason(tmp_path):
    for text, words in (
        ("elevon_command('simulate', 'torino-rotry')", "torino-rotary"),
        ("x = 1; save('-v7', 'x.mat', 'x'); elevon_read('x.mat')", "is no recording of Elevon"),
        ("elevon_write('l.mat', struct('motor_speed', 1))", "a log needs its time"),
        ("elevon_write('l.mat', struct('time', [0; 1], 'motor_speed', 1))", "2 numbers are needed"),
    ):
        done = octave(tmp_path, text)
        assert done.returncode == 1
        assert words in done.stderr
    assert not (tmp_path / "l.mat").exists()


def test_every_file_is_read_by_the_parser(tmp_path):
    """Those for MATLAB alone as well."""
    for file in sorted(HERE.glob("*.m")):
        done = octave(tmp_path, f"__parse_file__('{file}'); disp('parsed')")
        assert (done.returncode, done.stdout) == (0, "parsed\n"), done.stderr
