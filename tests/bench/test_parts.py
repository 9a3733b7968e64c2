"""Springs, micrometer, converter: the published numbers, and what is refused."""

import math

import numpy as np
import pytest

from elevon.bench import procedure
from elevon.bench.rig import Hx711
from elevon.bench.spring import STANDARD_WIRES, SpringTask, design_spring, search_springs
from elevon.errors import InputError


def test_the_chosen_spring():
    spring = design_spring()
    assert spring.coils == 342
    assert spring.free_length == pytest.approx(1.026)
    assert 1e-3 * spring.stiffness == pytest.approx(0.0614, abs=5e-5)
    assert 1e3 * spring.task.largest_coil(3e-3) == pytest.approx(64.7, abs=0.05)
    assert spring.task.cable_force == pytest.approx(75.0)
    assert spring.torsional_stiffness == pytest.approx(0.786, abs=5e-4)
    assert spring.rotation == pytest.approx(16.25)
    assert spring.feasible
    assert spring.radial_force(0.01) == pytest.approx(0.01 * spring.stiffness)
    # At full rotation both springs together give the design force on the guide.
    assert spring.torsional_stiffness * spring.rotation == pytest.approx(80 * 0.16, rel=0.003)


def test_stress_at_the_largest_coil_is_the_limit():
    task = SpringTask()
    for wire in STANDARD_WIRES:
        spring = design_spring(task, wire=wire, coil=task.largest_coil(wire))
        assert spring.stress == pytest.approx(task.allowed_stress, rel=1e-12)
        assert spring.safety == pytest.approx(task.safety, rel=1e-12)
        assert spring.curved_stress > spring.stress * 0.9


def test_search_is_feasible_and_sorted():
    found = search_springs()
    assert any(s.wire == 3e-3 and abs(s.coil - 34e-3) < 1e-9 for s in found)
    volumes = [s.wire_volume for s in found]
    assert volumes == sorted(volumes)
    for s in found:
        assert s.feasible
        assert s.free_length <= 1.1
        assert s.stiffness <= s.task.stiffness * (1 + 1e-9)
        assert s.stiffness * s.coils >= s.task.stiffness * (s.coils - 1) * (1 - 1e-9)
    assert search_springs(SpringTask(safety=50.0)) == []


def test_spring_refusals():
    with pytest.raises(InputError, match="75 N"):
        SpringTask(force=70.0)
    with pytest.raises(InputError, match="safety"):
        SpringTask(safety=0.0)
    with pytest.raises(InputError, match="larger"):
        design_spring(wire=5e-3, coil=4e-3)
    with pytest.raises(InputError, match="longest"):
        search_springs(longest=math.nan)


def test_micrometer_reproduces_the_printed_columns(shared):
    table = np.genfromtxt(
        shared / "reference" / "tables" / "torino_backlash.csv", delimiter=",", skip_header=2
    )
    for _, d, mw, _, calculated, _, measured, _ in table:
        assert procedure.centre_distance(d) == pytest.approx(mw, abs=0.015)
        assert procedure.geometric_backlash(d) == pytest.approx(calculated, abs=1.5e-4)
        assert procedure.measured_backlash(d) == pytest.approx(measured, abs=1e-12)


def test_micrometer_inverts():
    for curve in ("geometric", "measured"):
        for reading in np.linspace(9.0, 14.0, 21):
            backlash = procedure.total_backlash(reading, curve)
            assert procedure.micrometer_for(backlash, curve) == pytest.approx(reading, abs=1e-9)
    assert procedure.total_backlash(14.0) == procedure.INTRINSIC_BACKLASH
    for bad in (8.9, 14.1, math.nan):
        with pytest.raises(InputError):
            procedure.centre_distance(bad)
    with pytest.raises(InputError, match="slide sets"):
        procedure.micrometer_for(0.2)
    with pytest.raises(InputError, match="geometric"):
        procedure.total_backlash(14.0, "guess")


def test_converter_counts_and_clips():
    cell = Hx711(full_scale=100.0)
    force = cell.convert([0.0, 50.0, 1e6, -1e6])
    np.testing.assert_allclose(force[:2], [0.0, 50.0], atol=cell.step)
    assert force[2] == pytest.approx(100.0, abs=2 * cell.step)
    assert force[3] == -100.0
