"""What a fleet's histories say: form, lives, spread, covariates; and what is refused."""

import numpy as np
import pytest

import elevon
from elevon.errors import FormatError, InputError
from elevon.prognose.fleet_growth import read_lives
from elevon.prognose.value_history import VALUE
from elevon.results import load

POWER, SPREAD = 1.8, 0.2


def fleet(place, count=12, seed=0):
    """Write units whose severity is a power of their use, and lives that fall with the load."""
    rng = np.random.default_rng(seed)
    rows = ["unit,use,failed,load"]
    for k in range(count):
        load_factor = rng.uniform(0.7, 1.4)
        life = 1000.0 * np.exp(SPREAD * rng.standard_normal()) / load_factor**2
        failed = rng.random() < 0.75
        end = life if failed else life * rng.uniform(0.6, 0.95)
        uses = np.sort(rng.uniform(0.1, 0.97, 8)) * end
        lines = [f"{u:.2f},{(u / life) ** POWER + 0.01 * rng.standard_normal():.4f},0.01"
                 for u in uses]  # fmt: skip
        (place / f"u{k}.csv").write_text("use,severity,sd\n" + "\n".join(lines) + "\n")
        rows.append(f"u{k},{end:.2f},{failed:d},{load_factor:.3f}")
    (place / "lives.csv").write_text("\n".join(rows) + "\n")
    return sorted(place.glob("u*.csv")), place / "lives.csv"


@pytest.mark.long
def test_growth_of_a_fleet_is_learned_and_narrows_the_answer(tmp_path):
    pytest.importorskip("lifelines")
    units, lives = fleet(tmp_path)
    growth = elevon.learn_growth(units, limit="1", censored=lives)
    learned = growth.growth[VALUE]
    assert learned.life == pytest.approx(1000.0 / 1.1**2, rel=0.25)
    assert learned.spread == pytest.approx(SPREAD, abs=0.15)
    assert learned.covariates["load"] == pytest.approx(2.0 / 1.05, rel=0.4)
    course = dict(learned.form)
    assert course[0.5] == pytest.approx(0.5 ** (1.0 / POWER), abs=0.05)
    kept = load(growth.save(tmp_path / "growth.json"))
    assert kept == growth
    new = tmp_path / "new.csv"
    uses = np.linspace(60.0, 480.0, 6)
    new.write_text("use,severity,sd\n" + "".join(
        f"{u},{(u / 820.0) ** POWER:.4f},0.01\n" for u in uses))  # fmt: skip
    alone = elevon.predict(new, limit="1")
    known = elevon.predict(new, limit="1", growth=growth, covariate=["load=1.1"])
    width = [r.interval[1] - r.interval[0] for r in (known, alone)]
    assert width[0] < 0.6 * width[1]
    assert known.interval[0] < 820.0 - 480.0 < known.interval[1]


def test_lives_alone_give_a_distribution_that_plans_a_fleet(tmp_path):
    pytest.importorskip("lifelines")
    rng = np.random.default_rng(1)
    load_factor = rng.uniform(0.7, 1.4, 60)
    life = 1000.0 * rng.weibull(3.0, 60) / load_factor**2
    removed = rng.uniform(200.0, 2000.0, 60)
    each = enumerate(zip(life, removed, load_factor, strict=True))
    rows = [f"u{k},{min(a, b):.1f},{a <= b:d},{c:.3f}" for k, (a, b, c) in each]
    place = tmp_path / "lives.csv"
    place.write_text("unit,use,failed,load\n" + "\n".join(rows) + "\n")
    growth = elevon.learn_growth([], censored=place)
    assert growth.lives.shape == pytest.approx(3.0, rel=0.35)
    effect = dict(zip(growth.lives.names, growth.lives.coefficients, strict=True))["load"]
    assert effect == pytest.approx(-2.0, abs=0.7)
    running = tmp_path / "running.csv"
    running.write_text("unit,use,failed,load\nold,900,0,1.3\nyoung,50,0,0.8\n")
    plan = elevon.fleet([], growth=growth, running=running)
    assert plan.units["old"].median < plan.units["young"].median
    assert {name for visit in plan.visits for name in visit.units} <= {"old", "young"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("unit,use\na,5\n", "has no 'failed'"),
        ("unit,use,failed\na,5,yes\n", "neither 0 nor 1"),
        ("unit,use,failed\na,-5,1\n", "not a number above 0"),
        ("unit,use,failed\na,5,1\na,6,0\n", "stands there twice"),
        ("unit,use,failed,load\na,5,1,\n", "load is empty"),
        ("unit,use,failed\n", "has no unit"),
    ],
)
def test_lives_that_are_none_are_refused(text, message, tmp_path):
    place = tmp_path / "lives.csv"
    place.write_text(text)
    with pytest.raises(FormatError, match=message):
        read_lives(place)


def test_nothing_to_learn_from_is_refused():
    with pytest.raises(InputError, match="neither histories nor"):
        elevon.learn_growth([])
