"""Diagnosis by the trained trees."""

import json
from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.diagnose.engine.candidates import CANDIDATES
from elevon.diagnose.positions.features import FEATURES, features_of, median
from elevon.diagnose.positions.lost_motion import carried
from elevon.diagnose.surrogate import (
    Surrogate,
    diagnose_by_both,
    diagnose_by_surrogate,
    shipped,
)
from elevon.diagnose.surrogate.features import NAMES, changes, log_features
from elevon.diagnose.surrogate.population import (
    FAULTS,
    _stable,
    build_of,
    day_of,
    learned,
    unit_of,
)
from elevon.diagnose.surrogate.sampling import severities, sizes
from elevon.diagnose.surrogate.table import SINGLE_FAULTS
from elevon.errors import FormatError, InputError
from elevon.logs.brake import Brake
from elevon.nexttest.belief import Answered
from elevon.prognose.history import known_keys
from elevon.simulate.acting import check_values
from elevon.training.campaign import _Plan, _unit_runs
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture
from tests.diagnose.virtual import bench_logs

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
BACKLASH = "backlash@transmission=0.3 deg"
SHORT = "short@motor.phase_b=0.25"


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})


@pytest.fixture(scope="module")
def logs(unit):
    cases = [(1, []), (2, []), (3, [BACKLASH]), (4, [SHORT]), (5, ["gain@sensor.encoder=0.1"])]
    return dict(
        zip(("base", "healthy", "backlash", "short", "far"), bench_logs(unit, cases), strict=True)
    )


def test_sizes_and_severities_are_inverse():
    rng = np.random.default_rng(1)
    low, high = (np.array([getattr(c, end) for c in learned()]) for end in ("low", "high"))
    severity = low + rng.random((50, len(FAULTS))) * (high - low)
    np.testing.assert_allclose(severities(sizes(severity)), severity, rtol=1e-12)
    assert np.abs(sizes(severity)).max() <= 1.0
    assert (severities(np.full(len(FAULTS), 3.0)) == high).all()


def test_features_are_the_evidence_and_the_position_gain(unit, logs):
    features = log_features(logs["healthy"], unit)
    assert set(NAMES) <= set(FEATURES)
    values = dict(zip(NAMES, features.values, strict=True))
    assert values["lost_motion"] == pytest.approx(unit.parameters.value("backlash.total"), rel=0.01)
    gain = unit.parameters.value("control.position_gain")
    assert values["following_gain"] == pytest.approx(1.0 / gain, rel=0.005)
    assert np.isnan(values["brake_current"])


def test_evidence_without_deviations_is_the_same(unit, logs):
    """The surrogate and the model's runs need the numbers alone; they must be the same ones."""
    signals = replace(logs["short"], gain=(150.0, 1.0), brake=Brake.none())
    value = unit.parameters.value
    about = {"ratio": value("gear.ratio"), "pole_pairs": value("motor.pole_pairs"), "emf": 1.0}
    whole = features_of(signals, **about)
    quick = features_of(signals, **about, deviations=False, shaft=False)
    turning = {"current_shaft", "current_sideband", "voltage_sideband"}
    assert set(whole.names) - set(quick.names) == turning
    np.testing.assert_allclose(quick.values, whole.only(quick.names).values, rtol=1e-9)
    assert (whole.std > 0.0).all()
    assert np.isnan(quick.std[:-1]).all()  # the position gain's is given


def test_a_gap_is_passed_once_the_driver_has_gone_its_width():
    driver = np.concatenate((np.arange(0.0, 10.0), np.arange(10.0, -5.0, -1.0)))
    expected = np.concatenate((np.arange(0.0, 10.0), [10.0], np.arange(1.0, 15.0))) > 4.5
    out = carried(driver, 3.0)
    np.testing.assert_array_equal(out[:10], expected[:10])
    assert not out[11:15].any()
    assert out[16:].all()


@pytest.mark.parametrize("count", [1, 2, 3, 8, 801])
def test_the_median_is_numpys(count):
    values = np.random.default_rng(count).standard_normal(count)
    assert median(values) == np.median(values)


def test_a_change_is_a_share_where_it_scales():
    healthy, floor = np.full(len(NAMES), 2.0), np.zeros(len(NAMES))
    change = dict(zip(NAMES, changes(healthy + 0.5, healthy, floor), strict=True))
    assert change["dry_current"] == pytest.approx(0.25)
    assert change["lost_motion"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("name", "best"), [("healthy", ()), ("backlash", (FAULTS[0],)), ("short", (FAULTS[3],))]
)
def test_the_surrogate_names_the_fault(unit, logs, name, best):
    result = diagnose_by_surrogate([logs[name]], unit, baselines=[logs["base"]])
    assert result.best == best
    assert result.status == ("faulty" if best else "healthy")
    assert not any("outside" in text for text in result.findings)
    if best:
        cause = result.faults[0]
        true = np.radians(0.3) if name == "backlash" else 0.25
        assert cause.interval[0] < true < cause.interval[1]
    if name == "short":
        assert set(cause.ambiguous_with) == {("short", "motor.phase_b"), ("short", "motor.phase_c")}


def test_both_is_the_model_on_what_was_proposed(unit, logs):
    result = diagnose_by_both([logs["short"]], unit, baselines=[logs["base"]])
    assert result.best == (FAULTS[3],)
    assert any("surrogate: proposed" in text for text in result.findings)
    listed = {f"{i['kind']}@{i['place']}" for i in result.unobservable} | set(result.detectable)
    # What it was not trained on it cannot rule out.
    assert {c.key for c in CANDIDATES} - set(FAULTS) <= listed < {c.key for c in CANDIDATES}


def test_sets_of_faults_share_the_probability(unit, logs):
    """What next-test reads: each set with its own probability, the likeliest first."""
    words = ([logs["short"]], unit)
    for way in (diagnose_by_surrogate, diagnose_by_both):
        result = way(*words, baselines=[logs["base"]])
        shares = [item.probability for item in result.hypotheses]
        assert shares == sorted(shares, reverse=True)
        assert sum(shares) == pytest.approx(1.0, abs=0.05)
        first = result.hypotheses[0]
        assert [f"{f.kind}@{f.place}" for f in first.faults] == list(result.best)
        assert first.faults[0].interval[0] < first.faults[0].severity < first.faults[0].interval[1]
        answered = Answered.of(json.loads(json.dumps(result.to_dict())))
        assert answered.possible[result.best].weight == shares[0]


def test_a_history_takes_what_a_diagnosis_says(unit, logs):
    """`elevon predict` refuses keys that it does not know; a diagnosis must have none."""
    findings = diagnose_by_surrogate([logs["short"]], unit, baselines=[logs["base"]]).to_dict()
    assert set(findings) <= known_keys()


def test_two_logs_of_a_unit_are_surer_than_one(unit, logs):
    one = diagnose_by_surrogate([logs["short"]], unit, baselines=[logs["base"]])
    again = replace(logs["short"], name="again")
    two = diagnose_by_surrogate([logs["short"], again], unit, baselines=[logs["base"]])
    width = [r.faults[0].interval[1] - r.faults[0].interval[0] for r in (one, two)]
    assert width[1] < width[0]
    assert two.p_fault >= one.p_fault


def test_a_faulty_baseline_is_named(unit, logs):
    def named(item, name):
        return replace(item, name=name)

    healthy = [logs["base"], logs["healthy"]]  # of one name, as files of two folders are
    faulty = named(logs["backlash"], "third")
    log = bench_logs(unit, [(9, [])])
    result = diagnose_by_surrogate(log, unit, baselines=[*healthy, faulty])
    assert result.status == "healthy"
    findings = [text for text in result.findings if "looks faulty itself" in text]
    assert len(findings) == 1
    assert "third" in findings[0]
    assert "left out" in findings[0]
    sound = diagnose_by_surrogate(log, unit, baselines=healthy)
    assert not any("looks faulty" in text for text in sound.findings)


def test_what_was_not_trained_is_said(unit, logs):
    result = diagnose_by_surrogate([logs["far"]], unit, baselines=[logs["base"]])
    assert any("outside the training set" in text for text in result.findings)
    with pytest.raises(InputError, match="not trained on such a test"):
        diagnose_by_surrogate(bench_logs(unit, [(1, [])], procedure="chirp"), unit)
    without = logs["backlash"].without("torque_current")
    with pytest.raises(InputError, match="r78"):
        diagnose_by_surrogate([without], unit)


def test_a_unit_unlike_the_trained_ones_is_said():
    """Its logs agree with its own baseline: what is unlike is the unit, or that nothing braked."""
    rough = Actuator.load("torino-rotary").with_values(
        {"friction.dynamic": 1.2, "friction.static": 1.6}
    )
    log, base = bench_logs(rough, [(1, []), (2, [])])
    findings = diagnose_by_surrogate([log], rough, baselines=[base]).findings
    assert any("unit whose healthy dry_current" in text for text in findings)
    plain = Actuator.load("torino-rotary")
    cases = bench_logs(plain, [(1, []), (2, [])], procedure="loaded")
    bare = [replace(item, brake=replace(item.brake, known="on")) for item in cases]
    with pytest.raises(InputError, match="not trained on such a test"):
        diagnose_by_surrogate(bare[:1], plain, baselines=bare[1:])


def test_a_log_without_voltage_is_still_read(unit, logs):
    without = logs["backlash"].without("torque_voltage")
    result = diagnose_by_surrogate([without], unit, baselines=[logs["base"]])
    assert result.best == (FAULTS[0],)


def test_the_file_that_ships(tmp_path):
    ours = shipped()
    assert set(ours.tests) == {"backlash", "loaded"}
    path = ours.save(tmp_path / "again.npz")
    assert path.stat().st_size < 3_000_000
    again = Surrogate.load(path)
    for name, test in ours.tests.items():
        for view, head in test.heads.items():
            other = again.tests[name].heads[view]
            np.testing.assert_array_equal(head.known, other.known)
            for part, kept in head.ensemble.trees.arrays().items():
                np.testing.assert_array_equal(kept, other.ensemble.trees.arrays()[part])
    for damage in (path.read_bytes()[:-2000], b"nothing"):
        (tmp_path / "bad.npz").write_bytes(damage)
        with pytest.raises(FormatError):
            Surrogate.load(tmp_path / "bad.npz")


def test_days_asked_are_days_of_the_same_units(unit):
    drawn = next(_unit_runs(_Plan(unit, "loaded", 0, "low", False), 3))
    words = list(_unit_runs(_Plan(unit, "loaded", 0, "low", True), 3))
    assert [p.faults for p in words] == [{k: v} for k, v in SINGLE_FAULTS["loaded"].items()]
    path = "gear.inertia"  # of the unit, the same on every day
    inertia = {p.setup.actuator.parameters.value(path) for p in (drawn, *words)}
    assert len(inertia) == 1
    assert not any(p.baseline for p in words)


def test_units_and_days_differ(unit):
    rng = np.random.default_rng(5)
    build = build_of(rng)
    first, second = unit_of(unit, build, rng), unit_of(unit, build, rng)
    day = day_of(first, rng).actuator
    dry = [u.parameters.value("friction.dynamic") for u in (first, second, day)]
    assert len(set(dry)) == 3
    assert dry[2] / dry[0] == pytest.approx(1.0, abs=0.3)
    assert first.parameters["drive.kind"].value == build["drive.kind"]


def test_a_unit_whose_current_loop_bears_no_such_derivative_gets_a_slower_one(unit):
    gain, time = (unit.parameters.value(f"control.{n}") for n in ("speed_gain", "derivative_time"))
    ticks = {"drive.kind": "hysteresis", "control.sample_time": 1e-3}
    hard = {**ticks, "control.speed_gain": 1.5 * gain, "control.derivative_time": 1.2 * time}
    with pytest.raises(InputError, match="current loop bears"):
        check_values(unit.with_values(hard), "high")
    slower = _stable(unit.with_values(hard))
    assert slower.parameters.value("control.derivative_time") < time
    assert slower.parameters.value("control.speed_gain") == 1.5 * gain
    check_values(slower.with_values({"control.speed_gain": 1.6 * gain}), "high")
    assert _stable(unit) is unit


def test_the_command_line(elevon_cli, tmp_path):  # noqa: F811
    for name, seed, faults in (("base", 1, []), ("log", 3, ["--fault", BACKLASH])):
        elevon_cli("bench", "run", "backlash", "--actuator", "torino-rotary", "--fidelity", "low",
                   "--out", tmp_path / name, "--seed", seed, *faults)  # fmt: skip
    log, base = (tmp_path / n / "backlash.csv" for n in ("log", "base"))
    words = ("diagnose", log, "--actuator", "torino-rotary", "--baseline", base, "--json")
    result = elevon_cli(*words, "--method", "surrogate")
    assert result.code == 0
    document = json.loads(result.out)
    assert document["method"] == "surrogate"
    assert document["best"]["faults"] == [FAULTS[0]]
    assert elevon_cli(*words, "--method", "magic").code == 2
    assert elevon_cli(*words, "--surrogate", tmp_path / "none.npz").code == 2
    assert elevon_cli(*words, "--method", "both", "--surrogate", tmp_path / "none.npz").code == 2


@pytest.mark.long
def test_training_by_one_command(elevon_cli, tmp_path):  # noqa: F811
    out = tmp_path / "own.npz"
    words = ("diagnose-train", "--out", out, "--units", "8", "--low-units", "16", "--rounds", "20",
             "--test-units", "2", "--runs", tmp_path / "runs", "--json")  # fmt: skip
    first = elevon_cli(*words)
    assert first.code == 0
    whole = out.read_bytes()
    again = elevon_cli(*words, "--force")
    assert json.loads(again.out) == json.loads(first.out)
    assert out.read_bytes() == whole
    assert set(Surrogate.load(out).tests) == {"backlash", "loaded"}
