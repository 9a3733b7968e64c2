"""Nothing is lost and nothing is there twice, whatever happens on the way."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import pytest

import elevon
from elevon import files as files_module
from elevon.campaign import check as check_module
from elevon.campaign import execute as execute_module
from elevon.campaign import load_plan, load_run, read_manifest, resolve_plan
from elevon.errors import BusyError
from elevon.worklog import LOCK, WorkLog, locked
from tests.campaign.make import whole


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


@pytest.mark.parametrize("last", ["plan.toml", "resolved.json", "runs.parquet", "manifest.json"])
def test_killed_before_the_manifest(plan, cli, tmp_path, monkeypatch, last):
    """The plan is written, the manifest not: the folder is as good as new."""
    path, out = plan(), tmp_path / "out"

    def die(operation, path):
        if operation == "rename" and last in path.name:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(files_module, "step", die)
        assert cli("campaign", "run", path, "--out", out)[0] == 130
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
    from elevon.campaign import check as estimate_module

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

    requests = []
    usual = resolved_module.prepare
    monkeypatch.setattr(
        resolved_module, "prepare", lambda *a, **k: requests.append(1) or usual(*a, **k)
    )
    idle = check_module._settings_without_effect
    monkeypatch.setattr(
        check_module, "_settings_without_effect", lambda *a: requests.append(2) or idle(*a)
    )
    resolved = resolve_plan(*load_plan(plan(500)))
    check_module.check(resolved)
    assert requests.count(1) == 1
    assert requests.count(2) <= 2
