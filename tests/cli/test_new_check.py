"""``elevon new`` and ``elevon check``: from nothing to a set of one's own, all errors at once."""

import re

import pytest

from elevon import Actuator


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("base", ["torino-rotary", "nasa-ballscrew", "pisa-landing-gear"])
def test_the_new_file_is_its_base_until_a_line_is_changed(elevon_cli, tmp_path, base):
    assert elevon_cli("new", "mine", "--from", base, "--json").json["file"] == "mine.toml"
    mine, given = Actuator.load("mine"), Actuator.load(base)
    assert mine.name == "mine"
    assert mine.hash == given.hash
    text = (tmp_path / "mine.toml").read_text()
    for path in given.parameters:
        assert f"# {path} = " in text
    # every line, its # removed, is a valid entry of the same value
    free = re.sub(r"(?m)^# ([a-z_0-9]+\.[a-z_0-9.]+ = )", r"\1", text)
    (tmp_path / "free.toml").write_text(free)
    texts = {path: item.text for path, item in given.parameters.items()}
    assert {p: i.text for p, i in Actuator.load("free").parameters.items()} == texts
    assert elevon_cli("new", "mine", "--from", base).code == 2


def test_a_name_that_cannot_be_and_a_base_that_is_not(elevon_cli):
    assert elevon_cli("new", "-x y", "--from", "torino-rotary").code == 2
    assert "did you mean 'torino-rotary'" in elevon_cli("new", "a", "--from", "torino").err


def test_check_reports_everything_at_once(elevon_cli, tmp_path):
    (tmp_path / "bad.toml").write_text(
        'base = "torino-rotary"\ntitel = "x"\nmotor.inertia = 8\ngear.ratoi = 50\n'
    )
    result = elevon_cli("check", "bad.toml", "--json")
    assert result.code == 1
    text = " ".join(row["message"] for row in result.json["findings"])
    for part in ("titel", "8 kg cm2", "gear.ratio"):
        assert part in text
    assert result.json["status"] == "fail"


def test_check_of_a_good_set_names_what_has_no_source(elevon_cli, tmp_path):
    (tmp_path / "good.toml").write_text('base = "torino-rotary"\ngear.ratio = 50\n')
    result = elevon_cli("check", "good.toml", "--json")
    assert result.code == 0
    (row,) = [r for r in result.json["findings"] if "gear.ratio" in r["message"]]
    assert row["severity"] == "warning"


def test_check_tells_values_that_cannot_stand_together(elevon_cli, tmp_path):
    (tmp_path / "slow.toml").write_text('base = "torino-rotary"\nsolver.step = "20 ms"\n')
    result = elevon_cli("check", "slow.toml")
    assert result.code == 1
    assert "electrical pole" in result.out


def test_a_set_with_a_load_is_no_scenario(elevon_cli, tmp_path):
    text = 'base = "nasa-ballscrew"\n[load.mass]\nvalue = 5.0\nunit = "kg"\nsource = "mine"\n'
    text += 'confidence = "assumed"\n'
    (tmp_path / "drive.toml").write_text(text)
    result = elevon_cli("check", "drive.toml", "--json")
    assert (result.code, result.json["kind"]) == (0, "set")


def test_check_of_a_scenario(elevon_cli, tmp_path):
    (tmp_path / "s.toml").write_text(
        "duration = 1\n[[command.terms]]\nkind = 'constant'\nvalue = 7\n[initial]\nspeed = 1\n"
    )
    result = elevon_cli("check", "s.toml", "--json")
    assert result.code == 1
    assert result.json["kind"] == "scenario"
    assert "'7 deg'" in result.json["findings"][0]["message"]
    (tmp_path / "s.toml").write_text("duration = 1\n[initial]\nspeed = 0\n")
    assert elevon_cli("check", "s.toml").code == 0
    assert elevon_cli("check", "s.toml", "--actuator", "torino-rotary").code == 1


def test_check_of_a_set_reads_the_units_of_its_scenario(elevon_cli, tmp_path):
    (tmp_path / "mine.toml").write_text(
        'base = "torino-rotary"\n[scenario]\nduration = 1\n[[scenario.command.terms]]\n'
        "kind = 'constant'\nvalue = 7\n"
    )
    result = elevon_cli("check", "mine.toml", "--json")
    assert result.code == 1
    (row,) = result.json["findings"]
    assert "mine.toml:6" in row["message"]
    assert "'7 deg'" in row["message"]
