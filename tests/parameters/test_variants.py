"""A variant of one's own is a base and what differs, as short as it can be."""

import re
from pathlib import Path

import pytest

import elevon
from elevon.errors import InputError, RangeError, UnknownNameError

BASE = elevon.Actuator.load("torino-rotary")


def test_a_base_and_one_number_are_enough(tmp_path):
    path = tmp_path / "fast-gear.toml"
    path.write_text('base = "torino-rotary"\ngear.ratio = 50\nmotor.inertia = "9 kg cm2"\n')
    mine = elevon.Actuator.load(path)
    assert mine.name == "fast-gear"
    ratio = mine.parameters["gear.ratio"]
    assert (ratio.value, ratio.source, ratio.confidence) == (50.0, "given by the caller", "unknown")
    assert mine.parameters["motor.inertia"].value == 9e-4
    assert mine.parameters["motor.inertia"].text == "9 kg cm2"
    others = [p for p in BASE.parameters if p not in {"gear.ratio", "motor.inertia"}]
    assert all(mine.parameters[p].value == BASE.parameters[p].value for p in others)


def test_a_files_name_becomes_a_name_that_can_be(tmp_path):
    path = tmp_path / "my gear (2).toml"
    path.write_text('base = "torino-rotary"\n')
    assert elevon.Actuator.load(path).name == "my-gear-2"


def test_choices_and_numbers_whose_unit_is_si_need_no_unit(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('base = "torino-rotary"\ndrive.kind = "pwm"\n[friction]\ndynamic = 0.4\n')
    mine = elevon.Actuator.load(path)
    assert mine.parameters["drive.kind"].value == "pwm"
    assert mine.parameters["friction.dynamic"].text == "0.4 N m"


def test_a_base_beside_the_file_goes_by_its_name(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text('base = "torino-rotary"\ngear.ratio = 50\n')
    (tmp_path / "other.toml").write_text('base = "mine"\nmotor.pole_pairs = 5\n')
    monkeypatch.chdir(tmp_path.parent)
    other = elevon.Actuator.load(tmp_path / "other.toml")
    assert other.parameters.value("gear.ratio") == 50.0
    assert other.parameters.value("motor.pole_pairs") == 5.0
    monkeypatch.chdir(tmp_path)
    assert elevon.Actuator.load("mine").name == "mine"
    with pytest.raises(UnknownNameError):
        elevon.Actuator.load("mien")


def test_one_error_lists_all_that_is_wrong(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(
        'base = "torino-rotary"\nmotor.inertia = 8\ngear.ratoi = 50\nmotor.turns_a = 2\n'
        "motor.pole_pairs = true\n"
    )
    with pytest.raises(InputError) as caught:
        elevon.Actuator.load(path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 4
    expected = [("a.toml:2", "8 kg cm2"), (":3", "gear.ratio"), (":4", "(0, 1]"), (":5", "number")]
    for place, part in expected:
        assert any(place in line and part in line for line in lines), part


def test_a_single_error_keeps_its_kind(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('base = "torino-rotary"\nmotor.turns_a = 2\n')
    with pytest.raises(RangeError, match=r"a\.toml:2"):
        elevon.Actuator.load(path)


def test_the_page_on_own_actuators_shows_sets_that_load(tmp_path):
    page = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "own-actuators.md"
    blocks = re.findall(r"```toml\n(.*?)```", page.read_text("utf-8"), re.S)
    assert blocks
    for number, block in enumerate(blocks):
        text = block if "base = " in block else f'base = "torino-rotary"\n{block}'
        path = tmp_path / f"page-{number}.toml"
        path.write_text(text)
        assert elevon.Actuator.load(path).hash != BASE.hash
