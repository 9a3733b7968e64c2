"""From outcomes to numbers: cut sets, dormancy, rules; outcomes are made, no run is needed."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

import elevon
from elevon.errors import InputError
from elevon.safety import Hazard
from elevon.safety.assessment import Assessment, assess
from elevon.safety.gear import EXTENDED, HOME, GearRow
from elevon.safety.hazards import TARGETS, Message
from elevon.safety.outcomes import Outcome, Outcomes
from elevon.safety.rates import read_rates, read_service
from elevon.safety.result import TripleSample
from elevon.safety.rows import Failure
from elevon.safety.study import Study, study_of
from elevon.safety.tree import fault_tree

SWITCH = Failure("proximity_on", "sensor.proximity_100", 1.0)
JAM = Failure("jam", "screw", 5e4)
BRAKE = Failure("brake_slipping", "brake", 1.0)
CABLE = Failure("release_cable_failed", "release", 1.0)
EXTEND = ((0.1, "extend"),)
HAZARD = Hazard("collapse", "the leg folds", lambda run: None, "catastrophic")


def row(*faults, late=False, start=HOME, steps=EXTEND, group=""):
    """A row: its failures from the start, or the last one in the middle of the move."""
    times = [0.05] * len(faults)
    if late:
        times[-1] = 2.5
    timed = tuple(f.when("step", time=t) for f, t in zip(faults, times, strict=True))
    return GearRow(
        group or ("one failure" if len(faults) == 1 else "two failures"), timed, start, steps
    )


def outcome(*hazards, message=""):
    texts = (Message(1.0, message),) if message else ()
    return Outcome(dict.fromkeys(hazards, 2.0), texts, "locked", 0.5, "time")


def judged(rows, *, rates=None, checks=None, flight="1 h", triples=()):
    """Assess rows: pairs of a row and its outcome at low fidelity."""
    actuator = elevon.Actuator.load("pisa-landing-gear")
    names = dict.fromkeys(f.name for item, _ in rows for f in item.faults)
    found = read_rates("landing_gear", list(names), rates)
    study = Study(actuator, {"low": (), "high": ()}, found, (HAZARD,), "state@10 Hz", {})
    service = read_service("landing_gear", checks, flight)
    outcomes = Outcomes([item for item, _ in rows])
    outcomes.add("low", range(len(rows)), [result for _, result in rows])
    places = outcomes.append([item for item, _ in triples])
    outcomes.add("low", places, [result for _, result in triples])
    sample = TripleSample(tuple(places), 1e-6)
    return assess(Assessment(study, service, TARGETS, 0), outcomes, sample)


def singles(*seen):
    """Each failure alone, in extension and cruise; those of `seen` announce themselves."""
    rows = []
    for failure in (SWITCH, JAM, BRAKE, CABLE):
        for steps in (EXTEND, ()):
            text = "fault: stalled" if failure in seen and steps else ""
            rows.append((row(failure, steps=steps), outcome(message=text)))
    return rows


def sets_of(result):
    return {cut.failures: cut for cut in result.hazards[0].cut_sets}


def test_a_set_with_a_dormant_and_an_evident_failure() -> None:
    """Its mean is that of the closed form: rates of the file, the interval of the check."""
    result = judged([*singles(JAM), (row(SWITCH, JAM), outcome("collapse"))])
    known = {item.name: item for item in result.failures}
    switch, jam = known[SWITCH.name], known[JAM.name]
    assert (switch.evident, switch.interval) == (False, 1000.0)
    assert (jam.evident, jam.interval) == (True, 1.0)
    assert switch.rate == pytest.approx(2e-6 * 0.3)
    cut = sets_of(result)[(JAM.name, SWITCH.name)]
    assert cut.dormant == (SWITCH.name,)
    assert cut.mean == pytest.approx(switch.rate * jam.rate * 1001.0 / 2)
    assert cut.worst == pytest.approx(switch.rate * jam.rate * 1000.0)
    assert (cut.low, cut.high) == (
        pytest.approx(cut.mean / 100.0), pytest.approx(cut.mean * 100.0))  # fmt: skip


def test_order_matters_where_rows_show_it() -> None:
    """Only with the jam last, in the middle of the move: no other order, the move's share."""
    result = judged([*singles(JAM), (row(SWITCH, JAM, late=True), outcome("collapse")),
                     (row(JAM, SWITCH, late=True), outcome())])  # fmt: skip
    cut = sets_of(result)[(JAM.name, SWITCH.name)]
    assert cut.last == (JAM.name,)
    known = {item.name: item.rate for item in result.failures}
    share = 15.0 / 3600.0
    form = known[SWITCH.name] * known[JAM.name] * 1000.0 / 2 * share
    assert cut.mean == pytest.approx(form)


def test_supersets_are_dropped_and_severities_do_not_collapse() -> None:
    """A pair with a single failure that leads to the hazard is no cut set; signs are two."""
    plus, minus = (Failure("offset", "sensor.hall", x, several=True) for x in (0.25, -0.25))
    result = outcome("collapse")
    rows = [(row(plus), result), (row(minus), outcome()), (row(plus, JAM), result),
            (row(minus, JAM), result)]  # fmt: skip
    result = judged([*singles(), *rows])
    assert set(sets_of(result)) == {(plus.name,), tuple(sorted((minus.name, JAM.name)))}
    known = {item.name: item for item in result.failures}
    assert known[plus.name].rate == known[minus.name].rate
    assert known[plus.name].rate == pytest.approx(1.7e-5 * 0.1 / 2 * 0.1)


def test_dormant_means_silent_in_every_situation_of_every_flight() -> None:
    """One announcement in a phase of every flight makes it evident, one in a free fall does not."""
    fall = row(BRAKE, steps=((0.1, "free_fall"),))
    silent = judged([*singles(), (fall, outcome(message="fault: motion"))])
    assert not {f.name: f.evident for f in silent.failures}[BRAKE.name]
    later = row(BRAKE, start=EXTENDED, steps=((0.1, "retract"),))
    seen = judged([*singles(), (later, outcome(message="fault: motion"))])
    assert {f.name: f.evident for f in seen.failures}[BRAKE.name]
    usual = row(start=EXTENDED, steps=((0.1, "retract"),), group="no failure")
    both = judged([*singles(), (later, outcome(message="fault: motion")),
                   (usual, outcome(message="fault: motion"))])  # fmt: skip
    assert not {f.name: f.evident for f in both.failures}[BRAKE.name]


def test_a_row_without_a_failure_has_no_rate() -> None:
    """It breaks a rule of its own, and drops no set."""
    result = judged([*singles(), (row(group="no failure"), outcome("collapse"))])
    assert result.hazards[0].mean == 0.0
    assert result.hazards[0].cut_sets == ()
    failed = [check.name for check in result.checks if not check.passed]
    assert "collapse: rows without a failure" in failed


def test_rules_by_name() -> None:
    """A single catastrophe whatever its rate; latent failures and what they leave."""
    pair = (row(SWITCH, JAM), outcome("collapse"))
    rules = {c.name: c for c in judged([*singles(JAM), pair]).checks}
    latent = next(c for name, c in rules.items() if "(b)(5)(iii)" in name)
    left = next(c for name, c in rules.items() if "(b)(5)(ii)" in name)
    assert (latent.value, left.value) == (pytest.approx(6e-4), pytest.approx(1e-7))
    assert latent.passed
    assert left.passed
    alone = judged([*singles(), (row(JAM), outcome("collapse"))])
    broken = next(c for c in alone.checks if "(b)(1)(ii)" in c.name)
    assert (broken.value, broken.passed) == (1.0, False)


def test_a_planted_rate_and_a_planted_interval_are_found(tmp_path: Path) -> None:
    """Each by a rule that holds before: the mean of a flight hour, the sum of latent failures."""
    rows = [*singles(JAM), (row(SWITCH, JAM), outcome("collapse"))]

    def failed(**files):
        checks = judged(rows, **files).checks
        return [c.name for c in checks if not c.passed and "not listed" not in c.name]

    assert failed() == []
    rates = tmp_path / "rates.toml"
    rates.write_text(
        '[[part]]\nname = "screw"\nrate = 1e-3\nsource = "planted"\n'
        'mode = [{ failure = ["jam@screw"], ratio = 0.1, source = "planted" }]\n'
    )
    assert any("mean of a flight hour" in name for name in failed(rates=rates))
    checks = tmp_path / "checks.toml"
    checks.write_text(
        '[[check]]\nname = "gear inspection"\ninterval = "20000 h"\nreveals = ["*"]\n'
    )
    assert any("(b)(5)(iii)" in name for name in failed(checks=checks))


def test_importance_and_the_effect_of_a_check() -> None:
    """Shares of the mean, the derivative by a rate, twice the interval of the check."""
    rows = [*singles(JAM), (row(SWITCH, JAM), outcome("collapse")),
            (row(CABLE, JAM), outcome("collapse"))]  # fmt: skip
    hazard = judged(rows).hazards[0]
    shares = {item.failure: item for item in hazard.importance}
    assert shares[JAM.name].fussell_vesely == pytest.approx(1.0)
    assert shares[SWITCH.name].fussell_vesely + shares[CABLE.name].fussell_vesely == pytest.approx(
        1
    )
    assert shares[JAM.name].birnbaum == pytest.approx(hazard.mean / 1e-7)
    effects = {item.check: item for item in hazard.check_effects}
    test = effects["free-fall test"]
    cable = next(c.mean for c in hazard.cut_sets if CABLE.name in c.failures)
    assert test.twice - hazard.mean == pytest.approx(cable * 500.0 / 501.0, rel=1e-6)
    drawn = fault_tree(hazard)
    assert drawn.count("<circle") == 4
    assert "stroke-dasharray" in drawn


def test_three_failures_are_a_bound() -> None:
    """Those that contain a known set do not count; the bound is the interval's end."""
    known = [*singles(JAM), (row(SWITCH, JAM), outcome("collapse"))]
    triples = [
        (row(SWITCH, JAM, BRAKE, group="three failures"), outcome("collapse")),
        (row(CABLE, JAM, BRAKE, group="three failures"), outcome()),
    ]
    bound = judged(known, triples=triples).hazards[0].third_order
    assert (bound.drawn, bound.showing) == (2, 0)
    assert 0.0 < bound.bound < 1e-6
    assert len(judged(known, triples=triples).hazards[0].cut_sets) == 1


@pytest.mark.parametrize("name", ["pisa-landing-gear", "torino-rotary", "nasa-ballscrew"])
def test_every_failure_has_a_rate_of_one_part(name: str) -> None:
    """Shares of a part sum to at most one; every rate has an interval and a source."""
    study = study_of(elevon.Actuator.load(name), None, None, ())
    assert set(study.rates) == set(study.names)
    parts = itertools.groupby(sorted(study.rates.values(), key=lambda r: r.part), lambda r: r.part)
    for _, members in parts:
        assert sum(item.alpha for item in members) <= 1.0 + 1e-9
    for item in study.rates.values():
        assert 0.0 < item.rate_low <= item.rate <= item.rate_high
        assert item.source


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('[[part]]\nname = "a"\nrate = 1\nsource = "s"\nmode = [{ failure = ["jam@screw"], '
         'ratio = 0.6, source = "s" }, { failure = ["jam@screw"], ratio = 0.6, source = "s" }]',
         "above the limit 1"),
        ('[[part]]\nname = "a"\nrate = 1\nsource = "s"\nmode = [{ failure = ["jam@screws"], '
         'ratio = 0.6, source = "s" }]', "jam@screw"),
        ('[[part]]\nname = "a"\nrate = -1\nsource = "s"\nmode = []', "rate"),
        ('[[part]]\nname = "a"\nrate = 1\nsource = "s"\nbeta = 0.1\nmode = []', "family"),
        ('[[part]]\nname = "a"\nrats = 1', "rate"),
        ('[[part]]\nname = "a"\nrate = 1\nsource = "s"\nmode = [{ failure = ["jam@screw"], '
         'ratio = 0.6, source = "s" }]\n[[part]]\nname = "b"\nrate = 1\nsource = "s"\nmode = '
         '[{ failure = ["jam@screw"], ratio = 0.6, source = "s" }]', "one part alone"),
    ],
)  # fmt: skip
def test_a_wrong_file_of_rates_is_refused(text: str, word: str, tmp_path: Path) -> None:
    """With place, value and limit."""
    file = tmp_path / "rates.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=word):
        read_rates("landing_gear", [JAM.name], file)


def test_a_failure_that_no_check_reveals_is_refused(tmp_path: Path) -> None:
    """And so is an interval of no time."""
    service = read_service("landing_gear")
    assert service.check_of("lock_not_engaging@lock").name == "free-fall test"
    assert service.check_of(SWITCH.name).name == "gear inspection"
    file = tmp_path / "checks.toml"
    file.write_text('[[check]]\nname = "gear inspection"\ninterval = "10 h"\nreveals = ["x"]\n')
    with pytest.raises(InputError, match="no check reveals"):
        read_service("landing_gear", file).check_of(SWITCH.name)
    file.write_text('[[check]]\nname = "c"\ninterval = "0 h"\nreveals = ["x"]\n')
    with pytest.raises(InputError, match="longer than zero"):
        read_service("landing_gear", file)
