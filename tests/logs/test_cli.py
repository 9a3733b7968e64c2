"""`elevon import`: exit codes, JSON, files."""

import json

import numpy as np
import pytest

from elevon.cli import main
from elevon.logs.formats.drive import DriveFormat, write_drive_csv
from elevon.logs.formats.loadcell import write_loadcell
from elevon.recording import Recording


def run(capsys, *arguments):
    code = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_import_writes_a_recording_and_one_json_object(tmp_path, truth, capsys):
    path = write_drive_csv(tmp_path / "log.csv", truth.signals)
    write_loadcell(tmp_path / "log_loadcell.csv", np.arange(100) / 80, np.zeros(100))
    code, out, err = run(capsys, "import", path, "--out", tmp_path / "rec.parquet", "--json")
    assert code == 0
    result = json.loads(out)
    assert result["status"] == "ok"
    (log,) = result["logs"]
    assert log["clocks"]["drive"]["rate_hz"] == pytest.approx(400.0)
    assert log["synchronisation"]["method"] == "trigger"
    assert log["synchronisation"]["offset_s"] == pytest.approx(truth.trigger, abs=2.5e-3)
    assert "taken as rms" in err
    recording = Recording.load(tmp_path / "rec.parquet")
    assert set(recording.clocks) == {"drive", "load_cell"}
    code, _, err = run(capsys, "import", path, "--out", tmp_path / "rec.parquet")
    assert code == 2
    assert "--force" in err
    code, out, _ = run(capsys, "import", path, "--out", tmp_path / "rec.parquet", "--force")
    assert code == 0
    assert "encoder_position" in out


def test_gentle_dialects_are_no_error(tmp_path, truth, capsys):
    for k, layout in enumerate([
        DriveFormat(encoding="utf-8-sig"),
        DriveFormat(line_end="\r\n"),
        DriveFormat(delimiter=";", decimal_comma=True),
    ]):  # fmt: skip
        path = write_drive_csv(tmp_path / f"log{k}.csv", truth.signals, layout=layout)
        code, _, _ = run(capsys, "import", path, "--out", tmp_path / f"rec{k}.nc")
        assert code == 0


@pytest.mark.parametrize("content", [
    "", "Xms,Drive_axis_1.r4820,Drive_axis_1.r63\n",
    "Xms,Drive_axis_1.r4820,Drive_axis_1.r63\n0,1,1\n5,1,1\n2.5,1,1\n",
    "Xms,Drive_axis_1.r4820,Drive_axis_1.r63\n0,1,1\n2.5,one,1\n",
    "Xms,Drive_axis_1.r4820,Drive_axis_1.r63\n0,1,1\n2.5,1",
])  # fmt: skip
def test_bad_logs_exit_with_2_and_say_nothing_on_stdout(tmp_path, capsys, content):
    path = tmp_path / "bad.csv"
    path.write_text(content)
    code, out, err = run(capsys, "import", path, "--out", tmp_path / "rec.parquet", "--json")
    assert code == 2
    assert out == ""
    assert "bad.csv" in err
    assert not (tmp_path / "rec.parquet").exists()


def test_several_logs_go_to_a_folder_and_must_share_a_rate(tmp_path, truth, capsys):
    one = write_drive_csv(tmp_path / "one.csv", truth.signals)
    half = {k: v[::2] for k, v in truth.signals.items()}
    two = write_drive_csv(tmp_path / "two.csv", half)
    code, out, err = run(capsys, "import", one, two, "--out", tmp_path / "recs", "--json")
    assert (code, out) == (2, "")
    assert "400 Hz" in err
    assert "200 Hz" in err
    code, _, err = run(capsys, "import", one, one, "--out", tmp_path / "x.parquet")
    assert code == 2
    assert "folder" in err
    same = write_drive_csv(tmp_path / "same.csv", truth.signals)
    code, out, _ = run(capsys, "import", one, same, "--out", tmp_path / "recs", "--json")
    assert code == 0
    assert len(json.loads(out)["logs"]) == 2
    assert (tmp_path / "recs" / "same.parquet").is_file()


def test_usage_errors(tmp_path, truth, capsys):
    path = write_drive_csv(tmp_path / "log.csv", truth.signals)
    out = tmp_path / "rec.parquet"
    for arguments, message in (
        (("import", tmp_path / "none.csv", "--out", out), "no such file"),
        (("import", tmp_path, "--out", out), "not a regular file"),
        (("import", path, "--out", tmp_path / "rec.xlsx"), "ending"),
        (("import", path, "--out", out, "--format", "excel"), "format"),
        (("import", path, "--out", out, "--gear-ratio", "-1"), "gear ratio"),
        (("import", path, "--out", out, "--loadcell", path, "--loadcell", path), "one for each"),
        (("import", path), "out"),
    ):
        code, stdout, err = run(capsys, *arguments)
        assert code == 2
        assert stdout == ""
        assert message in err


def test_companions_named_by_a_glob_are_read_with_their_log(tmp_path, capsys):
    logs = tmp_path / "logs"
    words = ["bench", "run", "stall", "--actuator", "torino-rotary", "--fidelity", "low"]
    assert run(capsys, *words, "--out", logs, "--json")[0] == 0
    named = sorted(logs.glob("stall*.csv"))
    assert len(named) == 2
    out = tmp_path / "one.parquet"
    code, printed, messages = run(capsys, "import", *named, "--out", out, "--json")
    assert code == 0
    assert "read with its log" in messages
    assert len(json.loads(printed)["logs"]) == 1
