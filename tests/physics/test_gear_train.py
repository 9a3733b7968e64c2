"""A gear of several bodies: statics against closed forms, motion against an oracle of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import elevon
from elevon.simulate.sensitivity import sensitivities
from tests.oracle.gear_train import TEETH, Flanks, Gear
from tests.physics.rig import (
    FREE_SHAFT,
    INERTIA,
    LOCKED,
    actuator,
    constant,
    make_scenario,
    run,
    term,
    values,
)

OUTPUT_INERTIA = 0.02
# Backlash, stiffness and damping of each mesh, sized so that every one of them is felt.
MESHES = [(9e-3, 900.0, 0.5), (4e-3, 2500.0, 2.0), (3e-3, 2000.0, 1.5)]
BODIES = [4e-4, 6e-5]
RATIOS = {1: [124.0], 2: [4.0, 31.0], 3: [4.0, 5.0, 6.2]}
STEP = {"solver.method": "semi_implicit", "solver.step": 2e-6}
LAYOUTS = ["stages 1", "stages 2", "stages 3", "wolfrom"]
#: Compared with the oracle in every run of the tests.
QUICK = [("stages 2", 0.0), ("wolfrom", 4.0)]


def stages(layout: str) -> int:
    """Meshes of a layout."""
    return int(layout.split()[1]) if layout != "wolfrom" else 3


def settings(layout: str, meshes: list[Any] = MESHES) -> dict[str, Any]:
    """Parameters of a layout on the free shaft; only those that act."""
    count = stages(layout)
    model = layout.split(maxsplit=1)[0]
    chosen: dict[str, Any] = {"gear.model": model, "load.inertia": OUTPUT_INERTIA}
    if layout != "wolfrom":
        chosen["gear.stages"] = count
        chosen |= {f"gear.ratio_{k + 1}": RATIOS[count][k] for k in range(count - 1)}
    for k in range(min(count - 1, 2)):
        chosen[f"gear.inertia_{k + 1}"] = BODIES[k]
    for k in range(count):
        names = (f"gear.mesh_{what}_{k + 1}" for what in ("backlash", "stiffness", "damping"))
        chosen |= dict(zip(names, meshes[k], strict=True))
    return FREE_SHAFT | STEP | chosen


def weights(layout: str) -> np.ndarray:
    """Output's angle per displacement of each mesh, the motor held: what follows a mesh divides it.

    Of the planets by the wheels' geometry: three pitch points, three unknown angles.
    """
    if layout != "wolfrom":
        ratios = RATIOS[stages(layout)]
        return np.array([1.0 / np.prod(ratios[k + 1 :]) for k in range(len(ratios))])
    sun, planet, fixed, small, ring = TEETH
    centre = sun + planet
    points = [[-centre / sun, planet / sun, 0.0], [centre / fixed, planet / fixed, 0.0],
              [centre / ring, small / ring, -1.0]]  # fmt: skip
    return np.abs(np.linalg.inv(points)[2])


def rests(layout: str, loads: list[float], extra: dict[str, Any] | None = None) -> np.ndarray:
    """Where the output comes to rest under each load, the motor held."""
    scenarios = [{"load": {"output": {"terms": [constant(load)]}}} for load in loads]
    chosen = actuator(settings(layout) | LOCKED | {"solver.step": 1e-5} | (extra or {}))
    runs = [elevon.Run(chosen, make_scenario(duration=1.2, extra=one)) for one in scenarios]
    found = elevon.simulate_batch(runs, record=["output_position,motor_position@1 kHz"])
    assert all(rec["motor_position"].values[-1] == 0.0 for rec in found)
    return np.array([rec["output_position"].values[-1] for rec in found])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_lost_motion_and_wind_up_are_those_of_the_meshes_in_series(layout: str) -> None:
    """Output against load at rest: half the sum of the backlashes, each over what follows it, and
    the sum of the compliances over its square.
    """
    c = weights(layout)
    backlash, stiffness = (np.array([mesh[i] for mesh in MESHES[: len(c)]]) for i in (0, 1))
    at = rests(layout, [-6.0, -2.0, 2.0, 6.0])
    lost, compliance = float(c @ backlash), float(c**2 @ (1 / stiffness))
    assert at == pytest.approx(
        [lost / 2 + 6 * compliance, lost / 2 + 2 * compliance, -lost / 2 - 2 * compliance,
         -lost / 2 - 6 * compliance], rel=1e-6)  # fmt: skip


def moving(layout: str, step: float = 2e-6, load: float = 0.0, **options: Any) -> Any:
    """Run the free shaft under a torque that reverses."""
    shaft = [term("sine", amplitude=1.5, frequency=5.0, phase="90 deg")]
    loads = {"shaft": {"terms": shaft}, "output": {"terms": [constant(load)]}}
    return run(
        settings(layout) | {"solver.step": step},
        duration=0.3,
        record="motor_position,output_position@2 kHz",
        scenario={"load": loads},
        **options,
    )


def oracle(layout: str, times: np.ndarray, load: float) -> np.ndarray:
    """The same by the wheels' own equations: motor and output."""
    count = stages(layout)
    bodies = [INERTIA, *BODIES[: count - 1], OUTPUT_INERTIA]
    meshes = [Flanks(*mesh) for mesh in MESHES[:count]]
    gear = Gear(bodies, meshes, () if layout == "wolfrom" else RATIOS[count])
    shaft = 2 * np.pi * 5.0
    found = gear.run(times, lambda t: -1.5 * np.cos(shaft * t), lambda _: -load)
    return found[[0, -1]]


@pytest.mark.parametrize(
    ("layout", "load"),
    [
        pytest.param(layout, load, marks=[] if (layout, load) in QUICK else [pytest.mark.long])
        for layout in LAYOUTS
        for load in (0.0, 4.0)
    ],
)
def test_motion_is_the_oracles(layout: str, load: float) -> None:
    """Reversals through every backlash, free and under load, to a thousandth of the swing.

    The step leaves a quarter of that, which falls with the step (the next test).
    """
    rec = moving(layout, load=load)
    motor, output = values(rec, "motor_position", "output_position")
    expected = oracle(layout, rec["motor_position"].time, load)
    assert np.ptp(output) > 0.01
    assert motor == pytest.approx(expected[0], abs=1e-3 * np.ptp(motor))
    assert output == pytest.approx(expected[1], abs=1e-3 * np.ptp(output))


@pytest.mark.long
@pytest.mark.parametrize("layout", ["stages 2", "wolfrom"])
def test_the_error_falls_with_the_step(layout: str) -> None:
    """First order: a tenth of the step leaves about a tenth of the distance to the oracle."""
    errors = []
    for step in (1e-5, 1e-6):
        rec = moving(layout, step)
        expected = oracle(layout, rec["motor_position"].time, 0.0)
        errors.append(np.max(np.abs(rec["output_position"].values - expected[1])))
    assert 4.0 < errors[0] / errors[1] < 25.0


def test_one_stage_is_the_elastic_backlash() -> None:
    """The same two masses on the same contact, to rounding."""
    backlash, stiffness, damping = MESHES[0]
    elastic = {"backlash.model": "elastic", "backlash.total": backlash,
               "backlash.stiffness": stiffness, "backlash.damping": damping,
               "load.inertia": OUTPUT_INERTIA}  # fmt: skip
    one, two = (
        moving("stages 1", load=3.0),
        run(
            FREE_SHAFT | STEP | elastic,
            duration=0.3,
            record="motor_position,output_position@2 kHz",
            scenario={
                "load": {
                    "shaft": {
                        "terms": [term("sine", amplitude=1.5, frequency=5.0, phase="90 deg")]
                    },
                    "output": {"terms": [constant(3.0)]},
                }
            },
        ),
    )
    for name in ("motor_position", "output_position"):
        assert one[name].values == pytest.approx(two[name].values, rel=1e-7, abs=1e-10)


@pytest.mark.long
@pytest.mark.parametrize("layout", ["stages 3", "wolfrom"])
def test_stiff_meshes_without_backlash_are_the_rigid_gear(layout: str) -> None:
    """The bodies' inertias on the motor's shaft by the squares of their ratios; what is left is the
    wind-up of 1e6 N m/rad.
    """
    turns = {"stages 3": [1 / 4, 1 / 20], "wolfrom": [1 / 4, 1 / 4 * (1 - 63 / 21)]}[layout]
    reflected = sum(j * n * n for j, n in zip(BODIES, turns, strict=True))
    stiff = [(0.0, 1e6, 20.0)] * 3
    shaft = {"load": {"shaft": {"terms": [term("sine", amplitude=1.5, frequency=5.0)]}}}
    record = "motor_speed,output_position@2 kHz"
    small = {"solver.step": 5e-7}
    several = run(settings(layout, stiff) | small, duration=0.2, record=record, scenario=shaft)
    rigid = FREE_SHAFT | {
        "load.inertia": OUTPUT_INERTIA,
        "gear.inertia": INERTIA - 7.7e-4 + reflected,
        "solver.method": "semi_implicit",
    }
    one = run(rigid | small, duration=0.2, record=record, scenario=shaft)
    for name in ("motor_speed", "output_position"):
        scale = np.ptp(one[name].values)
        assert several[name].values == pytest.approx(one[name].values, abs=1e-5 * scale)


@pytest.mark.parametrize("layout", ["stages 3", "wolfrom"])
def test_energy_of_the_meshes_is_in_the_accounts(layout: str) -> None:
    """What torque and load give is kinetic, or in the meshes (impact: stored or lost there).

    Half an elastic energy stands apart: what the meshes store is read from their torques.
    """
    names = ("energy_load", "energy_impact", "energy_kinetic")
    meshes = [f"mesh_{k}_torque" for k in (1, 2, 3)]
    rec = run(
        settings(layout),
        duration=0.3,
        record=",".join((*names, *meshes)) + "@2 kHz",
        scenario={
            "load": {
                "shaft": {"terms": [term("sine", amplitude=1.5, frequency=5.0, phase="90 deg")]},
                "output": {"terms": [constant(4.0)]},
            }
        },
    )
    load, impact, kinetic = values(rec, *names)
    torques = values(rec, *meshes)
    size = np.ptp(kinetic)
    # The loads are the only source: their work is negative where they drive.
    assert np.max(np.abs(load + impact + kinetic)) < 1e-3 * size
    stored = sum(t**2 / (2 * mesh[1]) for t, mesh in zip(torques, MESHES, strict=True))
    lost = impact - stored
    assert lost[-1] > 1e-3 * size
    assert np.min(np.diff(lost[::50])) > -2e-2 * size


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_reduced_order_model_lumps_the_same_gear(layout: str) -> None:
    """The lumped gear of the same lost motion at the output, inertias on the motor's shaft."""
    c = weights(layout)
    lost = float(c @ [mesh[0] for mesh in MESHES[: len(c)]])
    turns = {"stages 1": [], "stages 2": [1 / 4], "stages 3": [1 / 4, 1 / 20],
             "wolfrom": [1 / 4, -1 / 2]}[layout]  # fmt: skip
    reflected = sum(j * n * n for j, n in zip(BODIES, turns, strict=False))
    several = {path: x for path, x in settings(layout).items() if acts_in_low(path)}
    lumped = FREE_SHAFT | {
        "load.inertia": OUTPUT_INERTIA,
        "backlash.total": lost,
        "gear.inertia": INERTIA - 7.7e-4 + reflected,
    }
    shaft = {"load": {"shaft": {"terms": [term("sine", amplitude=1.5, frequency=5.0)]}}}
    record = "motor_speed,output_position@2 kHz"
    pair = [
        run(x, duration=0.2, record=record, scenario=shaft, fidelity="low")
        for x in (several, lumped)
    ]
    for name in ("motor_speed", "output_position"):
        assert pair[0][name].values == pytest.approx(pair[1][name].values, rel=1e-9, abs=1e-12)


def test_at_power_up_every_mesh_stands_amid_its_backlash() -> None:
    """No torque in any mesh, wherever the motor stands; two positions that disagree are refused."""
    names = [f"mesh_{k}_torque" for k in (1, 2, 3)]
    record = ",".join([*names, "gear_body_1_position", "gear_body_2_position"]) + "@2 kHz"
    free = run(settings("wolfrom"), duration=0.01, record=record,
               scenario={"initial": {"motor_position": 3.0}})  # fmt: skip
    assert all(np.all(torque == 0.0) for torque in values(free, *names))
    assert free["gear_body_1_position"].values[-1] == pytest.approx(3.0 / 4)
    assert free["gear_body_2_position"].values[-1] == pytest.approx(-3.0 / 2)
    with pytest.raises(elevon.InputError, match="leave one of them out"):
        run(settings("wolfrom"), duration=0.01, record=record,
            scenario={"initial": {"motor_position": 3.0, "output_position": 0.0}})  # fmt: skip


@pytest.mark.parametrize("layout", ["stages 2", "wolfrom"])
def test_backlash_and_worn_teeth_widen_the_mesh_at_the_output(layout: str) -> None:
    """The fault's backlash is lost motion whole; worn teeth at their widest too."""
    healthy = rests(layout, [-2.0, 2.0])
    wider = rests(layout, [-2.0, 2.0], {"backlash.extra": 0.004})
    worn = rests(layout, [-2.0, 2.0], {"gear.tooth_chip": 0.004})
    gap = healthy[0] - healthy[1]
    assert wider[0] - wider[1] == pytest.approx(gap + 0.004, rel=1e-6)
    assert worn[0] - worn[1] == pytest.approx(gap + 0.004, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"gear.sun_teeth": 22}, "gear.ratio"),
        ({"load.inertia": 0.0}, "load.inertia"),
        ({"solver.step": 1e-3}, "solver.step"),
    ],
)
def test_a_gear_that_cannot_be_is_refused(change: dict[str, Any], place: str) -> None:
    """Teeth of another ratio, no mass at the output, a step too large for the meshes."""
    found = actuator(settings("wolfrom") | change).findings()
    assert place in [finding["path"] for finding in found if finding["severity"] == "error"]


FAULTS = {
    ("friction", "transmission"): 0.5, ("lubrication", "transmission"): 1.0,
    ("backlash", "transmission"): 0.01, ("jam", "transmission"): 0.5,
    ("tooth_wear", "gear"): 0.005, ("chipped_tooth", "gear"): 0.005,
    ("bearing", "bearing.outer"): 2e-3,
}  # fmt: skip


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_every_fault_of_the_transmission_moves_the_planets_output(fidelity: str) -> None:
    """Against the healthy run of the same motion, under a load that reverses."""
    chosen = elevon.Actuator.load("torino-rotary").with_values({"gear.model": "wolfrom"})
    motion = {"load": {"output": {"terms": [term("sine", amplitude=2.0, frequency=8.0)]}}}
    command = [term("sine", amplitude="2 deg", frequency="5 Hz")]
    faults = [{"kind": k, "place": p, "severity": x} for (k, p), x in FAULTS.items()]
    runs = [
        elevon.Run(
            chosen,
            make_scenario(duration=0.2, command=command, extra={**motion, "fault": some}),
        )
        for some in ([], *([fault] for fault in faults))
    ]
    healthy, *faulty = elevon.simulate_batch(
        runs, fidelity=fidelity, record="output_position@2 kHz"
    )
    reference = healthy["output_position"].values
    moved = [float(np.max(np.abs(x["output_position"].values - reference))) for x in faulty]
    assert [fault for fault, far in zip(FAULTS, moved, strict=True) if far < 1e-6] == []


def test_sensitivities_of_the_reduced_order_model_are_those_of_differences() -> None:
    """By the planets' inertia and by the backlash of a mesh."""
    scenario = make_scenario(duration=0.2, extra={"load": {"shaft": {"terms": [constant(-1.0)]}}})
    record = "motor_speed,output_position@1 kHz"
    paths = ["gear.inertia_2", "gear.mesh_backlash_2"]
    chosen = {path: x for path, x in settings("wolfrom").items() if acts_in_low(path)}
    found = sensitivities(actuator(chosen), scenario, paths, record=record).derivatives
    for path in paths:
        ends = []
        for factor in (1 - 1e-5, 1 + 1e-5):
            changed = actuator(chosen | {path: chosen[path] * factor})
            rec = elevon.simulate(changed, scenario, fidelity="low", record=[record])
            ends.append(rec["output_position"].values)
        difference = (ends[1] - ends[0]) / (2e-5 * chosen[path])
        assert np.max(np.abs(difference)) > 0.0
        exact = found[path]["output_position"]
        assert exact == pytest.approx(difference, abs=1e-3 * np.max(np.abs(difference)))


def acts_in_low(path: str) -> bool:
    """Does the reduced-order model carry it?"""
    return path not in STEP and not path.startswith(("gear.mesh_stiffness", "gear.mesh_damping"))
