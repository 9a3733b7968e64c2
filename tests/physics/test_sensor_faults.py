"""Sensors that fail: resolver windings, dark sectors of the encoder, readings that stand still."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import FREE_SHAFT, HYSTERESIS, MOTOR, PWM, RATIO, P, constant, run, term

SENSED = "resolver_speed,output_position,encoder_position"
CURRENTS = "current_a,current_a_meas,current_b,current_b_meas"
BOTH = pytest.mark.parametrize("fidelity", ["high", "low"])


def spun(fidelity: str, faults: list[dict[str, Any]], speed: float = 100.0, **more: Any) -> Any:
    """A free shaft that turns at a constant speed, its drive off."""
    return run(
        FREE_SHAFT | more,
        duration=1.0,
        mode="speed",
        command=[constant(0.0)],
        record=f"motor_position,resolver_position,{SENSED}@1 kHz",
        scenario={"initial": {"motor_speed": speed}, "fault": faults},
        fidelity=fidelity,
    )


def fault(kind: str, place: str, severity: float, **attributes: Any) -> dict[str, Any]:
    """One fault as a scenario spells it."""
    return {"kind": kind, "place": place, "severity": severity, **attributes}


def there(start: float, end: float) -> dict[str, Any]:
    """A profile: present between two instants of a second."""
    return {"kind": "intermittent", "start": start, "period": 10.0, "duty": (end - start) / 10.0}


@pytest.mark.signature("resolver_short", "resolver")
@BOTH
@pytest.mark.parametrize(("place", "a", "b"), [("sine", 0.6, 1.0), ("cosine", 1.0, 0.6)])
def test_shorted_resolver_winding_shows_the_angle_of_its_channels(
    fidelity: str, place: str, a: float, b: float
) -> None:
    """atan2(a sin, b cos), unwrapped; sampling error none, rounding of some hundred radians."""
    rec = spun(fidelity, [fault("resolver_short", f"sensor.resolver.{place}", 0.4)])
    theta = rec["motor_position"].values
    error = np.angle(np.exp(1j * (np.arctan2(a * np.sin(theta), b * np.cos(theta)) - theta)))
    assert rec["resolver_position"].values == pytest.approx(theta + error, abs=1e-9)
    assert np.max(np.abs(error)) == pytest.approx(math.asin(0.4 / 1.6), rel=1e-2)


@pytest.mark.signature("quadrature", "resolver")
@pytest.mark.signature("channel_offset", "resolver")
@BOTH
@pytest.mark.parametrize(
    ("kind", "place", "severity", "harmonics"),
    [
        ("quadrature", "sensor.resolver", 0.02, {0: 0.01, 2: -0.01}),
        ("channel_offset", "sensor.resolver.sine", 0.01, {1: 0.01}),
        ("channel_offset", "sensor.resolver.cosine", -0.01, {1: -0.01j}),
    ],
)
def test_skewed_or_offset_channels_err_at_their_order_of_the_shaft(
    fidelity: str, kind: str, place: str, severity: float, harmonics: dict[int, complex]
) -> None:
    """Exact: atan2(sin + o_s, cos(theta + delta) + o_c). First order: delta/2 (1 - cos 2 theta)
    and o_s cos theta - o_c sin theta; complex amplitudes of exp(1j n theta).
    """
    rec = spun(fidelity, [fault(kind, place, severity)], 2.0 * math.pi * 3.0)
    theta = rec["motor_position"].values
    error = rec["resolver_position"].values - theta
    skew = severity if kind == "quadrature" else 0.0
    sine, cosine = (severity if place.endswith(f".{end}") else 0.0 for end in ("sine", "cosine"))
    reading = np.arctan2(np.sin(theta) + sine, np.cos(theta + skew) + cosine)
    assert np.angle(np.exp(1j * (reading - theta - error))) == pytest.approx(0.0, abs=1e-9)
    for order in range(4):
        amplitude = (1 if order == 0 else 2) * np.mean(
            error[:-1] * np.exp(-1j * order * theta[:-1])
        )
        assert amplitude == pytest.approx(harmonics.get(order, 0.0), abs=severity**2)
    speed = rec["resolver_speed"].values
    assert np.gradient(rec["resolver_position"].values, 1e-3)[1:-1] == pytest.approx(
        speed[1:-1], abs=2e-3
    )


def test_offsets_that_outweigh_a_channel_are_refused() -> None:
    """The ellipse of the channels would not hold its centre: no angle that turns with the shaft."""
    weak = [
        fault("mismatch", "sensor.resolver", 0.85),
        fault("channel_offset", "sensor.resolver.cosine", 0.16),
    ]
    with pytest.raises(elevon.InputError, match="would not turn with the shaft"):
        spun("high", weak)


@pytest.mark.signature("interpolation", "encoder")
@BOTH
@pytest.mark.parametrize(("place", "order"), [("first", 1), ("second", 2)])
def test_interpolation_error_is_a_harmonic_of_the_encoders_period(
    fidelity: str, place: str, order: int
) -> None:
    """A tenth of the period of 20 pulses (4 wheel turns an output turn), read with 400 edges each:
    what is shown is the true position and T e sin(order z + phase), cut to whole counts.
    """
    disc = {"sensor.encoder.pulses": 20.0, "sensor.encoder.edges": 400.0}
    broken = fault("interpolation", f"sensor.encoder.{place}", 0.1, phase="40 deg")
    rec = spun(fidelity, [broken], RATIO, **disc)
    output, measured = rec["output_position"].values, rec["encoder_position"].values
    period = 2.0 * math.pi / (20.0 * 4.0)
    angle = order * 2.0 * math.pi * output / period + math.radians(40.0)
    count = period / 400.0
    lag = output + 0.1 * period * np.sin(angle) - measured
    assert np.all((lag > -1e-9) & (lag < count + 1e-9))


@BOTH
def test_loop_on_an_encoder_follows_its_interpolation_error(fidelity: str) -> None:
    """Slowly commanded, the shown position is the command: the output errs by as much."""
    rec = run(
        MOTOR
        | HYSTERESIS
        | {"control.position_feedback": "encoder", "sensor.encoder.pulses": 20.0}
        | {"sensor.encoder.edges": 4000.0, "backlash.total": 0.0},
        duration=1.5,
        command=[term("ramp", slope="6 deg/s")],
        record="output_position,encoder_position@1 kHz",
        scenario={"fault": [fault("interpolation", "sensor.encoder.first", 0.05)]},
        fidelity=fidelity,
    )
    late = rec["output_position"].time > 0.5
    error = (rec["output_position"].values - rec["encoder_position"].values)[late]
    assert np.max(error) == pytest.approx(0.05 * 2.0 * math.pi / 80.0, rel=0.02)
    assert np.min(error) == pytest.approx(-0.05 * 2.0 * math.pi / 80.0, rel=0.02)


@BOTH
def test_shorted_excitation_turns_no_angle_until_the_signal_is_lost(fidelity: str) -> None:
    """70 % of the amplitude is where the converter gives up (ASSUMED)."""
    weak = spun(fidelity, [fault("resolver_short", "sensor.resolver.excitation", 0.29)])
    assert np.array_equal(weak["resolver_position"].values, weak["motor_position"].values)
    lost = spun(fidelity, [fault("resolver_short", "sensor.resolver.excitation", 0.31)])
    assert np.ptp(lost["resolver_position"].values) == 0.0
    assert np.all(lost["resolver_speed"].values == 0.0)


@pytest.mark.signature("resolver_open", "resolver")
@pytest.mark.parametrize(("place", "zero"), [("sine", 0.0), ("cosine", math.pi / 2)])
def test_open_resolver_winding_leaves_multiples_of_half_a_turn(place: str, zero: float) -> None:
    """One channel alone tells only on which side the shaft stands; 0.1 % stray coupling."""
    rec = spun("high", [fault("resolver_open", f"sensor.resolver.{place}", 1)])
    theta, measured = rec["motor_position"].values, rec["resolver_position"].values
    halves = zero + math.pi * np.round((theta - zero) / math.pi)
    away = np.abs(np.angle(np.exp(2j * (theta - zero - math.pi / 2)))) > 0.1
    assert measured[away] == pytest.approx(halves[away], abs=0.021)


@BOTH
def test_without_excitation_the_measured_angle_stands(fidelity: str) -> None:
    """Neither channel has a signal."""
    none = spun(fidelity, [fault("resolver_open", "sensor.resolver.excitation", 1)])
    assert np.ptp(none["resolver_position"].values) == 0.0


@pytest.mark.signature("dark_sectors", "encoder")
@BOTH
def test_dark_sector_takes_its_share_of_the_disc(fidelity: str) -> None:
    """Three turns of the disc with a quarter of it dark: a quarter of the travel is lost, and
    inside the sector the shown position stands.
    """
    speed = 3.0 / 4.0 * 2.0 * math.pi * 20.0
    dark = fault("dark_sectors", "sensor.encoder", 0.25, position="180 deg", sectors=1)
    rec = spun(fidelity, [dark], speed, **{"gear.ratio": 20.0})
    output, measured = rec["output_position"].values, rec["encoder_position"].values
    assert measured[-1] == pytest.approx(0.75 * output[-1], abs=2.0 * math.pi / 80e3 * 2)
    disc = np.mod(4.0 * output / (2.0 * math.pi), 1.0)
    inside = (disc[:-1] > 0.38) & (disc[:-1] < 0.62) & (disc[1:] < 0.62) & (disc[1:] > 0.38)
    assert np.all(np.diff(measured)[inside] == 0.0)
    assert np.all(np.diff(measured)[(disc[:-1] > 0.65) | (disc[1:] < 0.35)] > 0.0)


@pytest.mark.signature("stuck", "encoder")
@pytest.mark.signature("dead", "encoder")
@BOTH
@pytest.mark.parametrize(("kind", "lost"), [("stuck", 0.0), ("dead", 0.4)])
def test_encoder_that_stood_still_comes_back(fidelity: str, kind: str, lost: float) -> None:
    """A stuck reading is the true one again, a dead encoder has lost the counts of its time."""
    rec = spun(fidelity, [fault(kind, "sensor.encoder", 1, profile=there(0.3, 0.7))], RATIO)
    time, output = rec["output_position"].time, rec["output_position"].values
    measured = rec["encoder_position"].values
    gone = (time > 0.3) & (time < 0.699)
    assert np.ptp(measured[gone]) == 0.0
    assert measured[gone][0] == pytest.approx(0.3, abs=2e-3)
    assert output[-1] - measured[-1] == pytest.approx(lost, abs=2e-3)


@pytest.mark.signature("stuck", "resolver")
@BOTH
def test_stuck_resolver_holds_angle_and_speed(fidelity: str) -> None:
    """What it showed at the onset; the true reading afterwards."""
    rec = spun(fidelity, [fault("stuck", "sensor.resolver", 1, profile=there(0.3, 0.7))])
    time, measured = rec["motor_position"].time, rec["resolver_position"].values
    gone = (time > 0.3) & (time < 0.699)
    assert np.ptp(measured[gone]) == 0.0
    assert rec["resolver_speed"].values == pytest.approx(100.0, rel=1e-12)
    assert np.array_equal(measured[time > 0.71], rec["motor_position"].values[time > 0.71])


@pytest.mark.signature("stuck", "current")
@pytest.mark.signature("dead", "current")
@pytest.mark.parametrize("kind", ["stuck", "dead"])
@pytest.mark.parametrize("drive", [HYSTERESIS, PWM], ids=["hysteresis", "pwm"])
def test_current_sensor_that_stands_still_frees_its_leg(kind: str, drive: dict[str, Any]) -> None:
    """Its reading holds, or is zero, and the true current of its phase leaves the reference: with
    relays by what the star's other two leave it, with a carrier by far more.
    """
    onset = {"kind": "step", "time": 0.2}
    rec = run(
        FREE_SHAFT | drive,
        duration=0.3,
        mode="speed",
        command=[constant(40.0)],
        record=f"{CURRENTS},current_ref,motor_position@10 kHz",
        scenario={
            "initial": {"motor_speed": 40.0},
            "load": {"shaft": {"terms": [constant(2.0)]}},
            "fault": [fault(kind, "sensor.current_a", 1, profile=onset)],
        },
    )
    late = rec["current_a"].time > 0.2001
    measured = rec["current_a_meas"].values[late]
    assert np.ptp(measured) == 0.0
    assert (measured[0] == 0.0) == (kind == "dead")
    commanded = rec["current_ref"].values * np.sin(P * rec["motor_position"].values)
    error = np.abs(rec["current_a"].values - commanded)
    settled = (rec["current_a"].time > 0.1) & ~late
    assert np.max(error[late]) > 2.0 * np.max(error[settled])
    assert np.array_equal(rec["current_b"].values, rec["current_b_meas"].values)


@BOTH
def test_dark_sector_carries_a_loop_on_the_encoder_too_far(fidelity: str) -> None:
    """The output must turn until as many counts have come as were commanded."""
    dark = fault("dark_sectors", "sensor.encoder", 0.1, position="45 deg")
    rec = run(
        MOTOR | HYSTERESIS | {"control.position_feedback": "encoder"},
        duration=3.0,
        command=[term("ramp", slope="12 deg/s", end=2.0)],
        record="output_position,encoder_position@1 kHz",
        scenario={"fault": [dark]},
        fidelity=fidelity,
    )
    assert math.degrees(rec.final["encoder_position"]) == pytest.approx(24.0, abs=0.3)
    # A tenth of the disc is a fortieth of an output turn.
    assert math.degrees(rec.final["output_position"]) == pytest.approx(24.0 + 9.0, abs=0.3)


@BOTH
def test_jam_waits_for_a_passage_after_its_onset(fidelity: str) -> None:
    """A triangle of 6 deg passes 3 deg at 0.6 s and 1.4 s; a jam that comes at 1 s holds at the
    second passage, and what it is labelled with acts from its onset on.
    """
    jam = fault("jam", "transmission", 100.0, position="3 deg", profile={"kind": "step", "time": 1})
    rec = run(
        MOTOR | HYSTERESIS,
        duration=2.0,
        command=[term("triangle", amplitude="5 deg", frequency="0.25 Hz")],
        record="output_position@1 kHz",
        scenario={"fault": [jam]},
        fidelity=fidelity,
    )
    time, position = rec["output_position"].time, np.degrees(rec["output_position"].values)
    assert np.max(position) == pytest.approx(5.0, abs=0.6)
    assert position[-1] == pytest.approx(3.0, abs=0.6)
    assert np.array_equal(rec["fault_1"].values, np.where(time >= 1.0, 100.0, 0.0))
