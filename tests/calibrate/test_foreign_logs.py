"""The foreign bench's files, sound and damaged: exit codes and what the messages name."""

import json
from dataclasses import replace

import numpy as np
import pytest

from elevon.cli.runner import run as elevon
from elevon.recording import Recording
from tests.calibrate.foreign import COUNT, LOADED, NOLOAD, draw
from tests.calibrate.foreign import run as carry_out
from tests.calibrate.foreign_files import HEADERS, Style, drive_columns, write_table, write_trial

SHAPES = {
    "plain": Style(),
    "bom": Style(bom=True),
    "crlf": Style(line_end="\r\n"),
    "decimal-comma": Style(delimiter=";", decimal_comma=True),
    "everything": Style(
        delimiter=";", decimal_comma=True, line_end="\r\n", bom=True, encoder_shaft="slow",
        current="peak", extra="Temperatur [°C]", note_keys="units", cell_header="Zeit,Kraft [N]",
    ),
    "latin-1": Style(encoding="latin-1", extra="Temperatur [°C]", missing=("field", "voltage")),
    "nested-note": Style(note_keys="nested", missing=("current", "trigger")),
}  # fmt: skip


@pytest.fixture(scope="module")
def trials():
    """One bench, turned for 5 s without and with its brake."""
    bench, sensors = draw(31)
    quick = {"amplitude": 8.0, "bias": 9.0, "frequency": 0.4}
    free, braked = replace(NOLOAD, values=quick), replace(LOADED, values=quick)
    runs = [carry_out(bench, sensors, t, 31, duration=5.0, start=0.3) for t in (free, braked)]
    return bench, sensors, runs


@pytest.fixture
def log(trials, tmp_path):
    """A sound trace with its note, and nothing else beside it."""
    _, sensors, (free, _) = trials
    return write_trial(tmp_path / "free.csv", free, sensors, Style())


def imported(path, capsys, *options):
    """Import a log; return the exit code, the report (None where there is none) and stderr."""
    out = path.with_suffix(".parquet")
    code = elevon(["import", str(path), "--out", str(out), "--json", "--force", *options])
    printed = capsys.readouterr()
    return code, json.loads(printed.out)["logs"][0] if printed.out else None, printed.err


@pytest.mark.parametrize("name", SHAPES)
def test_every_way_of_writing_gives_the_same_numbers(name, trials, tmp_path, capsys):
    _, sensors, (_, braked) = trials
    style = SHAPES[name]
    path = write_trial(tmp_path / "braked.csv", braked, sensors, style)
    code, report, messages = imported(path, capsys)
    assert code == 0, messages
    seen = Recording.load(report["recording"])
    np.testing.assert_allclose(
        seen["encoder_position"].values, braked.rows["output"], atol=1e-3 * COUNT
    )
    motor = seen["resolver_position"].values - sensors.motor_zero
    np.testing.assert_allclose(motor, braked.rows["motor"], atol=2e-6)
    np.testing.assert_allclose(seen["speed_ref"].values, braked.rows["speed_ref"], rtol=1e-7)
    np.testing.assert_allclose(
        seen["current_ref"].values, braked.rows["current_ref"], rtol=1e-7, atol=1e-9
    )
    assert ("current_d_meas" in seen.names) == ("field" not in style.missing)
    assert "load_cell_torque" in seen.names
    torque = seen["load_cell_torque"]
    truth = np.interp(torque.time, braked.time, braked.rows["reaction"])
    middle = (torque.time > braked.trigger + 0.5) & (torque.time < 4.5)
    scale = sensors.arm / sensors.chain
    residual = torque.values[middle] - truth[middle] - sensors.cell_offset * scale
    assert np.median(np.abs(residual)) < 3 * sensors.cell_noise * scale


def test_what_was_seen_is_in_the_report(trials, tmp_path, capsys):
    _, sensors, (free, _) = trials
    path = write_trial(tmp_path / "free.csv", free, sensors, SHAPES["everything"])
    code, report, _ = imported(path, capsys)
    assert code == 0
    text = json.dumps(report)
    assert "byte-order mark" in text
    assert "decimal comma" in text
    assert "is not known; left as it stands" in text
    assert "slow shaft in deg" in text
    assert report["clocks"]["drive"]["rate_hz"] == pytest.approx(400.0)


def damaged(log, how):
    """Spoil a trace in one way; return what the message must name."""
    lines = log.read_text().splitlines()
    text = "\n".join(lines) + "\n"
    if how == "empty":
        text, names = "", ["is empty"]
    elif how == "header alone":
        text, names = lines[0] + "\n", ["header alone"]
    elif how == "time backwards":
        lines[900], lines[901] = lines[901], lines[900]
        text, names = "\n".join(lines) + "\n", ["time", "back"]
    elif how == "text in numbers":
        cells = lines[500].split(",")
        cells[4] = "fault"
        lines[500] = ",".join(cells)
        text, names = "\n".join(lines) + "\n", ["line 501", "column 5", "fault"]
    elif how == "truncated":
        cut = len("\n".join(lines[:1500])) + len(lines[1500]) // 2
        text, names = text[:cut], ["line 1501", "cut off"]
    elif how == "no positions":
        text, names = text.replace("r4821", "r4999").replace("r4820", "r4998"), ["r4820", "r4821"]
    else:
        text, names = text.replace("Xms", "Xs ", 1), ["Xms"]
    log.write_text(text)
    return [log.name, *names]


DAMAGES = ["empty", "header alone", "time backwards", "text in numbers", "truncated",
           "no positions", "no time"]  # fmt: skip


@pytest.mark.parametrize("how", DAMAGES)
def test_damaged_logs_are_refused_by_every_command(how, log, tmp_path, capsys):
    names = damaged(log, how)
    model = ["--actuator", "torino-rotary", "--json"]
    for command in (
        ["import", str(log), "--out", str(tmp_path / "x.parquet"), "--json"],
        ["calibrate", str(log), *model, "--out", str(tmp_path / "x.toml")],
        ["validate", str(log), *model],
    ):
        assert elevon(command) == 2, command
        printed = capsys.readouterr()
        assert printed.out == ""
        for name in names:
            assert name in printed.err, (command[0], printed.err)
    assert not (tmp_path / "x.parquet").exists()
    assert not (tmp_path / "x.toml").exists()


@pytest.mark.parametrize(
    ("key", "factor", "names"),
    [
        ("encoder", -1.0, ["r4821", "sign"]),
        ("motor", -1.0, ["r4820", "sign"]),
        ("encoder", 4.0 / 124.0, ["r4821", "wrong shaft"]),
        ("encoder", 1.3, ["r4821", "gear ratio"]),
        ("motor", 124.0, ["r4820", "unit"]),
    ],
)
def test_a_wrong_sign_or_shaft_is_named(key, factor, names, trials, tmp_path, capsys):
    _, sensors, (free, _) = trials
    path = tmp_path / "free.csv"
    columns = drive_columns(free, sensors, Style(), np.random.default_rng(0))
    columns[key] = factor * columns[key]
    header = ",".join(HEADERS[name] for name in columns)
    write_table(path, header, list(columns.values()), Style(), ["%.9g"] * len(columns))
    for command in ("import", "calibrate"):
        tail = ["--out", str(tmp_path / "x.parquet")]
        if command == "calibrate":
            tail = ["--actuator", "torino-rotary", "--out", str(tmp_path / "x.toml")]
        assert elevon([command, str(path), *tail, "--json"]) == 2
        messages = capsys.readouterr().err
        assert all(name in messages for name in names), messages


def test_a_stated_shaft_is_checked_against_the_log(log, tmp_path, capsys):
    stated = tmp_path / "map.toml"
    for shaft, code in (("fast", 0), ("slow", 2)):
        stated.write_text(
            f'[[column]]\nname = "{HEADERS["encoder"]}"\nsignal = "encoder_position"\n'
            f'unit = "deg"\nshaft = "{shaft}"\n'
        )
        found, _, messages = imported(log, capsys, "--map", str(stated))
        assert found == code, messages
    assert HEADERS["encoder"] in messages
    assert "the other shaft" in messages


def test_logs_of_two_rates_are_refused(trials, log, tmp_path, capsys):
    lines = log.read_text().splitlines()
    other = tmp_path / "other.csv"
    other.write_text("\n".join([lines[0], *lines[1::2]]) + "\n")
    both = [str(log), str(other)]
    for command in (
        ["import", *both, "--out", str(tmp_path / "folder")],
        ["calibrate", *both, "--actuator", "torino-rotary", "--out", str(tmp_path / "x.toml")],
        ["validate", *both, "--actuator", "torino-rotary"],
    ):
        assert elevon([*command, "--json"]) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        for name in ("free.csv", "other.csv", "400 Hz", "200 Hz"):
            assert name in printed.err


def test_a_note_that_does_not_fit_is_named(log, capsys):
    note = log.with_name("free_command.json")
    sound = json.loads(note.read_text())
    for change, name in (
        ({"waveform": "sin"}, "sine"),
        ({"current": "average"}, "peak"),
        ({"load_cell_arm": -0.1}, "load_cell_arm"),
        ({"amplitude": "seven"}, "amplitude"),
        ({"brake": "perhaps"}, "brake"),
    ):
        note.write_text(json.dumps(sound | change))
        code, _, messages = imported(log, capsys)
        assert code == 2, change
        assert note.name in messages
        assert name in messages
    note.write_text(json.dumps(sound)[:-9])
    assert imported(log, capsys)[0] == 2
    note.write_text(json.dumps(sound | {"operator": "N. N."}))
    code, report, _ = imported(log, capsys)
    assert code == 0
    assert "operator" in json.dumps(report)


def test_a_damaged_load_cell_file_is_refused(trials, tmp_path, capsys):
    _, sensors, (_, braked) = trials
    path = write_trial(tmp_path / "braked.csv", braked, sensors, Style())
    cell = path.with_name("braked_loadcell.csv")
    lines = cell.read_text().splitlines()
    for text, name in (
        ("", "is empty"),
        (lines[0] + "\n", "header alone"),
        ("\n".join([*lines[:50], "later,heavy", *lines[50:]]) + "\n", "line 51"),
        ("\n".join([lines[0], *lines[60:], *lines[1:60]]) + "\n", "back"),
    ):
        cell.write_text(text)
        code, _, messages = imported(path, capsys)
        assert code == 2
        assert cell.name in messages
        assert name in messages, messages


def test_gaps_and_repeated_rows_are_reported_and_not_repaired(log, capsys):
    lines = log.read_text().splitlines()
    gone = [*lines[:700], *lines[720:900], lines[899], *lines[900:]]
    log.write_text("\n".join(gone) + "\n")
    code, report, messages = imported(log, capsys)
    assert code == 0
    assert report["clocks"]["drive"]["gaps"][0][2] == 20
    assert report["clocks"]["drive"]["duplicates"] == 1
    assert "20 samples missing" in messages
    assert len(Recording.load(report["recording"])["speed_ref"].values) == len(lines) - 1 - 20
