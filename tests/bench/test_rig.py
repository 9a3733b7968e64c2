"""The virtual bench: what it writes, what it hides, what it refuses."""

import json
import math

import numpy as np
import pytest

from elevon import Actuator
from elevon.bench.procedure import INTRINSIC_BACKLASH, Procedure, load_procedure, procedure_names
from elevon.bench.rig import BrakeRig, CellState, brake_loop, setups
from elevon.bench.run import claim_bench, run_procedure
from elevon.bench.traces import finished_logs
from elevon.cli import main
from elevon.documents import Document, validated
from elevon.errors import InputError, Interrupted, OutputExistsError
from elevon.logs.formats.loadcell import read_loadcell
from elevon.logs.importing import import_log
from elevon.scenario.scenario import Term

HEADER = (
    "Xms,C0Drive_axis_1r4821,C1Drive_axis_1r4820,Drive_axis_1.r62,Drive_axis_1.r63,"
    "Drive_axis_1.r77,Drive_axis_1.r76,Drive_axis_1.r78,Drive_axis_1.r1733,Drive_control.r722"
)
SINE = {"kind": "sine", "amplitude": "7 deg", "bias": "3 deg", "frequency": "0.5 Hz"}
IDEAL = CellState(offset=0.0, drift=0.0, noise=0.0, clock_drift=0.0, pad=1.0)


def procedure(*steps, name="short"):
    trace = {"kind": "trace", "name": name, "duration": "3 s", "command": {"terms": [SINE]}}
    return validated(
        Procedure, {"name": name, "step": [*steps, trace]}, Document("procedure", "", {})
    )


@pytest.fixture(scope="module")
def actuator():
    return Actuator.load("torino-rotary")


def brake_step(value):
    return {"kind": "brake", "terms": [{"kind": "constant", "value": value}]}


def test_every_procedure_of_the_package_can_be_set_up(actuator):
    for name in procedure_names("rotary-bench"):
        found = setups(load_procedure(name), actuator)
        assert len(found) == len(load_procedure(name).traces)


def test_loaded_runs_have_the_published_backlashes_and_brake(actuator):
    found = setups(load_procedure("loaded"), actuator)
    backlashes = [setup.actuator.parameters.value("backlash.total") for setup in found]
    assert backlashes == pytest.approx([INTRINSIC_BACKLASH + net for net in (0.0, 0.0145, 0.02335)])
    for setup in found:
        assert setup.brake.target[0] == pytest.approx(0.2)
        assert setup.brake.target[-1] == pytest.approx(2.0, abs=0.1)


def test_it_writes_the_drives_columns_and_nothing_it_cannot_know(tmp_path, actuator):
    result = run_procedure(procedure(brake_step("0.8 N m")), actuator, tmp_path, seed=2)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["bench-short.log", "short.csv", "short_command.json", "short_loadcell.csv"]
    assert result.to_dict()["status"] == "ok"
    lines = (tmp_path / "short.csv").read_text().splitlines()
    assert lines[0] == HEADER
    assert [line.split(",")[0] for line in lines[1:4]] == ["0", "2.5", "5"]
    assert len(lines) == 1 + 3 * 400 + 1
    note = json.loads((tmp_path / "short_command.json").read_text())
    assert note == {
        "waveform": "sine", "amplitude": "7 deg", "frequency": "0.5 Hz", "bias": "3 deg",
        "brake": "on", "load_cell_arm": 0.1, "chain_ratio": 4.5, "current": "rms",
    }  # fmt: skip


def test_positions_and_torque_come_back_through_the_import(tmp_path, actuator):
    plain = procedure(brake_step("1.5 N m"))
    run_procedure(plain, actuator, tmp_path, seed=2, truth=tmp_path / "truth.json")
    (truth,) = json.loads((tmp_path / "truth.json").read_text())["logs"]
    log = import_log(tmp_path / "short.csv")
    codes = {finding.code for finding in log.report.findings}
    assert {"unit-confirmed", "shaft-confirmed"} <= codes
    offset = log.report.synchronisation["offset_s"]
    assert offset == pytest.approx(truth["conditions"]["trigger"], abs=3e-3)
    torque = log.recording["load_cell_torque"]
    speed = np.interp(torque.time, log.recording["motor_speed"].time,
                      log.recording["motor_speed"].values)  # fmt: skip
    turning = (np.abs(speed) > 5.0) & (torque.time > 1.5)
    level = torque.values[turning] * np.sign(speed[turning])
    assert np.median(level) == pytest.approx(1.5, abs=0.03)


def test_one_seed_gives_one_set_of_files_and_another_seed_others(tmp_path, actuator):
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        run_procedure(procedure(), actuator, tmp_path / folder, seed=seed)
    a, b, c = ((tmp_path / f / "short.csv").read_bytes() for f in "abc")
    assert a == b
    assert a != c


def test_a_fault_reaches_the_log(tmp_path, actuator):
    run_procedure(procedure(), actuator, tmp_path / "healthy")
    run_procedure(procedure(), actuator, tmp_path / "worn", faults=["friction@transmission=1.0"])
    rms = []
    for folder in ("healthy", "worn"):
        recording = import_log(tmp_path / folder / "short.csv").recording
        moving = np.abs(recording["motor_speed"].values) > 5.0
        rms.append(np.abs(recording["current_q_meas"].values[moving]).mean())
    assert rms[1] > 1.2 * rms[0]
    assert "friction" not in (tmp_path / "worn" / "short_command.json").read_text()
    assert "friction" not in (tmp_path / "worn" / "bench-short.log").read_text()


def test_an_interrupted_procedure_goes_on_where_it_stopped(tmp_path, actuator):
    two = procedure().model_copy(
        update={"step": (*procedure(name="one").step, *procedure(name="two").step)}
    )
    with pytest.raises(Interrupted):
        # Asked before each log, whatever the time that a run takes.
        run_procedure(
            two, actuator, tmp_path, progress=lambda _: not (tmp_path / "one.csv").is_file()
        )
    assert (tmp_path / "one.csv").is_file()
    assert not (tmp_path / "two.csv").exists()
    before = (tmp_path / "one.csv").stat().st_mtime_ns
    result = run_procedure(two, actuator, tmp_path)
    assert [log.resumed for log in result.logs] == [True, False]
    assert (tmp_path / "one.csv").stat().st_mtime_ns == before
    with pytest.raises(OutputExistsError, match="other work"):
        run_procedure(two, actuator, tmp_path, seed=9)
    run_procedure(two, actuator, tmp_path, seed=9, force=True)
    assert (tmp_path / "one.csv").stat().st_mtime_ns != before


def two_logs(tmp_path):
    path = tmp_path / "pair.toml"
    trace = (
        '[[step]]\nkind = "trace"\nname = "{}"\nduration = "1 s"\n'
        '[step.command]\nterms = [{{ kind = "sine", amplitude = "2 deg", frequency = "1 Hz" }}]\n'
    )
    path.write_text('name = "pair"\n' + trace.format("one") + trace.format("two"))
    return path


TRIPS = "shorted_switch@inverter.a_high=1"


def test_a_tripped_run_stays_tripped_when_its_log_is_kept(tmp_path, capsys):
    whole = ["bench", "run", str(two_logs(tmp_path)), "--actuator", "torino-rotary"]
    whole += ["--fault", TRIPS, "--json"]
    reports = []
    for folder in ("once", "twice", "twice"):
        out = ["--out", str(tmp_path / folder), "--truth", str(tmp_path / f"{folder}.json")]
        reports.append((main([*whole, *out]), json.loads(capsys.readouterr().out)))
    once, first, second = reports
    assert once[1]["status"] == "tripped"
    assert [log["resumed"] for log in second[1]["logs"]] == [True, True]
    for code, report in (first, second):
        assert (code, report["status"]) == (once[0], once[1]["status"])
        for log, same in zip(report["logs"], once[1]["logs"], strict=True):
            assert log["status"] == same["status"] == "tripped"
            assert log["message"] == same["message"] != ""


def test_a_half_done_tripped_procedure_agrees_with_one_made_in_one_go(
    tmp_path, actuator, monkeypatch
):
    from elevon.bench import run as bench_run

    pair = load_procedure(two_logs(tmp_path))
    once = run_procedure(pair, actuator, tmp_path / "once", faults=[TRIPS])

    def first_only(setup, *arguments, **options):
        if setup.trace.name == "two":
            raise Interrupted("stopped between the logs")
        return whole(setup, *arguments, **options)

    # A run that trips early is over before anyone asks for its progress: stop between the logs.
    whole = bench_run._one
    with monkeypatch.context() as patch:
        patch.setattr(bench_run, "_one", first_only)
        with pytest.raises(Interrupted):
            run_procedure(pair, actuator, tmp_path / "halves", faults=[TRIPS])
    assert finished_logs(tmp_path / "halves" / "bench-pair.log") == ["one"]
    later = run_procedure(pair, actuator, tmp_path / "halves", faults=[TRIPS])
    assert [log.resumed for log in later.logs] == [True, False]
    assert [log.status for log in later.logs] == [log.status for log in once.logs]
    assert later.to_dict()["status"] == once.to_dict()["status"] == "tripped"
    for name in ("one.csv", "two.csv"):
        first, second = ((tmp_path / f / name).read_bytes() for f in ("once", "halves"))
        assert first == second


def test_a_log_that_is_not_as_it_was_written_is_made_again(tmp_path, actuator):
    pair = load_procedure(two_logs(tmp_path))
    first = run_procedure(pair, actuator, tmp_path, fidelity="low", truth=tmp_path / "t.json")
    good = (tmp_path / "one.csv").read_bytes()
    (tmp_path / "one.csv").write_bytes(good[:-100])
    again = run_procedure(pair, actuator, tmp_path, fidelity="low", truth=tmp_path / "t.json")
    assert [log.resumed for log in again.logs] == [False, True]
    assert (tmp_path / "one.csv").read_bytes() == good
    assert json.loads((tmp_path / "t.json").read_text())["logs"] == json.loads(
        json.dumps(first.hidden["logs"], default=str)
    )
    state = tmp_path / "bench-pair.log"
    state.write_text(state.read_text().splitlines(keepends=True)[0])
    unknown = run_procedure(pair, actuator, tmp_path, fidelity="low")
    assert [log.resumed for log in unknown.logs] == [False, False]
    with pytest.raises(OutputExistsError, match=r"t\.json"):
        run_procedure(pair, actuator, tmp_path / "x", seed=3, truth=tmp_path / "t.json")


def test_a_claimed_folder_keeps_no_earlier_log(tmp_path, actuator):
    pair = load_procedure(two_logs(tmp_path))
    run_procedure(pair, actuator, tmp_path, fidelity="low")
    with pytest.raises(OutputExistsError, match="other work"):
        claim_bench(pair, actuator, tmp_path, fidelity="low", seed=5)
    claim_bench(pair, actuator, tmp_path, fidelity="low")
    kept = run_procedure(pair, actuator, tmp_path, fidelity="low")
    assert [log.resumed for log in kept.logs] == [True, True]
    claim_bench(pair, actuator, tmp_path, fidelity="low", force=True)
    made = run_procedure(pair, actuator, tmp_path, fidelity="low")
    assert [log.resumed for log in made.logs] == [False, False]


def test_the_brakes_loop_settles_on_its_set_point_and_is_limited_in_rate():
    rig = BrakeRig()
    term = Term(kind="constant", value="2 N m")
    run = brake_loop(rig, IDEAL, [term], 5.0, np.random.default_rng(0))
    assert run.torque[0] == 0.0
    assert run.torque[-1] == pytest.approx(2.0, rel=2e-3)
    steepest = np.diff(run.torque).max() * 80.0
    assert steepest <= rig.servo_rate * rig.limit * (1.0 + 1e-9)
    worn = CellState(offset=0.0, drift=0.0, noise=0.0, clock_drift=0.0, pad=0.8)
    again = brake_loop(rig, worn, [term], 5.0, np.random.default_rng(0))
    assert again.torque[-1] == pytest.approx(2.0, rel=2e-3)  # the loop makes up for the pads


def test_an_offset_of_the_cell_is_a_torque_the_loop_does_not_see():
    rig = BrakeRig()
    off = CellState(offset=4.5, drift=0.0, noise=0.0, clock_drift=0.0, pad=1.0)
    term = Term(kind="constant", value="1 N m")
    run = brake_loop(rig, off, [term], 5.0, np.random.default_rng(0))
    assert run.torque[-1] == pytest.approx(1.0 - 4.5 * rig.arm / rig.chain_ratio, rel=2e-3)


def test_weights_pull_with_their_force(tmp_path, actuator):
    step = {"kind": "weights", "drops": [{"mass": "2 kg", "at": "0.5 s", "until": "1.5 s"}]}
    run_procedure(procedure(step), actuator, tmp_path)
    cell = read_loadcell(tmp_path / "short_loadcell.csv")
    pulled = (cell.time > 0.6) & (cell.time < 1.4)
    assert cell.value[pulled].mean() == pytest.approx(2 * 2 * 9.80665, abs=1.0)
    assert abs(cell.value[cell.time > 1.7].mean()) < 1.5


def test_springs_that_would_go_slack_are_refused(tmp_path, actuator):
    with pytest.raises(InputError, match=r"slack.*extension"):
        run_procedure(procedure({"kind": "spring", "extension": "0 m"}), actuator, tmp_path)
    assert not (tmp_path / "short.csv").exists()
    found = setups(procedure({"kind": "spring"}), actuator)
    stiffness = found[0].actuator.parameters.value("load.stiffness")
    assert stiffness == pytest.approx(2 * 61.4 * 0.08**2)


@pytest.mark.parametrize(("step", "message"), [
    (brake_step("6 N m"), "outside 0 to"),
    (brake_step("-1 N m"), "outside 0 to"),
    (brake_step("1 A"), "N m"),
    ({"kind": "settings", "parameters": {"motor.inertai": 1.0}}, "motor.inertia"),
])  # fmt: skip
def test_what_the_bench_cannot_do_is_refused(actuator, step, message):
    with pytest.raises(InputError, match=message):
        setups(procedure(step), actuator)


@pytest.mark.parametrize(("step", "message"), [
    ({"kind": "brakes"}, "brake"),
    ({"kind": "backlash"}, "exactly one"),
    ({"kind": "backlash", "micrometer": "20 mm"}, "outside"),
    ({"kind": "backlash", "micrometer": "12 mm", "net": 0.01}, "exactly one"),
    ({"kind": "spring", "radus": "8 mm"}, "radius"),
    ({"kind": "weights", "drops": [{"mass": "1 kg", "at": "2 s", "until": "1 s"}]}, "after"),
    ({"kind": "trace", "name": "../x", "duration": "3 s"}, "plain file name"),
    ({"kind": "trace", "name": "short", "duration": "3 s"}, "two traces"),
    ({"kind": "trace", "name": "b", "duration": "0.1 s"}, "1 s at least"),
])  # fmt: skip
def test_wrong_procedures_are_named(step, message):
    with pytest.raises(InputError, match=message):
        procedure(step)


def test_the_command_line(tmp_path, capsys):
    assert main(["bench", "list", "--json"]) == 0
    names = [row["name"] for row in json.loads(capsys.readouterr().out)["procedures"]]
    assert names == procedure_names()
    path = tmp_path / "mine.toml"
    path.write_text(
        'name = "mine"\n[[step]]\nkind = "trace"\nname = "x"\nduration = "1 s"\n'
        '[step.command]\nterms = [{ kind = "sine", amplitude = "2 deg", frequency = "1 Hz" }]\n'
    )
    arguments = ["bench", "run", str(path), "--actuator", "torino-rotary", "--json"]
    assert main([*arguments, "--out", str(tmp_path / "o"), "--fidelity", "low"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["logs"][0]["status"] == "ok"
    assert "r76" not in (tmp_path / "o" / "x.csv").read_text().splitlines()[0]
    assert main(["bench", "run", "backlsh", "--actuator", "torino-rotary", "--out", "o"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "backlash" in captured.err
    assert math.isfinite(result["wall_s"])
