"""The filter against the exact one, and what inspections may be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from elevon.errors import InputError
from elevon.prognose import GrowthFilter, Inspection, Seen, inspection
from elevon.prognose.fault_filter import COMMON as COMMON_ERROR
from elevon.prognose.fault_filter import RATE
from elevon.prognose.future import HORIZON, look_ahead
from elevon.prognose.manner import LAW_ALONE, WITHOUT_LAW, draw_manner
from elevon.prognose.mission import Usage
from elevon.prognose.observation import COMMON
from elevon.prognose.predict import check_order
from elevon.prognose.process import ONSET
from tests.prognose.units import law, process

KEY = "backlash@transmission"


def seen(usage, value, deviation, **fields):
    return Inspection(usage, {KEY: Seen(value, deviation, deviation)}, **fields)


def exact(observed, deviation, rate, prior):
    """Posterior of the growth factor where damage = factor rate usage, on a grid.

    How far the diagnoses scatter is known; the filter weighs four scales of it.
    """
    factor = np.exp(np.linspace(-4.0, 4.0, 8001) * prior)
    misfit = sum(((value - factor * rate * usage) / deviation) ** 2 for usage, value in observed)
    score = -0.5 * np.linspace(-4.0, 4.0, 8001) ** 2 - 0.5 * misfit
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    mean = weight @ np.log(factor)
    return mean, np.sqrt(weight @ (np.log(factor) - mean) ** 2)


def pace(flt, k=0):
    """Logarithm of the growth over the law's, of units that may be the one."""
    return np.log(flt.process.factors(flt.units)[:, k])


def test_the_bank_agrees_with_the_exact_posterior():
    """But for the rate's own wander, which widens it."""
    prior, rate, deviation, rng = 0.8, 1e-3, 0.05, np.random.default_rng(1)
    observed = [
        (u, 1.2 * rate * u + deviation * rng.standard_normal()) for u in range(100, 600, 83)
    ]
    mean, spread = exact(observed, deviation, rate, prior)
    flt = GrowthFilter(process(law(rate, spread=prior), limits=(5.0,)), seed=2)
    for usage, value in observed:
        flt.update(seen(usage, value, deviation))
    low, middle, high = np.quantile(pace(flt), (0.16, 0.5, 0.84))
    assert middle == pytest.approx(mean, abs=1.5 * spread)
    assert 0.7 * spread < 0.5 * (high - low) < 2.5 * spread


def test_several_faults_grow_together_and_each_is_seen_by_its_own_inspections():
    unit = process(law(1e-3, "backlash"), law(1e-3, "friction"), limits=(9.0, 9.0))
    flt = GrowthFilter(unit, seed=1)
    for usage in (100.0, 250.0, 300.0, 700.0):
        flt.update(
            Inspection(usage, {
                KEY: Seen(2e-3 * usage, 0.02, 0.02),
                "friction@transmission": Seen(5e-4 * usage, 0.02, 0.02),
            })
        )  # fmt: skip
    factor = np.median(flt.process.factors(flt.units), axis=0)
    assert factor == pytest.approx([2.0, 0.5], rel=0.08)


def test_a_fault_not_seen_bounds_its_growth():
    unit = process(law(1e-3))
    flt = GrowthFilter(unit, seed=1)
    before = flt.units.growth.mean()
    flt.update(Inspection(300.0, {KEY: Seen(None, 0.05, 0.05)}))
    assert flt.units.growth[:, 0].mean() < before - 0.5
    manner = draw_manner(
        400, np.zeros(1, dtype=bool), np.ones(1), (LAW_ALONE, WITHOUT_LAW), np.random.default_rng(0)
    )
    normal = np.linspace(-4.0, 4.0, 2001)
    grown = 300.0 * 1e-3 * np.exp(0.8 * normal)
    below = np.array([
        [0.5 * math.erfc((x - 0.15) / (0.15 * b) / math.sqrt(2.0)) for x in grown]
        for b in np.linspace(0.1, 0.5, 9)
    ]).mean(axis=0)  # fmt: skip
    missed = float(manner.missed.mean())
    mass = np.cumsum(np.exp(-0.5 * normal**2) * (missed + (1.0 - missed) * below))
    for share in (0.5, 0.8):
        expected = grown[np.searchsorted(mass, share * mass[-1])]
        assert np.quantile(flt.units.damage, share) == pytest.approx(expected, rel=0.1)  # drift


def test_how_widely_diagnoses_scatter_is_learned_from_them():
    """Intervals stated four times too wide: growth is known as well as the scatter allows."""
    rng, rate, true = np.random.default_rng(3), 1e-3, 0.01
    observed = [(u, rate * u + true * rng.standard_normal()) for u in np.linspace(100.0, 900.0, 25)]
    flt = GrowthFilter(process(law(rate)), seed=1)
    for usage, value in observed:
        flt.update(seen(usage, value, 4.0 * true))
    fault = flt.faults[0]
    assert fault.weight[fault.manner.scatter < 0.5].sum() > 0.9
    assert np.median(pace(flt)) == pytest.approx(0.0, abs=0.06)


def test_what_all_diagnoses_err_by_alike_is_learned_from_where_growth_began():
    """A new unit has no fault: what its diagnoses show beyond the growth is their common error."""
    rate, off, scatter = 1e-3, 0.06, 0.002
    rng = np.random.default_rng(5)
    flt = GrowthFilter(process(law(rate)), seed=1)
    deaf = GrowthFilter(process(law(rate)), seed=1)
    for usage in np.linspace(50.0, 400.0, 15):
        value = rate * usage + off + scatter * rng.standard_normal()
        flt.update(Inspection(usage, {KEY: Seen(value, scatter, scatter, 0.05)}))
        deaf.update(seen(usage, value, scatter))
    fault = flt.faults[0]
    common = float(fault.weight @ fault.mean[:, COMMON_ERROR] / fault.weight.sum())
    assert 0.05 * common == pytest.approx(off, abs=0.008)
    assert np.median(flt.units.damage) == pytest.approx(0.4, abs=0.01)
    assert np.median(deaf.units.damage) > 0.43


def test_a_coefficient_that_differs_from_unit_to_unit_is_learned():
    """Its spread does what the law's own spread does; a new part has a value of its own."""
    rate, rng = 1e-3, np.random.default_rng(4)
    observed = [(u, 1.5 * rate * u + 0.02 * rng.standard_normal()) for u in range(100, 900, 90)]
    flt = GrowthFilter(process(law(rate, spread=0.05, rate_spread=0.4)), seed=1)
    for usage, value in observed:
        flt.update(seen(usage, value, 0.02))
    assert np.median(pace(flt)) == pytest.approx(np.log(1.5), abs=0.1)
    known = pace(flt).std()
    flt.update(Inspection(1000.0, {}, reset=(KEY,)))
    assert pace(flt).std() > 2.0 * known


def test_a_fault_that_units_begin_with_is_given_up_where_no_inspection_sees_it():
    unit = process(law(1e-3, start=0.5, start_spread=0.02, dormant=0.3), limits=(2.0,))
    flt = GrowthFilter(unit, seed=1)
    there = flt.units.active[:, 0]
    assert there.mean() == pytest.approx(0.7, abs=0.03)
    for usage in (10.0, 20.0, 30.0):
        flt.update(Inspection(usage, {KEY: Seen(None, 0.1, 0.1)}))
    assert np.median(flt.units.damage) == 0.0
    assert (flt.units.damage > 0.3).mean() < 0.03
    future = look_ahead(unit, replace(flt.units, usage=1.0), Usage(), np.random.default_rng(0))
    absent = ~flt.units.active[:, 0]
    began = absent & np.isfinite(future.end)
    # By an e-fold of use with a rate of `ONSET`, up to the horizon.
    share = -np.expm1(-ONSET * np.log(HORIZON))
    assert began.sum() / absent.sum() == pytest.approx(share, abs=0.04)
    assert future.remaining[began].min() > 100.0  # it begins at 0.5, and has 1.5 to go


@pytest.mark.parametrize(("b", "ahead"), [(0.6, 1.5), (1.0, 1.0), (2.0, 0.6)])
def test_growth_in_either_direction_is_followed(b, ahead):
    """s = (u/1000)^b; a law of even growth, alone, would see an end at `ahead` of the true one."""
    flt = GrowthFilter(process(law(1e-3, only=False), wander=True), seed=1)
    rng = np.random.default_rng(6)
    for usage in np.linspace(30.0, 700.0, 24):
        flt.update(seen(usage, (usage / 1000.0) ** b + 0.01 * rng.standard_normal(), 0.01))
    future = look_ahead(flt.process, flt.units, Usage(), np.random.default_rng(0))
    low, middle, high = np.quantile(future.remaining, (0.05, 0.5, 0.95))
    assert low < 300.0 < high
    assert middle == pytest.approx(300.0, rel=0.3)


def test_each_fault_is_known_by_its_own_diagnoses():
    flt = GrowthFilter(process(law(1e-3), law(1e-3, "friction"), limits=(1.0, 1.0)), seed=1)
    friction = flt.faults[1]
    before = friction.weight @ friction.mean[:, RATE]
    for usage in (100.0, 200.0, 300.0):
        flt.update(seen(usage, 1e-3 * usage, 0.002))
    # Chance that weighs rare changes of the rate aside, nothing is learnt of it.
    assert friction.weight @ friction.mean[:, RATE] == pytest.approx(before, abs=0.05)
    assert friction.weight.max() < 3.0 / len(friction.weight)


def test_maintenance_makes_the_part_new_and_its_growth_unknown():
    unit = process(law(1e-3), limits=(1.0,))
    flt = GrowthFilter(unit, seed=1)
    for usage in (100.0, 200.0, 400.0):
        flt.update(seen(usage, 1e-3 * usage, 0.01))
    known = flt.units.growth.std()
    flt.update(seen(500.0, 0.5, 0.01, reset=(KEY,)))
    assert flt.units.damage.max() < 1e-3
    assert flt.units.growth.std() > 2.0 * known
    rng = np.random.default_rng(0)
    future = look_ahead(unit, flt.units, Usage(), rng)
    assert np.median(future.remaining) == pytest.approx(1000.0, rel=0.15)


def test_a_diagnosis_far_off_is_an_outlier_and_is_noted():
    unit = process(law(1e-3, spread=0.3))
    flt = GrowthFilter(unit, seed=1)
    for usage in (100.0, 200.0, 300.0):
        flt.update(seen(usage, 1e-3 * usage, 0.01))
    assert flt.surprises == []
    flt.update(seen(400.0, 0.9, 0.01))
    assert [item[:2] for item in flt.surprises] == [(400.0, KEY)]
    assert np.median(flt.process.factors(flt.units)) == pytest.approx(1.0, rel=0.1)


def test_a_diagnosis_becomes_an_inspection():
    item = law()
    cause = {"kind": "backlash", "place": "gear", "probability": 0.9, "severity": 0.015,
             "interval": [0.01, 0.0175],
             "ambiguous_with": [{"kind": "backlash", "place": "transmission"}]}  # fmt: skip
    data = {"faults": [cause], "detectable": {KEY: 0.003}}
    got = inspection(data, [item], usage=5.0).seen[KEY]
    assert (got.severity, got.low, got.high) == pytest.approx((0.015, 0.00304, 0.00152), rel=1e-3)
    edge = {
        "faults": [
            {
                **cause,
                "kind": "friction",
                "place": "transmission",
                "severity": 1.98,
                "interval": [1.9, 2.0],
            }
        ]
    }
    more = inspection(edge, [law(kind="friction", highest=6.0)], usage=5.0)
    assert more.seen["friction@transmission"].high > 2.0  # diagnosis looks up to 2
    unlikely = {"faults": [{**cause, "probability": 0.3}], "detectable": {KEY: 0.003}}
    guess = inspection(unlikely, [item], usage=5.0).seen[KEY]
    assert (guess.severity, guess.probability, guess.detectable) == (0.015, 0.3, 0.003)
    assert got.common == pytest.approx(COMMON["backlash"][0] * 0.015)
    relative, absolute = COMMON["friction"]
    assert more.seen["friction@transmission"].common == pytest.approx(
        math.hypot(relative * 1.98, absolute)
    )
    assert inspection({"faults": []}, [item], usage=5.0).seen == {}
    with pytest.raises(InputError, match="not within"):
        inspection({"faults": [{**cause, "interval": [0.016, 0.02]}]}, [item], usage=5.0)


def test_use_and_dates_go_forward():
    check_order([Inspection(1.0, {}), Inspection(1.0, {}), Inspection(4.0, {})])
    with pytest.raises(InputError, match=r"use falls from 4 \(b\) to 1"):
        check_order([Inspection(4.0, {}, name="b"), Inspection(1.0, {}, name="c")])
    with pytest.raises(InputError, match="is dated before"):
        check_order(
            [Inspection(1.0, {}, date="2026-02-01"), Inspection(4.0, {}, date="2026-01-01")]
        )
    with pytest.raises(InputError, match="goes back"):
        unit = process(law())
        flt = GrowthFilter(unit)
        flt.update(seen(5.0, 0.0, 1.0))
        flt.update(seen(4.0, 0.0, 1.0))
