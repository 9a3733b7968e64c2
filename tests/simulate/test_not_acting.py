"""In Python: a warning of its own category, or an error; once for a batch."""

import warnings

import pytest

import elevon
from elevon.errors import FindingWarning, NotActingError, NotActingWarning
from elevon.simulate import acting, sensitivities

SCENARIO = elevon.Scenario.from_dict({"duration": 0.01})
ACTUATOR = elevon.Actuator.load("torino-rotary")
IDLE = ACTUATOR.with_values({"solver.step": 2e-6})


def test_a_warning_names_path_value_and_reason():
    with pytest.warns(NotActingWarning, match=r"solver\.step = 2 us has no effect: .*low\.step"):
        elevon.simulate(IDLE, SCENARIO, fidelity="low")


@pytest.mark.parametrize(
    "call",
    [
        lambda: elevon.simulate(IDLE, SCENARIO, fidelity="low", strict=True),
        lambda: elevon.simulate_batch([elevon.Run(IDLE, SCENARIO)], fidelity="low", strict=True),
        lambda: sensitivities(IDLE, SCENARIO, ["motor.inertia"], strict=True),
    ],
    ids=["simulate", "simulate_batch", "sensitivities"],
)
def test_strict_is_an_error(call):
    with pytest.raises(NotActingError, match=r"solver\.step"):
        call()


def test_a_batch_says_it_once():
    runs = [elevon.Run(IDLE, SCENARIO, seed) for seed in range(3)]
    with pytest.warns(NotActingWarning) as caught:
        elevon.simulate_batch(runs, fidelity="low")
    assert len(caught) == 1


def test_what_the_scenario_sets_counts():
    scenario = elevon.Scenario.from_dict({"duration": 0.01, "parameters": {"solver.step": 2e-6}})
    with pytest.raises(NotActingError, match=r"solver\.step"):
        elevon.simulate(ACTUATOR, scenario, fidelity="low", strict=True)


def test_a_value_set_back_counts_as_not_set():
    back = IDLE.with_values({"solver.step": ACTUATOR.parameters.value("solver.step")})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        elevon.simulate(back, SCENARIO, fidelity="low")


def test_doubts_of_the_core_are_warnings_and_its_refusals_errors(monkeypatch):
    found = [{"path": "a.b", "message": "a.b = 1 is near its limit", "severity": "warning"}]
    monkeypatch.setattr(elevon.Actuator, "findings", lambda *_: found)
    assert acting.check_values(ACTUATOR, "high") == [
        acting.Notice(FindingWarning, "a.b = 1 is near its limit")
    ]
    found[0] = {**found[0], "severity": "error"}
    with pytest.raises(elevon.InputError, match="near its limit"):
        acting.check_values(ACTUATOR, "high")


def faulty(*faults: str) -> elevon.Scenario:
    return elevon.Scenario.from_dict(
        {
            "duration": 0.01,
            "fault": [
                dict(zip(("kind", "place", "severity"), each.split(), strict=True))
                for each in faults
            ],
        }
    )


def test_a_fault_that_changes_nothing_is_refused():
    with pytest.raises(elevon.InputError, match=r"connector_open@supply has no effect .*link_cap"):
        elevon.simulate(ACTUATOR, faulty("connector_open supply 1"), fidelity="high")
    buffered = ACTUATOR.with_values({"inverter.link_capacitance": 1e-3})
    elevon.simulate(buffered, faulty("connector_open supply 1"), fidelity="high")


def test_a_fault_is_judged_beside_those_of_another_fidelity():
    """A contact of a winding to ground is of the switching model alone."""
    elevon.simulate(
        ACTUATOR,
        faulty("ground_short motor.phase_b 0.3", "friction transmission 2"),
        fidelity="high",
    )
