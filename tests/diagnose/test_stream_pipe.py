"""A slow pipe into `elevon monitor -`: a line a window, soon, and what is kept at its end."""

import json
import signal
import statistics
import subprocess
import sys
import time

import pytest

from elevon.cli import main

pytestmark = pytest.mark.long
MOST = 0.05  # s from a window's end to its line


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A healthy log and one whose unit wears, 25 s each."""
    folder = tmp_path_factory.mktemp("pipe")
    (folder / "watch.toml").write_text(
        'name = "w"\n[[step]]\nkind = "trace"\nname = "w"\nduration = "25 s"\n'
        'command = { terms = [{ kind = "sine", amplitude = "7 deg", frequency = "0.4 Hz" }] }\n'
    )
    run = ["bench", "run", str(folder / "watch.toml"), "--actuator", "torino-rotary", "--fidelity",
           "low", "--out"]  # fmt: skip
    fault = ["--fault", "backlash@transmission=0.1 deg:step(time=13 s)"]
    for seed, name, more in (("1", "base", []), ("2", "worn", fault)):
        assert main([*run, str(folder / name), "--seed", seed, *more]) == 0
    return folder


def options(folder):
    """Of either form of the command."""
    return ["--actuator", "torino-rotary", "--baseline", str(folder / "base" / "w.csv")]


def begun(folder, *words):
    """The command, reading from a pipe."""
    return subprocess.Popen(
        [sys.executable, "-m", "elevon", "monitor", "-", *options(folder), *words],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0,
    )  # fmt: skip


def windows(lines):
    return [line for line in lines if line["event"] == "window"]


def test_a_line_comes_soon_after_its_windows_end(bench, capsys):
    head, *rows = (bench / "worn" / "w.csv").read_bytes().splitlines(keepends=True)
    assert main(["monitor", str(bench / "worn" / "w.csv"), *options(bench), "--json"]) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    stamps = [1e-3 * float(row.split(b",")[0]) for row in rows]
    process = begun(bench)
    process.stdin.write(head)
    delays, first = [], 0
    for step in steps[:-1]:
        behind = next(k for k, stamp in enumerate(stamps) if stamp >= step["end"])
        process.stdin.write(b"".join(rows[first:behind]))
        begin = time.perf_counter()
        process.stdin.write(rows[behind])
        line = json.loads(process.stdout.readline())
        delays.append(time.perf_counter() - begin)
        assert line["event"] == "window"
        assert line["samples"]["taken"] == 1000
        first = behind + 1
    out, _ = process.communicate()
    assert json.loads(out.splitlines()[-1])["event"] == "end"
    assert process.returncode == 0
    # The first one waits for the set-up, too.
    sys.stderr.write(f"from a window's end to its line, s: {delays}\n")
    assert statistics.median(delays[1:]) < MOST


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_stream_that_is_stopped_goes_on_from_its_state(bench, tmp_path, number):
    head, *rows = (bench / "worn" / "w.csv").read_bytes().splitlines(keepends=True)
    whole = begun(bench)
    expected = [
        json.loads(line) for line in whole.communicate(head + b"".join(rows))[0].splitlines()
    ]
    state = tmp_path / "state"
    process = begun(bench, "--state", str(state))
    process.stdin.write(head + b"".join(rows[:4000]))
    lines = [json.loads(process.stdout.readline()) for _ in range(3)]
    # The state is written behind the line; of a kill it may be that of the window before.
    process.send_signal(number)
    _, words = process.communicate()
    code = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}[number]
    assert process.returncode == code
    if number != signal.SIGKILL:
        assert b"state holds where the stream stands" in words
    process = begun(bench, "--state", str(state))
    # The source sends again from a little before: what was taken is left out and counted.
    out, words = process.communicate(
        head + b"".join(rows[0 if number == signal.SIGKILL else 3500 :])
    )
    assert process.returncode == 0, words
    lines += [json.loads(line) for line in out.splitlines()]
    got = {line["start"]: line for line in windows(lines) if not line["skipped"]}
    assert [
        {name: value for name, value in got[line["start"]].items() if name != "samples"}
        for line in windows(expected)
    ] == [
        {name: value for name, value in line.items() if name != "samples"}
        for line in windows(expected)
    ]
    assert lines[-1]["alarm"] == expected[-1]["alarm"]
    assert lines[-1]["samples"]["missing"] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["state"]
