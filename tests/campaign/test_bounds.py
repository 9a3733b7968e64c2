"""What a plan or folder of unknown origin may not do: fill memory, read or write elsewhere."""

import json
import os
import stat

import pytest

from elevon.campaign import load_plan, resolve_plan
from elevon.campaign.resolve import MOST_RUNS
from elevon.cli import main
from elevon.errors import FormatError, InputError

DRAW = (
    '[random]\ncount = {}\n[[random.draw]]\nparameter = "friction.dynamic"\n'
    'from = "0.2 N m"\nto = "0.4 N m"\n'
)
FACTOR = '[[design.factor]]\nparameter = "{}"\nfrom = {}\nto = {}\n'


@pytest.mark.parametrize(
    ("tail", "words"),
    [
        (DRAW.format(10**12), "1000000000000 random draws = 1000000000000 runs; the limit is"),
        (
            "[population]\nunits = 1000000000000\n[[population.spread]]\n"
            'parameter = "friction.dynamic"\nsd = "3 %"\n',
            "1000000000000 units",
        ),
        (
            '[[vary]]\nparameter = "friction.dynamic"\nfrom = "0.2 N m"\nto = "0.4 N m"\n'
            "count = 1000000000000\n",
            "1000000000000 values of vary[0]",
        ),
        (
            '[design]\nkind = "full_factorial"\nreplicates = 1000000000000\n'
            + FACTOR.format("friction.dynamic", '"0.2 N m"', '"0.4 N m"'),
            "2000000000000 points of the design",
        ),
    ],
    ids=["random", "population", "vary", "design"],
)
def test_counts_are_checked_before_anything_is_built(plan, cli, tail, words):
    path = plan(0, tail=tail)
    code, _, err = cli("campaign", "plan", path)
    assert code == 2
    assert words in err
    assert str(MOST_RUNS) in err


def test_many_seeds_times_many_values(plan, cli):
    path = plan(256, head=f"seeds = {list(range(100_000))}")
    code, _, err = cli("campaign", "plan", path)
    assert code == 2
    assert "100000 seeds x 256 values of vary[0] = 25600000 runs" in err


@pytest.fixture
def plans(tmp_path):
    """Return a folder of plans, and a table and an actuator file that lie outside it."""
    folder = tmp_path / "plans"
    folder.mkdir()
    (tmp_path / "secret.csv").write_text("0,0\n1,0.3\n")
    (tmp_path / "mine.toml").write_text('base = "torino-rotary"\n')
    return folder


def _plan(folder, actuator="torino-rotary", fault="friction@transmission=0.2", scenario=None):
    path = folder / "plan.toml"
    inline = (
        '[scenario]\nduration = "10 ms"\n[[scenario.command.terms]]\nkind = "sine"\n'
        'amplitude = "7 deg"\nfrequency = "2 Hz"\n'
    )
    path.write_text(
        f'actuator = "{actuator}"\nfidelity = "low"\nrecord = "output_position@400 Hz"\n'
        + (inline if scenario is None else f'scenario = "{scenario}"\n')
        + f'[[case]]\nname = "a"\nfaults = ["{fault}"]\n'
    )
    return path


@pytest.mark.parametrize(
    "options",
    [
        {"fault": "friction@transmission=0.2:table(file=../secret.csv)"},
        {"fault": "friction@transmission=0.2:table(file=link.csv)"},
        {"actuator": "../mine.toml"},
        {"scenario": "../scenario.toml"},
    ],
    ids=["table", "link", "actuator", "scenario"],
)
def test_a_plan_reads_below_its_folder_only(plans, capsys, options):
    (plans.parent / "scenario.toml").write_text('duration = "10 ms"\n')
    (plans / "link.csv").symlink_to(plans.parent / "secret.csv")
    path = _plan(plans, **options)
    for command in (["plan", str(path)], ["run", str(path), "--out", str(plans / "out")]):
        assert main(["campaign", *command]) == 2
        err = capsys.readouterr().err
        assert "lies outside the plan's folder" in err
        assert "--allow-outside" in err
    assert not (plans / "out").exists()
    assert main(["campaign", "plan", str(path), "--allow-outside"]) == 0
    assert len(resolve_plan(*load_plan(path), allow_outside=True)) == 1
    capsys.readouterr()


@pytest.mark.parametrize("kind", ["device", "pipe", "large"])
@pytest.mark.parametrize("what", ["plan", "table", "design"])
def test_kind_and_size_of_a_file_are_checked_before_it_is_read(tmp_path, capsys, kind, what):
    harm = tmp_path / "harm.toml"
    if kind == "device":
        harm = "/dev/zero"
    elif kind == "pipe":
        os.mkfifo(harm)
    else:
        with harm.open("wb") as stream:
            stream.truncate(2**31)
    if what == "plan":
        path = harm
    elif what == "table":
        path = _plan(tmp_path, fault=f"friction@transmission=0.2:table(file={harm})")
    else:
        path = _plan(tmp_path)
        path.write_text(
            path.read_text().partition("[[case]]")[0]
            + f'[design]\nkind = "table"\nfile = "{harm}"\n'
            + FACTOR.format("friction.dynamic", '"0.2 N m"', '"0.4 N m"')
        )
    more = [] if what == "plan" else ["--allow-outside"]
    assert main(["campaign", "plan", str(path), *more]) == 2
    err = capsys.readouterr().err
    assert ("is no regular file" in err) if kind != "large" else ("the limit is" in err), err


WRITERS = {
    "run": lambda plan, out: ["campaign", "run", str(plan), "--out", str(out)],
    "resume": lambda _, out: ["campaign", "resume", str(out)],
    "split": lambda _, out: ["dataset", "split", str(out), "--share", "a=1"],
    "repair": lambda _, out: ["dataset", "repair", str(out)],
}


@pytest.mark.parametrize("kind", ["symbolic", "hard"])
@pytest.mark.parametrize("name", [".elevon.lock", "runs.parquet", "ends", "plan.toml"])
@pytest.mark.parametrize("writer", WRITERS)
def test_nothing_is_written_through_a_link(plan, cli, tmp_path, capsys, writer, name, kind):
    path, out = plan(2, head="runs_per_file = 1"), tmp_path / "out"
    assert cli("campaign", "run", path, "--out", out)[0] == 0
    foreign = tmp_path / "foreign"
    target = out / name
    if name == "ends":
        if kind == "hard":
            target = out / "ends" / "block_00000.parquet"
            target.unlink()
        else:
            for item in target.iterdir():
                item.unlink()
            target.rmdir()
    else:
        target.unlink(missing_ok=True)
    if name == "ends" and kind == "symbolic":
        foreign.mkdir()
        target.symlink_to(foreign)
    else:
        foreign.write_bytes(b"precious")
        target.symlink_to(foreign) if kind == "symbolic" else os.link(foreign, target)
    code = main(WRITERS[writer](path, out))
    err = capsys.readouterr().err
    assert code in {0, 2}, err
    if code == 2:
        assert "nothing is written" in err or "damaged" in err, err
    if name == ".elevon.lock":
        assert code == 2
    if foreign.is_dir():
        assert not list(foreign.iterdir())
    else:
        assert foreign.read_bytes() == b"precious"
        assert stat.S_ISREG(foreign.stat().st_mode)


def test_a_refused_file_is_not_printed(tmp_path, capsys):
    secret = tmp_path / "secret.toml"
    secret.write_text("password = 'hunter2'\nroot:x:0:0\n")
    assert main(["campaign", "plan", str(secret)]) == 2
    err = capsys.readouterr().err
    assert "not valid TOML" in err
    assert "hunter2" not in err
    assert "root:x" not in err


def test_deep_json_and_pipes_in_a_folder(plan, cli, tmp_path):
    path, out = plan(2), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    good = (out / "manifest.json").read_text()
    (out / "manifest.json").write_text("[" * 100_000)
    assert cli("dataset", "describe", out)[0] == 2
    (out / "manifest.json").unlink()
    os.mkfifo(out / "manifest.json")
    assert cli("dataset", "describe", out)[0] == 2
    (out / "manifest.json").unlink()
    (out / "manifest.json").write_text(json.dumps({**json.loads(good), "schema": 1}))
    with pytest.raises((FormatError, InputError)):
        __import__("elevon").load_campaign(out)
