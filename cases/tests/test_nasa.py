"""Profiles, what the actuator can follow, and the reproductions of the ballscrew actuator."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import elevon
from elevon_cases.nasa.baseline import baseline_matrix, reproduce_baseline
from elevon_cases.nasa.features import orders
from elevon_cases.nasa.profiles import Capability, MotionProfile, profile_scenario

SHORT = 6.0
RUNS = "command,output_position,current_a,current_b,current_c@2 kHz"


def actuator(values: dict[str, Any] | None = None) -> Any:
    """The stand's actuator with some values changed."""
    return elevon.Actuator.load("nasa-ballscrew").with_values(values or {})


def statistics(
    fault: str | None = None, load: float = 4500.0, **profile: Any
) -> tuple[float, float]:
    """RMS current and RMS tracking error of a loaded sine after its first two seconds."""
    data = profile_scenario(MotionProfile("sinusoidal", 0.05, 0.06, SHORT), load)
    scenario = elevon.Scenario.from_dict({**data, **({"fault": [fault]} if fault else {})})
    rec = elevon.simulate(actuator(), scenario, record=RUNS)
    late = rec["command"].time > 2.0
    current = np.stack([rec[f"current_{p}"].values[late] for p in "abc"])
    error = rec["command"].values[late] - rec["output_position"].values[late]
    return float(np.sqrt(np.mean(current**2))), float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize(
    ("fault", "least"),
    [
        ("return_jam@screw.return_channel=1", 0.04),
        ("return_jam@screw.return_channel=4", 0.4),
        ("short@motor.phase_a=0.2", 0.05),
        ("lubrication_loss@screw=0.8", 0.03),
        ("friction@transmission=2", 0.005),
    ],
)
def test_the_position_follows_and_the_current_rises(fault: str, least: float) -> None:
    """At a jam, a short, a friction rise: current up, tracking as healthy to 0.01 mm."""
    healthy, broken = statistics(), statistics(fault)
    assert broken[0] > (1 + least) * healthy[0]
    assert broken[1] == pytest.approx(healthy[1], abs=1e-5)


def test_the_matrix_decouples_amplitude_and_rate() -> None:
    """Every amplitude at every rate under every load, each once."""
    matrix = baseline_matrix()
    assert len(matrix) == len(set(matrix)) == 147
    assert {load for _, load in matrix} == {0.0, 500.0, -500.0, 4500.0, -4500.0, 8500.0, -8500.0}
    for name in ("trapezoidal", "sinusoidal", "triangular", "sweep"):
        motions = {(p.amplitude, p.rate) for p, _ in matrix if p.name == name}
        assert motions == {(0.05, 0.06), (0.05, 0.12), (0.1, 0.06), (0.1, 0.12)}


@pytest.mark.parametrize("load_kind", ["constant", "step", "spring"])
def test_rows_are_what_the_command_prints(load_kind: Any) -> None:
    """A few short cases: names, units and statuses of the row."""
    cases = [
        (MotionProfile("sinusoidal", 0.05, 0.06, SHORT), 4500.0),
        (MotionProfile("rectangular", 0.05, 0.06, SHORT), 500.0),
        (MotionProfile("trapezoidal", 0.05, 0.20, SHORT), 500.0),
    ]
    result = reproduce_baseline(cases=cases, load_kind=load_kind, replicates=1)
    rows = result.to_dict()["rows"]
    assert [row["status"] for row in rows] == ["ok", "limited", "refused"]
    assert rows[0]["direction"] == "compressive"
    assert (rows[0]["amplitude_mm"], rows[0]["rate_mm_s"], rows[0]["load_n"]) == (
        50.0,
        60.0,
        4500.0,
    )
    assert "15 cm/s" in rows[2]["reason"]
    assert "control.speed_limit" in rows[2]["reason"]
    assert rows[2]["rms_current_a"] is None
    assert result.to_dict()["status"] == "fail"


def test_limits_follow_the_voltage_circle_and_the_current() -> None:
    """Each limit binds where it should; the numbers of docs/explanation/theory/ballscrew.md."""
    able = Capability.of(actuator())
    assert able.rate(8500.0) == (pytest.approx(0.15, rel=1e-6), "control.speed_limit")
    assert able.voltage_rate(8500.0) == pytest.approx(0.172, abs=0.002)
    assert able.voltage_rate(0.0) == pytest.approx(0.192, abs=0.002)
    assert able.acceleration(8500.0) == pytest.approx(2.6, abs=0.1)
    weak = Capability.of(actuator({"inverter.supply_voltage": 120.0}))
    assert weak.rate(8500.0)[1] == "inverter.supply_voltage"
    reason = weak.refusal(MotionProfile("triangular", 0.05, 0.12, 30.0), 8500.0)
    assert reason is not None
    assert "inverter.supply_voltage" in reason


def test_the_limit_of_the_voltage_is_where_the_motor_stops_following() -> None:
    """Requested 1.15 times the voltage's rate it stays near that rate; requested 0.9 it follows."""
    weak = actuator({"inverter.supply_voltage": 120.0})
    rate = Capability.of(weak).voltage_rate(4500.0)
    reached = {}
    for share in (0.85, 1.3):
        scenario = elevon.Scenario.from_dict(
            {
                "duration": 0.6,
                "command": {"mode": "speed", "terms": [
                    {"kind": "constant", "value": share * rate * 2 * np.pi / 0.01}]},
                "load": {"output": {"terms": [{"kind": "constant", "value": 4500.0}]}},
            }
        )  # fmt: skip
        reached[share] = elevon.simulate(weak, scenario, record="ram_speed@1 kHz").final[
            "ram_speed"
        ]
    assert reached[0.85] == pytest.approx(0.85 * rate, rel=0.02)
    # Hysteresis relays reach a little beyond the circle of a linear modulator.
    assert reached[1.3] < 1.15 * rate


@pytest.mark.parametrize(
    ("profile", "load", "words"),
    [
        (("sinusoidal", 0.12, 0.06), 0.0, ["120 mm", "stop.upper", "115 mm"]),
        (("rectangular", 0.2, 0.06), 0.0, ["stop.lower"]),
        (("triangular", 0.05, 0.16), 0.0, ["16 cm/s", "15 cm/s"]),
        (("sinusoidal", 0.002, 0.1), 8500.0, ["acceleration", "control.current_limit"]),
        (("sinusoidal", 0.05, 0.06), 20000.0, ["control.current_limit"]),
    ],
)
def test_what_cannot_be_followed_is_refused_with_its_limit(
    profile: tuple[str, float, float], load: float, words: list[str]
) -> None:
    """Value, limit and what sets it."""
    with pytest.raises(elevon.InputError) as caught:
        Capability.of(actuator()).check(MotionProfile(*profile, 30.0), load)
    for word in words:
        assert word in str(caught.value)


def test_wrong_profiles_are_refused() -> None:
    """Unknown name, no rate, a spring without stroke, an actuator without screw."""
    for arguments in (("sinus", 0.05, 0.06, 1.0), ("triangular", 0.05, 0.0, 1.0)):
        with pytest.raises(elevon.InputError):
            MotionProfile(*arguments)
    with pytest.raises(elevon.InputError, match="spring"):
        profile_scenario(MotionProfile("rectangular", 0.0, 0.06, 1.0), 500.0, "spring")
    with pytest.raises(elevon.InputError, match="ballscrew"):
        Capability.of(elevon.Actuator.load("torino-rotary"))


@pytest.mark.parametrize(
    "name", ["rectangular", "trapezoidal", "sinusoidal", "triangular", "sweep"]
)
def test_profiles_are_what_they_say(name: str) -> None:
    """Start at mid-stroke (a jump jumps), reach the amplitude, keep the rate."""
    profile = MotionProfile(name, 0.05, 0.06, 12.0)
    rec = elevon.simulate(
        actuator(),
        elevon.Scenario.from_dict(profile_scenario(profile)),
        fidelity="low",
        record="command@1 kHz",
    )
    command = rec["command"].values
    assert np.max(command) == pytest.approx(0.05, rel=1e-3)
    assert np.min(command) == pytest.approx(-0.05, rel=1e-3)
    if name != "rectangular":
        assert command[0] == pytest.approx(0.0, abs=1e-12)
        assert np.max(np.abs(np.diff(command))) / 1e-3 <= profile.peak_rate * (1 + 1e-3)


def test_orders_find_lines_of_known_size() -> None:
    """A signal made of two lines over changing speed, in strokes of both directions."""
    time = np.arange(0.0, 6.0, 2.5e-4)
    angle = 60.0 * np.sin(2 * np.pi * time / 3.0)
    speed = np.gradient(angle, time)
    signal = 0.3 * np.sin(8 * angle) + 0.1 * np.cos(9 * angle) + 2.0 * np.tanh(speed)
    found = orders(angle, speed, signal, [1.0, 8.0, 9.0])
    assert found[1] == pytest.approx(0.3, rel=0.05)
    assert found[2] == pytest.approx(0.1, rel=0.1)
    assert found[0] < 0.02


@pytest.mark.parametrize(
    "term",
    [
        {"kind": "sine", "amplitude": "120 mm", "frequency": "0.1 Hz"},
        {"kind": "step", "final": "-116 mm"},
        {"kind": "table", "times": [0.0, 1.0], "values": [0.0, 0.2]},
    ],
    ids=lambda term: str(term["kind"]),
)
def test_stroke_beyond_the_end_stops_is_refused(term: dict[str, Any]) -> None:
    """The range and the stop are named."""
    scenario = elevon.Scenario.from_dict({"duration": 0.01, "command": {"terms": [term]}})
    with pytest.raises(elevon.InputError, match=r"stop\.(lower|upper)"):
        elevon.simulate(actuator(), scenario, record="command@1 kHz")
