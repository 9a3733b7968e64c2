"""Units, their spread and growth; splits that never divide what belongs together."""

import numpy as np
import pytest

import elevon
from elevon.campaign import load_plan, resolve_plan
from elevon.campaign.resolved import dealt, leaks
from elevon.errors import InputError

POPULATION = """
[population]
units = 30
points = 5
seed = 7
[[population.spread]]
parameter = "friction.dynamic"
sd = "5 %"
[[population.spread]]
parameter = "motor.winding_temperature"
distribution = "uniform"
from = "20 degC"
to = "40 degC"
[[population.growth]]
fault = "backlash@transmission"
from = "0.01 deg"
to = "0.5 deg"
law = "power"
exponent = 2
onset = [0.1, 0.5]
spread = 0.2
"""
SPLIT = "[split]\ntrain = 0.6\nvalid = 0.2\ntest = 0.2\n"


def resolved_of(plan, tail, **options):
    return resolve_plan(*load_plan(plan(0, tail=tail, **options)))


def test_each_unit_has_its_own_values_for_life(plan):
    resolved = resolved_of(plan, POPULATION)
    assert len(resolved) == 150
    values = {c.name: c.values.reshape(30, 5) for c in resolved.columns}
    assert (resolved.index.unit.reshape(30, 5) == np.arange(30)[:, None]).all()
    assert (resolved.index.age.reshape(30, 5) == np.linspace(0.0, 1.0, 5)).all()
    friction = values["friction.dynamic"]
    nominal = resolved.actuator.parameters.value("friction.dynamic")
    assert (friction == friction[:, :1]).all()
    assert len(set(friction[:, 0])) == 30
    assert np.abs(friction / nominal - 1.0).max() <= 0.15
    assert 0.03 < np.std(friction[:, 0] / nominal) < 0.07
    temperature = values["motor.winding_temperature"]
    assert 293.15 <= temperature.min() < temperature.max() <= 313.15


def test_faults_grow_over_a_units_life(plan):
    resolved = resolved_of(plan, POPULATION)
    backlash = np.degrees(resolved.columns[2].values.reshape(30, 5))
    assert backlash[:, 0] == pytest.approx(0.01)
    assert (np.diff(backlash, axis=1) >= 0.0).all()
    assert 0.4 < np.median(backlash[:, -1]) < 0.6
    assert np.std(np.log(backlash[:, -1] - 0.01)) == pytest.approx(0.2, rel=0.4)
    # Before the onset nothing grows: at a quarter of life some have begun and some have not.
    begun = backlash[:, 1] > 0.01 + 1e-9
    assert 0 < begun.sum() < 30


@pytest.mark.parametrize("law", ["linear", "power", "exponential"])
def test_laws_of_growth_end_where_they_should(plan, law):
    text = POPULATION.replace('law = "power"', f'law = "{law}"').replace("spread = 0.2", "")
    text = text.replace("onset = [0.1, 0.5]", "")
    backlash = np.degrees(resolved_of(plan, text).columns[2].values.reshape(30, 5))
    assert backlash[0, [0, -1]] == pytest.approx([0.01, 0.5])
    half = {"linear": 0.5, "power": 0.25, "exponential": np.expm1(1.0) / np.expm1(2.0)}[law]
    assert backlash[0, 2] == pytest.approx(0.01 + 0.49 * half)


def test_another_quantity_leaves_the_units_as_they_are(plan):
    more = POPULATION + '[[population.spread]]\nparameter = "motor.inertia"\nsd = "1 %"\n'
    first, second = resolved_of(plan, POPULATION), resolved_of(plan, more)
    assert first.columns[0].values.tobytes() == second.columns[0].values.tobytes()


DRAWS = """
[random]
count = 3
[[random.draw]]
scenario = "command.terms[0].amplitude"
from = "4 deg"
to = "8 deg"
"""


def test_draws_are_made_anew_for_every_unit_and_age(plan):
    resolved = resolved_of(plan, POPULATION + DRAWS)
    assert len(resolved) == 450
    assert len(set(resolved.columns[3].values)) == 450
    assert len(set(resolved.index.draw)) == 450


def test_a_split_never_divides_a_unit(plan, cli, tmp_path):
    path = plan(0, tail=POPULATION.replace("points = 5", "points = 2") + SPLIT)
    assert cli("campaign", "run", path, "--out", tmp_path / "out")[0] == 0
    runs = elevon.load_campaign(tmp_path / "out").runs.to_pandas()
    assert runs.groupby("unit").split.nunique().max() == 1
    assert runs.groupby("split").unit.nunique().to_dict() == {"train": 18, "valid": 6, "test": 6}
    assert not leaks(runs.unit, runs.split)
    runs.loc[0, "split"] = "test" if runs.split[0] != "test" else "train"
    assert leaks(runs.unit, runs.split) == [0]


def test_a_split_by_draw_never_divides_a_draw(plan):
    axis = '[[vary]]\nparameter = "friction.dynamic"\nvalues = [0.2, 0.3]\n'
    resolved = resolved_of(plan, axis + DRAWS.replace("count = 3", "count = 10") + SPLIT)
    assert len(resolved) == 20
    assert not leaks(resolved.index.draw, resolved.index.split)
    assert list(resolved.index.split).count("train") == 12


def test_dealing_repeats_and_depends_on_its_seed():
    groups = np.repeat(np.arange(20), 3)
    shares = {"train": 0.5, "test": 0.5}
    first = dealt(groups, shares, 0, "split", "unit")
    assert (first == dealt(groups, shares, 0, "split", "unit")).all()
    assert (first != dealt(groups, shares, 1, "split", "unit")).any()


BAD = {
    "run": (SPLIT, 'split_by = "run"', "would leak"),
    "draw of units": (POPULATION + SPLIT, 'split_by = "draw"', "would leak"),
    "no units": (SPLIT, 'split_by = "unit"', "no 'population'"),
    "few units": (
        POPULATION.replace("units = 30", "units = 2") + SPLIT, "", "of 2 unit\\(s\\) is none"
    ),
    "no units at all": (POPULATION.replace("units = 30", "units = 0"), "", "greater than or equal"),
    "ages": (POPULATION.replace("points = 5", "ages = [0, 1.5]"), "", "not all from 0 to 1"),
    "falling": (POPULATION.replace("points = 5", "ages = [0.5, 0.5]"), "", "do not rise"),
    "sd": (POPULATION.replace('"5 %"', '"-5 %"'), "", "must be positive"),
    "no sd": (POPULATION.replace('sd = "5 %"', ""), "", "needs 'sd'"),
    "choice": (
        POPULATION.replace('"friction.dynamic"', '"control.mode"'), "", "is a choice"
    ),
    "unknown": (POPULATION.replace("backlash@", "baklash@"), "", "did you mean 'backlash'"),
    "onset": (POPULATION.replace("[0.1, 0.5]", "[0.5, 0.1]"), "", "not two ages"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_populations_that_cannot_be_name_the_place(plan, name):
    tail, head, message = BAD[name]
    with pytest.raises(InputError, match=message) as raised:
        resolved_of(plan, tail, head=head)
    assert "plan.toml" in str(raised.value)


def test_a_bound_beyond_floats_is_refused():
    from elevon.campaign.draw import _number_and_unit

    with pytest.raises(InputError, match=r"random.draw\[0\]: a whole number of 1329 bits is too"):
        _number_and_unit(10**400, "random.draw[0]")
