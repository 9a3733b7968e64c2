"""Files that change together: killed at any step, the folder is the old one or the new one."""

import errno
import multiprocessing
import os
import shutil

import pytest

import elevon
from elevon import files
from elevon.campaign import read_manifest
from elevon.campaign.store import LOG
from elevon.cli import main
from elevon.worklog import WorkLog

SPLIT = ("--share", "fit=0.75", "--share", "hold=0.25")
FORK = multiprocessing.get_context("fork")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a finished campaign of 8 runs in two parts, and its plan."""
    root = tmp_path_factory.mktemp("transaction")
    path = root / "plan.toml"
    path.write_text(
        'actuator = "torino-rotary"\nfidelity = "low"\nruns_per_file = 4\n'
        'record = "output_position@400 Hz"\n[scenario]\nduration = "10 ms"\n'
        '[[scenario.command.terms]]\nkind = "sine"\namplitude = "7 deg"\nfrequency = "2 Hz"\n'
        '[[vary]]\nparameter = "friction.dynamic"\nfrom = "0.2 N m"\nto = "0.4 N m"\ncount = 8\n'
        "[split]\ntrain = 0.5\ntest = 0.5\n"
    )
    assert main(["campaign", "run", str(path), "--out", str(root / "set")]) == 0
    return root / "set", path


def counted(action):
    """Return the steps on the disk that an action takes."""
    steps = []
    usual, files.step = files.step, lambda operation, path: steps.append((operation, path.name))
    try:
        assert action() == 0
    finally:
        files.step = usual
    return steps


def killed(action, at):
    """Carry an action out in a process that ends, as if killed, before its step number `at`."""

    def child():
        count = iter(range(at + 1))

        def die(_operation, _path):
            if next(count) == at:
                os._exit(9)

        files.step = die
        os._exit(action())

    process = FORK.Process(target=child)
    process.start()
    process.join(60)
    return process.exitcode


def parts(folder):
    return elevon.load_campaign(folder).runs.to_pandas()["split"].value_counts().to_dict()


OLD, NEW = {"train": 4, "test": 4}, {"fit": 6, "hold": 2}


def state(folder):
    """Return whether a folder is the old one or the new one; anything else is an error."""
    found = parts(folder)
    assert found in (OLD, NEW), found
    assert set(read_manifest(folder).split["shares"]) == set(found)
    assert elevon.load_campaign(folder).resolved().split["shares"].keys() == found.keys()
    return "new" if found == NEW else "old"


@pytest.mark.parametrize("every", [12, pytest.param(1, marks=pytest.mark.long)])
def test_a_split_killed_at_each_step_leaves_the_old_or_the_new(made, tmp_path, capsys, every):
    source, plan = made
    out = tmp_path / "set"
    shutil.copytree(source, out)
    steps = counted(lambda: main(["dataset", "split", str(out), *SPLIT]))
    assert sum(operation == "rename" for operation, _ in steps) >= 9
    states = []
    for at in range(0, len(steps), every):
        shutil.rmtree(out)
        shutil.copytree(source, out)
        assert killed(lambda: main(["dataset", "split", str(out), *SPLIT]), at) == 9
        states.append(state(out))
        assert main(["dataset", "repair", str(out)]) == 0
        assert state(out) == states[-1]
        assert main(["dataset", "verify", str(out)]) == 0
        assert not [path for path in out.iterdir() if path.suffix == ".next"]
        assert main(["campaign", "run", str(plan), "--out", str(out)]) == 0
        assert state(out) == states[-1]
    # One step switches: all before it leave the old, all after it the new.
    assert states == sorted(states, reverse=True)
    assert set(states) == {"old", "new"}
    capsys.readouterr()


def test_a_full_disk_at_each_step_of_a_split_leaves_the_old_or_the_new(made, tmp_path, capsys):
    source, _ = made
    out = tmp_path / "set"
    shutil.copytree(source, out)
    steps = counted(lambda: main(["dataset", "split", str(out), *SPLIT]))
    usual = files.step
    for at in range(0, len(steps), 14):
        shutil.rmtree(out)
        shutil.copytree(source, out)
        count = iter(range(len(steps) + 100))

        def full(_operation, _path, count=count, at=at):
            if next(count) == at:
                raise OSError(errno.ENOSPC, "No space left on device")

        files.step = full
        try:
            code = main(["dataset", "split", str(out), *SPLIT])
        finally:
            files.step = usual
        assert code in {0, 2}, steps[at]
        state(out)
        assert main(["dataset", "split", str(out), *SPLIT]) == 0
        assert state(out) == "new"
        assert main(["dataset", "verify", str(out)]) == 0
    assert "Traceback" not in capsys.readouterr().err


def test_the_split_is_no_part_of_the_plans_hash(made, tmp_path, capsys):
    source, plan = made
    out = tmp_path / "set"
    shutil.copytree(source, out)
    before = read_manifest(out).plan_hash
    assert main(["dataset", "split", str(out), *SPLIT]) == 0
    assert read_manifest(out).plan_hash == before
    assert main(["campaign", "run", str(plan), "--out", str(out)]) == 0
    assert "keeps the parts of its runs (fit = 0.75, hold = 0.25)" in capsys.readouterr().err
    assert main(["campaign", "resume", str(out)]) == 0
    assert parts(out) == NEW


def test_a_block_simulated_again_keeps_the_split(made, tmp_path, capsys):
    source, plan = made
    out = tmp_path / "set"
    shutil.copytree(source, out)
    assert main(["dataset", "split", str(out), *SPLIT]) == 0
    (out / "ends" / "block_00001.parquet").unlink()
    assert main(["campaign", "run", str(plan), "--out", str(out)]) == 0
    assert parts(out) == NEW
    assert main(["dataset", "verify", str(out)]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("command", ["run", "resume", "repair"])
def test_a_log_left_beside_a_finished_campaign_goes(made, tmp_path, capsys, command):
    source, plan = made
    out = tmp_path / "set"
    shutil.copytree(source, out)
    WorkLog.begin(out / LOG, read_manifest(out).plan_hash)
    words = {"run": ["campaign", "run", str(plan), "--out", str(out)],
             "resume": ["campaign", "resume", str(out)],
             "repair": ["dataset", "repair", str(out)]}  # fmt: skip
    assert main(words[command]) == 0
    assert sorted(p.name for p in out.iterdir()) == sorted(p.name for p in source.iterdir())
    capsys.readouterr()
