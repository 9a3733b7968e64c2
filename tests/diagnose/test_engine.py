"""Diagnosis by the model on logs of the virtual bench."""

import json

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.diagnose.by_model import DiagnosisRequest, diagnose
from elevon.diagnose.engine.candidates import CANDIDATES, chosen
from elevon.diagnose.engine.case import Detector, JoinedLogs, case_of
from elevon.diagnose.engine.posterior import marginals, posterior, quantiles
from elevon.diagnose.engine.replay import _RECENT, replay
from elevon.diagnose.positions.log import LONGEST, _first_part
from elevon.diagnose.positions.reading import PositionReading
from elevon.errors import InputError, UnknownNameError
from elevon.logs.drive import drive_log
from elevon.logs.log import Log
from elevon.logs.read import read_logs
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture
from tests.diagnose.virtual import bench_logs

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
NAME = "backlash.csv"
FEW = ["backlash@transmission", "friction@transmission"]


def bench(folder, seed, *faults, fidelity="low", settings=(), procedure="backlash"):
    from elevon.cli import main

    options = [x for f in faults for x in ("--fault", f)] + [
        x for s in settings for x in ("--set", s)
    ]
    code = main(["bench", "run", procedure, "--actuator", "torino-rotary", "--out", str(folder),
                 "--seed", str(seed), "--fidelity", fidelity, *options])  # fmt: skip
    assert code == 0
    return folder / NAME


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    root = tmp_path_factory.mktemp("logs")
    return {
        "base": bench(root / "base", 1),
        "healthy": bench(root / "healthy", 2),
        "backlash": bench(root / "backlash", 3, "backlash@transmission=0.13 deg"),
        "short": bench(root / "short", 4, "short@motor.phase_b=0.2"),
    }


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary")


def answer(unit, path, *baselines, **options):
    return diagnose(read_logs([path]), unit, baselines=read_logs(baselines), **options)


def test_a_healthy_log_is_healthy(unit, logs):
    result = answer(unit, logs["healthy"], logs["base"])
    assert result.status == "healthy"
    assert result.best == ()
    assert result.p_fault < 0.1


@pytest.mark.parametrize(
    ("name", "key", "severity"),
    [
        ("backlash", "backlash@transmission", np.radians(0.13)),
        ("short", "short@motor.phase_a", 0.2),
    ],
)
def test_a_fault_is_isolated_with_its_severity(unit, logs, name, key, severity):
    result = answer(unit, logs[name], logs["base"])
    assert result.status == "faulty"
    assert result.best == (key,)
    cause = result.faults[0]
    assert f"{cause.kind}@{cause.place}" == key
    assert cause.interval[0] < severity < cause.interval[1]
    assert cause.severity == pytest.approx(severity, rel=0.1)
    against = {item.fault: item for item in result.alternatives}
    assert key not in against
    moved = "lost_motion" if name == "backlash" else "voltage_order_2"
    assert against[""].name in (moved, "current_order_2")
    assert against[""].left > 3.0
    assert against["friction@transmission"].probability < 0.01
    if name == "short":
        assert set(cause.ambiguous_with) == {("short", "motor.phase_b"), ("short", "motor.phase_c")}


def test_without_the_voltage_a_short_and_a_current_sensor_are_one_cause(unit):
    """Both scale one phase's share of the torque; only the EMF separates them."""
    pwm = unit.with_values({"drive.kind": "pwm"})
    made = bench_logs(pwm, [(1, []), (2, ["short@motor.phase_b=0.2"])])
    base, log = (item.without("torque_voltage") for item in made)
    result = diagnose([log], pwm, baselines=[base])
    assert result.status == "faulty"
    cause = result.faults[0]
    kinds = {cause.kind, *(kind for kind, _ in cause.ambiguous_with)}
    assert {"short", "gain"} <= kinds
    assert {p for k, p in cause.ambiguous_with if k == "gain"} >= {
        f"sensor.current_{p}" for p in "bc"
    }
    reasons = {(item["kind"], item["place"]): item["reason"] for item in result.unobservable}
    assert "3 deviations" in reasons["sag", "supply"]
    assert "short" in reasons["open_phase", "motor.phase_a"]
    assert ("bearing", "bearing.cage") in reasons


@pytest.mark.long
@pytest.mark.parametrize("fidelity", ["low", "high"])
def test_an_eccentric_rotor_is_one_of_a_periodic_flux(unit, fidelity):
    """Unless the actuator states its law: named by its own and by none other."""
    pwm = unit.with_values({"drive.kind": "pwm"})
    laws = {law: pwm.with_values({"motor.eccentricity_law": law}, request=False)
            for law in ("periodic", "published")}  # fmt: skip
    best = {}
    for law, bench_unit in laws.items():
        cases = [(1, []), (2, ["eccentricity_static@motor=0.1"])]
        base, log = bench_logs(bench_unit, cases, fidelity=fidelity)
        result = diagnose([log], pwm, baselines=[base])
        best[law] = result.best
        assert result.alarm
        if law == "periodic":
            low, high = result.faults[0].interval
            assert low < 0.1 < high
        else:
            stated = diagnose([log], bench_unit, baselines=[base])
            assert stated.best == ("eccentricity_static@motor",)
    assert best["periodic"] == ("eccentricity_static@motor",)
    assert best["published"] != ("eccentricity_static@motor",)


def test_what_a_fault_leaves_alone_or_to_chance_is_no_evidence_of_it(unit, logs):
    item = PositionReading(read_logs([logs["base"]])[0], unit)
    turning = next(c for c in CANDIDATES if c.kind == "eccentricity_dynamic")
    sensor = next(c for c in CANDIDATES if c.place == "sensor.current_a")
    model = replay(item, [turning, sensor])
    names = np.array(model.healthy.names)
    moved = model.shift(turning.key, np.array([0.3]))[0]
    assert set(names[moved != 0.0]) == {"current_sideband", "voltage_sideband"}
    assert model.uncertainty(turning.key, 0.3)[names == "inertia_current"] > 0.0
    assert not model.uncertainty(turning.key, 0.3)[moved != 0.0].any()
    moved_by_gain = model.shift(sensor.key, np.array([0.2]))[0]
    assert not moved_by_gain[np.isin(names, sensor.fixed_features)].any()
    assert moved_by_gain[names == "current_order_2"] > 0.0
    assert not model.uncertainty(sensor.key, 0.2).any()


@pytest.mark.parametrize("baselines", [pytest.param((), marks=pytest.mark.long), ("base",)])
def test_an_answer_does_not_depend_on_what_was_asked_before(unit, logs, baselines):
    def chance_of(name):
        whole = answer(unit, logs[name], *(logs[b] for b in baselines), faults=FEW).to_dict()
        return {k: v for k, v in whole.items() if k != "seconds"}

    _RECENT.clear()
    alone = chance_of("backlash")
    _RECENT.clear()
    other = chance_of("healthy")
    assert chance_of("backlash") == alone != other


def test_the_runs_of_a_baseline_stand_about_the_logs_own_healthy_run(unit, logs):
    item, base = (PositionReading(*read_logs([logs[n]]), unit) for n in ("healthy", "base"))
    few = chosen(FEW)
    lent, direct, theirs = (
        replay(item, few, [base]),
        replay(item, few),
        replay(base, few),
    )
    np.testing.assert_array_equal(lent.healthy.values, direct.healthy.values)
    np.testing.assert_array_equal(lent.shifts[FEW[0]], theirs.shifts[FEW[0]])
    np.testing.assert_array_equal(lent.spread, theirs.spread)
    np.testing.assert_allclose(
        lent.mean - lent.healthy.values, theirs.mean - theirs.healthy.values, rtol=0.0, atol=1e-12
    )
    assert (lent.healthy.values != theirs.healthy.values).any()


def test_what_moves_next_to_nothing_gives_the_detector_no_direction(unit, logs):
    item = PositionReading(*read_logs([logs["healthy"]]), unit)
    every = chosen([*FEW, "sag@supply"])
    case = case_of(item, every, [])
    root = np.linalg.inv(np.linalg.cholesky(case.covariance))
    at = case.model.severities["sag@supply"][1:]
    size = np.linalg.norm(case.shift("sag@supply", at) @ root.T, axis=1)
    assert 0.0 < size.max() < 2.0
    scores = [JoinedLogs((case,)).detector(c).chance(4.0) for c in (every, every[:2])]
    assert scores[0] == scores[1]


def test_a_faulty_baseline_is_named_and_left_out(unit, logs):
    result = answer(unit, logs["healthy"], logs["base"], logs["short"])
    assert result.status == "healthy"
    # Both baselines' files have one name: the folder says which it is.
    assert any(f"short/{NAME} looks faulty" in text for text in result.findings)


def test_the_command_line(elevon_cli, logs, tmp_path):  # noqa: F811
    page = tmp_path / "page.html"
    result = elevon_cli("diagnose", logs["backlash"], "--actuator", "torino-rotary", "--baseline",
                        logs["base"], "--fault", "backlash@transmission", "--fault",
                        "friction@transmission", "--report", page, "--json")  # fmt: skip
    assert result.code == 0
    document = json.loads(result.out)
    assert document["status"] == "faulty"
    assert document["faults"][0]["kind"] == "backlash"
    assert document["parameter_hash"] == Actuator.load("torino-rotary").hash
    assert document["made_by"] == elevon.__version__
    assert [name.endswith(NAME) for name in document["baselines"]] == [True]
    assert "Backlash has grown by" in page.read_text()
    assert "what speaks against each" in page.read_text()
    assert "Signals against the healthy model" in page.read_text()
    refused = elevon_cli(
        "diagnose", logs["backlash"], "--actuator", "torino-rotary", "--fault", "rust"
    )
    assert refused.code == 2
    assert (
        elevon_cli(
            "diagnose", logs["backlash"], "--actuator", "torino-rotary", "--false-alarm", "0"
        ).code
        == 2
    )


def test_the_model_with_what_is_named_shows_what_the_log_shows(unit, logs):
    """The page's signals: the healthy model misses the log's backlash, the named one does not."""
    items = read_logs([logs["backlash"]])
    base = read_logs([logs["base"]])
    result = diagnose(items, unit, baselines=base, faults=FEW)
    traces, healthy = DiagnosisRequest(items, base, unit).traces(result)
    assert (traces.baseline, healthy.baseline, healthy.name) == (False, True, base[0].name)
    assert healthy.panels[0].named is None
    assert healthy.panels[0].apart < 0.3 * traces.panels[0].apart
    gap = traces.panels[0]
    misses = [float(np.std(gap.log - line)) for line in (gap.healthy, gap.named)]
    assert gap.unit == "deg"
    assert misses[0] > 0.05
    assert misses[1] < 0.3 * misses[0]


def _edited(source, target, change):
    """Copy a log with its note; `change` is given its rows as lists of text."""
    lines = source.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    rows = change(rows) or rows
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text("\n".join(",".join(row) for row in rows) + "\n")
    note = source.with_name(source.stem + "_command.json")
    target.with_name(target.stem + "_command.json").write_text(note.read_text())
    return target


def test_logs_that_cannot_be_diagnosed(unit, logs, tmp_path):
    short = _edited(logs["healthy"], tmp_path / "a" / NAME, lambda rows: rows[:801])
    with pytest.raises(InputError, match="lasts"):
        answer(unit, short)
    other = unit.with_values({"gear.ratio": 60.0})
    with pytest.raises(InputError, match="another actuator"):
        answer(other, logs["healthy"])

    def at_rest(rows):
        first = rows[1]
        return [rows[0], *([row[0], *first[1:3], "0", "0", *first[5:]] for row in rows[1:])]

    moved_by_gain = _edited(logs["healthy"], tmp_path / "b" / NAME, at_rest)
    with pytest.raises(InputError, match="nothing moves"):
        answer(unit, moved_by_gain)
    gaps = _edited(
        logs["healthy"], tmp_path / "c" / NAME,
        lambda rows: [*rows[:900], *([r[0], *["NaN"] * (len(r) - 1)] for r in rows[900:])],
    )  # fmt: skip
    with pytest.raises(InputError, match="can be used"):
        answer(unit, gaps)
    with pytest.raises(UnknownNameError):
        answer(unit, logs["healthy"], faults=["backlash@moon"])
    with pytest.raises(InputError, match="not modelled: not in the reduced-order model"):
        answer(unit, logs["healthy"], faults=["open_phase@motor.phase_a"])


def test_a_log_without_measured_current_tells_what_is_left(unit, logs, tmp_path):
    column = logs["backlash"].read_text().splitlines()[0].split(",").index("Drive_axis_1.r78")
    without, base = (
        _edited(
            logs[name], tmp_path / name / NAME,
            lambda rows: [r[:column] + r[column + 1 :] for r in rows],
        )
        for name in ("backlash", "base")
    )  # fmt: skip
    result = answer(unit, without, base, faults=FEW)
    assert result.best == ("backlash@transmission",)
    assert any("r78" in text for text in result.findings)


def test_missing_stretches_are_left_out(unit, logs, tmp_path):
    def blank(rows):
        for row in rows[3000:3600]:
            row[4] = row[6] = "nan"

    result = answer(
        unit, _edited(logs["backlash"], tmp_path / NAME, blank), logs["base"], faults=FEW
    )
    assert result.best == ("backlash@transmission",)
    assert any("samples are missing" in text for text in result.findings)


def test_the_threshold_keeps_its_rate():
    """Draws that the threshold has not seen exceed it at the rate it was set for."""
    rng = np.random.default_rng(7)
    ways = rng.standard_normal((6, 9))
    detector = Detector(ways, [True, False] * 3, 12.0)
    fresh = rng.standard_normal((20_000, 9)) / np.sqrt(rng.chisquare(12.0, 20_000) / 12.0)[:, None]
    share = float(np.mean(detector.ratio(fresh) > detector.threshold(0.05)))
    assert share == pytest.approx(0.05, abs=4 * np.sqrt(2 * 0.05 * 0.95 / 20_000))


def test_severities_cover_what_was_drawn():
    """With a linear shift and Gaussian features the intervals hold 90 % of the true severities."""
    item = CANDIDATES[1]
    slope = np.array([8.0, 3.0, 0.0])
    rng = np.random.default_rng(8)
    inside, count = 0, 400
    for _ in range(count):
        true = 0.5 + rng.random()
        error = item.error * true * slope * rng.standard_normal()
        residual = true * slope + error + rng.standard_normal(3)
        result = posterior(residual, np.eye(3), 1e4, [item], lambda _key, s: s[:, None] * slope)
        low, high = quantiles(*marginals(result, item.key), (0.05, 0.95))
        inside += low < true < high
    assert inside / count == pytest.approx(0.9, abs=4 * np.sqrt(0.09 / count))


@pytest.mark.long
@pytest.mark.parametrize(
    ("fault", "best"),
    [
        (None, ()),
        ("backlash@transmission=0.13 deg", ("backlash@transmission",)),
        ("friction@transmission=0.25", ("friction@transmission",)),
        ("short@motor.phase_c=0.2", ("short@motor.phase_a",)),
        ("eccentricity_static@motor=0.1", ("eccentricity_static@motor",)),
        ("gain_drift@control.position=0.02", ("gain_drift@control.position",)),
        ("gain_drift@control.position=-0.02", ("gain_drift@control.position",)),
        ("gain@sensor.current_b=0.15", ("gain@sensor.current_a",)),
        ("eccentricity_dynamic@motor=0.2", ("eccentricity_dynamic@motor",)),
        ("tooth_wear@gear=0.002 rad", ("tooth_wear@gear",)),
    ],
)
def test_on_the_high_model_with_another_drive(unit, tmp_path, fault, best):
    """Logs of the switching model with a PWM drive, diagnosed by the low one."""
    settings = ["drive.kind=pwm", "motor.eccentricity_law=periodic"]
    pwm = {"fidelity": "high", "settings": settings}
    base = bench(tmp_path / "base", 50, **pwm)
    path = bench(tmp_path / "log", 51, *([fault] if fault else []), **pwm)
    result = answer(unit.with_values({"drive.kind": "pwm"}), path, base)
    assert result.best == best


def test_a_long_log_is_read_for_a_while():
    """Ten minutes cost what forty seconds do: the runs are as long as what is read."""
    time = np.arange(0.0, 120.0, 1e-3)
    turn = np.where(time > 20.0, 5.0 * np.sin(2.0 * np.pi * 0.2 * time), 0.0)
    speed = np.gradient(turn, time)
    gap = 124.0 * np.radians(0.1) * np.sign(speed)
    log = Log("long", time, {
        "speed_ref": speed, "motor_speed": speed, "torque_current": np.sign(speed),
        "current_ref": np.sign(speed), "motor_position": turn,
        "output_position": (turn - gap) / 124.0,
    })  # fmt: skip
    part = _first_part(drive_log(log))
    assert part.duration == pytest.approx(LONGEST, abs=0.01)
    assert len(part.time) <= 500 * LONGEST
    assert 18.0 < part.start < 20.1
    assert _first_part(part) is part
