"""Backlash under a load: the flank that carries, its release, and the time of a crossing.

Rigid flanks (backlash.model = operator, and the reduced-order model) against the elastic form,
closed forms and an event-located integration of two masses.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import elevon
from elevon.simulate.sensitivity import sensitivities
from tests.physics.rig import (
    FREE_SHAFT,
    INERTIA,
    RATIO,
    actuator,
    constant,
    make_scenario,
    run,
    term,
    values,
)

FIDELITIES = ("high", "low")
STUCK = {"friction.static": 10.0, "friction.dynamic": 10.0}
GAP = 0.01
MASS = 0.01


def output_force(*terms: dict[str, Any]) -> dict[str, Any]:
    """A scenario's force on the output."""
    return {"load": {"output": {"terms": list(terms)}}}


def lost_motion(
    name: str, model: str, fidelity: str, force: float, amplitude: str, faults: list[str]
) -> float:
    """Range of motor against output over the last 3.5 s of a 0.5 Hz sine, at the output."""
    rec = run(
        {"backlash.model": model} if fidelity == "high" else None,
        name=name,
        duration=4.0,
        fidelity=fidelity,
        command=[term("sine", amplitude=amplitude, frequency=0.5)],
        scenario={**output_force(constant(force)), "fault": faults},
        record="motor_position,output_position@1 kHz",
    )
    motor, output = values(rec, "motor_position", "output_position")
    ratio = RATIO if name == "torino-rotary" else 2 * math.pi / 0.01
    return float(np.ptp((motor / ratio - output)[500:]))


@pytest.mark.parametrize(
    ("model", "fidelity"), [("operator", "high"), ("elastic", "high"), ("operator", "low")]
)
def test_a_loaded_ballscrew_loses_no_motion(model: str, fidelity: str) -> None:
    """4500 N hold the ram on one flank of 0.22 mm: only the elastic contact's stiffness is left,
    0.0034 mm by an independent two-mass program.
    """
    wear = ["backlash@transmission=0.2 mm"]
    lost = lost_motion("nasa-ballscrew", model, fidelity, 4500.0, "20 mm", wear)
    if model == "elastic":
        assert lost == pytest.approx(3.4e-6, rel=0.02)
    else:
        assert lost < 1e-12


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_an_unloaded_ballscrew_loses_all_of_it(fidelity: str) -> None:
    """50 N of the fixture's friction hold the load where the ram left it; at low the joint
    has the stiffness of the set, and 45 N wind it up on one flank.
    """
    wear = ["backlash@transmission=0.2 mm"]
    lost = lost_motion("nasa-ballscrew", "operator", fidelity, 45.0, "20 mm", wear)
    wound = 45.0 / 5e7 if fidelity == "low" else 0.0
    assert lost == pytest.approx(2.2e-4 + wound, rel=1e-9)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_loaded_rotary_actuator_loses_no_motion(fidelity: str) -> None:
    """10 N m on the output against 0.3656 deg of backlash."""
    assert lost_motion("torino-rotary", "operator", fidelity, 10.0, "5 deg", []) < 1e-12


def crossing(
    fidelity: str,
    *,
    force: float,
    friction: float = 0.0,
    damping: float = 0.0,
    mass: float = MASS,
    step: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Time after the force's reversal and output position; the motor is held by its friction."""
    wanted = FREE_SHAFT | STUCK | {"backlash.total": GAP, "load.inertia": mass}
    wanted |= {"load.friction": friction} if friction else {}
    wanted |= {"load.damping": damping} if damping else {}
    wanted |= {"low.step": step} if step else {}
    rec = run(
        wanted,
        duration=0.5,
        fidelity=fidelity,
        scenario=output_force(term("step", initial=force, final=-force, time=0.2)),
        record=f"output_position@{10 if fidelity == 'high' or step else 1} kHz",
    )
    return rec["output_position"].time - 0.2, values(rec, "output_position")[0]


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_crossing_takes_the_time_that_the_force_gives_it(fidelity: str) -> None:
    """x = (F - F_f) t^2 / 2m until the other flank: 10 ms, seen on a grid of 0.1 ms.

    The reduced-order model's force acts from the next step on.
    """
    force, friction = 3.0, 1.0
    time, output = crossing(
        fidelity, force=force, friction=friction, step=1e-4 if fidelity == "low" else None
    )
    duration = math.sqrt(2 * GAP * MASS / (force - friction))
    assert duration == pytest.approx(0.01)
    inside = (time > 0) & (time < duration - 1e-4)
    exact = -GAP / 2 + (force - friction) / (2 * MASS) * time**2
    step = 1e-4 if fidelity == "low" else 1e-6
    speed = math.sqrt(2 * GAP * (force - friction) / MASS)
    assert np.max(np.abs(output - exact)[inside]) < 1.5 * step * speed
    assert output[time < 0][-1] == pytest.approx(-GAP / 2, rel=1e-5)
    assert output[time > duration + 2e-4] == pytest.approx(GAP / 2, rel=1e-5)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_massless_output_creeps_through_its_damping(fidelity: str) -> None:
    """Without inertia the speed is (F - F_f)/c: 0.01 rad at 0.2 rad/s."""
    time, output = crossing(fidelity, force=3.0, friction=1.0, damping=10.0, mass=0.0)
    exact = -GAP / 2 + 0.2 * np.clip(time, 0.0, 0.05)
    after = time > 0.0
    assert output[after] == pytest.approx(exact[after], abs=0.2 * 1.1e-3)
    assert output[-1] == pytest.approx(GAP / 2, rel=1e-6)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_massless_free_output_is_on_the_pressed_flank_at_once(fidelity: str) -> None:
    """Neither inertia nor damping: no time at all. The step's impulse moves the motor by
    (F - F_f) dt^2 / (J i^2), 1.2e-8 rad at the reduced-order model's 0.5 ms.
    """
    time, output = crossing(fidelity, force=3.0, friction=1.0, mass=0.0)
    assert output[(time < 0) & (time > -0.19)] == pytest.approx(-GAP / 2, abs=1.3e-8)
    assert output[time > 1.1e-3] == pytest.approx(GAP / 2, abs=2.6e-8)


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize(("share", "crosses"), [(0.99, False), (1.0, False), (1.01, True)])
def test_friction_of_the_output_decides_which_flank(
    fidelity: str, share: float, crosses: bool
) -> None:
    """Below and at the friction limit the output stays where it stood, above it leaves."""
    _, output = crossing(fidelity, force=share * 2.0, friction=2.0, damping=0.05)
    assert np.ptp(output) == (pytest.approx(GAP, rel=1e-4) if crosses else 0.0)


def two_masses(
    duration: float, torque: float, frequency: float, force: float, forcing: float
) -> Any:
    """Own oracle: motor (at the output) and output, rigid flanks, events located to 1e-11 s.

    The motor is pushed by a cosine, the output by `force` with a sine of `forcing` Hz.
    """
    heavy = INERTIA * RATIO**2
    half = GAP / 2

    def pushes(t: float) -> tuple[float, float]:
        motor = -torque * RATIO * math.cos(2 * math.pi * frequency * t)
        return motor, -force * math.sin(2 * math.pi * forcing * t + 0.3)

    def carried(t: float, side: int) -> float:
        motor, output = pushes(t)
        return side * (MASS * (motor + output) / (heavy + MASS) - output)

    def motion(side: int) -> Any:
        def slope(t: float, y: np.ndarray) -> list[float]:
            motor, output = pushes(t)
            if side:
                both = (motor + output) / (heavy + MASS)
                return [y[1], both, y[3], both]
            return [y[1], motor / heavy, y[3], output / MASS]

        return slope

    def landing(_: float, y: np.ndarray) -> float:
        return half - abs(y[0] - y[2])

    landing.terminal, landing.direction = True, -1  # type: ignore[attr-defined]
    time, state, side = 0.0, np.zeros(4), 0
    times, outputs, landings = [0.0], [0.0], 0
    while time < duration:
        let_go = lambda t, y, side=side: carried(t, side)  # noqa: E731
        let_go.terminal, let_go.direction = True, -1  # type: ignore[attr-defined]
        found = solve_ivp(
            motion(side), (time, duration), state, events=let_go if side else landing,
            rtol=1e-10, atol=1e-13, max_step=1e-3,
        )  # fmt: skip
        times.extend(found.t[1:])
        outputs.extend(found.y[2][1:])
        time, state = float(found.t[-1]), found.y[:, -1]
        if found.status != 1:
            break
        if side:
            side = 0
            continue
        side = 1 if state[0] > state[2] else -1
        state[1] = state[3] = (heavy * state[1] + MASS * state[3]) / (heavy + MASS)
        state[2] = state[0] - side * half
        landings += 1
        if carried(time, side) < 0:
            side = 0
    return np.array(times), np.array(outputs), landings


ORACLE = (0.6, 2.0, 3.0, 0.4, 5.0)


def free_masses(fidelity: str, step: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The oracle's case on the tool."""
    duration, torque, frequency, force, forcing = ORACLE
    key = "low.step" if fidelity == "low" else "solver.step"
    rec = run(
        FREE_SHAFT | {"backlash.total": GAP, "load.inertia": MASS} | ({key: step} if step else {}),
        duration=duration,
        fidelity=fidelity,
        scenario={
            "load": {
                "shaft": {
                    "terms": [term("sine", amplitude=torque, frequency=frequency, phase="90 deg")]
                },
                "output": {
                    "terms": [term("sine", amplitude=force, frequency=forcing, phase="0.3 rad")]
                },
            }
        },
        record="output_position@1 kHz",
    )
    return rec["output_position"].time, values(rec, "output_position")[0]


def test_the_oracle_crosses_both_ways() -> None:
    """The case below has several landings and releases."""
    assert two_masses(*ORACLE)[2] >= 4


@pytest.mark.parametrize(("fidelity", "limit"), [("high", 1e-3), ("low", 0.1)])
def test_two_rigid_masses_move_as_an_event_located_integration(fidelity: str, limit: float) -> None:
    """A force through zero on a free output: RMS error in shares of the backlash."""
    time, output = free_masses(fidelity)
    exact = np.interp(time, *two_masses(*ORACLE)[:2])
    assert np.sqrt(np.mean((output - exact) ** 2)) < limit * GAP


def test_the_reduced_order_model_converges_with_its_step() -> None:
    """First order: a tenth of the step leaves less than a fifth of the error."""
    times, outputs, _ = two_masses(*ORACLE)
    errors = []
    for step in (5e-4, 5e-5):
        time, output = free_masses("low", step)
        errors.append(np.sqrt(np.mean((output - np.interp(time, times, outputs)) ** 2)))
    assert errors[1] < errors[0] / 5


def test_the_books_close_over_crossings_and_impacts() -> None:
    """What the motor's torque and the load give, friction and impacts take; an impact at rest
    takes m v^2 / 2 of the reduced mass.
    """
    names = ("load", "friction", "brake", "impact", "kinetic")
    rec = run(
        FREE_SHAFT | STUCK | {"backlash.total": GAP, "load.inertia": MASS, "load.friction": 1.0},
        duration=0.5,
        scenario=output_force(term("step", initial=3.0, final=-3.0, time=0.2)),
        record=",".join(f"energy_{name}" for name in names) + "@10 kHz",
    )
    change = {name: np.ptp(rec[f"energy_{name}"].values[[0, -1]]) for name in names}
    # Half the backlash first, then all of it; the force does the work, a third of it is friction's.
    load = float(rec["energy_load"].values[-1])
    assert load == pytest.approx(-3.0 * 1.5 * GAP, rel=2e-3)
    assert change["friction"] == pytest.approx(1.0 * 1.5 * GAP, rel=2e-3)
    assert change["impact"] == pytest.approx(2.0 * 1.5 * GAP, rel=2e-3)
    total = load + sum(change[name] for name in ("friction", "brake", "impact", "kinetic"))
    # The motor stops from the impact's speed within one step, whose energy is not counted.
    assert abs(total) < 1e-6 * abs(load)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_batches_equal_single_runs_under_load(fidelity: str) -> None:
    """Forces above, below and without, side by side."""
    unit = actuator({"load.friction": 1.0, "load.inertia": 0.05})
    scenarios = [
        make_scenario(
            duration=0.3,
            command=[term("sine", amplitude="3 deg", frequency="4 Hz")],
            extra=output_force(term("sine", amplitude=force, frequency=7.0)),
        )
        for force in (0.0, 0.5, 1.0, 3.0, 10.0)
    ]
    record = "output_position,output_speed,motor_speed@1 kHz"
    runs = [elevon.Run(unit, scenario) for scenario in scenarios]
    together = elevon.simulate_batch(runs, fidelity=fidelity, record=record)
    for scenario, one in zip(scenarios, together, strict=True):
        single = elevon.simulate(unit, scenario, fidelity=fidelity, record=record)
        for name in ("output_position", "output_speed", "motor_speed"):
            assert np.array_equal(single[name].values, one[name].values)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_force_of_zero_changes_no_bit(fidelity: str) -> None:
    """A free, unloaded output stays where the motor left it, as the published operator says."""
    motion = {"duration": 0.3, "command": [term("sine", amplitude="3 deg", frequency="4 Hz")]}
    record = "output_position,output_speed,motor_speed@1 kHz"
    plain = run(record=record, fidelity=fidelity, **motion)
    driven = run(record=record, fidelity=fidelity, scenario=output_force(constant(0.0)), **motion)
    for name in ("output_position", "output_speed", "motor_speed"):
        assert np.array_equal(plain[name].values, driven[name].values)


@pytest.mark.parametrize(
    ("path", "h"), [("backlash.total", 1e-6), ("load.inertia", 1e-6), ("load.constant", 1e-5)]
)
def test_sensitivities_hold_through_a_crossing(path: str, h: float) -> None:
    """Dual numbers against central differences while the output crosses, and after it landed."""
    base = {
        **FREE_SHAFT,
        **STUCK,
        "backlash.total": GAP,
        "load.inertia": MASS,
        "load.friction": 1.0,
        "load.constant": 0.5,
    }
    scenario = make_scenario(
        duration=0.23, extra=output_force(term("step", initial=3.0, final=-3.0, time=0.2))
    )
    record = "output_position@1 kHz"
    found = sensitivities(actuator(base), scenario, [path], fidelity="low", record=record)
    exact = found.derivatives[path]["output_position"]

    def at(value: float) -> np.ndarray:
        rec = elevon.simulate(
            actuator(base | {path: value}), scenario, fidelity="low", record=record
        )
        return values(rec, "output_position")[0]

    difference = (at(base[path] + h) - at(base[path] - h)) / (2 * h)
    assert np.max(np.abs(exact)) > 0
    inside = np.abs(difference - exact) < 1e-4 * np.max(np.abs(exact)) + 1e-9
    # The landing itself, one sample, falls into one step or the next.
    assert np.count_nonzero(~inside) <= 1
