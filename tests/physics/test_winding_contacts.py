"""Contacts of the windings: shorted turns with their loop, phase to phase, turn to ground."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import FREE_SHAFT, HYSTERESIS, MOTOR, PWM, K, L, P, R, constant, run, term
from tests.physics.test_energy import SINKS, STORES

DRIVES: dict[str, dict[str, Any]] = {"hysteresis": HYSTERESIS, "pwm": PWM}
MU, KAPPA, SPEED = 0.2, 0.9, 50.0
M = KAPPA * (1 - MU) * MU * L
SHORT = f"short@motor.phase_a={MU}"
# A flywheel holds the speed against the loaded motor.
TURNING: dict[str, Any] = FREE_SHAFT | {"gear.inertia": 100.0}
SUPPLY = 380.0


def loop(resistance: float) -> dict[str, Any]:
    return {"motor.short_model": "loop", "motor.short_contact_resistance": resistance}


def turning(values: dict[str, Any], faults: list[Any], record: str, **scenario: Any) -> Any:
    """4 N m commanded at 50 rad/s."""
    return run(
        TURNING | values,
        duration=0.15,
        mode="torque",
        command=[constant(4.0)],
        record=record + "@every",
        scenario={"fault": faults, "initial": {"motor_speed": SPEED}} | scenario,
    )


def phasors(rec: Any, *names: str) -> tuple[float, list[complex]]:
    """Electrical frequency and fundamentals of the last two periods, against sin theta_e."""
    last = slice(-round(2 * 2 * math.pi / (P * SPEED) / 1e-6), None)
    turn = np.exp(-1j * P * rec["motor_position"].values[last])
    w = P * float(np.mean(rec["motor_speed"].values[last]))
    return w, [complex(2j * np.mean(rec[name].values[last] * turn)) for name in names]


@pytest.mark.parametrize("resistance", [0.0, 0.1, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize("drive", DRIVES)
def test_loop_current_is_the_phasor_of_its_circuit(drive: str, resistance: float) -> None:
    """R_c (i - i_f) = mu R i_f + (mu L - M) di_f/dt + M di/dt + mu k w.

    The torque is that of N i + mu i_f. 0.3 %: the relays' ripple is not periodic with the field.
    """
    rec = turning(
        DRIVES[drive] | loop(resistance),
        [SHORT],
        "current_a,current_b,current_c,loop_current_a,motor_torque,motor_speed,motor_position",
    )
    w, (a, b, c, inside) = phasors(rec, "current_a", "current_b", "current_c", "loop_current_a")
    emf = MU * K * w / P
    expected = (resistance * a - 1j * w * M * a - emf) / (
        resistance + MU * R + 1j * w * (MU * L - M)
    )
    assert abs(inside - expected) < 3e-3 * max(abs(a), abs(expected))
    turn = np.exp(2j * math.pi / 3)
    linked = (1 - MU) * a + MU * inside + b * turn + c / turn
    last = slice(-round(4 * math.pi / (P * SPEED) / 1e-6), None)
    torque = np.mean(rec["motor_torque"].values[last])
    assert torque == pytest.approx(0.5 * K * linked.real, rel=3e-3)


def test_a_fifth_of_the_turns_across_ten_ohms() -> None:
    """The figures of the loop's equation at the current that flows: it drives, not brakes."""
    rec = turning(
        PWM | {"motor.emf_constant": 0.900383, "control.torque_constant": 1.5 * 0.900383}
        | loop(10.0),
        [SHORT],
        "current_a,loop_current_a,motor_torque,motor_speed,motor_position",
    )  # fmt: skip
    _, (a, inside) = phasors(rec, "current_a", "loop_current_a")
    assert abs(a) == pytest.approx(2.97, abs=0.02)
    assert inside.real == pytest.approx((10.0 * a.real - 9.004) / 10.55, abs=0.02)
    last = rec["motor_torque"].values[-31_416:]
    assert np.mean(last) == pytest.approx(3.91, abs=0.01)


@pytest.mark.parametrize("drive", DRIVES)
def test_without_limit_the_contact_is_the_healthy_motor(drive: str) -> None:
    """1e12 ohm: the whole run is the healthy one, at the default step."""
    command: dict[str, Any] = {
        "mode": "speed",
        "command": [term("sine", amplitude="30 rad/s", frequency="20 Hz")],
    }
    record = "current_a,motor_torque,motor_speed@10 kHz"
    healthy = run(MOTOR | DRIVES[drive], duration=0.1, record=record, **command)
    open_ = run(
        MOTOR | DRIVES[drive] | loop(1e12), duration=0.1, record=record,
        scenario={"fault": [SHORT]}, **command,
    )  # fmt: skip
    for name in ("current_a", "motor_torque", "motor_speed"):
        size = np.max(np.abs(healthy[name].values))
        assert np.max(np.abs(healthy[name].values - open_[name].values)) < 1e-6 * size


def fault(kind: str, place: str, severity: float, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "place": place, "severity": severity, **more}


CONTACT_CURRENTS = ("phase_short_current_ab", "ground_current")
CONTACTS = {
    "loop": fault("short", "motor.phase_a", 0.2),
    "phases": fault("phase_short", "motor.phases_bc", 0.5, turns=0.4),
    "ground": fault("ground_short", "motor.phase_c", 0.1, turns=0.6),
    "terminals": fault("phase_short", "motor.phases_ab", 0.1),
    "grounded terminal": fault("ground_short", "motor.phase_a", 0.05),
    "resistor": fault("resistor_short", "motor.phase_a", 0.25),
}


def test_a_loop_begins_with_the_phase_current_and_leaves_nothing() -> None:
    """From one sample to the next the current of the turns is that of the phase; cleared, it is
    gone, heats no more, and the motor is the healthy one again.
    """
    short = fault("short", "motor.phase_a", 0.2, profile={"kind": "intermittent", "start": "0.05 s",
                  "period": "1 s", "duty": 0.02})  # fmt: skip
    names = "current_a,loop_current_a,energy_contact,motor_speed"
    rec = turning(PWM | loop(0.1), [short], names)
    inside, current = rec["loop_current_a"].values, rec["current_a"].values
    begin = int(np.argmax(inside != 0.0))
    assert abs(begin - 50_000) <= 1
    assert abs(current[begin]) > 0.5
    # One step of the loop's voltage over its leakage inductance at most.
    assert abs(inside[begin] - current[begin]) < SUPPLY * 1e-6 / (KAPPA * L * 0.1)
    assert np.max(np.abs(inside[60_000:70_000])) > 10.0
    assert np.all(inside[70_002:] == 0.0)
    assert np.ptp(rec["energy_contact"].values[70_003:]) == 0.0
    healthy = turning(PWM, [], "current_a,motor_speed")
    # Ten time constants of the current control later.
    late = slice(80_000, None)
    assert np.max(np.abs(current[late] - healthy["current_a"].values[late])) < 0.1


BRIDGES: dict[str, tuple[dict[str, Any], list[Any]]] = {
    "hysteresis": (HYSTERESIS, []),
    "pwm": (PWM, []),
    "located": (HYSTERESIS | {"inverter.relay_crossing": "located"}, []),
    "lossy": (
        PWM
        | {"inverter.on_resistance": 0.2, "inverter.diode_drop": 1.0, "inverter.dead_time": 2e-6},
        [],
    ),
    "interrupted": (PWM, ["open_phase@motor.phase_b=1"]),
    "open switch": (HYSTERESIS, ["open_switch@inverter.a_high=1"]),
}


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("bridge", BRIDGES)
def test_energy_closes_with_every_contact(bridge: str, contact: str) -> None:
    """What the link gives is lost, stored or delivered, to 0.01 %, also where legs float."""
    names = ("energy_supply", *SINKS, *STORES, "energy_contact", "energy_tap")
    values, others = BRIDGES[bridge]
    rec = run(
        MOTOR | values | (loop(0.5) if contact == "loop" else {}),
        duration=0.25,
        command=[term("sine", amplitude="7 deg", frequency="4 Hz")],
        record=",".join(names) + "@2 kHz",
        scenario={
            "fault": [CONTACTS[contact], *others],
            "load": {"brake": {"terms": [constant(1.0)]}},
        },
    )
    change = {name: float(rec[name].values[-1] - rec[name].values[0]) for name in names}
    given = change.pop("energy_supply")
    assert abs(given - sum(change.values())) < 1e-4 * given
    assert change["energy_tap" if contact == "resistor" else "energy_contact"] > 0.0


@pytest.mark.parametrize("conductance", [1e-12, 1e-3, 0.1, 10.0, 1e3])
@pytest.mark.parametrize("kind", ["phase_short", "ground_short"])
@pytest.mark.parametrize("turns", [1.0, 0.4])
def test_contacts_of_any_resistance_run_at_the_default_step(
    kind: str, conductance: float, turns: float
) -> None:
    """From a milliohm to none, behind switches with a drop as behind ideal ones; none is the
    healthy motor.
    """
    place = "motor.phases_ab" if kind == "phase_short" else "motor.phase_b"
    record = "current_a,phase_short_current_ab,ground_current@100 kHz"
    for values in (PWM, PWM | {"inverter.on_resistance": 0.2, "inverter.dead_time": 2e-6}):
        runs = [
            run(
                MOTOR | values,
                duration=0.02,
                mode="speed",
                command=[constant(20.0)],
                record=record,
                scenario={"fault": faults},
            )
            for faults in ([], [fault(kind, place, conductance, turns=turns)])
        ]
        healthy, faulted = (rec["current_a"].values for rec in runs)
        assert np.all(np.isfinite(faulted))
        apart = np.max(np.abs(faulted - healthy))
        if conductance == 1e-12:
            # A switch's resistance acts on the step's end here, on its start in the healthy star.
            assert apart < (1e-9 if values is PWM else 1e-5)
        elif conductance >= 0.1:
            assert apart > 0.3


@pytest.mark.parametrize("contact", ["phases", "ground", "terminals", "grounded terminal"])
def test_a_cleared_contact_leaves_the_healthy_motor(contact: str) -> None:
    """Gone, it carries nothing from the next step on and heats no more; 50 ms later, some
    time constants of the current control's integral, the phase currents are the healthy run's.
    """
    profile = {"kind": "intermittent", "start": "0.05 s", "period": "1 s", "duty": 0.02}
    names = "current_a,phase_short_current_ab,phase_short_current_bc,ground_current,energy_contact"
    rec = turning(PWM, [CONTACTS[contact] | {"profile": profile}], names)
    through = sum(np.abs(rec[name].values) for name in names.split(",")[1:4])
    assert np.max(through[50_000:70_000]) > 1.0
    assert np.all(through[:50_000] == 0.0)
    assert np.all(through[70_002:] == 0.0)
    assert np.ptp(rec["energy_contact"].values[70_003:]) == 0.0
    healthy = turning(PWM, [], "current_a")["current_a"].values
    assert np.max(np.abs(rec["current_a"].values[120_000:] - healthy[120_000:])) < 0.05


@pytest.mark.signature("phase_short", "motor")
@pytest.mark.parametrize(("drive", "turns"), [("pwm", 1.0), ("pwm", 0.5), ("hysteresis", 0.5)])
def test_phase_short_draws_the_voltage_between_the_windings(drive: str, turns: float) -> None:
    """c = mu (v_a - v_b) / (1/G + 2 mu N R + jw 2 (1 - kappa) mu N L), beside what the windings
    carry; at the terminals it is that at each instant.
    """
    conductance = 0.05
    rec = turning(
        DRIVES[drive],
        [fault("phase_short", "motor.phases_ab", conductance, turns=turns)],
        "phase_short_current_ab,voltage_a,voltage_b,current_a,current_b,current_c,motor_torque,"
        "motor_speed,motor_position",
    )
    w, (c, v_a, v_b, i_a, i_b, i_c) = phasors(
        rec,
        "phase_short_current_ab",
        "voltage_a",
        "voltage_b",
        "current_a",
        "current_b",
        "current_c",
    )
    parts = 2 * turns * (1 - turns)
    impedance = 1 / conductance + parts * R + 1j * w * parts * (1 - KAPPA) * L
    expected = turns * (v_a - v_b) / impedance
    assert abs(expected) > 0.5
    assert abs(c - expected) < 5e-3 * abs(expected)
    if turns == 1.0:
        apart = rec["voltage_a"].values - rec["voltage_b"].values
        through = rec["phase_short_current_ab"].values
        assert np.max(np.abs(through - conductance * apart)) < 1e-9 * np.max(np.abs(through))
    sums = sum(rec[f"current_{x}"].values for x in "abc")
    assert np.max(np.abs(sums)) < 1e-9
    turn = np.exp(2j * math.pi / 3)
    linked = (i_a - turns * c) + (i_b + turns * c) * turn + i_c / turn
    torque = np.mean(rec["motor_torque"].values[-31_416:])
    assert torque == pytest.approx(0.5 * K * linked.real, rel=5e-3)


@pytest.mark.signature("ground_short", "motor")
def test_ground_short_returns_by_the_link() -> None:
    """From terminal a to the lower rail: the phase currents sum to what ground takes, and its mean
    is the mean voltage of the leg over the resistance: half the link, the middle of the three legs
    standing at the link's.
    """
    conductance = 0.01
    rec = turning(
        PWM,
        [fault("ground_short", "motor.phase_a", conductance)],
        "ground_current,voltage_a,current_a,current_b,current_c,motor_speed,motor_position",
    )
    ground = rec["ground_current"].values
    sums = sum(rec[f"current_{x}"].values for x in "abc")
    assert np.max(np.abs(sums - ground)) < 1e-9 * np.max(np.abs(ground))
    last = slice(-round(2 * math.pi / (P * SPEED) / 125e-6) * 125 * 3, None)
    mean = conductance * (SUPPLY / 2 + np.mean(rec["voltage_a"].values[last]))
    assert np.mean(ground[last]) == pytest.approx(mean, rel=0.01)
    assert mean > 1.0


def test_a_dead_short_trips_the_drive() -> None:
    """Between phases and to ground: the current passes the limit and the legs open."""
    for short in ("phase_short@motor.phases_ab=100 S", "ground_short@motor.phase_a=100 S"):
        rec = elevon.simulate(
            elevon.Actuator.load("torino-rotary").with_values(
                DRIVES["pwm"] | {"inverter.trip_current": 30.0}
            ),
            elevon.Scenario.from_dict(
                {
                    "duration": 0.05,
                    "command": {"mode": "speed", "terms": [constant(20.0)]},
                    "fault": [short],
                }
            ),
            record="current_a,current_b,current_c@10 kHz",
        )
        assert rec.meta["status"] == "tripped"
        assert np.all(np.isfinite(rec["current_a"].values))


def test_a_fault_too_fast_for_the_step_is_named_with_its_limit() -> None:
    """Set turns and lost turns pass the same check; the loop's currents are implicit and need
    none.
    """
    with pytest.raises(elevon.InputError, match=r"solver\.step.*at most 1\.\d+e-7 s"):
        run(MOTOR | HYSTERESIS | {"motor.turns_a": 0.05}, duration=1e-3, record="current_a@1 kHz")
    severe = {"fault": ["short@motor.phase_a=0.95"]}
    with pytest.raises(elevon.InputError, match=r"short@motor\.phase_a.*severity of at most 0\.8"):
        run(MOTOR | HYSTERESIS, duration=1e-3, record="current_a@1 kHz", scenario=severe)
    run(MOTOR | HYSTERESIS | loop(0.0), duration=1e-3, record="current_a@1 kHz", scenario=severe)


@pytest.mark.signature("local_demagnetisation", "motor")
def test_local_demagnetisation_puts_sidebands_beside_the_emf() -> None:
    """One weak pole pair of four, the motor turned from outside: the EMF's amplitude at the
    electrical frequency falls by d/p, and at p +- n times the shaft's stand half the window's
    harmonics, d sin(2 pi n/p) / (2 pi n (1 - (2n/p)^2)).
    """
    depth = 0.4
    rec = run(
        TURNING,
        duration=2 * math.pi / SPEED,
        record="voltage_a,motor_position,motor_speed@100 kHz",
        scenario={
            "fault": [fault("local_demagnetisation", "motor", depth)],
            "initial": {"motor_speed": SPEED},
        },
    )
    angle = rec["motor_position"].values[:-1]
    lines = rec["voltage_a"].values[:-1] / (K * SPEED)

    def line(order: int) -> float:
        return float(abs(2 * np.mean(lines * np.exp(-1j * order * angle))))

    # A floating phase shows its EMF over the neutral.
    assert line(P) == pytest.approx(1 - depth / P, abs=1e-3)
    for n, ratio in ((1, math.sin(math.pi / 2) / (math.pi * 0.75)), (2, 1 / P)):
        for order in (P - n, P + n):
            assert line(order) == pytest.approx(0.5 * depth * ratio, abs=1e-3)


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_a_weak_pole_pair_dips_the_torque_once_a_turn(fidelity: str) -> None:
    """Torque per ampere over the rotor's angle: k sum of gap_j sin^2 a_j for sinusoidal currents,
    gap_j the closed form of the window; the same in both fidelities.
    """
    depth, w0 = 0.4, 20.0
    values = TURNING | PWM | {"motor.torque_limit": 1e3}
    rec = run(
        values,
        duration=2 * math.pi / w0,
        mode="torque",
        command=[constant(4.0)],
        record="motor_torque,current_q,motor_position@2 kHz",
        scenario={
            "fault": [fault("local_demagnetisation", "motor", depth)],
            "initial": {"motor_speed": w0},
        },
        fidelity=fidelity,
    )
    # The reduced-order model shows the torque that acted in the step before.
    before = 1 if fidelity == "low" else 0
    angle = rec["motor_position"].values[60 - before : -1 - before]
    shifts = 2 * math.pi / 3 * np.arange(3)[:, None]
    away = np.abs((angle - shifts + math.pi) % (2 * math.pi) - math.pi)
    window = np.where(away < 2 * math.pi / P, 0.5 * (1 + np.cos(P * away / 2)), 0.0)
    expected = K * ((1 - depth * window) * np.sin(P * angle - shifts) ** 2).sum(axis=0)
    torque_constant = rec["motor_torque"].values[60:-1] / rec["current_q"].values[60:-1]
    assert np.ptp(expected) > 0.2 * np.mean(expected)
    # The ripple of the carrier is not all in the quadrature axis.
    assert np.max(np.abs(torque_constant - expected)) < (0.03 if fidelity == "high" else 1e-3) * K
