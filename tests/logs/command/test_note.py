"""Command notes: in many spellings, and what is refused."""

import math

import pytest

from elevon.errors import InputError
from elevon.logs.command.note import read_command_note

NOTES = {
    "flat json": '{"waveform": "sine", "amplitude": 45, "bias": 60, "frequency": 0.05}',
    "suffixes": '{"kind": "sine", "amplitude_deg": 45, "bias_deg": 60.0, "frequency_hz": 0.05}',
    "nested": '{"waveform": {"kind": "sine", "amplitude": 45, "bias": 60, "frequency": 0.05}}',
    "units": 'waveform = "sine"\namplitude = "45 deg"\nbias = "1.0471975511965976 rad"\n'
    'frequency = "50 mHz"\n',
    "toml table": '[command]\nwaveform = "Sine"\namplitude = 45\nbias = 60\nfrequency = 0.05\n',
    "terms": '{"terms": [{"kind": "sine", "amplitude": 45, "bias": 60, "frequency": 0.05}]}',
    "bench names": '{"waveform": "sine", "SinAmp": 45, "SinBias": 60, "SinFrq": 0.05}',
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
    "parameter": ('{"waveform": "sine", "slope": 1}', "no parameter"),
    "current": ('{"current": "mean"}', "rms"),
    "brake": ('{"brake": "half"}', "on, off"),
    "arm": ('{"load_cell_arm": 0}', "above 0"),
    "text": ('{"amplitude": "much"}', "amplitude"),
    "unit": ('{"amplitude": "3 s"}', "amplitude"),
    "nan": ('{"amplitude": NaN}', "finite"),
    "twice": ('{"amplitude": 1, "SinAmp": 2}', "second time"),
    "two waveforms": ('{"terms": [{"kind": "sine"}, {"kind": "ramp"}]}', "one waveform"),
}


@pytest.mark.parametrize(("text", "message"), BAD_NOTES.values(), ids=BAD_NOTES.keys())
def test_bad_notes(tmp_path, text, message):
    path = tmp_path / "note.json"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_command_note(path)
