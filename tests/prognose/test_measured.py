"""A requirement's own value, measured: what it teaches the filter, and bad input."""

import json

import numpy as np
import pytest

from elevon.errors import FormatError, InputError
from elevon.prognose import LAWS, GrowthFilter, Inspection, Process, ResponseTables, Seen
from elevon.prognose.future import LASTING, MODEL_ERROR, look_ahead
from elevon.prognose.history import read_history
from elevon.prognose.mission import Usage
from elevon.prognose.observation import Measured, governing, read_measured
from elevon.prognose.requirement import Requirement
from elevon.prognose.response import Grid
from tests.prognose.units import law

KEY, UNITS = "backlash@transmission", {"current": "A", "error": "rad"}
RATE = 1e-3


def process(*laws):
    """The current is 1 A + the first law's severity + a tenth of the second's; life ends at 2 A."""
    grid = Grid(tuple(np.array([0.0, 4.0]) for _ in laws))
    points = np.array(list(grid.points()))
    current = 1.0 + points @ np.array([1.0, 0.1][: len(laws)])
    bare = Requirement(name="bare", measure="severity", fault=laws[0].key, limit=3.5)
    requirements = (Requirement(name="current", measure="current", limit=2.0), bare)
    values = np.column_stack((current, np.zeros(len(points))))
    hours = {"hours": np.ones(len(points))}
    return Process(
        ResponseTables(laws, requirements, (2.0, 3.5), ("A", "1"), grid, hours, values, 1, "low")
    )


def flown(unit, off, *, measured, count=20, seed=0):
    """Inspect a unit whose current is less than the model's by the share `off`."""
    rng, flt = np.random.default_rng(7), GrowthFilter(unit, seed=seed)
    for model, value in flown_values(off, count):
        severity = model - 1.0 + 0.005 * rng.standard_normal()
        measured_now = {"current": Measured(value, 0.01)} if measured else {}
        seen = {KEY: Seen(severity, 0.005, 0.005)}
        flt.update(Inspection((model - 1.0) / RATE, seen, measured=measured_now))
    return flt


def flown_values(off, count=20):
    """What the model says at each inspection, and what the unit shows."""
    rng = np.random.default_rng(8)
    model = 1.0 + RATE * np.linspace(40.0, 800.0, count)
    return list(zip(model, model * (1.0 - off) + 0.01 * rng.standard_normal(count), strict=True))


def test_what_the_model_is_off_by_is_learned_and_moves_the_end():
    """Gaussian: values v of deviation s draw the prior's mean by S/(S + 1/e^2), S ~ sum (v/s)^2."""
    off, unit = 2.0 * MODEL_ERROR, process(law(1e-3))
    flt = flown(unit, off, measured=True)
    lasting = MODEL_ERROR * np.sqrt(LASTING)
    learned = lasting * flt.units.off[:, 0, 0]
    model, value = np.array(flown_values(off)).T
    variance = 0.01**2 + (1.0 - LASTING) * (MODEL_ERROR * value) ** 2
    precision_each = 1.0 / variance
    precision = np.sum(model**2 * precision_each) + 1.0 / lasting**2
    expected = np.sum(model * (model - value) * precision_each) / precision
    assert expected > 3.0 / np.sqrt(precision)
    assert learned.mean() == pytest.approx(expected, abs=1.0 / np.sqrt(precision))
    assert learned.std() < 0.6 * lasting
    rng = np.random.default_rng(0)
    blind = flown(unit, off, measured=False)
    ends = [
        look_ahead(unit, f.units, Usage(), rng, model_error=MODEL_ERROR).end for f in (flt, blind)
    ]
    moved = float(np.median(ends[0]) - np.median(ends[1]))
    assert moved == pytest.approx(2000.0 * expected, rel=0.3)
    widths = [float(np.subtract(*np.quantile(e, (0.75, 0.25)))) for e in ends]
    assert widths[0] < 0.9 * widths[1]


def test_without_a_measured_value_nothing_is_drawn_anew():
    """Units carry the model's error from the first value on, of each requirement."""
    unit = process(law(1e-3))
    flt = flown(unit, 0.0, measured=False)
    assert flt.units.off.shape == (2000, 1, 0)
    precision_each = flown(unit, 0.0, measured=True, count=1)
    assert precision_each.units.off.shape == (2000, 1, 2)
    assert precision_each.units.off[:, 0, 1].std() == pytest.approx(
        1.0, rel=0.1
    )  # not measured: as drawn


def test_the_law_that_moves_a_requirement_most_is_reweighted_and_the_other_left_alone():
    unit = process(law(1e-3), law(1e-3, "friction"))
    assert governing(unit.response, "current") == (0, 0)
    flt = GrowthFilter(unit, seed=1)
    flt.update(Inspection(100.0, {}))
    other = flt.units.growth[:, 1].copy()
    before = flt.units.damage[:, 0].std()
    flt.update(Inspection(100.0, {}, measured={"current": Measured(1.11, 0.01)}))
    assert np.array_equal(flt.units.growth[:, 1], other)
    assert flt.units.damage[:, 0].std() < 0.5 * before
    with pytest.raises(InputError, match="give a diagnosis"):
        flt.update(Inspection(100.0, {}, measured={"bare": Measured(0.1, 0.01)}))


def test_values_are_read_with_their_units():
    data = {"current": {"value": "850 mA", "deviation": 0.01},
            "error": {"value": "1 deg", "deviation": "0.1 deg"}}  # fmt: skip
    got = read_measured(data, UNITS, "1.json")
    assert got["current"] == Measured(pytest.approx(0.85), 0.01)
    assert got["error"].value == pytest.approx(np.radians(1.0))


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ([1.0], "1.json: measured = .* is not a requirement's values"),
        ({"curent": {}}, "1.json: measured: unknown requirement 'curent'; did you mean 'current'"),
        ({"current": 0.8}, "1.json: measured current: '0.8' has not just a value and a deviation"),
        ({"current": {"value": 1.0}}, "measured current: .*has not just"),
        ({"current": {"value": 1.0, "deviation": 0.0}}, "deviation = 0.0 must be above 0"),
        ({"current": {"value": "1 deg", "deviation": 0.1}}, "measured current: value: .*current"),
        ({"current": {"value": "much", "deviation": 0.1}}, "measured current: value: .*much"),
    ],
)
def test_bad_values_are_named_by_file_place_and_value(data, text):
    with pytest.raises((InputError, FormatError), match=text):
        read_measured(data, UNITS, "1.json")


def test_a_history_carries_them(tmp_path):
    entry = {"usage": 3, "unit": "flights", "faults": [],
             "measured": {"current": {"value": "0.8 A", "deviation": "0.02 A"}}}  # fmt: skip
    (tmp_path / "0.json").write_text(json.dumps(entry))
    (seen,) = read_history(tmp_path, unit="flights").inspections([LAWS["gear_wear"]], UNITS)
    assert seen.measured == {"current": Measured(0.8, 0.02)}
