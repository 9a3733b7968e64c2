import pytest

from elevon import errors
from elevon.errors import ElevonError, InputError, did_you_mean, nearest, unknown

PATHS = [
    "motor.inertia",
    "motor.winding_resistance",
    "gear.ratio",
    "backlash.total",
    "output.inertia",
]


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("motor.inertie", "motor.inertia"),
        ("Motor.Inertia", "motor.inertia"),
        ("motor_inertia", "motor.inertia"),
        ("motor-winding-resistance", "motor.winding_resistance"),
        ("ratio", "gear.ratio"),
        ("backlash.totl", "backlash.total"),
    ],
)
def test_nearest_name_comes_first(wrong, right):
    assert nearest(wrong, PATHS)[0] == right


def test_part_of_a_name_finds_every_whole():
    assert set(nearest("inertia", PATHS)) == {"motor.inertia", "output.inertia"}


def test_nothing_near_gives_nothing():
    assert nearest("zzzzzz", PATHS) == []
    assert nearest("motor", []) == []


def test_count_bounds_the_answer():
    assert len(nearest("current_x", [f"current_{c}" for c in "abcdefgh"], count=2)) == 2


def test_few_valid_names_are_listed_and_many_are_not():
    assert did_you_mean("zzz", ["one", "two"]) == "; valid: 'one', 'two'"
    assert did_you_mean("zzz", [f"name{k}" for k in range(100)]) == ""


def test_unknown_names_the_place_the_name_and_the_nearest():
    error = unknown("parameter", "motor.inertai", PATHS, "torino.toml")
    assert str(error).startswith("torino.toml: unknown parameter 'motor.inertai'; did you mean")
    assert (error.name, error.nearest[0]) == ("motor.inertai", "motor.inertia")


def test_every_error_is_of_the_family_and_says_its_exit_code():
    family = [
        value
        for value in vars(errors).values()
        if isinstance(value, type)
        and issubclass(value, Exception)
        and not issubclass(value, Warning)
    ]
    assert len(family) > 8
    for error in family:
        assert issubclass(error, ElevonError)
        expected = 2 if issubclass(error, InputError) else 1
        assert error.exit_code == (130 if error is errors.Interrupted else expected)


def test_every_warning_is_of_the_family_and_says_the_exit_code_of_its_refusal():
    family = [
        value
        for value in vars(errors).values()
        if isinstance(value, type) and issubclass(value, Warning)
    ]
    assert len(family) > 2
    for warning in family:
        assert issubclass(warning, errors.ElevonWarning)
        assert warning.exit_code == InputError.exit_code
