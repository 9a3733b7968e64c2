"""Designs are what their names say: orthogonal, of the stated resolution, in blocks, in order."""

import itertools
import math

import numpy as np
import pytest

from elevon.campaign import load_plan, resolve_plan
from elevon.campaign.design import power_rows
from elevon.campaign.grammar import Power
from elevon.campaign.twolevel import (
    block_words,
    blocks_of,
    fraction,
    full,
    letters,
    plackett_burman,
    product,
)
from elevon.errors import InputError

#: Highest resolution of 2^k designs by number of factors and runs (Box, Hunter and Hunter,
#: Statistics for Experimenters, table of fractional factorials).
RESOLUTIONS = {
    (3, 4): 3, (4, 8): 4, (5, 8): 3, (6, 8): 3, (7, 8): 3, (5, 16): 5, (6, 16): 4, (7, 16): 4,
    (8, 16): 4, (9, 16): 3, (11, 16): 3, (15, 16): 3, (6, 32): 6, (7, 32): 4, (8, 32): 4,
    (7, 64): 7, (8, 64): 5,
}  # fmt: skip


@pytest.mark.parametrize(("factors", "runs"), RESOLUTIONS)
def test_fractions_have_the_highest_resolution(factors, runs):
    design = fraction(letters(factors), "design", runs=runs)
    assert design.resolution == RESOLUTIONS[factors, runs]
    coded = design.coded()
    assert coded.shape == (runs, factors)
    assert set(coded.ravel()) == {-1.0, 1.0}
    assert len({tuple(row) for row in coded}) == runs
    # Resolution R: any R - 1 columns hold every combination equally often.
    strength = min(design.resolution - 1, 3)
    for chosen in itertools.combinations(range(factors), strength):
        counts = np.unique(coded[:, chosen], axis=0, return_counts=True)[1]
        assert len(counts) == 2**strength
        assert len(set(counts)) == 1


def test_the_defining_relation_holds_and_aliases_are_equal_columns():
    design = fraction(list("ABCDEF"), "design", ["E=ABC", "F=-BCD"])
    coded = design.coded()
    for word, sign in design.words.items():
        assert (product(coded, word) == sign).all()
    aliases = design.aliases()
    assert set(aliases["AB"]) == {"CE"}
    assert aliases["CD"] == ["-BF"]
    for effect, others in aliases.items():
        for other in others:
            sign = -1.0 if other.startswith("-") else 1.0
            assert (column(coded, effect) == sign * column(coded, other.lstrip("-"))).all()
    assert "A" not in aliases  # resolution IV


def column(coded, word):
    return coded[:, ["ABCDEF".index(letter) for letter in word]].prod(axis=1)


@pytest.mark.parametrize("runs", [4, 8, 12, 16, 20, 24, 32, 44, 48])
def test_plackett_burman_designs_are_orthogonal(runs):
    coded = plackett_burman(min(runs - 1, 19), runs, "design")
    assert set(coded.ravel()) == {-1.0, 1.0}
    assert (coded.sum(axis=0) == 0.0).all()
    assert (coded.T @ coded == runs * np.eye(coded.shape[1])).all()


def test_blocks_are_confounded_with_the_highest_interactions():
    design = full(list("ABCD"))
    coded = design.coded()
    for count, order in ((2, 4), (4, 2), (8, 2)):
        words = block_words(design, count, "design")
        blocks = blocks_of(coded, words)
        assert np.unique(blocks, return_counts=True)[1].tolist() == [16 // count] * count
        for block in range(count):  # every factor is balanced within every block
            assert (coded[blocks == block].sum(axis=0) == 0.0).all()
        assert min(word.bit_count() for word in words) >= order
    with pytest.raises(InputError, match="confounded with a factor"):
        block_words(design, 2, "design", ["A"])


def test_power_is_how_often_the_effect_is_seen():
    """Least squares over many experiments of a known effect, against the noncentral t."""
    generator = np.random.default_rng(4)
    coded = np.vstack([full(list("ABC")).coded()] * 2)
    blocks = np.repeat([0, 1], 8)
    request = Power(effect=1.5, sd=1.0, terms=("A", "AB"))
    rows = power_rows(request, coded, blocks, list("ABC"), "design")
    assert [row["term"] for row in rows] == ["A", "AB"]
    ab = coded[:, 0] * coded[:, 1]
    model = np.column_stack([np.ones(16), blocks, coded, ab])
    trials = 1500
    response = 0.75 * coded[:, [0]] + 0.75 * ab[:, None] + generator.normal(size=(16, trials))
    estimate, residual, _, _ = np.linalg.lstsq(model, response, rcond=None)
    freedom = 16 - model.shape[1]
    error = np.sqrt(residual / freedom * np.linalg.inv(model.T @ model)[2, 2])
    from scipy.stats import t

    seen = np.mean(np.abs(estimate[2] / error) > t.ppf(0.975, freedom))
    spread = math.sqrt(rows[0]["power"] * (1.0 - rows[0]["power"]) / trials)
    assert rows[0]["df"] == freedom
    assert abs(seen - rows[0]["power"]) < 4.0 * spread


def test_power_that_cannot_be_told_says_why():
    coded = full(list("AB")).coded()
    rows = power_rows(Power(effect=1, sd=1, terms=("A", "AB")), coded, np.zeros(4), ["A", "B"], "")
    assert all(row["power"] is None and "no degrees" in row["note"] for row in rows)
    fractioned = fraction(list("ABC"), "", ["C=AB"]).coded()
    twice, zeros = np.vstack([fractioned] * 2), np.zeros(8)
    rows = power_rows(Power(effect=1, sd=1, terms=("AB",)), twice, zeros, list("ABC"), "")
    assert "aliased" in rows[0]["note"]


FACTORS = """
[[design.factor]]
parameter = "friction.dynamic"
from = "0.2 N m"
to = "0.4 N m"
[[design.factor]]
fault = "backlash@transmission"
from = "0 deg"
to = "0.5 deg"
role = "nuisance"
[[design.factor]]
scenario = "command.terms[0].amplitude"
from = "4 deg"
to = "8 deg"
"""


def runs_of(plan, design, factors=FACTORS, **options):
    path = plan(0, tail=f"[design]\n{design}\n{factors}", **options)
    return resolve_plan(*load_plan(path))


def test_a_factorial_design_in_a_plan(plan):
    resolved = runs_of(
        plan, 'kind = "full_factorial"\nreplicates = 2\nblocks = 2\nrandomise = true\ncentre = 1'
    )
    assert len(resolved) == 18
    values = {c.name: c.values for c in resolved.columns}
    assert set(np.round(values["friction.dynamic"], 12)) == {0.2, 0.3, 0.4}
    assert resolved.index.block.tolist() == [0] * 9 + [1] * 9
    assert (resolved.index.replicate == resolved.index.block).all()
    first, second = resolved.index.draw[:9], resolved.index.draw[9:]
    assert sorted(first) == sorted(second) == list(range(9))
    assert list(first) != list(range(9))
    assert list(first) != list(second)
    assert {c.name: c.role for c in resolved.columns}["backlash@transmission"] == "nuisance"
    assert resolved.design["kind"] == "full_factorial"
    assert [len(resolved.run(n).scenario.fault) for n in range(18)] == [
        int(value > 0.0) for value in values["backlash@transmission"]
    ]


def test_a_fraction_states_what_it_confounds(plan, cli):
    path = plan(
        0, tail='[design]\nkind = "fractional_factorial"\ngenerators = ["C=AB"]\n' + FACTORS
    )
    code, report, _ = cli("campaign", "plan", path)
    assert code == 0
    assert report["runs"] == 4
    assert report["design"]["resolution"] == "III"
    assert report["design"]["generators"] == ["C=AB"]
    assert report["design"]["aliases"]["A"] == ["BC"]
    _, printed, _ = cli("campaign", "plan", path, json_output=False)
    assert "resolution III; generators C=AB" in printed
    assert "A is aliased with BC" in printed


def test_a_blocking_quantity_goes_with_the_blocks(plan):
    blocking = (
        '[design.blocking]\nparameter = "motor.winding_temperature"\n'
        'values = ["20 degC", "60 degC"]\n'
    )
    resolved = runs_of(plan, 'kind = "full_factorial"\nblocks = 2', FACTORS + blocking)
    column = resolved.columns[-1]
    assert column.role == "nuisance"
    assert (column.values == np.array([293.15, 333.15])[resolved.index.block]).all()


@pytest.mark.parametrize("kind", ["latin_hypercube", "sobol", "random"])
def test_sampled_designs_fill_their_ranges(plan, kind):
    resolved = runs_of(plan, f'kind = "{kind}"\ncount = 64\nseed = 2')
    again = runs_of(plan, f'kind = "{kind}"\ncount = 64\nseed = 2')
    for column, other in zip(resolved.columns[1:], again.columns[1:], strict=True):
        assert column.values.tobytes() == other.values.tobytes()
        scaled = (column.values - column.values.min()) / np.ptp(column.values)
        assert abs(np.median(scaled) - 0.5) < 0.2
    assert resolved.columns[0].values.max() <= 0.4


def test_a_users_table(plan, tmp_path):
    (tmp_path / "points.csv").write_text(
        "C,backlash@transmission,A\n5 deg,0.1 deg,0.25 N m\n6 deg,0,0.3 N m\n"
    )
    resolved = runs_of(plan, 'kind = "table"\nfile = "points.csv"\nreplicates = 2')
    assert len(resolved) == 4
    assert resolved.values(1) == {
        "friction.dynamic": 0.3,
        "backlash@transmission": 0.0,
        "command.terms[0].amplitude": pytest.approx(math.radians(6.0)),
    }
    assert any(name.endswith("points.csv") for name in resolved.sources)


BAD = {
    "no points": ('kind = "sobol"\ncount = 0', FACTORS, "empty"),
    "count": ('kind = "sobol"\ncount = -4', FACTORS, "greater than or equal to 0"),
    "needs count": ('kind = "random"', FACTORS, "needs 'count'"),
    "no use": ('kind = "full_factorial"\ncount = 3', FACTORS, "no use for 'count'"),
    "no file": ('kind = "table"', FACTORS, "needs 'file'"),
    "file": ('kind = "table"\nfile = "absent.csv"', FACTORS, "cannot be read"),
    "both": ('kind = "fractional_factorial"', FACTORS, "either 'generators' or 'runs'"),
    "form": ('kind = "fractional_factorial"\ngenerators = ["C"]', FACTORS, "form E=ABCD"),
    "letter": ('kind = "fractional_factorial"\ngenerators = ["C=AX"]', FACTORS, "'X' in 'AX'"),
    "weak": ('kind = "fractional_factorial"\ngenerators = ["C=A"]', FACTORS, "below III"),
    "size": ('kind = "fractional_factorial"\nruns = 5', FACTORS, "power of two"),
    "burman": ('kind = "plackett_burman"\nruns = 28', FACTORS, "runs: 4, 8, 12, 16"),
    "blocks": ('kind = "full_factorial"\nblocks = 3', FACTORS, "power of two"),
    "sampled blocks": ('kind = "random"\ncount = 4\nblocks = 2', FACTORS, "multiple of as many"),
    "factor": (
        'kind = "full_factorial"',
        FACTORS.replace("friction.dynamic", "friction.dynamik"),
        "did you mean 'friction.dynamic'",
    ),
    "term": (
        'kind = "full_factorial"\npower = { effect = 1, sd = 1, terms = ["D"] }',
        FACTORS,
        "unknown factor 'D'",
    ),
    "replicates": ('kind = "full_factorial"\nreplicates = 0', FACTORS, "greater than or equal"),
}


@pytest.mark.parametrize("name", BAD)
def test_designs_that_cannot_be_name_the_place(plan, name):
    design, factors, message = BAD[name]
    with pytest.raises(InputError, match=message) as raised:
        runs_of(plan, design, factors)
    assert "plan.toml" in str(raised.value)
    assert "design" in str(raised.value)
