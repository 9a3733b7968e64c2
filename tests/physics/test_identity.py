"""Same input, same bits: recording, threads, lanes, position in a batch and seeds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import elevon
from elevon import _core
from tests.physics.rig import HYSTERESIS, PWM, actuator, make_scenario, run, term

COMMAND = [term("sine", amplitude="7 deg", frequency="2 Hz")]
NOISY = {"control.noise_deviation": 1e-4, "sensor.current.noise_deviation": 0.02}
NAMES = ["output_position", "motor_speed", "current_a", "current_q", "motor_torque"]
DRIVES = {"hysteresis": HYSTERESIS, "pwm": PWM}


def same(a: Any, b: Any, names: list[str] = NAMES) -> None:
    """Final values equal to the last bit."""
    for name in names:
        assert a.final[name] == b.final[name], name


@pytest.mark.parametrize("drive", DRIVES)
def test_same_seed_same_bits_other_seed_other_noise(drive: str) -> None:
    """The seed decides every random number and nothing else does."""
    kept = {"duration": 0.05, "command": COMMAND, "record": ",".join(NAMES) + "@2 kHz"}
    first, again, other = (run(DRIVES[drive] | NOISY, seed=seed, **kept) for seed in (7, 7, 8))
    for name in NAMES:
        assert np.array_equal(first[name].values, again[name].values), name
    assert not np.array_equal(first["motor_speed"].values, other["motor_speed"].values)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(
    "record",
    ["output_position@400 Hz", "motor_speed,current_q@15.625 kHz", "@every", "drive_log@400 Hz"],
)
def test_recording_does_not_change_the_run(drive: str, record: str) -> None:
    """Cutting the run at recording ticks moves no bit."""
    plain = run(
        DRIVES[drive] | NOISY,
        duration=0.03,
        command=COMMAND,
        record="output_position@10 Hz",
        seed=3,
    )
    same(plain, run(DRIVES[drive] | NOISY, duration=0.03, command=COMMAND, record=record, seed=3))


def batch(count: int = 19) -> list[Any]:
    """Runs that differ in all that may differ: none may disturb its neighbour."""
    runs = []
    for i in range(count):
        faults = (
            [{"kind": "short", "place": "motor.phase_a", "severity": 0.02 * i}] if i % 3 else []
        )
        if i % 5 == 2:
            profile = {"kind": "intermittent", "start": f"{i} ms", "period": "5 ms", "duty": 0.5}
            faults.append(
                {"kind": "friction", "place": "transmission", "severity": 1.0, "profile": profile}
            )
        if i % 7 == 6:
            faults.append({"kind": "ground_short", "place": "motor.phase_b", "severity": 0.01 * i})
            faults.append({"kind": "phase_short", "place": "motor.phases_ca", "severity": 0.1,
                           "turns": 0.3, "profile": {"kind": "step", "time": "8 ms"}})  # fmt: skip
        settings = {
            "motor.short_model": "loop" if i % 3 and i % 2 else "reduced",
            "motor.inertia": 7e-4 + 1e-5 * i,
            "sensor.current.bits": (0, 8, 10, 12)[i % 4],
            "inverter.dead_time": 2e-6 if i % 6 == 5 else 0.0,
            "inverter.relay_crossing": "located" if i % 6 == 4 else "sampled",
        }
        scenario = make_scenario(
            duration=0.02,
            command=[term("sine", amplitude=f"{3 + i} deg", frequency="2 Hz")],
            extra={"fault": faults},
        )
        drive = PWM if i % 4 == 3 else HYSTERESIS
        runs.append(elevon.Run(actuator(drive | NOISY | settings), scenario, i, f"run {i}"))
    return runs


WIDTHS = ("single", "portable", "avx2")
RECORD = [",".join(NAMES) + "@2 kHz"]


@pytest.fixture(scope="module")
def alone() -> list[Any]:
    """Every run of the batch by itself."""
    return [elevon.simulate(r.actuator, r.scenario, record=RECORD, seed=r.seed) for r in batch()]


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("lanes", ["auto", *sorted(set(_core.widths()) & set(WIDTHS))])
def test_batch_is_bit_identical_to_single_runs(alone: list[Any], threads: int, lanes: str) -> None:
    """Any width, any lane, any number of threads."""
    together = elevon.simulate_batch(batch(), record=RECORD, threads=threads, lanes=lanes)
    for one, many in zip(alone, together, strict=True):
        for name in NAMES:
            assert np.array_equal(one[name].values, many[name].values), name


def test_order_in_the_batch_does_not_matter(alone: list[Any]) -> None:
    """The same runs backwards, so every one sits in another lane."""
    together = elevon.simulate_batch(batch()[::-1], record=RECORD)
    for one, many in zip(alone, together[::-1], strict=True):
        for name in NAMES:
            assert np.array_equal(one[name].values, many[name].values), name


@pytest.mark.filterwarnings("ignore::elevon.errors.NotActingWarning")
@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_batch_identity_in_both_fidelities(fidelity: str) -> None:
    """The reduced-order model too, which carries a part of what differs."""
    runs = batch(5)
    record = ["output_position,motor_speed,current_q@400 Hz"]
    together = elevon.simulate_batch(runs, fidelity=fidelity, record=record)
    for r, many in zip(runs, together, strict=True):
        one = elevon.simulate(r.actuator, r.scenario, fidelity=fidelity, record=record, seed=r.seed)
        same(one, many, ["output_position", "motor_speed", "current_q"])


LOCATED = HYSTERESIS | {"inverter.relay_crossing": "located"}
DETAILS = {"inverter.dead_time": 2e-6, "inverter.diode_drop": 1.0, "sensor.current.bits": 12}
SHORT_TICKS = {"control.sample_time": 125e-6}
LONG_STEPS = {
    "carrier, 1 us": PWM,
    "carrier, 12.5 us": PWM | SHORT_TICKS | {"solver.step": 12.5e-6},
    # 125 us are no whole number of these steps' carrier periods: they reach from one into the next.
    "carrier, straddling": PWM | SHORT_TICKS | {"solver.step": 12.5e-6, "pwm.frequency": 3300.0},
    "carrier, detailed": PWM | SHORT_TICKS | {"solver.step": 12.5e-6} | DETAILS,
    "located, 5 us": LOCATED | {"solver.step": 5e-6},
    "located, detailed": LOCATED | {"solver.step": 5e-6} | DETAILS,
}


def different(settings: dict[str, Any], faults: list[dict[str, Any]], count: int) -> list[Any]:
    """Runs of one structure, each with its own command, inertia and carrier."""
    runs = []
    for i in range(count):
        changes = {"motor.inertia": 7e-4 + 2e-5 * i}
        if settings["drive.kind"] == "pwm":
            changes["pwm.frequency"] = settings["pwm.frequency"] + 10.0 * i
        scenario = make_scenario(
            duration=0.02,
            command=[term("sine", amplitude=f"{3 + i} deg", frequency="3 Hz")],
            extra={"fault": faults},
        )
        runs.append(elevon.Run(actuator(settings | changes), scenario, i, f"run {i}"))
    return runs


@pytest.mark.parametrize("case", LONG_STEPS)
def test_lanes_of_carrier_and_located_steps_are_single_runs_to_the_bit(case: str) -> None:
    """Every width that this build has, in steps longer than the papers' as well."""
    record = [",".join([*NAMES, "leg_transitions"]) + "@8 kHz"]
    runs = different(LONG_STEPS[case], [], 9)
    alone = [elevon.simulate(r.actuator, r.scenario, record=record) for r in runs]
    assert all(one.final["leg_transitions"] > 100 for one in alone)
    for lanes in ("auto", *sorted(set(_core.widths()) & set(WIDTHS))):
        together = elevon.simulate_batch(runs, record=record, lanes=lanes)
        for one, many in zip(alone, together, strict=True):
            for name in one.names:
                assert np.array_equal(one[name].values, many[name].values), (lanes, name)


@pytest.mark.parametrize("case", ["carrier, 12.5 us", "carrier, straddling", "located, 5 us"])
@pytest.mark.parametrize("fault", ["open_phase@motor.phase_a", "friction@transmission"])
def test_a_fault_of_severity_zero_leaves_the_bits_of_the_lean_step(case: str, fault: str) -> None:
    """The step with every detail, the bridge's included, and the lean one."""
    kind, place = fault.split("@")
    none = [{"kind": kind, "place": place, "severity": 0.0}]
    healthy, (faulty,) = different(LONG_STEPS[case], [], 1)[0], different(LONG_STEPS[case], none, 1)
    record = [",".join(NAMES) + "@8 kHz"]
    one, other = (elevon.simulate(r.actuator, r.scenario, record=record) for r in (healthy, faulty))
    for name in NAMES:
        assert np.array_equal(one[name].values, other[name].values), name
