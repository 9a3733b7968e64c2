"""What the reduced-order model shares with the switching one: faults, options, closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import PWM, actuator, constant, make_scenario, run, term

FIDELITIES = ("high", "low")
#: EMF constant of the actuator file, V s/rad.
K = 0.9004
LOADED = {"load": {"output": {"terms": [constant("50 N m")]}}}
#: A flywheel that keeps its speed over the run, so that only the torque speaks.
FLYWHEEL = {"load.inertia": 5e4, "friction.static": 0.0, "friction.dynamic": 0.0,
            "friction.viscous": 0.0, "gear.efficiency": 1.0, "gear.efficiency_aiding": 1.0,
            "stop.upper": 1e3, "stop.lower": -1e3}  # fmt: skip
#: 40 electrical turns a second, eight of them in the last two thirds of 0.3 s.
TURNING = {"initial": {"motor_speed": 20 * math.pi}}


def fault(kind: str, place: str, severity: float, **more: Any) -> dict[str, Any]:
    """A fault from the begin on."""
    return {"kind": kind, "place": place, "severity": severity, **more}


def simulated(fidelity: str, values: dict[str, Any], **options: Any) -> Any:
    """A run, tripped or not."""
    scenario = make_scenario(
        duration=options.get("duration", 0.3),
        mode=options.get("mode", "speed"),
        command=[constant(options.get("command", "40 rad/s"))],
        extra=options.get("scenario", LOADED),
    )
    # The relays' ripple, 0.3 N m, needs some thousand samples for a mean within 1 %.
    rate = "2 kHz" if fidelity == "low" else "50 kHz"
    names = f"motor_speed,motor_torque,current_q,current_q_meas,current_ref@{rate}"
    return elevon.simulate(actuator(values), scenario, fidelity=fidelity, record=names)


def late(rec: Any, name: str) -> float:
    """Mean of the last two thirds of a run."""
    samples = np.asarray(rec[name].values)
    return float(samples[len(samples) // 3 :].mean())


def both(values: dict[str, Any], name: str, **options: Any) -> tuple[float, float]:
    """The late mean of a signal in both fidelities."""
    high, low = (late(simulated(fidelity, values, **options), name) for fidelity in FIDELITIES)
    return high, low


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_two_open_phases_give_no_torque(fidelity: str) -> None:
    """No loop is left for a current."""
    open_phases = [fault("open_phase", f"motor.phase_{p}", 1.0) for p in "ab"]
    rec = simulated(fidelity, {}, scenario=LOADED | {"fault": open_phases}, duration=0.05)
    assert np.abs(rec["motor_torque"].values).max() == 0.0
    assert np.abs(rec["current_q"].values).max() == 0.0


def test_a_shorted_switch_brakes() -> None:
    """Its leg and the diodes beside it short the windings by half waves: both torques."""
    scenario = TURNING | {"fault": [fault("shorted_switch", "inverter.a_high", 1.0)]}
    high, low = both(FLYWHEEL, "motor_torque", scenario=scenario, command="60 rad/s")
    assert high < -1.0
    assert low == pytest.approx(high, rel=0.05)


def test_lost_feedback_opens_the_bridge() -> None:
    """With feedback_loss = stop no current flows without resolver power; with run it does."""
    scenario = LOADED | {"fault": [fault("dropout", "sensor.resolver", 1.0)]}
    for fidelity in FIDELITIES:
        stopped = simulated(fidelity, {"drive.feedback_loss": "stop"}, scenario=scenario)
        running = simulated(fidelity, {"drive.feedback_loss": "run"}, scenario=scenario)
        assert np.abs(stopped["current_q"].values[100:]).max() < 1e-9, fidelity
        assert np.abs(running["current_q"].values[100:]).max() > 0.1, fidelity


def test_trip_current() -> None:
    """The drive trips above the peak that load and band ask for, and not below it."""
    scenario = {"load": {"output": {"terms": [constant("600 N m")]}}}
    for fidelity in FIDELITIES:
        for trip, expected in ((5.5, "tripped"), (8.0, "ok")):
            values = {"inverter.trip_current": trip, "control.speed_feedforward": 0.0}
            rec = simulated(fidelity, values, scenario=scenario)
            assert rec.meta["status"] == expected, (fidelity, trip)


def test_a_jump_of_the_command_trips_in_neither() -> None:
    """The derivative's kick is over before the current follows: 3.5 A are not reached."""
    for fidelity in FIDELITIES:
        rec = simulated(fidelity, {"inverter.trip_current": 3.5}, scenario={})
        assert rec.meta["status"] == "ok", fidelity
        assert np.abs(rec["motor_torque"].values).max() < 3.5 * 1.5 * K


@pytest.mark.parametrize("duty", [0.1, 0.2, 0.4])
def test_dropout_of_the_resolver_over_six_losses(duty: float) -> None:
    """The field stands while it is lost, and each loss is a jump that unwinds the integrator."""
    lost = LOADED | {"fault": [fault("dropout", "sensor.resolver", duty, period=0.1)]}
    for signal in ("motor_speed", "motor_torque", "current_q"):
        high, low = both({}, signal, scenario=lost, duration=0.6)
        assert low == pytest.approx(high, rel=0.08), signal


def test_noise_of_the_command() -> None:
    """Both fidelities draw the same noise from the same seed, and it moves the motor."""
    values = {"control.noise_deviation": 1e-3, "control.noise_sample_time": 1e-3}
    options = {"duration": 0.1, "mode": "position", "record": "command,motor_speed@1 kHz",
               "command": [constant("2 deg")]}  # fmt: skip
    high, low = (run(values, fidelity=f, seed=5, **options) for f in FIDELITIES)
    assert np.std(high["command"].values) > 5e-4
    assert np.array_equal(high["command"].values[1:], low["command"].values[1:])
    quiet = run({}, fidelity="low", **options)
    assert np.abs(low["motor_speed"].values - quiet["motor_speed"].values).max() > 0.1


@pytest.mark.parametrize("commutation", ["sinusoidal", "six_step"])
def test_trapezoidal_emf(commutation: str) -> None:
    """Torque per ampere of a trapezoid, in both fidelities; six-step on its flats gives 2 k I."""
    values = {"motor.emf_shape": "trapezoidal", "drive.commutation": commutation}
    runs = (simulated(fidelity, values) for fidelity in FIDELITIES)
    high, low = (late(rec, "motor_torque") / late(rec, "current_q_meas") for rec in runs)
    assert low == pytest.approx(high, rel=0.02)
    if commutation == "six_step":
        # A block of height I has i_q = 2 sqrt(3) / pi I.
        assert low == pytest.approx(2 * K / (2 * math.sqrt(3) / math.pi), rel=0.005)


@pytest.mark.parametrize("drive", [{}, PWM], ids=["hysteresis", "pwm"])
@pytest.mark.parametrize("gain", [0.5, -0.5])
def test_gain_of_a_current_sensor(drive: dict[str, Any], gain: float) -> None:
    """The drive shows another current than flows: their ratio, in both fidelities."""
    scenario = LOADED | {"fault": [fault("gain", "sensor.current_a", gain)]}
    ratios = [
        late(rec, "current_q_meas") / late(rec, "current_q")
        for rec in (simulated(f, drive, scenario=scenario) for f in FIDELITIES)
    ]
    assert abs(ratios[0] - 1) > 0.1
    assert ratios[1] == pytest.approx(ratios[0], rel=0.03)


def test_viscous_slope() -> None:
    """C (1 + slope |w|) w."""
    high, low = both({"friction.viscous_slope": 0.05}, "motor_torque")
    plain, _ = both({}, "motor_torque")
    assert high > 1.05 * plain
    assert low == pytest.approx(high, rel=0.03)


def test_quadrature_current_is_that_of_the_rotor() -> None:
    """Under an offset d the current I has i_q = I cos d; an open phase leaves what turns."""
    offset = LOADED | {"fault": [fault("offset", "sensor.resolver", 0.2)]}
    rec = simulated("low", {}, scenario=offset)
    assert late(rec, "current_q") == pytest.approx(
        late(rec, "current_q_meas") * math.cos(0.8), rel=0.005
    )
    stalled = {"load": {"output": {"terms": [constant("800 N m")]}},
               "fault": [fault("open_phase", "motor.phase_a", 1.0)]}  # fmt: skip
    high, low = both({}, "current_q", scenario=stalled, mode="torque", command="10 N m")
    assert low == pytest.approx(high, rel=0.05)


def test_loop_short_in_the_low_fidelity() -> None:
    """Braking current of shorted turns in both; a contact without limit is healthy."""
    short = LOADED | {"fault": [fault("short", "motor.phase_a", 0.2)]}
    for contact in (0.0, 10.0):
        values = {"motor.short_model": "loop", "motor.short_contact_resistance": contact}
        high, low = both(values, "current_q", scenario=short)
        assert low == pytest.approx(high, rel=0.08), contact
    healthy = late(simulated("low", {}), "current_q")
    endless = values | {"motor.short_contact_resistance": 1e9}
    found = late(simulated("low", endless, scenario=short), "current_q")
    assert found == pytest.approx(healthy, rel=5e-3)


@pytest.mark.parametrize(
    ("name", "load", "severity", "coupling"),
    [
        ("torino-rotary", "50 N m", 0.05, 0.9),
        ("torino-rotary", "50 N m", 0.2, 0.9),
        ("nasa-ballscrew", "2000 N", 0.05, 0.9),
        ("nasa-ballscrew", "2000 N", 0.2, 0.5),
        ("nasa-ballscrew", "2000 N", 0.5, 0.5),
    ],
)
def test_loop_short_over_whole_turns(
    name: str, load: str, severity: float, coupling: float
) -> None:
    """Mean current over four electrical turns, at any coupling: with i_f = i the shorted turns
    link the whole winding's flux.
    """
    values = {"motor.short_model": "loop", "motor.short_coupling": coupling}
    values |= {"thermal.model": "off"} if name == "nasa-ballscrew" else {}
    scenario = make_scenario(
        duration=0.8, mode="speed", command=[constant("40 rad/s")],
        extra={"load": {"output": {"terms": [constant(load)]}},
               "fault": [fault("short", "motor.phase_a", severity)]},
    )  # fmt: skip
    means = []
    for fidelity, rate in (("high", 20), ("low", 2)):
        record = f"current_q@{rate} kHz"
        rec = elevon.simulate(actuator(values, name), scenario, fidelity=fidelity, record=record)
        last = rec["current_q"].time > 0.8 - 4 * 2 * math.pi / (4 * 40.0)
        means.append(float(rec["current_q"].values[last].mean()))
    assert means[1] == pytest.approx(means[0], rel=0.025)


@pytest.mark.parametrize("speed", [584.0, 900.0])
def test_diodes_rectify_the_emf_of_a_drive_without_gates(speed: float) -> None:
    """Above the link's voltage the diodes brake; a step is far more than an electrical radian."""
    torques = []
    for fidelity in FIDELITIES:
        scenario = make_scenario(duration=0.1, mode="speed", command=[constant("0 rad/s")],
                                 extra={"initial": {"motor_speed": speed}})  # fmt: skip
        values = FLYWHEEL | {"drive.kind": "off", "motor.inertia": 100.0}
        values["control.derivative_time"] = 0.0
        rec = elevon.simulate(
            actuator(values), scenario, fidelity=fidelity, record="motor_torque@2 kHz"
        )
        torques.append(late(rec, "motor_torque"))
    assert torques[0] < -2.0
    assert torques[1] == pytest.approx(torques[0], rel=0.07)


def test_voltage_of_a_linear_carrier_drive() -> None:
    """In a sag the voltage vector ends at V / sqrt 3; the speed of both fidelities follows."""
    sag = {"fault": [fault("sag", "supply", 0.9)]}
    options = {"scenario": sag, "command": "200 rad/s", "duration": 0.5}
    high, low = both({"drive.kind": "pwm"}, "motor_speed", **options)
    assert low == pytest.approx(high, rel=0.04)


NASA = {"thermal.model": "off", "load.stiffness": 0.0}
LEAD = 0.010 / (2 * math.pi)


@pytest.mark.parametrize("backlash", ["elastic", "operator"])
@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("blocked", [0, 1])
@pytest.mark.parametrize("brake", [0.0, 1000.0])
def test_screw_current_against_the_closed_form(
    backlash: str, fidelity: str, blocked: int, brake: float
) -> None:
    """All force at the joint passes the screw: load, and the load side's friction and brake."""
    if fidelity == "low" and backlash == "elastic":
        pytest.skip("the low fidelity keeps the backlash operator")
    scenario: dict[str, Any] = {
        "load": {
            "output": {"terms": [constant("4003 N")]},
            "brake": {"terms": [constant(f"{brake} N")]},
        }
    }
    if blocked:
        scenario["fault"] = [fault("return_jam", "screw.return_channel", blocked)]
    speed = 0.06 / LEAD
    names = "current_q_meas,motor_speed,screw_efficiency@1 kHz"
    rec = run(NASA | {"backlash.model": backlash}, duration=0.7, mode="speed",
              command=[term("constant", value=f"{speed!r} rad/s")], record=names,
              scenario=scenario, fidelity=fidelity, name="nasa-ballscrew")  # fmt: skip
    w = float(np.mean(rec["motor_speed"].values[-300:]))
    eta = rec.final["screw_efficiency"]
    force = 4003.0 + 50.0 + 500.0 * w * LEAD + brake
    # The load relieves the preloaded nut far beyond the 2^(3/2) 437.5 N at which its drag ends.
    torque = force * LEAD / eta + 0.3 + 0.002 * w
    current = float(np.mean(rec["current_q_meas"].values[-300:]))
    assert current == pytest.approx(torque / 1.65, rel=0.01)


def test_damping_of_a_rigid_load_is_observed() -> None:
    """The friction shown contains c w / i^2 in both fidelities."""
    recordings = [
        run(
            FLYWHEEL | {"drive.kind": "off", "load.damping": 500.0},
            duration=0.01,
            mode="speed",
            command=[constant("0 rad/s")],
            record="friction_torque,motor_speed@1 kHz",
            scenario=TURNING,
            fidelity=fidelity,
        )
        for fidelity in FIDELITIES
    ]
    for rec in recordings:
        expected = 500.0 * rec.final["motor_speed"] / 124.0**2
        assert rec.final["friction_torque"] == pytest.approx(expected, rel=1e-9)
