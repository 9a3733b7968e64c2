"""A prepared run: the same bits as `simulate`, other values by call, wrong input named."""

from __future__ import annotations

import numpy as np
import pytest

import elevon
from elevon.errors import InputError

SCENARIO = {
    "duration": "20 ms",
    "command": {"terms": [{"kind": "sine", "amplitude": "7 deg", "frequency": "1 Hz"}]},
}
VARY = ["friction.viscous", "load.inertia"]


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("faults", [[], ["backlash@transmission=0.2 deg"]])
def test_a_prepared_run_is_a_run(fidelity: str, faults: list[str]) -> None:
    """Bit by bit, with the values it was prepared with and with others."""
    record = ["output_position,motor_speed@400 Hz", "current_q@200 Hz"]
    run = elevon.prepare(
        "torino-rotary", SCENARIO, record=record, fidelity=fidelity, faults=faults, vary=VARY
    )
    for values in (run.values, [5e-3, 3e-3]):
        actuator = elevon.Actuator.load("torino-rotary").with_values(
            dict(zip(VARY, map(float, values), strict=True))
        )
        expected = elevon.simulate(
            actuator, SCENARIO, record=record, fidelity=fidelity, faults=faults
        )
        got = run(values)
        assert got.status == "ok"
        for name in ("output_position", "motor_speed", "current_q"):
            assert np.array_equal(got.values[name], expected[name].values)
        assert got.final["motor_position"] == expected.final["motor_position"]
        assert got.values["current_q"].size == got.time["at_200_hz"].size == 5


def test_the_seed_is_that_of_the_call() -> None:
    """Noise differs with it, and is the same with the same."""
    actuator = elevon.Actuator.load("torino-rotary").with_values({"control.noise_deviation": 1e-5})
    run = elevon.prepare(actuator, SCENARIO, record="command@400 Hz")
    first, again, other = (run(seed=seed).values["command"] for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_features_of_a_prepared_run() -> None:
    """By name, in SI."""
    run = elevon.prepare("torino-rotary", SCENARIO, features="all@400 Hz", fidelity="low")
    assert run().features


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        (["friction.viscus"], "friction.viscous"),
        (["drive.kind"], "choice"),
        (["solver.step"], "settled"),
        (["load.inertia", "load.inertia"], "twice"),
        ("load.inertia", r"\['load.inertia'\]"),
    ],
)
def test_what_cannot_vary_is_named(vary: list[str], message: str) -> None:
    """Before anything runs."""
    with pytest.raises(InputError, match=message):
        elevon.prepare("torino-rotary", SCENARIO, vary=vary)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1e-3], "1 given for 2"),
        ([-1.0, 2e-3], "friction.viscous"),
        ([float("nan"), 2e-3], "friction.viscous"),
        ([1e4, 2e-3], "solver.step"),
    ],
)
def test_wrong_values_are_named(values: list[float], message: str) -> None:
    """By path, value and limit; together by the core."""
    run = elevon.prepare("torino-rotary", SCENARIO, vary=VARY)
    with pytest.raises(InputError, match=message):
        run(values)
