"""What `simulate` and `Run` take: actuators and scenarios in every form a caller has them."""

import dataclasses
import pickle

import pytest

import elevon
from elevon.errors import ArgumentTypeError

SHORT = {"duration": "20 ms", "command": {"terms": [{"kind": "step", "final": "1 deg"}]}}
RECORD = "output_position@400 Hz"


@pytest.fixture(scope="module")
def actuator():
    return elevon.Actuator.load("torino-rotary")


@pytest.fixture(scope="module")
def expected(actuator):
    return elevon.simulate(actuator, elevon.Scenario.from_dict(SHORT), record=RECORD)


def test_a_scenario_is_an_object_a_dict_or_a_file(actuator, expected, tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(
        'duration = "20 ms"\n[[command.terms]]\nkind = "step"\nfinal = "1 deg"\n', "utf-8"
    )
    for scenario in (SHORT, path, str(path)):
        again = elevon.simulate("torino-rotary", scenario, record=RECORD)
        assert again["output_position"].equals(expected["output_position"])


def test_without_a_scenario_the_actuators_own_runs(actuator):
    default = elevon.Scenario.from_dict(actuator.default_scenario)
    assert elevon.Run(actuator).scenario == default
    for name in elevon.list_actuators():
        assert elevon.Run(name).scenario.seconds > 0.0


def test_a_run_is_a_value(actuator):
    run = elevon.Run(actuator, SHORT, 3, "mine", number=5)
    assert pickle.loads(pickle.dumps(run)) == run
    other = dataclasses.replace(run, seed=4)
    assert (other.seed, other.label, other.number, other.scenario) == (4, "mine", 5, run.scenario)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((3,), ["actuator", "an int", "expected an Actuator", "TOML file"]),
        (("torino-rotary", 4.0), ["scenario", "a float", "a Scenario, a dict", "None"]),
        (("torino-rotary", ["sine"]), ["scenario", "a list"]),
    ],
)
def test_other_types_are_refused_with_what_is_expected(arguments, message):
    for call in (elevon.simulate, elevon.Run):
        with pytest.raises(TypeError) as caught:
            call(*arguments)
        assert isinstance(caught.value, ArgumentTypeError)
        assert isinstance(caught.value, elevon.InputError)
        assert all(word in str(caught.value) for word in message)


def test_a_batch_of_something_else_is_refused(actuator):
    with pytest.raises(ArgumentTypeError, match=r"runs\[1\]: a dict is no run; expected"):
        elevon.simulate_batch([elevon.Run(actuator, SHORT), SHORT])


def test_the_package_shows_its_public_names_only():
    names = dir(elevon)
    assert set(names) == set(elevon.__all__)
    assert {"Actuator", "Scenario", "Recording", "simulate", "list_actuators"} <= set(names)
    assert all(getattr(elevon, name) is not None for name in names)


def test_the_listed_actuators_load():
    listed = elevon.list_actuators()
    assert {"torino-rotary", "nasa-ballscrew", "pisa-landing-gear"} <= set(listed)
    assert [elevon.Actuator.load(name).name for name in listed] == listed
