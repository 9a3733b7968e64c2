"""What is damaged in a campaign's folder is rebuilt from what is whole; nothing is simulated."""

import json
import shutil

import pytest

import elevon
from elevon.campaign import block as block_module
from elevon.campaign import execute as execute_module
from elevon.campaign import read_manifest
from elevon.cli import main
from elevon.errors import FormatError

NAMES = ("manifest.json", "resolved.json", "plan.toml", "runs.parquet")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return folders of a finished campaign and of one that stopped after two of three blocks."""
    root = tmp_path_factory.mktemp("repair")
    path = root / "plan.toml"
    path.write_text(
        'actuator = "torino-rotary"\nfidelity = "low"\nruns_per_file = 2\n'
        'record = "output_position@400 Hz"\n[scenario]\nduration = "10 ms"\n'
        '[[scenario.command.terms]]\nkind = "sine"\namplitude = "7 deg"\nfrequency = "2 Hz"\n'
        '[[vary]]\nparameter = "friction.dynamic"\nfrom = "0.2 N m"\nto = "0.4 N m"\ncount = 6\n'
        "[split]\ntrain = 0.5\ntest = 0.5\n"
    )
    assert main(["campaign", "run", str(path), "--out", str(root / "whole")]) == 0
    done = []
    usual = execute_module.simulate_block

    def simulate(*arguments):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(1)
        return usual(*arguments)

    execute_module.simulate_block = simulate
    try:
        assert main(["campaign", "run", str(path), "--out", str(root / "begun")]) == 130
    finally:
        execute_module.simulate_block = usual
    return root


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


HARM = {"flip": flip, "remove": lambda path: path.unlink(), "cut": cut}


@pytest.fixture
def never_simulated(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("something was simulated")

    monkeypatch.setattr(execute_module, "simulate_block", refuse)
    monkeypatch.setattr(block_module, "simulate_prepared", refuse)


def contents(folder):
    return {name: (folder / name).read_bytes() for name in NAMES}


@pytest.mark.parametrize("harm", HARM)
@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_file_of_a_finished_campaign(made, tmp_path, capsys, never_simulated, name, harm):
    out = tmp_path / "set"
    shutil.copytree(made / "whole", out)
    before = contents(out)
    HARM[harm](out / name)
    assert main(["dataset", "verify", str(out)]) != 0
    capsys.readouterr()
    assert main(["dataset", "repair", str(out), "--json"]) == 0
    done = json.loads(capsys.readouterr().out)["done"]
    assert any(line.startswith(name) for line in done), done
    assert main(["dataset", "verify", str(out)]) == 0
    assert contents(out) == before
    capsys.readouterr()
    assert main(["dataset", "repair", str(out)]) == 0
    assert capsys.readouterr().out == "nothing is damaged\n"


@pytest.mark.parametrize("harm", HARM)
@pytest.mark.parametrize("name", [*NAMES, "progress.log"])
def test_a_damaged_file_of_a_begun_campaign(made, tmp_path, capsys, monkeypatch, name, harm):
    out = tmp_path / "set"
    shutil.copytree(made / "begun", out)
    HARM[harm](out / name)
    with monkeypatch.context() as patch:
        patch.setattr(block_module, "simulate_prepared", None)
        assert main(["dataset", "repair", str(out)]) == 0
    assert read_manifest(out).status == "running"
    assert [item.name for item in elevon.load_campaign(out).items] == ["block_00000", "block_00001"]
    capsys.readouterr()
    assert main(["campaign", "resume", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["skipped"] == 4
    assert main(["dataset", "verify", str(out)]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("name", [*NAMES, "progress.log"])
def test_resume_repairs_what_it_can_prove(made, tmp_path, capsys, name):
    out = tmp_path / "set"
    shutil.copytree(made / "begun", out)
    flip(out / name) if name != "progress.log" else (out / name).unlink()
    assert main(["campaign", "resume", str(out), "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["skipped"] == 4
    assert ("repaired: " in captured.err) or ("found whole" in captured.err)
    assert main(["dataset", "verify", str(out)]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("name", ["manifest.json", "resolved.json", "progress.log"])
def test_commands_that_meet_damage_name_the_repair(made, tmp_path, capsys, name):
    out = tmp_path / "set"
    shutil.copytree(made / "begun", out)
    (out / name).unlink()
    commands = [["dataset", "describe"]] if name == "manifest.json" else []
    commands += [["campaign", "status"]] if name != "resolved.json" else []
    commands += [["dataset", "export"]] if name == "resolved.json" else []
    for command in commands:
        more = ["--out", str(tmp_path / "x")] if "export" in command else []
        assert main([*command, str(out), *more]) == 2
        assert f"elevon dataset repair {out}" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "remedy"), [
    ("runs.parquet", "elevon dataset repair {}"),
    ("runs/at_400_hz/block_00001.parquet", "elevon campaign resume {} simulates its runs again"),
])  # fmt: skip
def test_a_table_that_is_damaged_names_its_remedy(made, tmp_path, name, remedy):
    out = tmp_path / "set"
    shutil.copytree(made / "whole", out)
    flip(out / name)
    ds = elevon.load_campaign(out)
    with pytest.raises(FormatError) as raised:
        (ds.signals if "block" in name else ds.runs).to_arrow()
    assert remedy.format(out) in str(raised.value)


def test_a_lost_block_is_named_and_simulated_by_resume(made, tmp_path, capsys):
    out = tmp_path / "set"
    shutil.copytree(made / "whole", out)
    flip(out / "runs" / "at_400_hz" / "block_00001.parquet")
    assert main(["dataset", "repair", str(out)]) == 0
    assert "block_00001: is damaged or has gone" in capsys.readouterr().out
    assert main(["campaign", "resume", str(out)]) == 0
    assert main(["dataset", "verify", str(out)]) == 0
    capsys.readouterr()


def test_what_nothing_proves_is_no_repair(made, tmp_path, capsys):
    out = tmp_path / "set"
    shutil.copytree(made / "whole", out)
    for name in ("resolved.json", "runs.parquet", "plan.toml"):
        flip(out / name)
    assert main(["dataset", "repair", str(out)]) == 2
    assert "cannot be repaired" in capsys.readouterr().err
    assert main(["dataset", "repair", str(tmp_path)]) == 2
    assert "is not a campaign folder" in capsys.readouterr().err


def test_a_split_outlives_a_repair(made, tmp_path, capsys):
    out = tmp_path / "set"
    shutil.copytree(made / "whole", out)
    shares = ["--share", "fit=0.5", "--share", "hold=0.5"]
    assert main(["dataset", "split", str(out), *shares, "--seed", "5"]) == 0
    parts = elevon.load_campaign(out).runs.to_pandas()["split"].tolist()
    for name in NAMES:
        (out / name).unlink()
        assert main(["dataset", "repair", str(out)]) == 0, name
        assert elevon.load_campaign(out).runs.to_pandas()["split"].tolist() == parts
        assert main(["dataset", "verify", str(out)]) == 0
    capsys.readouterr()
