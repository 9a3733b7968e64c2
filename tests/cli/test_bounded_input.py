"""Files that are none, endless or huge, and numbers at the ends: a message, soon, no traceback."""

import os
import signal

import pytest

from elevon.cli import main

ROTARY = ("--actuator", "torino-rotary")
SURFACE = ("--area", "0.5 m2", "--chord", "400 mm", "--c-delta", "-0.4",
           "--actuator", "nasa-ballscrew")  # fmt: skip

#: Commands with the place of a file of somebody else.
READERS = [
    ("check", "FILE"),
    ("simulate", "torino-rotary", "--scenario", "FILE"),
    ("campaign", "plan", "FILE"),
    ("campaign", "run", "FILE", "--out", "out"),
    ("bench", "run", "FILE", *ROTARY, "--out", "out"),
    ("import", "FILE", "--out", "out.parquet"),
    ("features", "FILE"),
    ("calibrate", "FILE", *ROTARY, "--out", "x.toml"),
    ("validate", "FILE", *ROTARY),
    ("diagnose", "FILE", *ROTARY),
    ("monitor", "FILE", *ROTARY, "--baseline", "FILE"),
    ("loads", "FILE", *SURFACE, "--out", "x.csv"),
    ("next-test", *ROTARY, "--so-far", "FILE"),
    ("predict", ".", *ROTARY, "--mission", "FILE"),
    ("diagnose", "log.csv", *ROTARY, "--model", "FILE"),
    ("import", "log.csv", "--map", "FILE", "--out", "out.parquet"),
    ("import", "log.csv", "--command", "FILE", "--out", "out.parquet"),
    ("import", "log.csv", "--loadcell", "FILE", "--out", "out.parquet"),
]

LIMIT = 60
"""Seconds for all readers of one file; each takes a few hundredths."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of files that nobody should read to their end."""
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    for name in ("big.toml", "big.csv"):
        with open(name, "wb") as stream:  # noqa: PTH123
            stream.truncate(2**31 + 1)  # takes no room: it is one hole
    (tmp_path / "deep.json").write_text('{"a":' * 5000 + "1" + "}" * 5000)
    (tmp_path / "long.json").write_text('{"usage": ' + "9" * 5000 + "}")
    (tmp_path / "long.toml").write_text("x = " + "9" * 5000)
    (tmp_path / "log.csv").write_text("time,output_position\n0,0\n0.1,0\n")
    (tmp_path / "secret").write_text("root:$6$hash:19000:0:99999:7:::\n")
    return tmp_path


@pytest.fixture
def bounded():
    """Fail a test that waits for ever."""

    def late(*_):
        raise AssertionError(f"still waiting after {LIMIT} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LIMIT)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(
    "name",
    ["/dev/zero", "pipe", "big.toml", "big.csv", "deep.json", "long.json", "long.toml", "", ".",
     "a\0b", "x" * 5000],
)  # fmt: skip
def test_every_reader_refuses_it(folder, bounded, capsys, name):
    for reader in READERS:
        words = [name if word == "FILE" else word for word in reader]
        assert main(words) == 2, words
        captured = capsys.readouterr()
        assert captured.out == ""
        assert "elevon: " in captured.err
        assert "Traceback" not in captured.err


def test_the_content_of_a_refused_file_is_not_printed(folder, bounded, capsys):
    for reader in READERS:
        assert main(["secret" if word == "FILE" else word for word in reader]) == 2, reader
        captured = capsys.readouterr()
        assert "$6$hash" not in captured.out + captured.err, reader


@pytest.mark.parametrize("table", ["pipe", "/dev/zero", "big.csv", "secret"])
def test_tables_of_a_scenario(folder, bounded, capsys, table):
    (folder / "s.toml").write_text(
        f'duration = "1 s"\n[[command.terms]]\nkind = "table"\nfile = "{table}"\n'
    )
    assert main(["simulate", "torino-rotary", "--scenario", "s.toml"]) == 2
    assert "$6$hash" not in capsys.readouterr().err


@pytest.mark.parametrize("acceleration", ["", 'acceleration = "1 deg/s2"\n'])
def test_a_trapezoid_shorter_than_the_rounding_of_its_time(folder, bounded, acceleration):
    (folder / "s.toml").write_text(
        'duration = "0.01 s"\n[[command.terms]]\nkind = "trapezoid"\nlow = "0 deg"\n'
        'high = "5 deg"\nrise = "1e-30 s"\nfall = "1e-30 s"\nhold_high = "0.1 s"\n'
        f'start = "0.5 s"\n{acceleration}'
    )
    code = main(["simulate", "torino-rotary", "--scenario", "s.toml", "--fidelity", "low"])
    assert code == (2 if acceleration else 0)


@pytest.mark.parametrize(
    "words",
    [
        ("compare", "torino-rotary", "--cutoff", "0"),
        ("compare", "torino-rotary", "--cutoff", "-1"),
        ("compare", "torino-rotary", "--cutoff", "nan"),
        ("compare", "torino-rotary", "--cutoff", "1e-320"),
        ("response", "torino-rotary", "--fidelity", "low", "--from", "1e-30", "--to", "1 Hz"),
        ("response", "torino-rotary", "--fidelity", "low", "--from", "1e-30 Hz", "--to", "1 Hz"),
        ("response", "torino-rotary", "--fidelity", "low", "--from", "1 Hz", "--to", "1e300 Hz"),
    ],
)
def test_numbers_at_the_ends(bounded, capsys, words):
    assert main(list(words)) == 2
    assert "Traceback" not in capsys.readouterr().err
