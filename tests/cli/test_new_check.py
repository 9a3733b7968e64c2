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


NUMBERS = ("--linear", "--supply", "28V", "--power", "50W", "--lead", "2mm", "--gear", "4")


def test_a_file_of_few_numbers_is_one_page_and_passes_its_check(elevon_cli, tmp_path):
    made = elevon_cli("new", "mine", *NUMBERS, "--encoder", "1024", "--bench", "bench.toml")
    assert made.out.startswith("wrote mine.toml: 1440 N at 25 mm/s, motor 3000 rpm and 3.032 A")
    assert "ASSUMED motor_speed 3000 rpm" in made.out
    lines = (tmp_path / "mine.toml").read_text().splitlines()
    assert len([line for line in lines if line and not line.startswith("#")]) <= 40
    assert elevon_cli("check", "mine.toml").out == "mine.toml: 0 errors, 0 warnings\n"
    # every line, its # removed, is a number of the design of the same value
    text = re.sub(r"(?m)^# ([a-z_]+ = )", r"\1", (tmp_path / "mine.toml").read_text())
    (tmp_path / "free.toml").write_text(text)
    free, mine = Actuator.load("free.toml"), Actuator.load("mine.toml")
    assert set(free.design) == set(mine.design)
    for name, item in mine.design.items():
        assert free.design[name].value == pytest.approx(item.value, rel=1e-3)


def test_a_design_of_another_and_what_is_changed(elevon_cli, tmp_path):
    elevon_cli("new", "mine", *NUMBERS)
    assert elevon_cli("new", "low", "--from", "mine.toml", "--supply", "24V").code == 0
    text = (
        (tmp_path / "low.toml")
        .read_text()
        .replace("\n[design]", "\nmotor.pole_pairs = 5\n[design]")
    )
    (tmp_path / "low.toml").write_text(text)
    answer = elevon_cli("show", "low.toml", "--changed", "--json").json
    assert [row["path"] for row in answer["parameters"]] == ["motor.pole_pairs"]
    design = {name: row["confidence"] for name, row in answer["design"].items()}
    assert answer["design"]["supply"]["text"] == "24 V"
    assert (design["motor_speed"], design["speed"]) == ("assumed", "derived")
    printed = elevon_cli("show", "low.toml", "--changed").out
    assert "design.motor_speed" in printed
    assert "design.speed" not in printed


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (NUMBERS[1:], "one of --linear, --rotary or --from"),
        ((*NUMBERS, "--torque", "5 N m"), "--linear takes --thrust"),
        ((*NUMBERS, "--motor", "torque_konstant=1 N m/A"), "did you mean 'torque_constant'"),
        ((*NUMBERS, "--motor", "resistance"), "KEY=QUANTITY"),
        ((*NUMBERS, "--mass", "3"), "--mass: 3 has no unit; write it like '3 kg'"),
        (("--from", "torino-rotary", "--supply", "270V"), "has no [design]"),
        (("--rotary", "--supply", "270V"), "lacks power (or torque and speed"),
    ],
)
def test_new_refuses_and_writes_nothing(elevon_cli, tmp_path, options, text):
    refused = elevon_cli("new", "mine", *options)
    assert refused.code == 2
    assert text in refused.err
    assert not (tmp_path / "mine.toml").exists()
