"""A command noted in full: the grammar of scenario files, laid over a log."""

import json
import math

import numpy as np
import pytest

from elevon.errors import InputError
from elevon.logs.command.note import CommandNote, align_noted, noted_values, read_command_note
from elevon.logs.command.reconstruct import CommandTrace

FULL = """
brake = "off"
[[command.terms]]
kind = "chirp"
amplitude = "5 deg"
start_frequency = 0.1
end_frequency = 1.0
sweep_time = 10
[[command.terms]]
kind = "step"
initial = 0
final = "3 deg"
time = "4 s"
[[command.terms]]
kind = "table"
times = [0, 5, 10]
values = [0, 2, 0]
unit = "deg"
"""


def written(tmp_path, text, name="run_command.toml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_a_chirp_with_steps_and_a_table_is_noted_and_recovered(tmp_path):
    note = read_command_note(written(tmp_path, FULL))
    assert note.brake is False
    time = np.arange(0.0, 12.0, 0.01)
    table = np.interp(time, [0, 5, 10], np.radians([0, 2, 0]))
    only = read_command_note(
        written(tmp_path, FULL[FULL.rindex("[[command") :], "table_command.toml")
    )
    np.testing.assert_allclose(noted_values(only, "rad", time), table, atol=1e-15)
    assert noted_values(note, "rad", [3.9, 4.1]) @ [-1, 1] > math.radians(2)
    shifted = noted_values(note, "rad", time - 1.234)
    noise = 1e-4 * np.random.default_rng(0).normal(size=len(time))
    valid = np.abs(shifted) < math.radians(7)
    noted = align_noted(CommandTrace(time, shifted + noise, valid), note)
    assert noted.start == pytest.approx(1.234, abs=2e-4)
    assert noted.rms < 1.2e-4


def test_a_sequence_of_actions_and_what_the_metadata_keep(tmp_path):
    text = json.dumps(
        {"command": {"mode": "gear", "steps": [{"time": "0.1 s", "action": "extend"}]}}
    )
    note = read_command_note(written(tmp_path, text, "c.json"))
    assert note.command.steps[0].action == "extend"
    assert CommandNote.from_dict(note.to_dict(), "x").command == note.command
    with pytest.raises(InputError, match="no command of waveforms"):
        noted_values(note, "rad", [0.0])


REFUSED = {
    "key": ('[[command.terms]]\nkind = "sine"\namplitud = 1', "amplitud"),
    "kind": ('[[command.terms]]\nkind = "sinus"', "sine"),
    "both": (
        'waveform = "sine"\n[[command.terms]]\nkind = "constant"\nvalue = "1 deg"',
        "both state",
    ),
    "elsewhere": ('[[command.terms]]\nkind = "table"\nfile = "/etc/passwd"', "beside the note"),
    "many": (
        "command = {terms = [" + ",".join(['{kind = "constant", value = 1}'] * 1001) + "]}",
        "at most 1000",
    ),
    "deep": ("a = " + "[" * 40 + "]" * 40, "nested deeper"),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_bad_full_notes(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_command_note(written(tmp_path, text))
