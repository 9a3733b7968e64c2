"""Laws, growth and ends of life against closed forms."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from elevon.errors import RangeError, UnknownNameError
from elevon.prognose import LAWS
from elevon.prognose.future import look_ahead, run_to_failure
from elevon.prognose.law import DRIVERS
from elevon.prognose.mission import Usage
from elevon.prognose.response import Grid
from tests.prognose.units import end, law, process

USE = {
    "hours": 1.5, "friction_work": 1e4, "shaft_travel": 2e4, "torque_cubic_mean": 1.2,
    "winding_temperature": 400.0, "surface_temperature": 350.0,
}  # fmt: skip


def drivers(count, **changes):
    return {name: np.full(count, {**USE, **changes}[name]) for name in DRIVERS}


@pytest.mark.parametrize("name", LAWS)
def test_a_law_grows_and_its_map_goes_both_ways(name):
    item = LAWS[name]
    damage = item.damage(np.linspace(0.0, 1.0, 7)[1:] * item.highest)
    growth = item.growth(damage, drivers(len(damage)))
    assert (growth > 0.0).all()
    assert np.isfinite(growth).all()
    assert (np.diff(damage) > 0.0).all()
    np.testing.assert_allclose(item.damage(item.severity(damage)), damage, rtol=1e-12)
    for coefficient in item.coefficients.values():
        assert coefficient.source
        assert coefficient.value > 0.0


def test_wear_is_in_proportion_to_friction_work():
    zero = np.zeros(1)
    one, two = (LAWS["gear_wear"].growth(zero, drivers(1, friction_work=w)) for w in (1e4, 2e4))
    assert two == pytest.approx(2.0 * one)
    assert one == pytest.approx(1e4 * 2e-10)


def test_insulation_halves_its_life_for_ten_kelvin_and_then_shorts():
    item = LAWS["insulation"]
    cool, hot = (
        item.growth(np.zeros(1), drivers(1, winding_temperature=t)) for t in (423.15, 433.15)
    )
    assert hot / cool == pytest.approx(2.0, rel=0.03)
    at_index = item.growth(np.zeros(1), drivers(1, winding_temperature=428.15, hours=20000.0))
    assert at_index == pytest.approx(1.0)
    assert item.severity(np.array([0.99]))[0] == 0.0
    assert item.severity(np.array([1.0, 2.0])) == pytest.approx([0.01, 0.01 * np.e])
    slow, fast = item.growth(item.damage(np.array([0.02, 0.4])), drivers(2))
    assert fast > slow  # its own heat


def test_grease_ages_by_fifteen_kelvin_and_only_when_warm():
    item = LAWS["lubricant_loss"]
    cold, warm, hot = (
        item.growth(np.zeros(1), drivers(1, surface_temperature=t))[0]
        for t in (300.0, 343.15, 358.15)
    )
    assert cold == warm
    assert hot == pytest.approx(2.0 * warm)


def test_an_unknown_coefficient_and_a_bad_law_are_refused():
    with pytest.raises(UnknownNameError, match="wear"):
        LAWS["gear_wear"].with_values({"weer": 1.0})
    with pytest.raises(UnknownNameError, match="driver"):
        law(kind="backlash").__class__(**{**vars(LAWS["spall"]), "drivers": ("shaft_way",)})
    with pytest.raises(RangeError, match="grain"):
        law(grain=-1.0)


@pytest.mark.parametrize("power", [0.0, 1.0])
def test_the_end_of_life_is_that_of_the_closed_form(power):
    unit = process(law(1e-3, power=power), limits=(2.0,))
    rng = np.random.default_rng(0)
    units = unit.start(10, rng)
    units = replace(units, growth=0.0 * units.growth)
    future = look_ahead(unit, units, Usage(), rng)
    np.testing.assert_allclose(future.end, end(1e-3, 2.0, power), rtol=1e-4)
    life = run_to_failure(unit, units.picked(np.array([0])), rng)
    assert life.end == pytest.approx(end(1e-3, 2.0, power), rel=1e-4)
    assert life.at(life.end) == pytest.approx([2.0], rel=1e-4)


def test_growth_is_a_gamma_process_whatever_the_steps():
    unit = process(law(1e-3, grain=0.02, spread=0.0))
    ends = []
    for steps in (1, 20):
        rng = np.random.default_rng(steps)
        units = unit.start(40_000, rng)
        for _ in range(steps):
            units = unit.advance(units, 500.0 / steps, rng)
        ends.append(units.damage[:, 0])
    for damage in ends:
        assert damage.mean() == pytest.approx(0.5, rel=0.005)
        assert damage.var() == pytest.approx(0.5 * 0.02, rel=0.04)
        assert damage.min() >= 0.0


def test_ends_do_not_depend_on_whether_their_course_is_kept():
    unit = process(law(1e-3, spread=0.5, grain=0.01), limits=(1.0,))
    units = unit.start(50, np.random.default_rng(0))
    kept, ends = (
        look_ahead(unit, units, Usage(), np.random.default_rng(1), course=course)
        for course in (True, False)
    )
    np.testing.assert_array_equal(kept.end, ends.end)
    assert len(kept.course) > 10
    np.testing.assert_array_equal(ends.course, kept.course[:1])


def test_the_first_of_two_requirements_is_named_with_its_share():
    unit = process(law(1e-3, "backlash"), law(1e-3, "friction"), limits=(1.0, 1.5))
    rng = np.random.default_rng(3)
    future = look_ahead(unit, unit.start(2000, rng), Usage(), rng)
    # The factors are lognormal and independent: friction first where its is 1.5 times backlash's.
    from scipy.stats import norm

    expected = norm.sf(np.log(1.5) / (0.8 * np.sqrt(2.0)))
    assert np.mean(future.first == 1) == pytest.approx(expected, abs=0.035)


def test_interpolation_is_exact_for_what_is_linear_in_each_axis():
    rng = np.random.default_rng(4)
    grid = Grid((np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0]), np.array([-1.0, 0.5, 4.0])))
    c = rng.standard_normal(8)

    def f(x, y, z):
        return c @ [1 + 0 * x, x, y, z, x * y, y * z, x * z, x * y * z]

    table = np.array([[f(*p), 1.0] for p in itertools.product(*grid.axes)])
    at = [rng.uniform(a[0], a[-1], 50) for a in grid.axes]
    values = grid.interpolate(table, at)
    np.testing.assert_allclose(values[0], [f(*p) for p in zip(*at, strict=True)], rtol=1e-12)
    outside = grid.interpolate(table, [np.array([9.0]), np.array([-1.0]), np.array([0.0])])
    assert outside[0, 0] == pytest.approx(f(3.0, 0.0, 0.0))
