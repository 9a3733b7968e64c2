"""Which test to run next."""

import json

import numpy as np
import pytest

from elevon import Actuator
from elevon.diagnose.bymodel.candidates import CANDIDATES
from elevon.diagnose.nexttest import Belief, Possible, next_test, profiles
from elevon.diagnose.nexttest.belief import read_result
from elevon.diagnose.nexttest.information import expected_information, planned, updated
from elevon.errors import FormatError, InputError
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
SHORT, FRICTION = "short@motor.phase_a", "friction@transmission"


def _fault(key, probability, severity, interval, equivalents=()):
    kind, _, place = key.partition("@")
    return {"kind": kind, "place": place, "probability": probability, "severity": severity,
            "unit": "1", "interval": interval, "equivalents": list(equivalents)}  # fmt: skip


RESULT = {
    "status": "faulty",
    "p_fault": 0.9,
    "faults": [_fault(SHORT, 0.6, 0.05, [0.02, 0.08]), _fault(FRICTION, 0.4, 0.1, [0.0, 0.2])],
    "best": {"faults": [SHORT, FRICTION], "probability": 0.1},
}


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})


@pytest.fixture(scope="module")
def cases(unit):
    some = [c for c in CANDIDATES if c.key in {SHORT, FRICTION}]
    return {p.name: planned(p, unit, some) for p in profiles() if p.name in {"backlash", "loaded"}}


def _weights(belief):
    return {p.keys: p.weight for p in belief.possible}


def test_before_any_test_the_prior_holds():
    prior = _weights(Belief.prior())
    assert sum(prior.values()) == pytest.approx(1.0)
    assert prior[()] == pytest.approx(0.5)
    assert _weights(Belief.after([])) == pytest.approx(prior)
    assert Belief.of([Possible((), 3.0), Possible((SHORT,), 1.0)]).entropy == pytest.approx(
        0.8113, 1e-4
    )


def test_a_result_is_believed_as_it_stands():
    belief = _weights(Belief.after([RESULT]).leading())
    assert belief[SHORT,] == pytest.approx(0.5, abs=0.03)
    assert belief[FRICTION,] == pytest.approx(0.3, abs=0.03)
    assert belief[FRICTION, SHORT] == pytest.approx(0.1, abs=0.02)
    assert belief[()] == pytest.approx(0.1, abs=0.02)


def test_two_results_agree_more_than_one():
    one, two = (Belief.after([RESULT] * n) for n in (1, 2))
    assert _weights(two)[()] < 0.2 * _weights(one)[()]
    width = [next(p for p in b.possible if p.keys == (SHORT,)).deviation[0] for b in (one, two)]
    assert width[1] == pytest.approx(width[0] / np.sqrt(2.0))


def test_what_a_log_does_not_separate_shares_the_probability():
    alike = {"kind": "friction", "place": "transmission"}
    result = {**RESULT, "best": {"faults": [SHORT], "probability": 0.8},
              "faults": [_fault(SHORT, 0.9, 0.05, [0.02, 0.08], [alike])]}  # fmt: skip
    belief = {p.keys: p for p in Belief.after([result]).possible}
    rate = {c.key: c.rate for c in CANDIDATES}
    ratio = belief[FRICTION,].weight / belief[SHORT,].weight
    assert ratio == pytest.approx(rate[FRICTION] / rate[SHORT], rel=1e-6)
    assert belief[FRICTION,].deviation == (np.inf,)


def test_information_lies_between_nothing_and_all(cases):
    same = Belief.of([Possible((SHORT,), 1.0, (0.1,), (0.01,))] * 2)
    clear = Belief.of([Possible((), 1.0), Possible((SHORT,), 1.0, (0.4,), (0.04,))])
    small = Belief.of([Possible((), 1.0), Possible((SHORT,), 1.0, (0.01,), (0.001,))])
    for case in cases.values():
        assert expected_information(case, same) == pytest.approx(0.0, abs=0.02)
        assert expected_information(case, clear) == pytest.approx(1.0, abs=0.05)
        assert -0.02 < expected_information(case, small) < 0.6


def test_a_tests_outcome_moves_the_belief(cases):
    case = cases["loaded"]
    before = Belief.of([Possible((), 1.0), Possible((SHORT,), 1.0, (0.1,), (0.02,))])
    shown = case.unit.mean + case.shift(SHORT, np.array([0.1]))[0]
    assert _weights(updated(case, before, shown))[SHORT,] > 0.99
    assert _weights(updated(case, before, case.unit.mean))[()] > 0.9


def test_profiles_are_the_benchs_and_variants():
    every = {p.name: p for p in profiles()}
    assert [n for n, p in every.items() if p.standard] == ["backlash", "chirp", "loaded"]
    assert every["backlash:slow"].parameters["command.frequency"] == "0.1 Hz"
    assert every["loaded:heavy"].parameters["brake.slope"] == "0.125 N m/s"


def test_a_file_that_is_no_result(tmp_path):
    for text in ("", "{}", '{"p_fault": 0.5, "faults": [{"kind": "play"}]}', "[1]"):
        (tmp_path / "r.json").write_text(text)
        with pytest.raises(FormatError):
            read_result(tmp_path / "r.json")
    with pytest.raises(InputError, match="rotary"):
        next_test(Actuator.load("nasa-ballscrew"))


def test_the_command_line(elevon_cli, monkeypatch, tmp_path):  # noqa: F811
    from elevon.diagnose.nexttest import choose

    monkeypatch.setattr(choose, "profiles", lambda: profiles()[::2][:2])  # fewer: seconds each
    path = tmp_path / "r.json"
    path.write_text(json.dumps(RESULT))
    result = elevon_cli("next-test", "--actuator", "torino-rotary", "--so-far", path, "--json")
    assert result.code == 0
    document = json.loads(result.out)
    told = [t["expected_information_bit"] for t in document["tests"]]
    assert told == sorted(told, reverse=True)
    assert document["next"] == document["tests"][0]
    assert 0.0 < told[0] < document["unknown_bit"] + 0.1
    assert elevon_cli("next-test", "--actuator", "torino-rotary", "--so-far", tmp_path).code == 2


@pytest.mark.long
def test_information_beats_a_fixed_order(elevon_cli):  # noqa: F811
    result = elevon_cli("reproduce", "next-test", "--units", "6", "--seed", "3", "--json")
    document = json.loads(result.out)
    assert document["status"] == "pass", document["checks"]
