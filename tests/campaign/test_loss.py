"""Nothing is lost, nothing is there twice, and damage is seen: whatever happens on the way."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import pytest

import elevon
from elevon.campaign import check as check_module
from elevon.campaign import execute as execute_module
from elevon.campaign import folder as folder_module
from elevon.campaign import load_plan, load_run, read_manifest, resolve_plan
from elevon.campaign.dataset import Part, Table
from elevon.errors import BusyError, FormatError, InputError, OutputError
from elevon.worklog import LOCK, WorkLog, locked


def whole(out, total):
    """Assert that a folder holds every run once, and return its samples."""
    ds = elevon.load_campaign(out)
    runs = ds.runs.to_pandas()
    assert list(runs.run) == list(range(total))
    assert set(runs.status) == {"ok"}
    samples = ds.signals.to_pandas()
    assert samples.groupby("run").size().to_dict() == dict.fromkeys(range(total), 5)
    assert not (out / "progress.log").exists()
    return samples


def stopped(monkeypatch, blocks):
    """Let a campaign stop as if it were killed when so many blocks have been simulated."""
    done = []
    usual = execute_module.simulate_block

    def simulate(*arguments):
        if len(done) == blocks:
            raise KeyboardInterrupt
        done.append(1)
        return usual(*arguments)

    monkeypatch.setattr(execute_module, "simulate_block", simulate)
    return done


def test_borders_stay_where_they_were_whatever_the_memory(plan, cli, tmp_path, monkeypatch):
    path, out = plan(40, head=""), tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(check_module, "_FILE_RUNS", 4)
        stopped(patch, 3)
        assert cli("campaign", "run", path, "--out", out)[0] == 130
    assert read_manifest(out).edges == list(range(0, 41, 4))
    code, summary, _ = cli("campaign", "run", path, "--out", out)
    assert (code, summary["runs"], summary["skipped"]) == (0, 40, 12)
    assert read_manifest(out).edges == list(range(0, 41, 4))
    whole(out, 40)


@pytest.mark.parametrize("other", [2, 6])
def test_borders_stay_where_they_were_whatever_the_plan_says_now(
    plan, cli, tmp_path, monkeypatch, other
):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        stopped(patch, 2)
        assert cli("campaign", "run", plan(24), "--out", out)[0] == 130
    path = plan(24, head=f"runs_per_file = {other}")
    code, summary, _ = cli("campaign", "run", path, "--out", out)
    assert (code, summary["runs"], summary["skipped"]) == (0, 24, 8)
    whole(out, 24)


def test_ok_only_with_every_row(plan, cli, tmp_path, monkeypatch):
    path, out = plan(), tmp_path / "out"
    with monkeypatch.context() as patch:
        stopped(patch, 2)
        cli("campaign", "run", path, "--out", out)
    log = WorkLog.read(out / "progress.log")
    item = log.items["block_00000"]
    item.data["status"].pop()
    log.rewrite()
    code, summary, err = cli("campaign", "run", path, "--out", out)
    assert (code, summary) == (2, None)
    assert "runs 0 to 3 are not there in full" in err
    assert read_manifest(out).status == "running"


TABLE = '[[scenario.load.brake.terms]]\nkind = "table"\nfile = "brake.csv"\n'


def test_a_file_is_found_from_the_plan_and_its_points_are_kept(plan, cli, tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "brake.csv").write_text("0,0\n1,0.3\n")
    path, out = plan(terms=TABLE), tmp_path / "out"
    with monkeypatch.context() as patch:
        stopped(patch, 1)
        assert cli("campaign", "run", path, "--out", out)[0] == 130
    first = elevon.load_campaign(out).resolved()
    (tmp_path / "brake.csv").write_text("0,0\n1,0.6\n")
    code, _, err = cli("campaign", "run", path, "--out", out)
    assert code == 2
    assert "the points of" in err
    assert "brake.csv have changed" in err
    (tmp_path / "brake.csv").unlink()
    assert cli("campaign", "resume", out)[0] == 0
    whole(out, 12)
    assert first.scenario["load"]["brake"]["terms"][0]["values"] == [0.0, 0.3]
    assert load_run(out, 11).meta["scenario"]["load"]["brake"]["terms"][0]["values"] == [0.0, 0.3]


def test_files_of_faults_and_axes_are_found_from_the_plan_too(plan, tmp_path, monkeypatch):
    monkeypatch.chdir("/")
    (tmp_path / "growth.csv").write_text("0,0\n1,1\n")
    (tmp_path / "a.csv").write_text("0,0\n1,0.1\n")
    tail = (
        '[[case]]\nname = "worn"\nfaults = ["friction@transmission=0.2:table(file=growth.csv)"]\n'
        '[[vary]]\nscenario = "load.brake.terms[0].file"\nvalues = ["a.csv", "brake.csv"]\n'
    )
    (tmp_path / "brake.csv").write_text("0,0\n1,0.3\n")
    resolved = resolve_plan(*load_plan(plan(2, tail=tail, terms=TABLE)))
    run = resolved.run(3)
    assert run.scenario.fault[0].profile.times == (0.0, 1.0)
    assert [resolved.run(n).scenario.loads.brake.terms[0].points()[1][1] for n in (0, 1)] == [
        0.1, 0.3
    ]  # fmt: skip
    assert len(resolved.sources) == 3


@pytest.mark.parametrize("last", ["plan.toml", "resolved.json", "runs.parquet"])
def test_killed_before_the_manifest(plan, cli, tmp_path, monkeypatch, last):
    """The plan is written, the manifest not: the folder is as good as new."""
    path, out = plan(), tmp_path / "out"

    def die(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        following = {"plan.toml": "resolved_text", "resolved.json": "write_runs"}
        patch.setattr(folder_module, following.get(last, "_manifest"), die)
        assert cli("campaign", "run", path, "--out", out)[0] == 130
    assert (out / last).exists()
    assert not (out / "manifest.json").exists()
    assert cli("campaign", "run", path, "--out", out)[0] == 0
    whole(out, 12)


def hold(folder, ready, release):
    with locked(folder):
        ready.set()
        release.wait(30)


def test_two_processes_on_one_folder(plan, cli, tmp_path):
    path, out = plan(), tmp_path / "out"
    context = multiprocessing.get_context("fork")
    ready, release = context.Event(), context.Event()
    process = context.Process(target=hold, args=(out, ready, release))
    process.start()
    assert ready.wait(30)
    code, _, err = cli("campaign", "run", path, "--out", out)
    assert code == 2
    assert f"another process works there (process {process.pid} on " in err
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    assert cli("campaign", "run", path, "--out", out)[0] == 0
    whole(out, 12)


def test_a_lock_is_held_once(tmp_path):
    with locked(tmp_path), pytest.raises(BusyError), locked(tmp_path):
        pass
    with locked(tmp_path):
        assert (tmp_path / LOCK).is_file()


def flip(path, place):
    data = bytearray(path.read_bytes())
    data[place % len(data)] ^= 1 << (place % 8)
    path.write_bytes(data)


def test_one_flipped_bit_is_seen_and_mended(plan, cli, tmp_path):
    path, out = plan(), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    block = out / "runs" / "at_400_hz" / "block_00001.parquet"
    good = block.read_bytes()
    for place in range(7, len(good), len(good) // 12):
        flip(block, place)
        with pytest.raises(FormatError, match="not as it was written"):
            load_run(out, 5)
        block.write_bytes(good)
    flip(block, len(good) // 2)
    code, summary, _ = cli("campaign", "run", path, "--out", out)
    assert (code, summary["skipped"]) == (0, 8)
    assert block.read_bytes() == good
    whole(out, 12)


def test_pages_carry_checksums(plan, cli, tmp_path):
    path, out = plan(4, head=""), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    ds = elevon.load_campaign(out)
    block = ds.signals.files[0]
    good = block.read_bytes()
    values = ds.signals.to_arrow()
    bare = Table(ds.signals.path, [Part(block, 0, 3, None)])  # nobody knows its SHA-256
    refused = 0
    footer = int.from_bytes(good[-8:-4], "little") + 8
    for place in range(4, len(good) - footer, 37):
        flip(block, place)
        try:
            assert bare.to_arrow().equals(values), place
        except FormatError:
            refused += 1
        block.write_bytes(good)
    assert refused > 10


@pytest.mark.parametrize("name", ["manifest.json", "resolved.json", "runs.parquet"])
def test_damage_to_what_a_folder_says_of_itself(plan, cli, tmp_path, name):
    path, out = plan(), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    text = (out / name).read_bytes()
    flip(out / name, len(text) // 2)
    with pytest.raises(InputError):
        elevon.load_campaign(out).resolved()


@pytest.mark.parametrize("name", ["resolved.json", "runs.parquet", "plan.toml"])
def test_a_damaged_table_of_a_finished_campaign_is_mended(plan, cli, tmp_path, name):
    path, out = plan(4, head="runs_per_file = 2"), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    good = (out / name).read_bytes()
    flip(out / name, (out / name).stat().st_size // 2)
    assert cli("dataset", "verify", out)[0] == 1
    code, told, _ = cli("campaign", "run", path, "--out", out)
    assert (code, told["skipped"]) == (0, 4)  # nothing is simulated again
    assert cli("dataset", "verify", out)[0] == 0
    assert (out / name).read_bytes() == good


def test_a_damaged_table_and_a_damaged_block(plan, cli, tmp_path):
    """What its own table of ends does not tell is simulated, nothing else."""
    path, out = plan(6, head="runs_per_file = 2"), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    for name in ("runs.parquet", "ends/block_00001.parquet"):
        flip(out / name, (out / name).stat().st_size // 2)
    code, told, _ = cli("campaign", "run", path, "--out", out)
    assert (code, told["skipped"]) == (0, 4)
    assert cli("dataset", "verify", out)[0] == 0


def test_sigterm_is_told_and_leaves_no_parts(plan, tmp_path):
    path, out = plan(400, head="runs_per_file = 1"), tmp_path / "out"
    path.write_text(path.read_text().replace('"10 ms"', '"60 s"'))
    command = [sys.executable, "-m", "elevon.cli", "campaign", "run", str(path), "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(1500):
        if list(out.rglob("block_*.parquet")) or process.poll() is not None:
            break
        time.sleep(0.02)
    process.terminate()
    stdout, stderr = process.communicate(timeout=30)
    assert process.returncode == 143
    assert stdout == ""
    assert f"of 400 runs are kept in {out}" in stderr
    assert not [p for p in out.rglob(".*") if p.name != LOCK]


def test_what_killed_writers_left_is_swept(plan, cli, tmp_path, monkeypatch):
    path, out = plan(), tmp_path / "out"
    with monkeypatch.context() as patch:
        stopped(patch, 2)
        cli("campaign", "run", path, "--out", out)
    stale = out / "runs" / "at_400_hz" / ".block_00001.0123456789ab.part.parquet"
    stale.write_bytes(b"half")
    mine = out / ".notes.part"
    mine.write_text("not ours")
    assert cli("campaign", "run", path, "--out", out)[0] == 0
    assert not stale.exists()
    assert mine.exists()


def test_resuming_counts_the_disk_of_what_is_missing_only(plan, cli, tmp_path, monkeypatch):
    from elevon.campaign import estimate as estimate_module

    path, out = plan(), tmp_path / "out"
    with monkeypatch.context() as patch:
        stopped(patch, 2)
        cli("campaign", "run", path, "--out", out)
    need = read_manifest(out).estimate["disk"]
    usage = type("Usage", (), {"free": 0.5 * need})
    monkeypatch.setattr(estimate_module.shutil, "disk_usage", lambda _: usage)
    code, _, err = cli("campaign", "run", plan(13, name="b.toml"), "--out", tmp_path / "other")
    assert code == 2
    assert "free on the disk" in err
    assert cli("campaign", "run", path, "--out", out)[0] == 0


def test_a_folder_that_goes_midway(plan, cli, tmp_path, monkeypatch):
    import shutil

    path, out = plan(), tmp_path / "out"
    usual = execute_module.simulate_block

    def simulate(*arguments):
        results = usual(*arguments)
        shutil.rmtree(out, ignore_errors=True)
        return results

    monkeypatch.setattr(execute_module, "simulate_block", simulate)
    code, _, err = cli("campaign", "run", path, "--out", out)
    assert code == 2
    assert "the folder has gone since the campaign began" in err
    assert not out.exists()


def test_a_finished_campaign_is_left_alone(plan, cli, tmp_path, monkeypatch):
    path, out = plan(), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    times = {file: file.stat().st_mtime_ns for file in out.rglob("*") if file.name != LOCK}

    def never(*_):
        raise AssertionError

    monkeypatch.setattr(execute_module, "check", never)
    code, summary, _ = cli("campaign", "run", path, "--out", out)
    assert (code, summary["skipped"], summary["status"]) == (0, 12, "ok")
    assert {file: file.stat().st_mtime_ns for file in times} == times


def test_a_run_is_prepared_without_asking_the_catalogue_again(plan, monkeypatch):
    """Ten thousand runs of one kind are one kind: the slow questions are asked once."""
    from elevon.campaign import resolved as resolved_module

    asked = []
    usual = resolved_module.prepare
    monkeypatch.setattr(
        resolved_module, "prepare", lambda *a, **k: asked.append(1) or usual(*a, **k)
    )
    idle = check_module._idle
    monkeypatch.setattr(check_module, "_idle", lambda *a: asked.append(2) or idle(*a))
    resolved = resolve_plan(*load_plan(plan(500)))
    check_module.check(resolved)
    assert asked.count(1) == 1
    assert asked.count(2) <= 2


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
