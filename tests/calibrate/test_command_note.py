"""The position gain from a command that the operator noted in full."""

import json
import math
from dataclasses import replace

import pytest

from elevon.calibrate import read_logs
from elevon.calibrate.kinematics import command_fit
from tests.calibrate.foreign import CHIRP, Trial, draw, run
from tests.calibrate.foreign_files import Style, write_trial


class Summed(Trial):
    """A sine and a chirp at once: no single waveform explains it."""

    def command(self, time):
        slow = Trial("sine", {"amplitude": 5.0, "bias": 2.0, "frequency": 0.13})
        return slow.command(time) + replace(CHIRP).command(time)


TERMS = [
    {"kind": "sine", "amplitude": "5 deg", "bias": "2 deg", "frequency": "0.13 Hz"},
    {"kind": "chirp", "amplitude": "2 deg", "bias": "8 deg", "start_frequency": "0.1 Hz",
     "end_frequency": "4 Hz", "sweep_time": "20 s"},
]  # fmt: skip


def test_a_sum_noted_in_full_gives_the_position_gain(tmp_path):
    bench, sensors = draw(11, {"position_gain": 1900.0})
    done = run(bench, sensors, Summed("chirp", CHIRP.values), 11, duration=12.0, start=0.8)
    path = write_trial(tmp_path / "summed.csv", done, sensors, Style(), 11)
    note = {"brake": "off", "current": "rms", "command": {"mode": "position", "terms": TERMS}}
    path.with_name("summed_command.json").write_text(json.dumps(note))
    log = read_logs([path])[0]
    fit = command_fit(log, 2066.7, 52.36)
    assert fit is not None
    assert fit.waveform.kind == "noted"
    assert fit.gain == pytest.approx(1900.0, rel=0.01)
    assert math.isnan(fit.amplitude)
