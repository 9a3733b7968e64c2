"""What is no candidate is distinguished from what is; each fault of the catalogue has a place."""

from dataclasses import replace
from itertools import combinations
from math import comb

import numpy as np
import pytest

from elevon.diagnose.by_model import diagnose
from elevon.diagnose.engine.answer import Reason
from elevon.diagnose.engine.candidates import CANDIDATES, not_modelled
from elevon.diagnose.engine.case import Detector, JoinedLogs, LogCase
from elevon.diagnose.engine.diagnosis import answer_of
from elevon.diagnose.engine.explain import refuting
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.likelihood import Frame, _somewhere
from elevon.diagnose.engine.lookalikes import SHARE
from elevon.diagnose.engine.page import sentence
from elevon.diagnose.engine.replay import Replay
from elevon.diagnose.engine.table import FeatureVector
from elevon.diagnose.positions.features import FEATURES
from elevon.diagnose.positions.reading import BRAKE_UNKNOWN
from elevon.errors import InputError
from elevon.faults import catalogue
from studies.diagnosis_limits.campaign import calibrated
from studies.diagnosis_limits.logs import Trial, bench_logs
from studies.diagnosis_limits.unit import draw_unit

NAMES = ("lost_motion", "dry_current", "viscous_current", "voltage_order_1", "speed_gain")
BACKLASH = next(c for c in CANDIDATES if c.kind == "backlash")


def _case(values, baselines=(), *, brake_unknown=False):
    """A unit whose features are 1 with a deviation of 2 %; backlash moves the lost motion only."""
    rng = np.random.default_rng(0)
    draws = 1.0 + 0.02 * rng.standard_normal((40, len(NAMES)))
    grid = np.linspace(0.0, BACKLASH.high, 6)
    moved = np.zeros((6, len(NAMES)))
    moved[:, 0] = grid / 0.01
    std = np.full(len(NAMES), 1e-3)
    model = Replay(
        FeatureVector(NAMES, np.ones(5), std), {BACKLASH.key: grid}, {BACKLASH.key: moved},
        BRAKE_UNKNOWN if brake_unknown else FEATURES, draws.mean(axis=0), np.cov(draws.T), 10.0,
    )  # fmt: skip
    logs = [FeatureVector(NAMES, np.array(values), std) for values in baselines]
    unit = healthy(model, NAMES, logs)
    return LogCase("log", FeatureVector(NAMES, np.array(values), std), unit, model)


def test_each_fault_of_the_catalogue_is_candidate_ambiguous_or_not_modelled_once():
    placed = [(c.kind, p) for c in CANDIDATES for p in (c.place, *c.same)]
    placed += [name for c in CANDIDATES for name in c.ambiguous]
    placed += [(item["kind"], item["place"]) for item in not_modelled()]
    known = [(r.kind, place) for r in catalogue("rotary") for place in r.places]
    assert sorted(placed) == sorted(known)


def test_something_else_is_distinguished_from_the_candidates():
    base = [[1.0] * 5]
    other = answer_of([_case([1, 2, 0, 1.3, 2], base)], [BACKLASH], 0.05)
    assert (other.status, other.best, other.faults) == ("unknown_fault", (), ())
    assert other.alarm
    assert other.p_other > 0.9
    assert abs(other.reason.value - 1.0) > abs(other.reason.limit - 1.0)
    assert other.p_fault > 0.9
    assert "none of the candidates" in sentence(other)
    assert any("no candidate explains" in text for text in other.findings)
    backlash = answer_of([_case([1.5, 1, 1, 1, 1], base)], [BACKLASH], 0.05)
    assert backlash.best == (BACKLASH.key,)
    assert backlash.p_other < SHARE  # wind-up looks like it
    assert any("wind-up" in text for text in backlash.findings)
    well = answer_of([_case([1.01, 1, 0.98, 1, 1], base)], [BACKLASH], 0.05)
    assert well.status == "healthy"
    assert well.p_other < 0.02


def test_one_feature_that_no_candidate_moves_is_something_else():
    """A fault that explains a part of it does not win for want of a better one."""
    for values in ([1, 1, 1, 1, 1.8], [1.05, 1, 1, 1, 1.8]):
        answer = answer_of([_case(values, [[1.0] * 5])], [BACKLASH], 0.05)
        assert answer.status == "unknown_fault"
        assert answer.p_other > 0.5
        assert answer.reason.feature == "speed_gain"


def test_the_best_few_features_are_those_of_all_sets():
    """Determinant and square by the matrices themselves, over every set of four features."""
    rng = np.random.default_rng(0)
    half = rng.standard_normal((4, 4))
    covariance = half @ half.T + np.eye(4)
    y = rng.standard_normal(4) * [1.0, 30.0, 1.0, 10.0]
    frame = Frame(y, covariance, 10.0, lambda _key, s: np.zeros((len(s), 4)), np.zeros(4))
    logs = []
    for n in range(1, 5):
        best = -np.inf
        for some in map(list, combinations(range(4), n)):
            wide = covariance.copy()
            wide[some, some] += 9.0 * np.diag(covariance)[some]
            square = float(y @ np.linalg.solve(wide, y))
            best = max(best, -0.5 * np.linalg.slogdet(wide)[1] - 7.0 * np.log1p(square / 10.0))
        logs.append(best - n * np.log(2.0) - np.log(comb(4, n)))
    assert _somewhere(frame, 3.0) == pytest.approx(np.logaddexp.reduce(logs), rel=1e-9)


def test_a_cause_that_a_feature_refutes_is_not_named():
    known, base = [(BACKLASH, 0.002)], [[1.0] * 5]
    assert refuting(JoinedLogs((_case([1.2, 1, 1, 1, 1], base),)), known) is None
    assert refuting(JoinedLogs((_case([1.2, 1, 1, 1, 9.0], base),)), known).feature == "speed_gain"


def test_a_fault_may_move_a_number_that_the_model_leaves_alone_by_a_share_of_its_shift():
    """Backlash of 24 deviations and one of 3.5 in another number is backlash; of 20, another."""
    base = [[1.0] * 5]
    std = float(np.sqrt(_case(base[0], base).covariance[4, 4]))
    near, far = ([1.7, 1, 1, 1, 1 + k * std] for k in (3.5, 20.0))
    named = answer_of([_case(near, base)], [BACKLASH], 0.05)
    assert (named.status, named.best) == ("faulty", (BACKLASH.key,))
    assert answer_of([_case(far, base)], [BACKLASH], 0.05).status == "unknown_fault"


def test_one_feature_alone_is_a_direction_of_the_test():
    """A number that no candidate moves is seen by itself, at the rate that is set."""
    base = [[1.0] * 5]
    std = float(np.sqrt(_case(base[0], base).covariance[4, 4]))
    case = _case([1, 1, 1, 1, 1 + 4.25 * std], base)
    logs = JoinedLogs((case,))
    detector = logs.detector([BACKLASH])
    assert logs.score(detector) > detector.threshold(0.05)


def test_a_unit_that_the_model_does_not_show_is_not_diagnosed():
    wrong = Reason("dry_current", 3.0, 1.2)
    gated = answer_of([replace(_case([1] * 5, [[1.0] * 5]), misfit=wrong)], [BACKLASH], 0.05)
    assert (gated.status, gated.best, gated.faults) == ("model_does_not_fit", (), ())
    assert (gated.hypotheses, gated.reason, gated.alarm) == ((), wrong, False)


def test_the_rate_holds_with_a_share_for_other_directions():
    """Of 20 000 fresh healthy units 5 % within four deviations; off the candidates' way, all."""
    detector = Detector(np.eye(6)[:2], [True, False], 12.0, 0.2)
    rng = np.random.default_rng(3)
    fresh = rng.standard_normal((20_000, 6)) / np.sqrt(rng.chisquare(12, 20_000) / 12)[:, None]
    share = float(np.mean(detector.score(fresh) > detector.threshold(0.05)))
    assert share == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 20_000))
    off = np.array([[0.0, 0.0, 0.0, 7.0, 7.0, 0.0]])
    assert detector.ratio(off)[0] == 0.0
    assert detector.score(off)[0] > detector.threshold(0.05)


def test_the_assumed_distance_from_the_model_yields_to_a_baseline():
    near, far = ([1.0, 1.05, 1, 1, 1], [2.0, 1.05, 1, 1, 1])
    assert _case(far, [far]).unit.mean[0] == pytest.approx(2.0, abs=0.02)
    # Within what is assumed the baseline counts by its precision, with and without the far number.
    assert _case(far, [far]).unit.mean[1] == pytest.approx(
        _case(near, [near]).unit.mean[1], abs=0.01
    )


def test_of_a_brake_of_unknown_torque_a_baseline_says_all_of_friction():
    values = [1.0, 1.15, 1, 1, 1]
    known, brake_unknown = (_case(values, [values], brake_unknown=h).unit for h in (False, True))
    assert brake_unknown.mean[1] == pytest.approx(1.15, abs=2e-3)
    assert known.mean[1] < 1.147
    assert _case(values, brake_unknown=True).unit.covariance[1, 1] > 50.0


#: A clear severity of each fault that the switching model has, by its kind and place.
CLEAR = {
    "short@motor.phase_a": 0.3, "eccentricity_static@motor": 0.2, "eccentricity_dynamic@motor": 0.2,
    "resistor_short@motor.phase_a": 0.2, "phase_short@motor.phases_ab": 0.01,
    "ground_short@motor.phase_a": 0.005, "unbalance@motor.rotor": 3e-4,
    "open_phase@motor.phase_a": 1.0, "open_switch@inverter.a_high": 1.0,
    "shorted_switch@inverter.a_low": 1.0, "connector_open@supply": 1.0,
    "demagnetisation@motor": 0.15,
    "local_demagnetisation@motor": 0.4, "sag@supply": 0.3, "gain@sensor.current_a": 0.15,
    "offset@sensor.current_a": 0.3, "friction@transmission": 0.5, "lubrication@transmission": 2.0,
    "backlash@transmission": 0.004, "bearing@bearing.outer": 0.002, "stator_rub@motor": 0.5,
    "bearing@bearing.cage": 0.1, "tooth_wear@gear": 0.004, "chipped_tooth@gear": 0.004,
    "jam@transmission": 0.3, "gain_drift@control.position": 0.03, "gain_drift@control.speed": 0.4,
    "dropout@sensor.resolver": 0.2, "mismatch@sensor.resolver": 0.05,
    "offset@sensor.resolver": 0.05, "offset@sensor.encoder": 0.02, "gain@sensor.resolver": 0.01,
    "gain@sensor.encoder": 0.01, "missing_counts@sensor.encoder": 0.1,
    "dark_sectors@sensor.encoder": 0.1, "resolver_short@sensor.resolver.sine": 0.1,
    "resolver_short@sensor.resolver.excitation": 0.3, "resolver_open@sensor.resolver.sine": 1.0,
    "quadrature@sensor.resolver": 0.05, "channel_offset@sensor.resolver.sine": 0.05,
    "channel_offset@sensor.resolver.cosine": 0.05, "interpolation@sensor.encoder.first": 0.1,
    "interpolation@sensor.encoder.second": 0.1,
    "stuck@sensor.resolver": 1.0, "stuck@sensor.encoder": 1.0, "stuck@sensor.current_a": 1.0,
    "dead@sensor.encoder": 1.0, "dead@sensor.current_a": 1.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def bench():
    unit = draw_unit(7100, 0)
    return unit, *calibrated(unit, 7100, None)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
@pytest.mark.parametrize("test", ["noload", "loaded"])
def test_no_fault_of_the_catalogue_is_called_another(bench, test, tmp_path):
    """Each is named, ambiguous, or not_modelled with a reason that says what it may be named."""
    unit, actuator, baselines = bench
    reasons = {f"{i['kind']}@{i['place']}": i["reason"] for i in not_modelled()}
    wrong = []
    faults = list(CLEAR.items())
    trials = [
        Trial(f"f{k}", test, (f"{key}={severity}",), 500 + k)
        for k, (key, severity) in enumerate(faults)
    ]
    for (key, severity), log in zip(faults, _made(unit, trials, tmp_path), strict=True):
        try:
            answer = None if log is None else diagnose([log], actuator, baselines=baselines)
        except InputError:  # refused: no motion, or positions that contradict each other
            continue
        if answer is not None:
            wrong += [f"{test}: {key}: {text}" for text in _wrong(answer, key, severity, reasons)]
    assert wrong == []


def _made(unit, trials, folder):
    """Logs, eight in a batch; None for one that cannot even be read."""
    out = []
    for k in range(0, len(trials), 8):
        block = trials[k : k + 8]
        try:
            out += bench_logs(unit, block, folder / "all")
        except InputError:
            for trial in block:
                try:
                    out += bench_logs(unit, [trial], folder / "alone")
                except InputError:
                    out.append(None)
    return out


def _wrong(answer, key, severity, reasons):
    """Say what is wrong with an answer about one fault."""
    blind = {f"{i['kind']}@{i['place']}" for i in answer.unobservable}
    below = severity < answer.detectable.get(key, 0.0)
    named = set()
    for cause in answer.faults:
        names = {f"{cause.kind}@{cause.place}", *(f"{k}@{p}" for k, p in cause.ambiguous_with)}
        named |= names
        stated = any(name in reasons.get(key, "") for name in names)
        if (
            cause.probability > 0.9
            and key not in names
            and not stated
            and not _named_too(answer, key)
        ):
            yield f"called {cause.kind}@{cause.place} with {cause.probability:.2f}"
    if key not in named | blind | set(reasons) and not below:
        yield f"nowhere: {answer.status}, {answer.best}"


def _named_too(answer, key):
    """Whether the fault is named, too: a second one beside it is another question."""
    return any(
        key in {f"{c.kind}@{c.place}", *(f"{k}@{p}" for k, p in c.ambiguous_with)}
        for c in answer.faults
        if c.probability > 0.5
    )
