"""Growth that no law says, and histories that mislead, through the command."""

import json

import numpy as np
import pytest
import tomlkit

from elevon.cli import main
from tests.prognose.test_predict import FLIGHT, KEY

LIMIT = 0.012  # rad
MISSION = {
    **FLIGHT,
    "requirement": [{"name": "backlash", "measure": "severity", "fault": KEY, "limit": LIMIT}],
}
ERROR = 2e-4


def history(place, course, uses, *, unit="flights", seed=1):
    """Inspections of a course of backlash [rad] over use."""
    rng = np.random.default_rng(seed)
    place.mkdir()
    for usage in uses:
        value = max(float(course(usage)) + ERROR * rng.standard_normal(), 1e-5)
        half = 1.6449 * ERROR
        cause = {"kind": "backlash", "place": "transmission", "probability": 0.99, "unit": "rad",
                 "severity": value, "interval": [max(value - half, 0.0), value + half]}  # fmt: skip
        data = {"usage": float(usage), "unit": unit, "faults": [cause], "detectable": {KEY: 3e-4}}
        (place / f"{usage:05.0f}.json").write_text(json.dumps(data))


def predicted(tmp_path, capsys, course, uses, **options):
    history(tmp_path / "history", course, uses, **options)
    mission = tmp_path / "mission.toml"
    mission.write_text(tomlkit.dumps(MISSION))
    code = main(["predict", str(tmp_path / "history"), "--actuator", "torino-rotary", "--mission",
                 str(mission), "--particles", "500", "--json"])  # fmt: skip
    assert code == 0
    return json.loads(capsys.readouterr().out)


def bent(usage):
    """Rate three times as high since flight 1,500."""
    return 3e-6 * min(usage, 1500.0) + 9e-6 * max(usage - 1500.0, 0.0)


EVEN = np.arange(100, 1900, 100)
CASES = {  # course, uses, true remaining flights after the last
    "rate three times": (bent, np.arange(100, 2001, 100), (LIMIT - bent(2000)) / 9e-6),
    "jump": (lambda u: 3e-6 * u + 0.003 * (u > 1000), EVEN, 3000.0 - 1800.0),
    "enters worn": (lambda u: 0.004 + 3e-6 * u, EVEN, 0.008 / 3e-6 - 1800.0),
    "renewed without a record": (lambda u: 4e-6 * (u if u < 900 else u - 900), EVEN, 2100.0),
    "square root": (lambda u: LIMIT * (u / 3000.0) ** 0.5, EVEN, 1200.0),
    "exact Archard": (lambda u: LIMIT * u / 3000.0, EVEN, 1200.0),
    "outliers": (lambda u: 4e-6 * u + (0.004 if u in (400, 1300) else 0.0), EVEN, 1200.0),
    "past its end": (lambda u: 8e-6 * u, np.arange(100, 1900, 100), 0.0),
}  # fmt: skip


@pytest.mark.parametrize("name", ["rate three times", "renewed without a record", "exact Archard"])
def test_the_interval_holds_where_the_law_does_not(name, tmp_path, capsys):
    _holds(name, tmp_path, capsys)


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_the_interval_holds_for_each_form(name, tmp_path, capsys):
    _holds(name, tmp_path, capsys)


def _holds(name, tmp_path, capsys):
    course, uses, true = CASES[name]
    result = predicted(tmp_path, capsys, course, uses)
    low, high = result["rul"]["interval"]
    assert low <= true + 1e-6 <= (np.inf if high is None else high) + 1.0
    if name == "exact Archard":
        assert result["rul"]["median"] == pytest.approx(true, rel=0.1)


def test_one_inspection_answers_widely_and_two_at_one_use_are_noted(tmp_path, capsys):
    one = predicted(tmp_path, capsys, lambda u: 4e-6 * u, [1000])
    low, high = one["rul"]["interval"]
    assert low <= 2000.0 <= (np.inf if high is None else high)
    assert any("needed before its growth" in text for text in one["findings"])


def test_a_stray_diagnosis_last_is_off_law_and_its_interval_allows_both(tmp_path, capsys):
    """It may be true: then the unit has failed."""
    course = lambda u: 4e-6 * u + (0.006 if u == 1800 else 0.0)  # noqa: E731
    result = predicted(tmp_path, capsys, course, [*EVEN[:-1].tolist(), 1800])
    assert result["status"] == "off_law"
    low, high = result["rul"]["interval"]
    assert low <= 1200.0 <= high
