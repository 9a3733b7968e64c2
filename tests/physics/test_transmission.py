"""End stops, inertia and spring on the output side, seizure."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, INERTIA, RATIO, constant, run, values


def pushed(settings: dict[str, object], torque: float, duration: float, record: str) -> object:
    """A free shaft under a constant driving torque (a negative shaft load)."""
    return run(
        FREE_SHAFT | settings,
        duration=duration,
        record=record,
        scenario={"load": {"shaft": {"terms": [constant(-torque)]}}},
    )


@pytest.mark.parametrize("sign", [1, -1])
def test_end_stop_holds_and_takes_the_speed(sign: int) -> None:
    """At the stop: position at its limit, speed zero, though the torque goes on pushing."""
    stop = math.radians(2.0)
    rec = pushed(
        {"stop.upper": stop, "stop.lower": -stop},
        sign * 1.0,
        1.0,
        "motor_position,motor_speed@1 kHz",
    )
    position, speed = values(rec, "motor_position", "motor_speed")
    assert position[-1] == pytest.approx(sign * stop * RATIO, rel=1e-12)
    assert np.max(np.abs(position)) <= stop * RATIO * (1 + 1e-12)
    assert speed[-1] == pytest.approx(0.0, abs=2 * 1.0 / INERTIA * 1e-6)


def test_a_shaft_leaves_its_stop_when_pulled_back() -> None:
    """The reaction cancels outward torque only."""
    stop = math.radians(2.0)
    rec = run(
        FREE_SHAFT | {"stop.upper": stop, "stop.lower": -stop},
        duration=0.5,
        record="motor_position@1 kHz",
        scenario={
            "load": {
                "shaft": {
                    "terms": [{"kind": "step", "initial": -1.0, "final": 1.0, "time": "0.3 s"}]
                }
            }
        },
    )
    time, position = rec["motor_position"].time, rec["motor_position"].values
    assert position[time < 0.3][-1] == pytest.approx(stop * RATIO)
    late = time > 0.31
    fallen = stop * RATIO - 0.5 / INERTIA * (time[late] - 0.3) ** 2
    assert position[late] == pytest.approx(np.maximum(fallen, -stop * RATIO), abs=1e-3)


def test_output_inertia_counts_divided_by_the_ratio_squared() -> None:
    """theta = T t^2 / (2 (J + J_u / i^2)), an output inertia that doubles the total."""
    output = INERTIA * RATIO**2
    rec = pushed({"load.inertia": output}, 0.5, 0.2, "motor_position@1 kHz")
    expected = 0.5 * 0.2**2 / (2 * 2 * INERTIA)
    assert rec.final["motor_position"] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("viscous_slope", [0.0, 0.01])
def test_viscous_friction_depends_on_speed_as_given(viscous_slope: float) -> None:
    """C (1 + s |w|) w: the mean deceleration over 10 ms at 50 rad/s."""
    viscous, start, duration = 2e-3, 50.0, 0.01
    rec = run(
        FREE_SHAFT | {"friction.viscous": viscous, "friction.viscous_slope": viscous_slope},
        duration=duration,
        record="motor_speed@1 kHz",
        scenario={"initial": {"motor_speed": start}},
    )
    end = rec.final["motor_speed"]
    mean = 0.5 * (start + end)
    expected = viscous * (1 + viscous_slope * mean) * mean / INERTIA * duration
    assert start - end == pytest.approx(expected, rel=1e-3)
