"""Writing back into a set file keeps what is there."""

import difflib
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import elevon
from elevon.errors import InputError, OutputExistsError
from elevon.parameters import updated_set, write_set

ACTUATOR = elevon.Actuator.load("torino-rotary")
TEXT = ACTUATOR.path.read_text(encoding="utf-8")


def calibrated(path="motor.inertia", value=9e-4):
    old = ACTUATOR.parameters[path]
    return replace(
        old, value=value, old=old.value, confidence="calibrated", source="fit", note="",
        interval=(0.9 * value, 1.1 * value),
    )  # fmt: skip


def test_only_the_entry_changes():
    new = updated_set(TEXT, [calibrated()])
    changed = [
        line
        for line in difflib.ndiff(TEXT.splitlines(), new.splitlines())
        if line.startswith(("+ ", "- "))
    ]
    assert "+ value = 9.0" in changed
    assert "+ old = 7.7" in changed
    assert len(changed) <= 10
    assert new.count("#") == TEXT.count("#")


@given(st.floats(1e-6, 10.0))
def test_values_read_back_to_the_last_bit(value):
    new = updated_set(TEXT, [calibrated(value=value)])
    number = next(
        line for line in new.split("[motor.inertia]")[1].splitlines() if line.startswith("value")
    )
    again = ACTUATOR.with_values({"motor.inertia": number.partition("=")[2] + " kg cm2"})
    assert again.parameters["motor.inertia"].value == pytest.approx(value, rel=1e-15)


def test_a_new_set_over_a_base(tmp_path):
    path = tmp_path / "fitted.toml"
    write_set(path, name="fitted", base="torino-rotary", changes=[calibrated()])
    loaded = elevon.Actuator.load(path)
    parameter = loaded.parameters["motor.inertia"]
    assert parameter.value == pytest.approx(9e-4, rel=1e-15)
    assert parameter.confidence == "calibrated"
    assert parameter.interval == pytest.approx((8.1e-4, 9.9e-4))
    with pytest.raises(OutputExistsError):
        write_set(path, name="fitted", base="torino-rotary", changes=[])


def test_a_value_without_provenance_is_not_written():
    changed = ACTUATOR.with_values({"motor.inertia": 1e-3})
    with pytest.raises(InputError, match="source and a confidence"):
        updated_set(TEXT, [changed.parameters["motor.inertia"]])
