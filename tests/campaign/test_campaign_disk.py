"""Threads, logs and disks of a campaign."""

import os
import subprocess
import sys

import pytest

import elevon
from elevon.errors import FormatError, InputError, OutputError
from elevon.worklog import LOCK, WorkLog


@pytest.mark.parametrize("threads", [0, -1, 4000, True, 2.0])
def test_threads_that_cannot_be(threads):
    actuator = elevon.Actuator.load("torino-rotary")
    scenario = elevon.Scenario.from_dict({"duration": "1 ms"})
    with pytest.raises(InputError, match="threads = "):
        elevon.simulate_batch([elevon.Run(actuator, scenario)], threads=threads)


def test_threads_are_at_most_the_cores(monkeypatch):
    from elevon import _core
    from elevon.simulate import batch

    started = []
    usual = _core.simulate
    monkeypatch.setattr(_core, "simulate", lambda *a: started.append(a[4]) or usual(*a))
    actuator = elevon.Actuator.load("torino-rotary")
    run = elevon.Run(actuator, elevon.Scenario.from_dict({"duration": "1 ms"}))
    batch.simulate_batch([run], threads=1000)
    assert started == [batch.checked_threads(None)]


def test_a_log_is_what_was_written_to_it(tmp_path):
    (tmp_path / "a").write_text("a")
    log = WorkLog.begin(tmp_path / "log", "key")
    log.note("first", [tmp_path / "a"], said=1)
    log.note("second", [])
    text = (tmp_path / "log").read_bytes()
    ends = [place for place, byte in enumerate(text) if byte == 10]
    cuts = {*range(0, len(text), 9), *ends, *(end + 1 for end in ends[:-1])}
    for cut in sorted(cuts):
        (tmp_path / "log").write_bytes(text[:cut])
        lines = sum(cut >= end for end in ends)
        if lines == 0:
            with pytest.raises(FormatError):
                WorkLog.read(tmp_path / "log")
            continue
        read = WorkLog.read(tmp_path / "log")
        assert list(read.items) == ["first", "second"][: lines - 1]
        read.note("third", [])
        assert list(WorkLog.read(tmp_path / "log").items)[-1] == "third"


def test_a_log_that_cannot_grow_is_as_before(tmp_path, monkeypatch):
    log = WorkLog.begin(tmp_path / "log", "key")
    before = (tmp_path / "log").read_bytes()
    usual = os.write

    def full(handle, data):
        usual(handle, data[:5])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OutputError, match="No space left"):
        log.note("first", [])
    assert (tmp_path / "log").read_bytes() == before
    assert not log.items


def limited(out, path, megabytes):
    """Run a campaign in a process whose files may not grow beyond so much."""
    code = (
        "import resource, signal, sys\n"
        "from elevon.cli import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({int(1e6 * megabytes)},) * 2)\n"
        f"sys.exit(main(['campaign', 'run', {str(path)!r}, '--out', {str(out)!r}]))\n"
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


def test_a_disk_that_is_full(plan, cli, tmp_path):
    """A file cannot grow: the message is clear, what is done is whole, and it goes on later."""
    path, out = plan(), tmp_path / "out"
    path.write_text(path.read_text().replace('"10 ms"', '"4 s"').replace("400 Hz", "2 kHz"))
    first = limited(out, path, 0.2)
    assert first.returncode == 2
    assert "block_00000.parquet: cannot be written" in first.stderr
    assert "Traceback" not in first.stderr
    assert not [p for p in out.rglob(".*") if p.name != LOCK]
    assert all(item.intact(out) for item in elevon.load_campaign(out).items)
    assert cli("campaign", "run", path, "--out", out)[0] == 0
    assert cli("dataset", "verify", out)[0] == 0


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_is_read_only(plan, cli, tmp_path):
    path, out = plan(), tmp_path / "out"
    out.mkdir(mode=0o500)
    code, _, err = cli("campaign", "run", path, "--out", out)
    assert code == 2
    assert "cannot be written" in err


def test_a_folder_that_cannot_be_made(plan, cli, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = cli("campaign", "run", plan(), "--out", tmp_path / "file" / "out")
    assert code == 2
    assert "file/out: cannot be written" in err
