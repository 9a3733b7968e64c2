"""Known effects are recovered, with intervals that hold what they say."""

import itertools

import numpy as np
import pytest

from elevon.analysis import CampaignResponse, effects_of
from elevon.analysis.response import VariedFactor

LETTERS = "ABCDE"


def _response(coded, values, block=None):
    factors = [
        VariedFactor(LETTERS[k], f"factor_{k}", "1", "control", 3.0 + column, (2.0, 4.0))
        for k, column in enumerate(np.asarray(coded, dtype=float).T)
    ]
    count = len(values)
    block = np.zeros(count, dtype=int) if block is None else np.asarray(block)
    index = np.arange(count)
    return CampaignResponse("y", "A", index, index, block, np.asarray(values), factors, [], [])


def _full(factors):
    return np.array(list(itertools.product([-1, 1], repeat=factors)))


def _truth(coded):
    """Effects: A 2, C -1, AB 0.8; all others 0."""
    return 5.0 + coded[:, 0] - 0.5 * coded[:, 2] + 0.4 * coded[:, 0] * coded[:, 1]


KNOWN = {"A": 2.0, "C": -1.0, "AB": 0.8}


def test_exact_effects_without_noise():
    coded = _full(3)
    found = effects_of(_response(coded, _truth(coded)))
    assert {t.term: t.effect for t in found.terms} == pytest.approx(
        {**dict.fromkeys(["B", "AC", "BC"], 0.0), **KNOWN}, abs=1e-12
    )
    assert found.terms[0].term == "A"


@pytest.mark.parametrize(
    ("factors", "copies", "method"), [(3, 2, "replicates"), (4, 1, "lenth"), (5, 1, "lenth")]
)
def test_intervals_cover_the_truth_as_often_as_they_say(factors, copies, method):
    generator = np.random.default_rng(7)
    coded = np.tile(_full(factors), (copies, 1))
    block = np.repeat(np.arange(copies), 2**factors)
    inside = []
    for _ in range(150):
        noise = generator.normal(0.0, 0.7, len(coded)) + 3.0 * block
        found = effects_of(_response(coded, _truth(coded) + noise, block), level=0.9)
        assert found.method == method
        inside += [t.low <= KNOWN.get(t.term, 0.0) <= t.high for t in found.terms]
    assert 0.85 <= np.mean(inside) <= 0.97


def test_equal_repeats_count_as_one_run():
    coded = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1], [0, 0]])
    values = 5.0 + coded[:, 0] + 0.3 * coded[:, 0] ** 2
    once = effects_of(_response(coded, values))
    twice = effects_of(_response(np.tile(coded, (2, 1)), np.tile(values, 2)))
    assert (once.method, twice.method) == ("residual", "residual")
    assert (once.equal_repeats, twice.equal_repeats) == (False, True)
    for one, two in zip(once.terms, twice.terms, strict=True):
        assert (two.low, two.effect, two.high) == pytest.approx((one.low, one.effect, one.high))
        assert two.low < two.effect < two.high


def test_aliases_of_a_fraction_are_named():
    coded = _full(3)
    coded = np.column_stack([coded, coded.prod(axis=1)])  # D = ABC
    found = effects_of(_response(coded, _truth(coded)))
    terms = {t.term: t for t in found.terms}
    assert terms["AB"].aliases == ["CD"]
    assert terms["AB"].effect == pytest.approx(0.8)
    assert "CD" not in terms
    found = effects_of(
        _response(np.column_stack([coded[:, :2], -coded[:, :2].prod(1)]), coded[:, 0])
    )
    assert {t.term: t.aliases for t in found.terms} == {"A": ["-BC"], "B": ["-AC"], "C": ["-AB"]}


def test_blocks_are_removed_and_what_they_hide_is_named():
    coded = _full(3)
    block = (coded[:, 1] * coded[:, 2] > 0).astype(int)
    found = effects_of(_response(coded, _truth(coded) + 100.0 * block, block))
    assert found.blocked == ["BC"]
    assert {t.term: t.effect for t in found.terms}["A"] == pytest.approx(2.0)


def test_partly_aliased_interactions_are_left_out_and_named():
    from elevon.campaign.twolevel import plackett_burman

    coded = plackett_burman(5, 12, "test")
    found = effects_of(_response(coded, coded @ [1.0, 0.0, 0.5, 0.0, 0.0]))
    assert len(found.partial) == 10
    assert {t.term: t.effect for t in found.terms} == pytest.approx(
        {"A": 2.0, "B": 0.0, "C": 1.0, "D": 0.0, "E": 0.0}, abs=1e-12
    )


PLAN = """
actuator = "torino-rotary"
fidelity = "low"
record = []
features = "friction,level@1 kHz"
[scenario]
duration = "0.25 s"
[[scenario.command.terms]]
kind = "sine"
amplitude = "4 deg"
frequency = "8 Hz"
[design]
kind = "full_factorial"
[[design.factor]]
parameter = "friction.dynamic"
from = "0.2 N m"
to = "0.4 N m"
[[design.factor]]
parameter = "friction.viscous"
from = "0 N m s/rad"
to = "0.001 N m s/rad"
[[design.factor]]
parameter = "motor.inertia"
from = "8e-4 kg m^2"
to = "9e-4 kg m^2"
"""


def test_the_command_says_what_moves_a_feature(elevon_cli, tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    assert elevon_cli("campaign", "run", "plan.toml", "--out", "out", "--json").code == 0
    command = ("campaign", "effects", "out", "--response", "friction_current")
    found = elevon_cli(*command, "--report", "page.html", "--json").json
    assert found["terms"][0]["term"] == "A"
    assert found["terms"][0]["effect"] > 0.0
    assert found["method"] == "lenth"
    assert "Pareto" in (tmp_path / "page.html").read_text()
    wrong = elevon_cli("campaign", "effects", "out", "--response", "friction_curent")
    assert wrong.code == 2
    assert "friction_current" in wrong.err
