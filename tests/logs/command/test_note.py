"""Command notes: in many spellings, and what is refused."""

import math

import pytest

from elevon.errors import InputError, UnitError
from elevon.logs.command.note import read_command_note

SINE = '"amplitude": "45 deg", "bias": "60deg", "frequency": 0.05'
NOTES = {
    "flat json": f'{{"waveform": "sine", {SINE}}}',
    "suffixes": '{"kind": "sine", "amplitude_deg": 45, "bias_deg": 60.0, "frequency_hz": 0.05}',
    "nested": f'{{"waveform": {{"kind": "sine", {SINE}}}}}',
    "units": 'waveform = "sine"\namplitude = "45 deg"\nbias = "1.0471975511965976 rad"\n'
    'frequency = "50 mHz"\n',
    "toml table": '[command]\nwaveform = "Sine"\namplitude = "45 deg"\nbias = "60 deg"\n'
    "frequency = 0.05\n",
    "terms": f'{{"terms": [{{"kind": "sine", {SINE}}}]}}',
    "bench names": '{"waveform": "sine", "SinAmp": "45 deg", "SinBias": "60 deg", "SinFrq": 0.05}',
}


@pytest.mark.parametrize("text", NOTES.values(), ids=NOTES.keys())
def test_notes_in_many_spellings(tmp_path, text):
    path = tmp_path / "run_command.txt"
    path.write_text(text)
    note = read_command_note(path)
    assert note.waveform == "sine"
    assert note.parameters == pytest.approx(
        {"amplitude": math.radians(45), "bias": math.radians(60), "frequency": 0.05}
    )


BAD_NOTES = {
    "neither": ("{broken", "JSON"),
    "list": ("[1, 2]", "JSON|table"),
    "waveform": ('{"waveform": "sinus"}', "sine"),
    "parameter": ('{"waveform": "sine", "slope": "1 deg/s"}', "no parameter"),
    "current": ('{"current": "mean"}', "rms"),
    "brake": ('{"brake": "half"}', "on, off"),
    "arm": ('{"load_cell_arm": 0}', "above 0"),
    "text": ('{"amplitude": "much"}', "amplitude"),
    "unit": ('{"amplitude": "3 s"}', "amplitude"),
    "nan": ('{"amplitude": NaN}', "finite"),
    "twice": ('{"amplitude": "1 deg", "SinAmp": "2 deg"}', "second time"),
    "two waveforms": ('{"terms": [{"kind": "sine"}, {"kind": "ramp"}]}', "one waveform"),
}


@pytest.mark.parametrize(("text", "message"), BAD_NOTES.values(), ids=BAD_NOTES.keys())
def test_bad_notes(tmp_path, text, message):
    path = tmp_path / "note.json"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_command_note(path)


@pytest.mark.parametrize(
    ("text", "readings"),
    [
        ('{"waveform": "sine", "amplitude": 7}', ["'7 deg'", "'7 rad'", "amplitude"]),
        ('{"waveform": "ramp", "slope": 2.5}', ["'2.5 deg/s'", "'2.5 rad/s'"]),
        ('{"command": {"terms": [{"kind": "sine", "amplitude": 7, "frequency": 1}]}}',
         ["command.terms[0].amplitude", "'7 deg'", "'7 rad'", "'7 mm'"]),
    ],
)  # fmt: skip
def test_an_angle_without_a_unit_is_refused_with_both_readings(tmp_path, text, readings):
    path = tmp_path / "note.json"
    path.write_text(text)
    with pytest.raises(UnitError) as caught:
        read_command_note(path)
    for reading in readings:
        assert reading in str(caught.value)


def test_what_is_the_same_in_every_unit_needs_none(tmp_path):
    path = tmp_path / "note.json"
    path.write_text('{"waveform": "sine", "bias": 0, "frequency": 0.2, "arm": 0.1}')
    note = read_command_note(path)
    assert note.parameters == {"bias": 0.0, "frequency": 0.2}
    assert note.load_cell_arm == 0.1
