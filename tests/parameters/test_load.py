"""Set files: what is accepted, and what every refusal says."""

import math

import pytest

import elevon
from elevon.errors import FormatError, InputError, RangeError, UnitError, UnknownNameError
from elevon.parameters import json_schema, load_set, records

BASE = 'name = "mine"\nbase = "torino-rotary"\n'


def entry(path="motor.inertia", value="9.0", unit='"kg cm2"', **more):
    lines = [f"[{path}]", f"value = {value}"]
    keys = {"unit": unit, "source": '"bench"', "confidence": '"published"'} | more
    lines += [f"{key} = {text}" for key, text in keys.items() if text is not None]
    return "\n".join(lines) + "\n"


@pytest.fixture
def write(tmp_path):
    def make(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return make


def test_a_file_overrides_its_base(write):
    actuator = elevon.Actuator.load(write(BASE + entry()))
    base = elevon.Actuator.load("torino-rotary")
    assert actuator.name == "mine"
    assert actuator.wiring == "rotary"
    assert actuator.parameters["motor.inertia"].value == 9e-4
    assert actuator.parameters["gear.ratio"] == base.parameters["gear.ratio"]
    assert actuator.hash != base.hash
    assert set(actuator.references) == {"T1", "T2", "T3"}


def test_a_base_may_be_a_file_beside_it(write):
    write(BASE + entry(), "first.toml")
    second = write('name = "second"\nbase = "first.toml"\n' + entry(value="8.0"), "second.toml")
    assert elevon.Actuator.load(second).parameters["motor.inertia"].value == 8e-4


def test_a_folder_of_the_user_is_searched(write, monkeypatch):
    path = write(BASE + entry(), "shop-floor.toml")
    monkeypatch.setenv("ELEVON_ACTUATORS", str(path.parent))
    assert load_set("shop-floor").name == "mine"
    monkeypatch.setenv("ELEVON_ACTUATORS", str(path.parent / "nowhere"))
    with pytest.raises(InputError, match="ELEVON_ACTUATORS"):
        load_set("torino-rotary")


def test_calibrated_entries_keep_the_old_value(write):
    text = entry(old="7.7", interval="[8.5, 9.5]", confidence='"calibrated"')
    parameter = elevon.Actuator.load(write(BASE + text)).parameters["motor.inertia"]
    assert parameter.old == pytest.approx(7.7e-4)
    assert parameter.interval == pytest.approx((8.5e-4, 9.5e-4))


REFUSED = {
    "unknown path": (entry("motor.inertai"), UnknownNameError, "motor.inertia"),
    "negative": (entry(value="-9.0"), RangeError, r"-0\.0009 kg m2 is outside \(0, inf\)"),
    "nan": (entry(value="nan"), InputError, "nan"),
    "wrong kind": (entry(unit='"N m"'), UnitError, "expected an inertia"),
    "unknown unit": (entry(unit='"kg cn2"'), UnitError, "kg cm2|did you mean"),
    "no unit": (entry(unit=None), InputError, "the unit is missing"),
    "silent source": (entry(source='" "'), InputError, "a source is needed"),
    "bare ASSUMED": (entry(source='"ASSUMED:"'), InputError, "a source is needed"),
    "no source": (entry(source=None), InputError, "source: is missing"),
    "unknown key": (entry(sorce='"x"'), InputError, "did you mean 'source'"),
    "bad confidence": (entry(confidence='"sure"'), InputError, "published"),
    "text value": (entry(value='"9 kg cm2"', unit=None), InputError, "is text"),
    "bool value": (entry(value="true"), InputError, "not a number"),
    "choice": (
        entry("drive.kind", '"pmw"', None),
        InputError,
        "did you mean 'pwm'",
    ),
    "no turns": (entry("motor.turns_a", "0.0", None), RangeError, r"outside \(0, 1\]"),
    "too many turns": (entry("motor.turns_a", "1.2", None), RangeError, r"outside \(0, 1\]"),
    "zero step": (entry("solver.step", "0.0", '"s"'), RangeError, r"outside \[1e-12, 1\] s"),
    "interval": (entry(interval="[9.5, 8.5]"), InputError, "ends before it starts"),
    "loose key": ("[motor]\ninertia = 3\n", UnitError, "'3 kg cm2' .*'3 kg m2'"),
    "list": ("[motor]\ninertia = [3]\n", InputError, "a parameter is a number, a text with a unit"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_file_line_and_path(write, name):
    text, error, message = REFUSED[name]
    path = write(BASE + text)
    with pytest.raises(error, match=message) as caught:
        elevon.Actuator.load(path)
    assert str(path) in str(caught.value)


def test_errors_name_the_line(write):
    path = write(BASE + "\n# a comment\n" + entry(value="-9.0"))
    with pytest.raises(RangeError, match=f"{path.name}:5: motor.inertia"):
        elevon.Actuator.load(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "mine"\n', "'wiring' is missing"),
        ('name = "mine"\nwiring = "rotery"\n', "unknown wiring 'rotery'"),
        ('name = "mine"\nwiring = "rotary"\n', "parameter(s) missing"),
        ('nam = "mine"\nwiring = "rotary"\n', "did you mean 'name'"),
        ('name = "mine"\nbase = "torino-rotry"\n', "did you mean 'torino-rotary'"),
        ('name = "mine"\nbase = "mine.toml"\n', "in a circle"),
    ],
)
def test_bad_headers(write, text, message):
    with pytest.raises(InputError) as caught:
        elevon.Actuator.load(write(text))
    assert message in str(caught.value)


def test_bad_files(write, tmp_path):
    with pytest.raises(FormatError, match=r"not valid TOML.*line 1"):
        elevon.Actuator.load(write("name = \n"))
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe")
    with pytest.raises(FormatError, match="UTF-8"):
        elevon.Actuator.load(binary)
    with pytest.raises(InputError, match="no such actuator file"):
        elevon.Actuator.load(tmp_path / "absent.toml")
    with pytest.raises(UnknownNameError) as caught:
        elevon.Actuator.load("torino-rotry")
    assert caught.value.nearest == ["torino-rotary"]


ACTUATOR = elevon.Actuator.load("torino-rotary")


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"motor.inertai": 1.0}, UnknownNameError, "did you mean 'motor.inertia'"),
        ({"motor.inertia": -1.0}, RangeError, "outside"),
        ({"motor.inertia": math.nan}, RangeError, "not a finite number"),
        ({"motor.inertia": "nan"}, RangeError, "not a finite number"),
        ({"motor.inertia": math.inf}, RangeError, "not a finite number"),
        ({"motor.inertia": "3 N"}, UnitError, "expected an inertia"),
        ({"motor.inertia": True}, InputError, "is not a number"),
        ({"motor.inertia": None}, InputError, "is not a number"),
        ({"drive.kind": 1}, InputError, "is none of"),
        ({"drive.kind": "of"}, InputError, "did you mean 'off'"),
    ],
)
def test_bad_overrides(values, error, message):
    with pytest.raises(error, match=message):
        ACTUATOR.with_values(values)


def test_overrides_keep_the_old_value_and_leave_the_original_alone():
    changed = ACTUATOR.with_values({"motor.inertia": "9 kg cm2", "drive.kind": "pwm"})
    parameter = changed.parameters["motor.inertia"]
    assert (parameter.value, parameter.old, parameter.confidence) == (9e-4, 7.7e-4, "override")
    assert ACTUATOR.parameters["motor.inertia"].value == 7.7e-4
    known = records("rotary")
    vector = changed.parameters.vector()
    rebuilt = [known[path].number(item.value) for path, item in changed.parameters.items()]
    assert vector.tolist() == rebuilt
    with pytest.raises(ValueError, match="read-only"):
        vector[0] = 1.0


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        ("solver.step", 1e-4, "hysteresis_band"),
        ("solver.step", 0.1, "electrical pole"),
    ],
)
def test_values_that_contradict_each_other_are_refused_before_the_run(path, value, named):
    scenario = elevon.Scenario.from_dict({"duration": "10 ms"})
    with pytest.raises(InputError, match=named):
        elevon.simulate(ACTUATOR.with_values({path: value}), scenario)


def test_contact_stiffness_too_large_for_the_step_is_named():
    stiff = ACTUATOR.with_values({"backlash.model": "elastic", "backlash.stiffness": 1e12})
    with pytest.raises(InputError, match=r"backlash\.stiffness"):
        elevon.simulate(stiff, elevon.Scenario.from_dict({"duration": "10 ms"}))


def test_schema_describes_every_parameter():
    schema = json_schema("rotary")
    for path, record in records("rotary").items():
        node = schema
        for part in path.split("."):
            node = node["properties"][part]
        assert node["x-unit"] == record.unit
        assert node["description"] == record.text
    assert schema["additionalProperties"] is False
