"""A first sighting that is not sure: what to do, and a remaining life for each case."""

from tests.prognose.cases import answer


def test_a_first_sighting_contradicts_nothing_and_answers_in_branches():
    result = answer((500, None, 0.0), (1000, 0.15, 0.8))
    assert result.status == "ok"
    real, other = result.branches
    assert real.what == "the backlash is real"
    assert 0.5 < real.probability < 0.97
    assert real.probability + other.probability == 1.0
    assert 1000.0 < real.median < 20_000.0
    assert other.rul["median"] is None
    assert other.rul["censored"] is True
    assert result.headline.startswith("INSPECT within ")
    assert "if not, no end is known" in result.headline
    assert "contradicts" not in result.headline
    action = result.to_dict()["action"]
    assert action["kind"] == "inspect"
    assert 0.0 < action["within"] < real.interval[0]
    assert action["unit"] == "flights"


def test_what_is_seen_again_and_again_is_one_branch():
    result = answer(*[(u, u / 6000.0, 0.8) for u in (1000, 1500, 2000, 2500)])
    assert len(result.branches) == 1
    assert result.branches[0].rul == result.rul
    assert result.rul["censored"] is False


def test_a_headline_has_no_infinite_median():
    result = answer((500, None, 0.0), (5000, None, 0.0), (9000, None, 0.0))
    assert "inf" not in result.headline.split()
    assert "No end of life is in sight" in result.headline or " remain " in result.headline
