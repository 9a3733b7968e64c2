"""Recordings that Elevon wrote: their scenario is their note, as docs/reference/logs.md says."""

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.diagnose.positions.log import prepared
from elevon.logs.read import read_log
from elevon.scenario import Scenario
from elevon.simulate import simulate

SIGNALS = "encoder_position,resolver_position,speed_ref,motor_speed,current_ref,current_q_meas"
SINE = {"kind": "sine", "amplitude": "7 deg", "frequency": "0.2 Hz"}
TRIANGLE = {"kind": "triangle", "amplitude": "5 deg", "frequency": "0.15 Hz"}
CHIRP = {
    "kind": "chirp", "amplitude": "1 deg", "start_frequency": "0.1 Hz", "end_frequency": "1 Hz",
    "sweep_time": "10 s",
}  # fmt: skip


@pytest.mark.parametrize(
    "terms", [[SINE], [TRIANGLE], [SINE, CHIRP]], ids=["sine", "triangle", "sum"]
)
def test_its_command_is_known_without_a_note(tmp_path, terms):
    unit, path = Actuator.load("torino-rotary"), tmp_path / "own.csv"
    scenario = Scenario.from_dict({"duration": 8, "command": {"mode": "position", "terms": terms}})
    recording = simulate(unit, scenario, fidelity="low", record=f"{SIGNALS},command@400 Hz")
    recording.save(path)
    item = prepared(read_log(path), unit)
    assert item.gain[0] == pytest.approx(unit.parameters.value("control.position_gain"), rel=5e-3)
    command = np.interp(item.time, recording["command"].time, recording["command"].values)
    # Within one sample's motion: the instant at which the command began is fitted to the log.
    step = float(np.abs(np.diff(command)).max())
    assert np.abs(item["command"] - command)[item.good].max() < step
