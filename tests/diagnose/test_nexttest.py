"""Which test to run next."""

import json

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.diagnose.engine.candidates import CANDIDATES, candidates_of
from elevon.errors import FormatError
from elevon.nexttest import Belief, Possible, profiles
from elevon.nexttest.belief import read_result
from elevon.nexttest.information import expected_information, planned, updated
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
SHORT, FRICTION = "short@motor.phase_a", "friction@transmission"
BACKLASH = "backlash@transmission"


def _set(probability, *faults):
    rows = []
    for key, severity, interval in faults:
        kind, _, place = key.partition("@")
        row = {"kind": kind, "place": place, "severity": severity, "unit": "1"}
        rows.append({**row, "interval": interval})
    return {"faults": rows, "probability": probability}


SMALL_SHORT = (SHORT, 0.05, [0.02, 0.08])
SMALL_FRICTION = (FRICTION, 0.1, [0.0, 0.2])
RESULT = {
    "status": "faulty",
    "detectable": {c.key: 0.1 for c in CANDIDATES},
    "hypotheses": [
        _set(0.5, SMALL_SHORT),
        _set(0.3, SMALL_FRICTION),
        _set(0.1, SMALL_SHORT, SMALL_FRICTION),
        _set(0.0998),
    ],
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
    belief = _weights(Belief.after([RESULT]))
    assert belief[SHORT,] == pytest.approx(0.5, rel=1e-9)
    assert belief[FRICTION,] == pytest.approx(0.3, rel=1e-9)
    assert belief[FRICTION, SHORT] == pytest.approx(0.1, rel=1e-9)
    assert belief[()] == pytest.approx(0.0998, rel=1e-9)


def test_two_results_agree_more_than_one():
    one, two = (Belief.after([RESULT] * n) for n in (1, 2))
    assert _weights(two)[()] < 0.2 * _weights(one)[()]
    width = [next(p for p in b.possible if p.keys == (SHORT,)).deviation[0] for b in (one, two)]
    assert width[1] == pytest.approx(width[0] / np.sqrt(2.0))


def test_a_log_says_of_what_it_cannot_show_that_nothing_is_there():
    """A fault that was no candidate looks like none; beside another one, like that one alone."""
    detectable = {key: 0.1 for key in RESULT["detectable"] if key != BACKLASH}
    belief, prior = (
        _weights(Belief.after([{**RESULT, "detectable": detectable}])),
        _weights(Belief.prior()),
    )
    moved = {keys: weight / prior[keys] for keys, weight in belief.items()}
    assert moved[BACKLASH,] == pytest.approx(moved[()], rel=1e-9)
    assert moved[BACKLASH, SHORT] == pytest.approx(moved[SHORT,], rel=1e-9)
    assert moved[SHORT,] > 2.0 * moved[()]


def test_an_answer_of_classes_stands_against_what_was_learnt():
    """It says one half of a fault that one log in ten had."""
    faults = [SHORT, "backlash@transmission", "friction@transmission"]
    detectable = dict.fromkeys(faults, 0.1)
    shares = {0: 0.9**3, 1: 0.1 * 0.9**2}
    prior = dict.fromkeys(faults, 0.1)
    answer = {**RESULT, "detectable": detectable, "method": "learned", "prior": prior}
    belief, prior = _weights(Belief.after([answer])), _weights(Belief.prior())
    moved = [belief[keys] / prior[keys] for keys in ((SHORT,), ())]
    assert moved[0] / moved[1] == pytest.approx((0.5 / shares[1]) / (0.0998 / shares[0]), rel=1e-9)


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
    values = case.unit.mean + case.shift(SHORT, np.array([0.1]))[0]
    assert _weights(updated(case, before, values))[SHORT,] > 0.99
    assert _weights(updated(case, before, case.unit.mean))[()] > 0.9


def test_profiles_are_the_benchs_and_variants():
    every = {p.name: p for p in profiles()}
    assert [n for n, p in every.items() if p.standard] == ["backlash", "chirp", "loaded"]
    assert every["backlash:slow"].parameters["command.frequency"] == "0.1 Hz"
    assert every["loaded:heavy"].parameters["brake.slope"] == "0.125 N m/s"


def test_a_file_that_is_no_result(tmp_path):
    unknown = {**RESULT, "hypotheses": [_set(1.0, ("rust@gear", 0.1, [0.0, 0.2]))]}
    texts = {
        "": "not JSON",
        "{}": "'hypotheses' is missing",
        "[1]": "not one JSON object",
        json.dumps(unknown): "rust",
    }
    for text, why in texts.items():
        (tmp_path / "r.json").write_text(text)
        with pytest.raises(FormatError, match=why):
            read_result(tmp_path / "r.json")


def _linear_result():
    """What a diagnosis of a screw leaves open."""
    screw = candidates_of(Actuator.load("nasa-ballscrew"))
    backlash = (BACKLASH, 3e-5, [1e-5, 5e-5])
    return {
        "status": "faulty",
        "detectable": {c.key: 0.1 for c in screw},
        "hypotheses": [_set(0.5, backlash), _set(0.4, (FRICTION, 0.5, [0.4, 0.6])), _set(0.09)],
    }


def test_a_screws_and_a_gears_tests_are_their_stands():
    screw, gear = Actuator.load("nasa-ballscrew"), Actuator.load("pisa-landing-gear")
    names = {name: [p.name for p in profiles(unit)] for name, unit in (("s", screw), ("g", gear))}
    assert "sine-opposing" in names["s"]
    assert "retraction-normal" in names["g"]
    nominal = next(p for p in profiles(gear) if p.name == "retraction-nominal")
    assert nominal.duration == 12.0
    assert nominal.parameters["action at 0.1 s"] == "retract"
    assert nominal.parameters["force.over the stroke"] == "-1994.2 to -756.7 N"
    with pytest.raises(FormatError, match="of this actuator: short"):
        elevon.next_test(gear, [{**RESULT, "hypotheses": [_set(1.0, (SHORT + "x", 1, [0, 1]))]}])


def test_what_is_counted_is_drawn_as_a_count():
    gear = candidates_of(Actuator.load("pisa-landing-gear"))
    switch = next(c for c in gear if c.switched)
    rng = np.random.default_rng(1)
    drawn = Possible((switch.key,), 1.0, (0.0,), (np.inf,)).severities(9, rng, {switch.key: switch})
    assert (drawn == 1.0).all()


def test_a_test_of_a_screw_tells_backlash_from_friction(monkeypatch):
    from elevon.nexttest import door

    unit = Actuator.load("nasa-ballscrew")
    monkeypatch.setattr(door, "profiles", lambda a: profiles(a)[:1])  # a second each
    answer = elevon.next_test(unit, [_linear_result()])
    assert answer.next.name == "sine-free"
    assert 0.3 * answer.unknown < answer.next.information < answer.unknown + 0.1
    assert answer.next.rate == pytest.approx(5.0 * answer.next.information)


@pytest.mark.long
@pytest.mark.parametrize("name", ["nasa-ballscrew", "pisa-landing-gear"])
def test_every_test_of_a_stand_is_ranked(name):
    """Information lies between none and all, and what is not known before any test is the prior."""
    answer = elevon.next_test(name)
    assert len(answer.tests) == len(profiles(Actuator.load(name)))
    assert all(-0.1 < t.information < answer.unknown for t in answer.tests)
    assert answer.findings == ()


def test_a_diagnosis_without_hypotheses_is_no_result():
    with pytest.raises(FormatError, match=r"the diagnosis: .* 'hypotheses' is missing"):
        elevon.next_test("torino-rotary", [{"status": "faulty", "faults": []}])


def test_the_command_line(elevon_cli, monkeypatch, tmp_path):  # noqa: F811
    from elevon.nexttest import door

    monkeypatch.setattr(door, "profiles", lambda a: profiles(a)[::2][:2])  # fewer: seconds each
    path = tmp_path / "r.json"
    path.write_text(json.dumps(RESULT))
    result = elevon_cli("next-test", "--actuator", "torino-rotary", "--so-far", path, "--json")
    assert result.code == 0
    document = json.loads(result.out)
    bits = [t["expected_information_bit"] for t in document["tests"]]
    assert bits == sorted(bits, reverse=True)
    assert document["next"] == document["tests"][0]
    assert 0.0 < bits[0] < document["unknown_bit"] + 0.1
    assert elevon_cli("next-test", "--actuator", "torino-rotary", "--so-far", tmp_path).code == 2
