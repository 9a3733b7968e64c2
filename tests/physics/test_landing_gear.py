"""The landing gear against closed forms: EMF, six-step torque, lever, energy, free fall."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import elevon
from elevon import _core
from tests.physics.gear import EXTENDED, NAME, gear, value

RETRACTED, LOCKED, RELEASED, FAULT = 0, 2, 5, 6


def trapezoid(angle: np.ndarray) -> np.ndarray:
    """P eq. (6) by its branches, the last one corrected; flat width 120 degrees."""
    turn = np.mod(angle, 2 * np.pi)
    rise, slope = np.pi / 6, 6 / np.pi
    return np.select(
        [turn < rise, turn < 5 * rise, turn < 7 * rise, turn < 11 * rise],
        [slope * turn, 1.0, -slope * (turn - np.pi), -1.0],
        slope * (turn - 2 * np.pi),
    )


def test_emf_has_the_trapezoids_shape() -> None:
    """Three phases, whole turns, at speed: the shape of each branch."""
    rec = gear((0.0, "retract"), duration=1.5, start=EXTENDED, fidelity="high",
               record="emf_a,emf_b,emf_c,motor_position,motor_speed@20 kHz")  # fmt: skip
    angle = value("motor.pole_pairs") * rec["motor_position"].values
    speed = rec["motor_speed"].values
    for index, name in enumerate(("emf_a", "emf_b", "emf_c")):
        expected = value("motor.emf_constant") * speed * trapezoid(angle - 2 * np.pi * index / 3)
        assert np.max(np.abs(rec[name].values - expected)) < 1e-9
    assert np.ptp(angle) > 100.0


def test_six_step_torque_is_twice_the_phase_constant_times_the_current() -> None:
    """Aligned sensors, two phases conducting: no ripple but the current's own.

    Nine samples in ten are exact. The rest have an old pair free-wheeling past its commutation,
    where its EMF already falls: never more torque, and at most a few percent less.
    """
    rec = gear((0.0, "retract"), duration=4.0, start=EXTENDED, fidelity="high",
               record="current_a,current_b,current_c,motor_torque@10 kHz")  # fmt: skip
    currents = np.stack([rec[f"current_{phase}"].values for phase in "abc"])
    sizes = np.sort(np.abs(currents), axis=0)
    pair = (sizes[0] < 1e-9) & (sizes[2] > 1.0)
    line = 0.5 * sizes.sum(axis=0)
    torque = np.abs(rec["motor_torque"].values)
    ratio = torque[pair] / line[pair] / (2 * value("motor.emf_constant"))
    assert pair.sum() > 10_000
    assert np.mean(np.abs(ratio - 1.0) < 1e-9) > 0.9
    assert ratio.max() < 1.0 + 1e-9
    assert ratio.min() > 0.9


@pytest.mark.parametrize("shift", [5.0, 10.0, 20.0])
def test_torque_ripple_of_shifted_sensors(shift: float) -> None:
    """Sensors late by delta: T/I runs from 2 k down to k (2 - delta/30), 2 - delta^2/3600 in mean.

    The outgoing phase, at k (1 - delta/30) and falling, keeps a part of the current for another
    phi = p w 3 L I/(V + e): (delta phi/60 + phi^2/180)/60 less, degrees. Retracting, the shift
    that delays the sensors is positive: the shaft turns backwards. Both legs chopped: with the
    low one alone the third phase brakes as well.
    """
    rec = gear((0.0, "retract"), duration=5.0, start=EXTENDED,
               record="current_line,motor_torque,motor_speed,supply_voltage@50 kHz",
               values={"hall.offset": f"{shift} deg", "load.factor": 0.0,
                       "inverter.chopping": "both"})  # fmt: skip
    current, torque = rec["current_line"].values, rec["motor_torque"].values
    steady = (np.abs(current) > 1.0) & (rec["motor_speed"].values < -500.0)
    ratio = torque[steady] / current[steady] / value("motor.emf_constant")
    assert ratio.max() == pytest.approx(2.0, abs=1e-9)
    assert ratio.min() == pytest.approx(2.0 - shift / 30.0, abs=0.03)
    speed = np.mean(np.abs(rec["motor_speed"].values[steady]))
    volts = rec["supply_voltage"].values[steady].mean() + 2 * value("motor.emf_constant") * speed
    charge = 3 * value("motor.winding_inductance") * np.mean(np.abs(current[steady]))
    phi = np.degrees(value("motor.pole_pairs") * speed * charge / volts)
    overlap = (shift * phi / 60.0 + phi**2 / 180.0) / 60.0
    assert ratio.mean() == pytest.approx(2.0 - shift**2 / 3600.0 - overlap, abs=0.004)


def test_the_third_phase_brakes_as_much_at_low_as_at_high() -> None:
    """Low-side chopping at 417 rad/s: 2.7 % less torque over line current than the pair's 2 k."""
    ratio = []
    for fidelity in ("low", "high"):
        rec = gear((0.0, "retract"), duration=0.8, start=EXTENDED, fidelity=fidelity,
                   record="current_line,motor_torque@12.5 kHz")  # fmt: skip
        late = rec["motor_torque"].time > 0.6
        torque, current = (
            rec[name].values[late].mean() for name in ("motor_torque", "current_line")
        )
        ratio.append(torque / current / (2.0 * value("motor.emf_constant")))
    assert ratio[0] == pytest.approx(ratio[1], abs=0.002)
    assert 0.95 < ratio[1] < 0.98


def test_lever_is_the_triangle_and_virtual_work_is_an_identity() -> None:
    """Both loop equations close and h = dx/dalpha = g sin(a + b), all to rounding."""
    rec = gear((0.0, "extend"), duration=8.0, record="output_position,lever_angle,lever_arm@200 Hz")
    ram = np.minimum(rec["output_position"].values, value("lever.stroke"))
    arm, d, e = value("lever.arm"), value("lever.pivot_x"), value("lever.pivot_y")
    length = value("lever.length_retracted") + ram

    def swing(at: np.ndarray) -> np.ndarray:
        cosine = (d * d + e * e + arm * arm - at * at) / (2 * arm * np.hypot(d, e))
        return np.arccos(cosine) - np.arctan2(e, d)

    a = swing(length)
    b = np.arctan2(e + arm * np.sin(a), d - arm * np.cos(a))
    assert np.max(np.abs(length * np.cos(b) + arm * np.cos(a) - d)) < 1e-14
    assert np.max(np.abs(length * np.sin(b) - arm * np.sin(a) - e)) < 1e-14
    start = swing(np.array([value("lever.length_retracted")]))
    assert np.max(np.abs(rec["lever_angle"].values - (a - start))) < 1e-13
    inside = ram < value("lever.stroke")
    height = arm * np.sin(a + b)
    # F dx = (F h) dalpha for every F: h is the derivative.
    assert np.max(np.abs(rec["lever_arm"].values[inside] / height[inside] - 1.0)) < 1e-12
    assert np.ptp(ram) > 0.26


def cycle(fidelity: str, factor: float, supply: float, **values: float) -> Any:
    """Extension, lock, unlock, retraction; the exact inertia term on."""
    return gear(
        (0.1, "extend"), (9.0, "retract"), duration=18.0, record="all@10 Hz", fidelity=fidelity,
        values={"load.factor": factor, "inverter.supply_voltage": supply,
                "leg.inertia_rate_term": "on"} | values,
    )  # fmt: skip


def change(rec: Any, *names: str) -> float:
    """Growth of energies over a run, J."""
    return sum(float(rec[f"energy_{n}"].values[-1] - rec[f"energy_{n}"].values[0]) for n in names)


def electric_rest(rec: Any) -> float:
    """What the electrical account leaves, of the energy given."""
    names = ("source", "dump", "copper", "inverter", "capacitor", "magnetic", "motor")
    return 1.0 - change(rec, *names) / change(rec, "supply")


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize(
    ("factor", "supply"), [(1.0, 28.0), pytest.param(3.5, 20.5, marks=pytest.mark.long)]
)
def test_energy_balances_over_a_cycle_with_the_lock(
    fidelity: str, factor: float, supply: float
) -> None:
    """Extension, lock, unlock, retraction.

    What the electrical account leaves is the cut of a step where an outgoing phase stops
    conducting: of first order in the step (the next test).
    """
    rec = cycle(fidelity, factor, supply)
    mechanic = change(rec, "load", "lock", "detent", "friction", "efficiency", "brake", "governor",
                      "impact", "kinetic")  # fmt: skip
    assert rec.final["state"] == RETRACTED
    assert change(rec, "supply") > 500.0
    if (fidelity, factor) != ("high", 3.5):
        assert abs(electric_rest(rec)) < 5e-4
    assert abs(change(rec, "motor") - mechanic) < 1e-3
    assert change(rec, "impact") > 0.0
    assert change(rec, "brake") > 0.0


@pytest.mark.long
def test_what_the_energy_leaves_is_of_first_order_in_the_step() -> None:
    """At 3.5 g it halves with the step, and nothing is left at no step."""
    whole, half = (
        electric_rest(cycle("high", 3.5, 20.5, **{"solver.step": step})) for step in (1e-6, 5e-7)
    )
    assert whole / half == pytest.approx(2.0, rel=0.2)
    assert abs(2.0 * half - whole) < 1e-4


def test_the_load_drives_back_only_through_an_efficient_train() -> None:
    """Brake gone at 100 mm: above one half the leg falls, below it stays at any load."""

    def loose(**values: float) -> float:
        rec = gear(duration=2.0, start="100 mm", faults=["brake_slipping@brake=1"],
                   values={"load.factor": 3.5, "control.brake_reading": "release", **values},
                   )  # fmt: skip
        return float(rec.final["nut_position"])

    assert loose() > 0.12
    total = value("gear.efficiency_first") * value("gear.efficiency_second")
    locking = {"screw.efficiency_unloaded": 0.49 / total, "screw.efficiency_loaded": 0.49 / total}
    assert loose(**locking) == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_no_cut_off_stops_a_rectified_current(fidelity: str) -> None:
    """An EMF far above the link: the diodes carry more than the 60 A at which switches open."""
    scenario = elevon.Scenario.from_dict(
        {
            "duration": 0.03,
            "command": {"mode": "gear", "steps": []},
            "initial": {"nut_position": 0.1, "motor_speed": 1200.0},
            "parameters": {"inverter.supply_voltage": 14.0},
            "fault": ["brake_slipping@brake=1"],
        }
    )
    rec = elevon.simulate(elevon.Actuator.load(NAME), scenario, fidelity=fidelity,
                          record=["current_mean,motor_speed@1 kHz"])  # fmt: skip
    assert rec["current_mean"].values.min() < -1.2 * value("inverter.current_cutoff")
    assert rec["motor_speed"].values[-1] < 800.0


def test_what_decays_to_nothing_is_nothing() -> None:
    """No signal of a stroke holds numbers without full precision: they are slow."""
    rec = gear((0.1, "extend"), duration=8.0, record="all@1 kHz")
    for name in rec.names:
        size = np.abs(rec[name].values)
        assert not np.any((size > 0.0) & (size < np.finfo(float).tiny)), name


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_free_fall_extends_and_locks_without_the_motor(fidelity: str) -> None:
    """Gravity alone, motor apart and standing, no current; the lock engages by its spring."""
    rec = gear((0.1, "free_fall"), duration=6.0, fidelity=fidelity)
    assert rec.final["state"] == LOCKED
    assert rec.final["locked"] == 1.0
    assert rec.final["released"] == 1.0
    assert np.max(np.abs(rec["current_line"].values)) == 0.0
    assert np.ptp(rec["motor_position"].values) == 0.0
    speed = rec["output_speed"].values
    assert speed.max() == pytest.approx(0.081, rel=0.05)


def test_free_fall_against_more_friction_than_weight_stays() -> None:
    """A light leg in a worn screw does not come down, and the unit does not claim it has."""
    rec = gear((0.1, "free_fall"), duration=6.0, faults=["friction_growth@screw=2000"])
    assert rec.final["state"] == RELEASED
    assert rec.final["nut_position"] < 0.01


@pytest.mark.parametrize(
    ("factor", "supply"),
    [
        (1.0, 28.0),
        pytest.param(1.5, 22.0, marks=pytest.mark.long),
        pytest.param(3.5, 20.5, marks=pytest.mark.long),
        pytest.param(3.5, 32.2, marks=pytest.mark.long),
    ],
)
def test_low_and_high_fidelity_agree_on_the_stroke(factor: float, supply: float) -> None:
    """Within 2 % of the time; the averaged current within the 6 % its resistance was fitted to."""
    values = {"load.factor": factor, "inverter.supply_voltage": supply}
    for action, start, end in (("extend", None, LOCKED), ("retract", EXTENDED, RETRACTED)):
        times, currents = [], []
        for fidelity in ("low", "high"):
            rec = gear((0.1, action), duration=9.0, start=start, fidelity=fidelity, values=values,
                       record="state,current_mean,output_position@1 kHz")  # fmt: skip
            state = rec["state"]
            times.append(state.time[(state.values == end) & (state.time > 0.2)][0])
            ram = rec["output_position"].values
            middle = (ram > 0.1) & (ram < 0.16)
            currents.append(np.mean(rec["current_mean"].values[middle]))
        assert times[0] == pytest.approx(times[1], rel=0.02)
        if action == "retract":
            assert currents[0] == pytest.approx(currents[1], rel=0.06)


def test_batches_of_any_width_equal_single_runs() -> None:
    """Gears in different states, faults and loads side by side, bit for bit."""
    record = ["nut_position,motor_speed,current_line,supply_voltage,state@1 kHz"]
    runs = []
    for index in range(7):
        fault = [["hall_high@sensor.hall_b=1"], [], ["short@motor.phase_a=0.2"]][index % 3]
        action = ["extend", "retract", "free_fall"][index % 3]
        scenario = elevon.Scenario.from_dict(
            {
                "duration": 0.8,
                "command": {"mode": "gear", "steps": [{"time": 0.02 * index, "action": action}]},
                "initial": {"nut_position": [0.0008, 0.267, 0.26][index % 3]},
                "parameters": {"load.factor": 1.0 + 0.3 * index},
                "fault": fault,
            }
        )
        runs.append(elevon.Run(elevon.Actuator.load(NAME), scenario, index, str(index)))
    for fidelity in ("high", "low"):
        alone = [
            elevon.simulate(r.actuator, r.scenario, fidelity=fidelity, record=record, seed=r.seed)
            for r in runs
        ]
        for lanes in {"portable", "auto"} & set(_core.widths()):
            together = elevon.simulate_batch(runs, fidelity=fidelity, record=record, lanes=lanes)
            for one, many in zip(alone, together, strict=True):
                for name in one.names:
                    assert np.array_equal(one[name].values, many[name].values), (fidelity, name)


@pytest.mark.parametrize("supply", [20.5, 32.2])
def test_the_software_brake_gives_its_energy_to_the_supply(supply: float) -> None:
    """An extension at 3.5 g is held back by shorted windings at the current cut-off, which are a
    boost converter: of 152 J, both models give back more than 100 J (an independent three-phase
    model: 110 J, and 31 J of copper heat).
    """
    kept = {}
    for fidelity in ("high", "low"):
        rec = gear(
            (0.2, "extend"),
            duration=9.0,
            fidelity=fidelity,
            record="energy_supply,energy_copper,energy_motor@1 kHz",
            values={"load.factor": 3.5, "inverter.supply_voltage": supply},
        )
        kept[fidelity] = {n: rec.final[f"energy_{n}"] for n in ("supply", "copper", "motor")}
    high, low = kept["high"], kept["low"]
    assert low["motor"] == pytest.approx(high["motor"], rel=0.02)
    # What the cut-off's ripple adds to the copper's heat is not in the mean current.
    braked = -high["motor"]
    assert abs(low["supply"] - high["supply"]) < 0.1 * braked
    assert abs(low["copper"] - high["copper"]) < 0.1 * braked
    assert low["supply"] < -100.0


@pytest.mark.filterwarnings("ignore:supply.dump_voltage")
@pytest.mark.parametrize("supply", [20.5, 28.0, 32.2])
def test_a_blocked_source_lets_the_link_rise_alike(supply: float) -> None:
    """What the software brake gives back charges the link until the unit ends the motion, which
    waits for its supply: highest voltage within 1 %, its time within 3 %.
    """
    seen = {}
    for fidelity in ("high", "low"):
        rec = gear(
            (0.2, "extend"),
            duration=1.5,
            fidelity=fidelity,
            record="supply_voltage,state@1 kHz",
            values={
                "load.factor": 3.5,
                "inverter.supply_voltage": supply,
                "supply.regeneration": "block",
                "supply.dump_voltage": 36.0,
            },
        )
        state = rec["state"]
        ended = float(state.time[state.values == FAULT][0])
        seen[fidelity] = (float(rec["supply_voltage"].values.max()), ended)
    (high, when), (low, then) = seen["high"], seen["low"]
    assert high > supply + 2.0
    assert low == pytest.approx(high, rel=0.01)
    assert then == pytest.approx(when, rel=0.03)
